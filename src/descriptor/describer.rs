//! Image after image into descriptors, in memory that is kept.

use super::image::ImageView;
use super::patches::{Patches, level};
use super::resize::Resize;
use super::sad::Sad;
use crate::distance::Values;
use crate::error::Error;
use crate::isa::{Isa, Work};

/// Describes image after image without allocating, as long as the images keep their size.
///
/// ```
/// use surefix::descriptor::Describer;
/// use surefix::{Channels, ImageView, Sad, Values};
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
    small: Vec<u8>,
    patches: Patches,
}

impl Describer {
    /// A describer with the memory that the recipe needs, on the best instruction set.
    pub fn new(sad: Sad) -> Self {
        let (small, patches) = (vec![0; sad.dim()], Patches::new(sad.size().0, sad.patch()));
        Self { sad, isa: Isa::best(), resize: Resize::default(), small, patches }
    }

    /// The same describer on another instruction set. The descriptors are the same on all of them.
    ///
    /// # Errors
    /// [`Error::Option`] where this processor lacks it.
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
    /// [`Error::Length`] or [`Error::Dtype`] where `out` has not.
    pub fn describe(&mut self, image: ImageView<'_>, out: &mut Values) -> Result<(), Error> {
        let Self { sad, isa, resize, small, patches } = self;
        let what = "descriptor";
        if out.len() != sad.dim() {
            return Err(Error::Length { what, expected: sad.dim(), got: out.len() });
        }
        if out.dtype() != sad.dtype() {
            return Err(Error::Dtype { what, map: sad.dtype(), or_float: false, got: out.dtype() });
        }
        isa.run(Shrink { isa: *isa, resize, image, to: sad.size(), small });
        match out {
            Values::U8(out) => isa.run(Normalise { patches, small, out, store: level }),
            Values::F32(out) => isa.run(Normalise { patches, small, out, store: |z| z as f32 }),
            // A recipe has no other type.
            Values::F16(_) | Values::I8(_) => {}
        }
        Ok(())
    }

    /// The image in grey, at the recipe's size: row by row.
    pub(super) fn thumbnail(mut self, image: ImageView<'_>) -> Vec<u8> {
        let Self { sad, isa, resize, small, .. } = &mut self;
        isa.run(Shrink { isa: *isa, resize, image, to: sad.size(), small });
        self.small
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

impl Work for Shrink<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.resize.run(self.isa, self.image, self.to, self.small);
    }
}

/// From grey levels to `z`, kept as `store` has it.
struct Normalise<'a, T, S> {
    patches: &'a mut Patches,
    small: &'a [u8],
    out: &'a mut [T],
    store: S,
}

impl<T, S: Fn(f64) -> T> Work for Normalise<'_, T, S> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.patches.normalise(self.small, self.out, self.store);
    }
}
