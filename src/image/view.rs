//! Images as the library takes them: grey or RGB pixels of 8 or 16 bits, row by row.

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

/// The memory of a sample: of one colour of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Depth {
    Bits8,
    Bits16,
}

/// An image that owns its pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    channels: Channels,
    depth: Depth,
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
    depth: Depth,
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
        Ok(Self { width, height, channels, depth: Depth::Bits8, pixels })
    }

    /// The same of more than 8 bits a sample, as of a thermal camera: see
    /// [`Levels`](crate::Levels).
    ///
    /// # Errors
    /// [`Error::Shape`] if a side is zero or there are not `width * height * channels` samples.
    pub fn new_deep(
        width: usize,
        height: usize,
        channels: Channels,
        samples: &[u16],
    ) -> Result<Self, Error> {
        let view = ImageView::new_deep(width, height, channels, samples)?;
        Ok(view.to_image())
    }

    /// The same image, borrowed.
    pub fn view(&self) -> ImageView<'_> {
        let &Self { width, height, channels, depth, ref pixels } = self;
        ImageView { width, height, channels, depth, pixels }
    }

    /// The bytes, row by row: one a sample, or two in the machine's order if the image is
    /// [`deep`](Self::is_deep).
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
        check(width, height, channels, pixels.len(), "byte(s)")?;
        Ok(Self { width, height, channels, depth: Depth::Bits8, pixels })
    }

    /// The same of more than 8 bits a sample: see [`Levels`](crate::Levels).
    ///
    /// ```
    /// use surefix::{Channels, ImageView};
    /// let thermal = [7_300_u16, 7_310, 7_295, 7_402]; // 2 x 2 grey pixels
    /// assert!(ImageView::new_deep(2, 2, Channels::Grey, &thermal)?.is_deep());
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Shape`] if a side is zero or there are not `width * height * channels` samples.
    pub fn new_deep(
        width: usize,
        height: usize,
        channels: Channels,
        samples: &'a [u16],
    ) -> Result<Self, Error> {
        check(width, height, channels, samples.len(), "16-bit sample(s)")?;
        let pixels = bytemuck::must_cast_slice(samples);
        Ok(Self { width, height, channels, depth: Depth::Bits16, pixels })
    }

    /// The bytes, row by row: one a sample, or two in the machine's order if the image is
    /// [`deep`](Self::is_deep).
    pub fn pixels(&self) -> &'a [u8] {
        self.pixels
    }

    /// A copy that owns its pixels.
    pub fn to_image(&self) -> Image {
        let &Self { width, height, channels, depth, pixels } = self;
        Image { width, height, channels, depth, pixels: pixels.to_vec() }
    }

    /// The same shape with 8-bit pixels, of which there is one for each sample.
    pub(super) fn with_bytes<'b>(&self, pixels: &'b [u8]) -> ImageView<'b> {
        let &Self { width, height, channels, .. } = self;
        ImageView { width, height, channels, depth: Depth::Bits8, pixels }
    }
}

/// Refuses another number of samples than the sides have.
fn check(
    width: usize,
    height: usize,
    channels: Channels,
    samples: usize,
    unit: &str,
) -> Result<(), Error> {
    let count = channels.count();
    let expected = width.checked_mul(height).and_then(|area| area.checked_mul(count));
    if width > 0 && height > 0 && expected == Some(samples) {
        return Ok(());
    }
    let got = format!("{samples} {}", if unit.starts_with("16") { "samples" } else { "bytes" });
    let expected = format!(
        "at least one pixel, and {count} {unit} for each of {width} x {height} ({channels})"
    );
    Err(Error::Shape { what: "image", expected, got })
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

            /// Whether a sample has 16 bits, and not 8.
            pub fn is_deep(&self) -> bool {
                self.depth == Depth::Bits16
            }

            /// The samples of a deep image, row by row; none of one of 8 bits.
            pub fn deep_samples(&self) -> impl Iterator<Item = u16> {
                let pixels = if self.is_deep() { &self.pixels[..] } else { &[] };
                pixels.as_chunks::<2>().0.iter().map(|&bytes| u16::from_ne_bytes(bytes))
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
