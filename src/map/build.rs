//! A map from images: in memory, or straight into a file.

use std::path::Path;

use super::beside::write_beside;
use super::layout::Layout;
use super::names::Names;
use super::storage::Storage;
use super::{Map, Positions, Recipe};
use crate::descriptor::{Sad, describe_each, describe_into};
use crate::distance::Metric;
use crate::error::Error;
use crate::image::{ImageSource, Progress};

impl Map {
    /// A map of the SAD descriptors of a traverse's images, described on all cores (feature
    /// `rayon`). Places are named as the images are. `progress` hears of images done and to do;
    /// `Break` from it stops the work.
    ///
    /// # Errors
    /// [`Error::Image`] or [`Error::Io`] for an image that cannot be read, [`Error::ImageSize`] for
    /// one of another size, [`Error::TooFewPlaces`] below two images, [`Error::Interrupted`] where
    /// `progress` breaks.
    pub fn from_images(
        images: &(impl ImageSource + ?Sized),
        sad: Sad,
        progress: Progress<'_>,
    ) -> Result<Self, Error> {
        let places = enough(images)?;
        let mut rows = Storage::zeros(sad.dtype(), places * sad.dim());
        describe_into(&sad, images, progress, rows.bytes_mut())?;
        let names = Names::new((0..places).map(|index| images.name(index)))?;
        Self::assemble(rows, sad.dim(), Metric::Manhattan, Recipe::Sad(sad))?.named(names)
    }

    /// The same, straight into a file: the bytes that [`from_images`](Self::from_images) and
    /// [`save`](Self::save) would write, in the memory of one image a core. Where it fails or is
    /// stopped, an old file stays as it was, and nothing else is left.
    ///
    /// ```
    /// use std::ops::ControlFlow;
    /// use surefix_simulate::{Conditions, Route, RouteConfig};
    /// use surefix::{Map, Sad};
    /// let route = Route::new(RouteConfig { places: 20, width: 64, height: 32, ..RouteConfig::default() })?;
    /// let drive = route.traverse(Conditions::reference())?;
    /// let folder = tempfile::tempdir().unwrap();
    /// let path = folder.path().join("route.safetensors");
    /// Map::build(&path, &drive, Sad::default(), None, &mut |_done, _total| ControlFlow::Continue(()))?;
    /// assert_eq!(Map::open(&path)?.places(), 20);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// As for [`from_images`](Self::from_images); [`Error::Length`] unless there are as many
    /// positions as images, [`Error::Io`] where the file cannot be written.
    pub fn build(
        path: impl AsRef<Path>,
        images: &(impl ImageSource + ?Sized),
        sad: Sad,
        positions: Option<&Positions>,
        progress: Progress<'_>,
    ) -> Result<(), Error> {
        let places = enough(images)?;
        let got = positions.map_or(places, Positions::len);
        if got != places {
            return Err(Error::Length { what: "positions", expected: places, got });
        }
        let names = Names::new((0..places).map(|index| images.name(index)))?;
        let layout = Layout {
            metric: Metric::Manhattan,
            recipe: Recipe::Sad(sad),
            dtype: sad.dtype(),
            places,
            dim: sad.dim(),
            axes: positions.map_or(0, Positions::axes),
            positions: None,
            norms: None,
            rows: 0..0,
            names: None,
            post: Vec::new(),
            post_parts: Vec::new(),
            learned: None,
        };
        let layout = layout.placed(Some(names.bytes().len()));
        write_beside(path.as_ref(), |out| {
            out.head(&layout)?;
            out.floats(positions.map_or(&[], Positions::metres))?;
            describe_each(&sad, images, progress, |rows| out.numbers(rows, sad.dtype().size()))?;
            out.bytes(names.bytes())
        })
    }
}

fn enough(images: &(impl ImageSource + ?Sized)) -> Result<usize, Error> {
    match images.len() {
        got @ (0 | 1) => Err(Error::TooFewPlaces { what: "map", got }),
        places => Ok(places),
    }
}
