//! Images as the library takes them: 8-bit grey or RGB pixels, row by row.

use std::fmt;

use crate::error::Error;

/// The bytes of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Channels {
    /// One byte a pixel: brightness.
    Grey,
    /// Three bytes a pixel: red, green, blue.
    Rgb,
}

impl Channels {
    /// Bytes a pixel.
    #[must_use]
    pub const fn count(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::Rgb => 3,
        }
    }
}

impl fmt::Display for Channels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Grey => "grey",
            Self::Rgb => "RGB",
        })
    }
}

/// An image that owns its pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    channels: Channels,
    pixels: Vec<u8>,
}

/// An image in borrowed memory, such as a camera driver's buffer.
///
/// ```
/// use surefix::{Channels, ImageView};
///
/// let buffer = [0, 64, 128, 255, 32, 16]; // 3 x 2 grey pixels
/// let image = ImageView::new(3, 2, Channels::Grey, &buffer)?;
/// assert_eq!((image.width(), image.height()), (3, 2));
/// assert!(ImageView::new(3, 2, Channels::Rgb, &buffer).is_err());
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageView<'a> {
    width: usize,
    height: usize,
    channels: Channels,
    pixels: &'a [u8],
}

impl Image {
    /// An image of `width x height` pixels, row by row from the top left.
    ///
    /// # Errors
    /// [`Error::Shape`] if a side is zero or `pixels` is not `width * height * channels` bytes.
    pub fn new(
        width: usize,
        height: usize,
        channels: Channels,
        pixels: Vec<u8>,
    ) -> Result<Self, Error> {
        ImageView::new(width, height, channels, &pixels)?;
        Ok(Self { width, height, channels, pixels })
    }

    /// The same image, borrowed.
    pub fn view(&self) -> ImageView<'_> {
        let &Self { width, height, channels, ref pixels } = self;
        ImageView { width, height, channels, pixels }
    }

    /// The bytes, row by row.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// The bytes, taken out.
    pub fn into_pixels(self) -> Vec<u8> {
        self.pixels
    }
}

impl<'a> ImageView<'a> {
    /// A borrowed image of `width x height` pixels, row by row from the top left.
    ///
    /// # Errors
    /// [`Error::Shape`] if a side is zero or `pixels` is not `width * height * channels` bytes.
    pub fn new(
        width: usize,
        height: usize,
        channels: Channels,
        pixels: &'a [u8],
    ) -> Result<Self, Error> {
        let bytes = width.checked_mul(height).and_then(|area| area.checked_mul(channels.count()));
        if width == 0 || height == 0 || bytes != Some(pixels.len()) {
            return Err(Error::Shape {
                what: "image",
                expected: format!(
                    "at least one pixel, and {} byte(s) for each of {width} x {height} ({channels})",
                    channels.count()
                ),
                got: format!("{} bytes", pixels.len()),
            });
        }
        Ok(Self { width, height, channels, pixels })
    }

    /// The bytes, row by row.
    pub fn pixels(&self) -> &'a [u8] {
        self.pixels
    }
}

macro_rules! sides {
    ($image:ty) => {
        impl $image {
            /// Pixels a row.
            pub fn width(&self) -> usize {
                self.width
            }

            /// Rows.
            pub fn height(&self) -> usize {
                self.height
            }

            /// Grey or RGB.
            pub fn channels(&self) -> Channels {
                self.channels
            }
        }
    };
}
sides!(Image);
sides!(ImageView<'_>);

impl<'a> From<&'a Image> for ImageView<'a> {
    fn from(image: &'a Image) -> Self {
        image.view()
    }
}
