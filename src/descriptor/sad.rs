//! The SAD descriptor: small, patch-normalised, grey (method 1.7).

use serde::{Deserialize, Serialize};

use super::describer::Describer;
use super::image::{Channels, Image, ImageView};
use super::patches::LEVELS;
use crate::distance::{Dtype, Values};
use crate::error::Error;

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
    /// Descriptors of `size` (width, height) pixels, normalised in patches of `patch x patch`, kept
    /// as `U8` (`128 + 32 z`) or `F32` (`z`).
    ///
    /// # Errors
    /// [`Error::Option`] where a side is not a multiple of the patch or above 4096, or for another
    /// type.
    pub fn new(size: (usize, usize), patch: usize, dtype: Dtype) -> Result<Self, Error> {
        let (width, height) = size;
        let divides = |side: usize| (1..=MAX_SIDE).contains(&side) && side.is_multiple_of(patch);
        if patch == 0 {
            return Err(option("patch", "a side of at least 1 pixel", &patch));
        }
        if !(divides(width) && divides(height)) {
            let expected = format!(
                "a width and a height from 1 to {MAX_SIDE} that the patch ({patch}) divides"
            );
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

    /// What the descriptor sees before it is normalised: the image in grey, at the descriptor's
    /// size.
    ///
    /// # Errors
    /// None today: an [`ImageView`] is checked when it is made.
    pub fn thumbnail(&self, image: ImageView<'_>) -> Result<Image, Error> {
        Image::new(self.size.0, self.size.1, Channels::Grey, Describer::new(*self).thumbnail(image))
    }
}

fn option(name: &'static str, expected: &str, got: &dyn std::fmt::Display) -> Error {
    Error::Option { name, expected: expected.to_owned(), got: got.to_string() }
}
