//! The SAD descriptor: small, patch-normalised, grey (method 1.7).

use serde::{Deserialize, Serialize};

use super::image::{Channels, Image, ImageView};
use super::resize::Resize;
use crate::distance::{Dtype, Values};
use crate::error::Error;

/// Grey levels a unit of `z` has in the 8-bit form, and the level of `z = 0`.
const LEVELS: f64 = 32.0;
const MIDDLE: f64 = 128.0;
/// The longest side that is accepted: sums over a patch stay exact.
const MAX_SIDE: usize = 4096;

/// The recipe of the SAD descriptor: grey, resize, normalise patch by patch (method 1.7).
///
/// ```
/// use surefix::{Channels, ImageView, Sad};
/// let sad = Sad::default(); // 64 x 32, patches of 8 x 8, u8
/// let pixels = vec![7; 640 * 480];
/// let descriptor = sad.describe(ImageView::new(640, 480, Channels::Grey, &pixels)?)?;
/// assert_eq!(descriptor.len(), 2048);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "Unchecked", into = "Unchecked")]
pub struct Sad {
    size: (usize, usize),
    patch: usize,
    dtype: Dtype,
}

/// A recipe as it stands in a file, before it is checked.
#[derive(Serialize, Deserialize)]
struct Unchecked {
    size: (usize, usize),
    patch: usize,
    dtype: Dtype,
}

impl TryFrom<Unchecked> for Sad {
    type Error = Error;

    fn try_from(Unchecked { size, patch, dtype }: Unchecked) -> Result<Self, Error> {
        Self::new(size, patch, dtype)
    }
}

impl From<Sad> for Unchecked {
    fn from(Sad { size, patch, dtype }: Sad) -> Self {
        Self { size, patch, dtype }
    }
}

impl Default for Sad {
    fn default() -> Self {
        Self { size: (64, 32), patch: 8, dtype: Dtype::U8 }
    }
}

impl Sad {
    /// Descriptors of `size` (width, height) pixels, normalised in patches of `patch x patch`, kept as `U8`
    /// (`128 + 32 z`) or `F32` (`z`).
    ///
    /// # Errors
    /// [`Error::Option`] where a side is not a multiple of the patch or above 4096, or for another type.
    pub fn new(size: (usize, usize), patch: usize, dtype: Dtype) -> Result<Self, Error> {
        let (width, height) = size;
        let divides = |side: usize| (1..=MAX_SIDE).contains(&side) && side.is_multiple_of(patch);
        if patch == 0 {
            return Err(option("patch", "a side of at least 1 pixel", &patch));
        }
        if !(divides(width) && divides(height)) {
            let expected =
                format!("a width and a height from 1 to {MAX_SIDE} that the patch ({patch}) divides");
            return Err(option("size", &expected, &format!("{width} x {height}")));
        }
        if !matches!(dtype, Dtype::U8 | Dtype::F32) {
            return Err(option("dtype", "uint8 or float32", &dtype));
        }
        Ok(Self { size, patch, dtype })
    }

    /// Width and height of the small image, in pixels.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// The side of a patch, in pixels.
    pub fn patch(&self) -> usize {
        self.patch
    }

    /// The type of the descriptor's numbers.
    pub fn dtype(&self) -> Dtype {
        self.dtype
    }

    /// How many numbers a descriptor has: width times height.
    pub fn dim(&self) -> usize {
        self.size.0 * self.size.1
    }

    /// What one unit of distance (of `z`) is in the descriptor's own numbers.
    pub(crate) fn unit(&self) -> f64 {
        if self.dtype == Dtype::U8 { LEVELS } else { 1.0 }
    }

    /// The image's descriptor: `dim()` numbers, row by row.
    ///
    /// # Errors
    /// None today: an [`ImageView`] is checked when it is made.
    pub fn describe(&self, image: ImageView<'_>) -> Result<Values, Error> {
        let mut values = Values::zeros(self.dtype, self.dim());
        Describer::new(*self).describe(image, &mut values)?;
        Ok(values)
    }

    /// What the descriptor sees before it is normalised: the image in grey, at the descriptor's size.
    ///
    /// # Errors
    /// None today: an [`ImageView`] is checked when it is made.
    pub fn thumbnail(&self, image: ImageView<'_>) -> Result<Image, Error> {
        let mut describer = Describer::new(*self);
        describer.shrink(image);
        Image::new(self.size.0, self.size.1, Channels::Grey, describer.small)
    }
}

/// Describes image after image without allocating, as long as the images keep their size.
#[derive(Clone, Debug)]
pub struct Describer {
    sad: Sad,
    grey: Vec<u8>,
    resize: Resize,
    small: Vec<u8>,
}

impl Describer {
    /// A describer with the memory that the recipe needs.
    pub fn new(sad: Sad) -> Self {
        Self { sad, grey: Vec::new(), resize: Resize::default(), small: vec![0; sad.dim()] }
    }

    /// The recipe.
    pub fn sad(&self) -> &Sad {
        &self.sad
    }

    /// Writes the image's descriptor into `out`, which has the recipe's type and length.
    ///
    /// # Errors
    /// [`Error::Length`] or [`Error::Dtype`] where `out` has not.
    pub fn describe(&mut self, image: ImageView<'_>, out: &mut Values) -> Result<(), Error> {
        if out.len() != self.sad.dim() {
            return Err(Error::Length { what: "descriptor", expected: self.sad.dim(), got: out.len() });
        }
        self.shrink(image);
        match (self.sad.dtype, out) {
            (Dtype::U8, Values::U8(out)) => {
                self.normalise(out, |z| (MIDDLE + LEVELS * z).round().clamp(0.0, 255.0) as u8);
            }
            (Dtype::F32, Values::F32(out)) => self.normalise(out, |z| z as f32),
            (dtype, out) => {
                return Err(Error::Dtype {
                    what: "descriptor",
                    map: dtype,
                    or_float: false,
                    got: out.dtype(),
                });
            }
        }
        Ok(())
    }

    /// Grey, then the recipe's size.
    fn shrink(&mut self, image: ImageView<'_>) {
        let from = (image.width(), image.height());
        let grey = match image.channels() {
            Channels::Grey => image.pixels(),
            Channels::Rgb => {
                self.grey.resize(from.0 * from.1, 0);
                for (grey, rgb) in self.grey.iter_mut().zip(image.pixels().as_chunks::<3>().0) {
                    *grey = brightness(*rgb);
                }
                &self.grey
            }
        };
        self.resize.run(grey, from, self.sad.size, &mut self.small);
    }

    /// Each patch by itself: `z = (p - mean) / std`, and 0 where the std is below one grey level. The sums are
    /// whole numbers, so nothing is lost before the last division.
    fn normalise<T>(&self, out: &mut [T], store: impl Fn(f64) -> T) {
        let ((width, _), patch) = (self.sad.size, self.sad.patch);
        let count = (patch * patch) as u64;
        let bands = self.small.chunks_exact(width * patch).zip(out.chunks_exact_mut(width * patch));
        for (band, out) in bands {
            for left in (0..width).step_by(patch) {
                let spans = || (left..width * patch).step_by(width).map(|start| start..start + patch);
                let (mut sum, mut squares) = (0_u64, 0_u64);
                for pixel in spans().flat_map(|span| &band[span]) {
                    let pixel = u64::from(*pixel);
                    sum += pixel;
                    squares += pixel * pixel;
                }
                // count^2 times the variance.
                let spread = count * squares - sum * sum;
                let flat = spread < count * count;
                let scale = 1.0 / (spread as f64).sqrt();
                for span in spans() {
                    for (out, &pixel) in out[span.clone()].iter_mut().zip(&band[span]) {
                        let above = (count * u64::from(pixel)) as f64 - sum as f64;
                        *out = store(if flat { 0.0 } else { above * scale });
                    }
                }
            }
        }
    }
}

/// Rec. 601 luma in whole numbers, as Pillow computes it.
fn brightness([red, green, blue]: [u8; 3]) -> u8 {
    ((19_595 * u32::from(red) + 38_470 * u32::from(green) + 7_471 * u32::from(blue) + 0x8000) >> 16) as u8
}

fn option(name: &'static str, expected: &str, got: &dyn std::fmt::Display) -> Error {
    Error::Option { name, expected: expected.to_owned(), got: got.to_string() }
}
