//! What is given with the images of a map.

use std::borrow::Cow;

use super::positions::Positions;
use super::route::Names;
use super::storage::Storage;
use super::thumbnails::{LARGEST, Seen, Thumbnails, in_memory};
use super::{Map, Recipe, at_least_two};
use crate::descriptor::{DescriberPool, Sad};
use crate::distance::Metric;
use crate::error::Error;
use crate::image::{ImageSource, Progress};
use crate::segments::Segments;

/// What is known, or wanted, of the places of a map beside their images.
///
/// ```
/// use surefix::{Extras, Segments};
/// let road = Segments::new(500, &[200])?;
/// let extras = Extras::default().segments(&road).thumbnails();
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Extras<'a> {
    pub(super) positions: Option<&'a Positions>,
    pub(super) segments: Option<&'a Segments>,
    pub(super) thumbnails: bool,
    pub(super) size: Option<(usize, usize)>,
    pub(super) new_segment: bool,
}

impl<'a> Extras<'a> {
    /// With a position for each image.
    #[must_use]
    pub fn positions(self, positions: &'a Positions) -> Self {
        Self { positions: Some(positions), ..self }
    }

    pub(super) fn with(self, positions: Option<&'a Positions>) -> Self {
        Self { positions, ..self }
    }

    /// With these segments; else there is one.
    #[must_use]
    pub fn segments(self, segments: &'a Segments) -> Self {
        Self { segments: Some(segments), ..self }
    }

    /// With a small picture of each place. Images that are appended have one if the map has.
    #[must_use]
    pub fn thumbnails(self) -> Self {
        Self { thumbnails: true, ..self }
    }

    /// The same, of this width and height.
    #[must_use]
    pub fn thumbnails_of(self, size: (usize, usize)) -> Self {
        Self { thumbnails: true, size: Some(size), ..self }
    }

    /// Images that are appended begin a new segment.
    #[must_use]
    pub fn new_segment(self) -> Self {
        Self { new_segment: true, ..self }
    }

    /// The segments of `images` images.
    ///
    /// # Errors
    /// [`Error::Length`] unless positions and segments have one for each; [`Error::Shape`] for
    /// thumbnails without pixels.
    pub(super) fn check(&self, images: usize) -> Result<Cow<'a, Segments>, Error> {
        let lengths = [
            ("positions", self.positions.map(Positions::len)),
            ("segments: places", self.segments.map(Segments::places)),
        ];
        for (what, got) in lengths {
            if let Some(got) = got.filter(|&got| got != images) {
                return Err(Error::Length { what, expected: images, got });
            }
        }
        if let Some((width, height)) = self.size {
            Thumbnails::new(width, height, Vec::new())?;
            if width.max(height) > LARGEST {
                let expected = format!("pictures of at most {LARGEST} pixels a side");
                let got = format!("{width} x {height}");
                return Err(Error::Shape { what: "thumbnails", expected, got });
            }
        }
        Ok(self.segments.map_or_else(|| Cow::Owned(Segments::one(images)), Cow::Borrowed))
    }

    /// The size of thumbnails, if they are wanted, of images of which the first has this size.
    pub(super) fn picture_size(&self, first: (usize, usize)) -> Option<(usize, usize)> {
        self.thumbnails.then(|| self.size.unwrap_or_else(|| Thumbnails::size_for(first)))
    }
}

impl Map {
    /// [`from_images`](Self::from_images) with positions, segments and thumbnails.
    ///
    /// # Errors
    /// As for [`from_images`](Self::from_images); before any image is read, [`Error::Length`]
    /// unless `extras` has a position for each image, and segments of their number.
    pub fn from_images_with(
        images: &(impl ImageSource + ?Sized),
        sad: Sad,
        extras: Extras<'_>,
        progress: Progress<'_>,
    ) -> Result<Self, Error> {
        let places = at_least_two(images.len())?;
        let segments = extras.check(places)?.into_owned();
        let pool = DescriberPool::of_map(sad, images)?;
        let (sad, size) = (pool.sad(), pool.size());
        let mut rows = Storage::zeros(sad.dtype(), places * sad.dim());
        let pictures = match extras.picture_size(pool.first_size()) {
            None => {
                pool.describe_into(progress, rows.bytes_mut())?;
                None
            }
            Some(small) => {
                let seen = Seen::new(images, sad.levels(), small);
                DescriberPool::new(&sad, &seen)?.describe_into(progress, rows.bytes_mut())?;
                Some(in_memory(&seen))
            }
        };
        let names = Names::new((0..places).map(|index| images.name(index)))?;
        let map = Self::checked(rows, sad.dim(), Metric::Manhattan, Recipe::Sad(sad))?;
        let mut map = map.named(names)?.with_image_size(size)?.with_segments(segments)?;
        map.route_mut().positions = extras.positions.cloned();
        map.route_mut().thumbnails = pictures;
        Ok(map)
    }
}
