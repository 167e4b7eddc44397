//! Many images into descriptors.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use super::sad::{Describer, Sad};
use crate::error::Error;
use crate::image::{Image, ImageSource, Levels, Progress, go_on};
use crate::numbers::{Values, View};
use crate::parallel::{each_row, threads};

/// Images that each thread describes between two reports of progress.
const BATCH: usize = 32;

/// The descriptors of all images, one after the other, on all cores (feature `rayon`).
///
/// # Errors
/// Whatever loading an image gives; [`Error::ImageSize`] for one whose size is not the first one's;
/// [`Error::Interrupted`] if `progress` breaks. The first image in route order that fails is the
/// one named.
pub fn describe_all(
    sad: &Sad,
    images: &(impl ImageSource + ?Sized),
    progress: Progress<'_>,
) -> Result<Values, Error> {
    let mut all = Values::zeros(sad.dtype(), images.len() * sad.dim());
    if !all.is_empty() {
        DescriberPool::new(sad, images)?.describe_into(progress, all.bytes_mut())?;
    }
    Ok(all)
}

fn batch_size() -> usize {
    BATCH * threads()
}

/// `work` on batch after batch of `total` images, each told to `progress` before it.
fn in_batches(
    total: usize,
    progress: Progress<'_>,
    mut work: impl FnMut(Range<usize>) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut report = |done| go_on(progress(done, total), done, total);
    for start in (0..total).step_by(batch_size()) {
        report(start)?;
        work(start..total.min(start + batch_size()))?;
    }
    report(total)
}

/// A describer for each thread at work, and the images that they describe. An image is in memory
/// only while it is described.
pub(crate) struct DescriberPool<'a, I: ?Sized> {
    sad: Sad,
    images: &'a I,
    /// Width and height of the first image.
    size: (usize, usize),
    /// The idle ones, each with a descriptor's memory.
    idle: Mutex<Vec<(Describer, Values)>>,
}

impl<'a, I: ImageSource + ?Sized> DescriberPool<'a, I> {
    /// For images, of which there is at least one, that are described as a map's own were.
    pub(crate) fn new(sad: &Sad, images: &'a I) -> Result<Self, Error> {
        Ok(Self::knowing(*sad, images, &images.load(0)?))
    }

    /// For the images of a new map: if they are deep, and the recipe has no levels, they are
    /// measured.
    pub(crate) fn of_map(sad: Sad, images: &'a I) -> Result<Self, Error> {
        let first = images.load(0)?;
        let levels = match sad.levels() {
            None => Levels::measured(images, &first),
            given => given,
        };
        Ok(Self::knowing(sad.with_levels(levels), images, &first))
    }

    fn knowing(sad: Sad, images: &'a I, first: &Image) -> Self {
        let size = (first.width(), first.height());
        Self { sad, images, size, idle: Mutex::default() }
    }

    /// The recipe, with levels if there are any.
    pub(crate) fn sad(&self) -> Sad {
        self.sad
    }

    /// Width and height of all images; `None` if they may differ.
    pub(crate) fn size(&self) -> Option<(usize, usize)> {
        (!self.images.has_mixed_sizes()).then_some(self.size)
    }

    /// Width and height of the first image.
    pub(crate) fn first_size(&self) -> (usize, usize) {
        self.size
    }

    /// Describes all images, straight into `memory`, which has the size of their descriptors.
    pub(crate) fn describe_into(
        &self,
        progress: Progress<'_>,
        memory: &mut [u8],
    ) -> Result<(), Error> {
        let width = self.width();
        in_batches(self.images.len(), progress, |batch| {
            self.describe(batch.start, &mut memory[batch.start * width..batch.end * width])
        })
    }

    /// The same, batch by batch in one small piece of memory: `take` is handed each batch's
    /// descriptors, in route order.
    pub(crate) fn describe_each(
        &self,
        progress: Progress<'_>,
        mut take: impl FnMut(View<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let (width, dim) = (self.width(), self.sad.dim());
        let rows = self.images.len().min(batch_size());
        let mut memory = Values::zeros(self.sad.dtype(), rows * dim);
        in_batches(self.images.len(), progress, |batch| {
            self.describe(batch.start, &mut memory.bytes_mut()[..batch.len() * width])?;
            take(match memory.view() {
                View::U8(rows) => View::U8(&rows[..batch.len() * dim]),
                View::F32(rows) => View::F32(&rows[..batch.len() * dim]),
                // A recipe has no other type.
                other => other,
            })
        })
    }

    /// Bytes of a descriptor.
    fn width(&self) -> usize {
        self.sad.dim() * self.sad.dtype().size()
    }

    /// Describes the images from `start` on, one a row, into `rows`.
    fn describe(&self, start: usize, rows: &mut [u8]) -> Result<(), Error> {
        each_row(rows, self.width(), |row, memory| self.describe_one(start + row, memory))?;
        Ok(())
    }

    fn describe_one(&self, index: usize, row: &mut [u8]) -> Result<(), Error> {
        let image = self.images.load(index)?;
        let (expected, got) = (self.size, (image.width(), image.height()));
        if got != expected && !self.images.has_mixed_sizes() {
            return Err(Error::ImageSize { name: self.images.name(index), expected, got });
        }
        let idle = || self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let free = idle().pop();
        let (mut describer, mut values) = free.unwrap_or_else(|| {
            (Describer::new(self.sad), Values::zeros(self.sad.dtype(), self.sad.dim()))
        });
        let described = describer.describe(image.view(), &mut values);
        row.copy_from_slice(values.view().bytes());
        idle().push((describer, values));
        described
    }
}
