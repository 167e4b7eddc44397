//! The images of a source that can be read.

use super::source::{ImageSource, Progress, go_on};
use super::view::Image;
use crate::error::Error;
use crate::parallel::each;

/// Images that are loaded between two reports of progress.
const BATCH: usize = 256;

/// The images of a source without those that cannot be read, such as half a file: one bad frame
/// does not end a drive.
///
/// ```
/// use std::ops::ControlFlow;
/// use surefix::{Channels, Error, Image, ImageSource, ReadableImages};
///
/// struct Camera;
/// impl ImageSource for Camera {
///     fn len(&self) -> usize {
///         3
///     }
///     fn load(&self, index: usize) -> Result<Image, Error> {
///         let bytes = if index == 1 { vec![] } else { vec![7; 4] };
///         Image::new(2, 2, Channels::Grey, bytes)
///             .map_err(|e| Error::Image { name: index.to_string(), reason: e.to_string() })
///     }
/// }
/// let readable = ReadableImages::of(&Camera, &mut |_, _| ControlFlow::Continue(()))?;
/// assert_eq!((readable.kept(), readable.bad().len()), (&[0, 2][..], 1));
/// # Ok::<(), Error>(())
/// ```
#[derive(Debug)]
pub struct ReadableImages<'a, I: ?Sized> {
    images: &'a I,
    kept: Vec<usize>,
    bad: Vec<(usize, Error)>,
}

impl<'a, I: ImageSource + ?Sized> ReadableImages<'a, I> {
    /// Loads each image, on all cores, to see which can be read.
    ///
    /// # Errors
    /// The first error of an image if none can be read; one that is no [`Error::Image`], such as a
    /// folder that is gone; [`Error::Interrupted`] if `progress` breaks.
    pub fn of(images: &'a I, progress: Progress<'_>) -> Result<Self, Error> {
        let total = images.len();
        let (mut kept, mut bad) = (Vec::new(), Vec::new());
        for start in (0..total).step_by(BATCH) {
            go_on(progress(start, total), start, total)?;
            let batch = start..total.min(start + BATCH);
            let results = each(batch.clone(), || (), |(), index| Ok(images.load(index).map(drop)))?;
            for (index, result) in batch.zip(results) {
                match result {
                    Ok(()) => kept.push(index),
                    Err(error @ Error::Image { .. }) => bad.push((index, error)),
                    Err(error) => return Err(error),
                }
            }
        }
        go_on(progress(total, total), total, total)?;
        if kept.is_empty() && !bad.is_empty() {
            return Err(bad.swap_remove(0).1);
        }
        Ok(Self { images, kept, bad })
    }

    /// The indices in the source of those that can be read, in order.
    pub fn kept(&self) -> &[usize] {
        &self.kept
    }

    /// The index of each that cannot be read, and why.
    pub fn bad(&self) -> &[(usize, Error)] {
        &self.bad
    }
}

impl<I: ImageSource + ?Sized> ImageSource for ReadableImages<'_, I> {
    fn len(&self) -> usize {
        self.kept.len()
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        self.images.load(self.kept[index])
    }

    fn name(&self, index: usize) -> String {
        self.images.name(self.kept[index])
    }

    fn has_mixed_sizes(&self) -> bool {
        self.images.has_mixed_sizes()
    }
}
