//! The SAD descriptor: small, patch-normalised, grey (method 1.7).

use std::fmt;

use serde::{Deserialize, Serialize};

use super::patches::{LEVELS, Patches, level};
use crate::dtype::Dtype;
use crate::error::Error;
use crate::image::{Channels, Image, ImageView, Levels, Resize};
use crate::numbers::{Values, View};
use crate::simd::{Compiled, Isa};

/// The longest side that is accepted: sums over a patch stay exact.
const MAX_SIDE: usize = 4096;

/// An image shows nothing if at most one tile in this many is not even, whatever is on it: a logo.
const TILES: usize = 8;
/// Or if at most this share of its numbers is apart from the median of its tile: a clock or "NO
/// SIGNAL" on black. Of a railway's tunnel by headlight it is a little more, of roads a half.
const BARE: (usize, usize) = (3, 40);
/// How many levels of a byte (32 are a deviation of the tile) are not apart.
const ABOUT: usize = 8;

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
#[derive(Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct Sad {
    size: (usize, usize),
    patch: usize,
    dtype: Dtype,
    #[serde(skip_serializing_if = "Option::is_none")]
    levels: Option<Levels>,
}

/// A recipe of a file, before it is checked.
#[derive(Deserialize)]
struct Unchecked {
    size: (usize, usize),
    patch: usize,
    dtype: Dtype,
    #[serde(default)]
    levels: Option<Levels>,
}

impl TryFrom<Unchecked> for Sad {
    type Error = Error;

    fn try_from(recipe: Unchecked) -> Result<Self, Error> {
        let Unchecked { size, patch, dtype, levels } = recipe;
        Ok(Self { levels, ..Self::new(size, patch, dtype)? })
    }
}

/// Levels only if there are any: a map is known by this text, among others.
impl fmt::Debug for Sad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { size, patch, dtype, levels } = self;
        let mut text = f.debug_struct("Sad");
        text.field("size", size).field("patch", patch).field("dtype", dtype);
        if let Some(levels) = levels {
            text.field("levels", levels);
        }
        text.finish()
    }
}

impl Default for Sad {
    fn default() -> Self {
        Self { size: (64, 32), patch: 8, dtype: Dtype::U8, levels: None }
    }
}

impl Sad {
    /// Descriptors of `size` (width, height) pixels, normalised in patches of `patch x patch`, kept
    /// as `U8` (`128 + 32 z`) or `F32` (`z`).
    ///
    /// # Errors
    /// [`Error::Option`] if a side is not a multiple of the patch or above 4096, or for another
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
        Ok(Self { size, patch, dtype, levels: None })
    }

    /// The same recipe, by which deep images are first made 8-bit ones by `levels`. Without, a map
    /// of deep images measures its own, and others are described by [`Levels::FULL`].
    #[must_use]
    pub fn with_levels(self, levels: Option<Levels>) -> Self {
        Self { levels, ..self }
    }

    /// The range of deep images, if it is known.
    pub fn levels(&self) -> Option<Levels> {
        self.levels
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

    /// The numbers of a descriptor: width times height.
    pub fn dim(&self) -> usize {
        self.size.0 * self.size.1
    }

    /// One unit of distance (of `z`) in the descriptor's own numbers.
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

    /// Whether an image shows nothing (method 1.7): a lens cap, a tunnel, a text on black, whatever
    /// describes it.
    ///
    /// ```
    /// use surefix::{Channels, ImageView, Sad};
    /// let dark: Vec<u8> = (0..96 * 48).map(|at| 7 + (at % 3) as u8).collect();
    /// assert!(Sad::default().shows_nothing(ImageView::new(96, 48, Channels::Grey, &dark)?)?);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// None today: an [`ImageView`] is checked when it is made.
    pub fn shows_nothing(&self, image: ImageView<'_>) -> Result<bool, Error> {
        Ok(self.is_bare(self.describe(image)?.view()))
    }

    /// Whether nearly all tiles of a descriptor are even, or nearly all numbers about the median of
    /// their tile: flat tiles, and those with some strokes of a text or some bright pixels on them.
    pub(crate) fn is_bare(&self, descriptor: View<'_>) -> bool {
        // In levels of a byte, whatever the type.
        let level_at = |at: usize| match descriptor {
            View::U8(numbers) => numbers[at],
            View::F32(numbers) => level(f64::from(numbers[at])),
            // There are no such SAD descriptors.
            View::F16(_) | View::I8(_) => 0,
        };
        let ((width, height), patch) = (self.size, self.patch);
        if descriptor.len() != width * height {
            return false;
        }
        let most = (width * height * BARE.0 / BARE.1) as u32;
        let half = ((patch * patch) as u32).div_ceil(2);
        let corners = (0..height)
            .step_by(patch)
            .flat_map(|top| (0..width).step_by(patch).map(move |left| top * width + left));
        let tiles = (width / patch) * (height / patch) / TILES;
        let (mut apart, mut uneven) = (0, 0);
        for corner in corners {
            let mut counts = [0_u32; 256];
            for start in (0..patch).map(|row| corner + row * width) {
                (start..start + patch).for_each(|at| counts[usize::from(level_at(at))] += 1);
            }
            let mut below = 0;
            let up_to = |count: &u32| {
                below += count;
                below >= half
            };
            let median = counts.iter().position(up_to).unwrap_or_default();
            let about = median.saturating_sub(ABOUT)..counts.len().min(median + ABOUT + 1);
            let off = (patch * patch) as u32 - counts[about].iter().sum::<u32>();
            apart += off;
            uneven += usize::from(off > 0);
            if apart > most && uneven > tiles {
                return false;
            }
        }
        true
    }

    /// The image in grey, at the descriptor's size, before it is normalised.
    ///
    /// # Errors
    /// None today: an [`ImageView`] is checked when it is made.
    pub fn thumbnail(&self, image: ImageView<'_>) -> Result<Image, Error> {
        let grey = Describer::new(*self).thumbnail(image).to_vec();
        Image::new(self.size.0, self.size.1, Channels::Grey, grey)
    }
}

/// Describes image after image without allocating, as long as the images keep their size and depth.
///
/// ```
/// use surefix::{Channels, Describer, ImageView, Sad, Values};
/// let mut describer = Describer::new(Sad::default());
/// let mut descriptor = Values::U8(vec![0; 2048]);
/// for frame in [vec![7; 320 * 240 * 3], vec![8; 320 * 240 * 3]] {
///     describer.describe(ImageView::new(320, 240, Channels::Rgb, &frame)?, &mut descriptor)?;
/// }
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Describer {
    sad: Sad,
    isa: Isa,
    resize: Resize,
    /// A deep image in 8 bits.
    shallow: Vec<u8>,
    small: Vec<u8>,
    patches: Patches,
}

impl Describer {
    /// A describer with the memory that the recipe needs, on the best instruction set.
    pub fn new(sad: Sad) -> Self {
        let (small, patches) = (vec![0; sad.dim()], Patches::new(sad.size().0, sad.patch()));
        let (isa, resize, shallow) = (Isa::best(), Resize::default(), Vec::new());
        Self { sad, isa, resize, shallow, small, patches }
    }

    /// The same describer on another instruction set. The descriptors are the same on all of them.
    ///
    /// # Errors
    /// [`Error::Option`] if this CPU lacks it.
    pub fn with_isa(self, isa: Isa) -> Result<Self, Error> {
        Ok(Self { isa: isa.checked()?, ..self })
    }

    /// The instruction set that it runs on.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// The recipe.
    pub fn sad(&self) -> &Sad {
        &self.sad
    }

    /// Writes the image's descriptor into `out`, which has the recipe's type and length.
    ///
    /// # Errors
    /// [`Error::Length`] or [`Error::Dtype`] if it has another.
    pub fn describe(&mut self, image: ImageView<'_>, out: &mut Values) -> Result<(), Error> {
        let (sad, what) = (&self.sad, "descriptor");
        if out.len() != sad.dim() {
            return Err(Error::Length { what, expected: sad.dim(), got: out.len() });
        }
        if out.dtype() != sad.dtype() {
            return Err(Error::Dtype { what, map: sad.dtype(), or_float: false, got: out.dtype() });
        }
        self.thumbnail(image);
        let Self { isa, small, patches, .. } = self;
        match out {
            Values::U8(out) => isa.run(Normalise { patches, small, out, store: level }),
            Values::F32(out) => isa.run(Normalise { patches, small, out, store: |z| z as f32 }),
            // A recipe has no other type.
            Values::F16(_) | Values::I8(_) => {}
        }
        Ok(())
    }

    /// The image in grey, at the recipe's size, before it is normalised: row by row.
    pub fn thumbnail(&mut self, image: ImageView<'_>) -> &[u8] {
        let Self { sad, isa, resize, shallow, small, .. } = self;
        let image = sad.levels.unwrap_or(Levels::FULL).view(image, shallow);
        isa.run(Shrink { isa: *isa, resize, image, to: sad.size(), small });
        small
    }
}

/// Grey, then the recipe's size.
struct Shrink<'a> {
    isa: Isa,
    resize: &'a mut Resize,
    image: ImageView<'a>,
    to: (usize, usize),
    small: &'a mut [u8],
}

impl Compiled for Shrink<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.resize.run(self.isa, self.image, self.to, self.small);
    }
}

/// From grey levels to `z`, converted by `store`.
struct Normalise<'a, T, S> {
    patches: &'a mut Patches,
    small: &'a [u8],
    out: &'a mut [T],
    store: S,
}

impl<T, S: Fn(f64) -> T> Compiled for Normalise<'_, T, S> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.patches.normalise(self.small, self.out, self.store);
    }
}

fn option(name: &'static str, expected: &str, got: &dyn std::fmt::Display) -> Error {
    Error::Option { name, expected: expected.to_owned(), got: got.to_string() }
}
