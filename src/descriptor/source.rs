//! Many images from wherever they are: a list, files, the generated route.

use std::ops::ControlFlow;

use super::describer::Describer;
use super::image::Image;
use super::sad::Sad;
use crate::distance::Values;
use crate::error::Error;
use crate::parallel::each;

/// A traverse's images, in route order, each loaded when it is needed.
pub trait ImageSource: Sync {
    /// How many images there are.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The image `index`, below `len()`.
    ///
    /// # Errors
    /// [`Error::Image`], or [`Error::Io`], where it cannot be read; the error names it.
    fn load(&self, index: usize) -> Result<Image, Error>;

    /// What to call the image `index`: its file's name, where it has one.
    fn name(&self, index: usize) -> String {
        index.to_string()
    }
}

impl ImageSource for [Image] {
    fn len(&self) -> usize {
        <[Image]>::len(self)
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        Ok(self[index].clone())
    }
}

impl ImageSource for Vec<Image> {
    fn len(&self) -> usize {
        self.as_slice().len()
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        self.as_slice().load(index)
    }
}

/// Hears how many images of how many are done, on the calling thread; `Break` stops the work.
pub type Progress<'a> = &'a mut (dyn FnMut(usize, usize) -> ControlFlow<()> + Send);

/// How many images are described between two reports of progress.
const BATCH: usize = 64;

/// The descriptors of all images, one after the other, on all cores (feature `rayon`).
///
/// # Errors
/// Whatever loading an image gives; [`Error::ImageSize`] for one whose size is not the first one's;
/// [`Error::Interrupted`] where `progress` breaks. The first image in route order that fails is the one named.
pub fn describe_all(
    sad: &Sad,
    images: &(impl ImageSource + ?Sized),
    progress: Progress<'_>,
) -> Result<Values, Error> {
    let (total, dim) = (images.len(), sad.dim());
    let mut all = Values::zeros(sad.dtype(), 0);
    let Some(first) = (total > 0).then(|| images.load(0)).transpose()? else { return Ok(all) };
    let size = (first.width(), first.height());
    let describe = |describer: &mut Describer, index: usize| -> Result<Values, Error> {
        let image = images.load(index)?;
        let got = (image.width(), image.height());
        if got != size {
            return Err(Error::ImageSize { name: images.name(index), expected: size, got });
        }
        let mut values = Values::zeros(sad.dtype(), dim);
        describer.describe(image.view(), &mut values)?;
        Ok(values)
    };
    for start in (0..total).step_by(BATCH) {
        if progress(start, total).is_break() {
            return Err(Error::Interrupted { done: start, total });
        }
        for values in each(start..total.min(start + BATCH), || Describer::new(*sad), describe) {
            match (&mut all, values?) {
                (Values::U8(all), Values::U8(more)) => all.extend(more),
                (Values::F32(all), Values::F32(more)) => all.extend(more),
                _ => {}
            }
        }
    }
    if progress(total, total).is_break() {
        return Err(Error::Interrupted { done: total, total });
    }
    Ok(all)
}
