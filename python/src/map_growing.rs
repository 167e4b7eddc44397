//! `surefix.Map.append`: the map in a file, made longer.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyBool;
use surefix::Extras;

use crate::error::value;
use crate::images::{Images, Terms, progress_callback, with_progress};
use crate::learned;
use crate::map::Map;
use crate::places::{self, positions_of};
use crate::signals::detached;

#[pymethods]
impl Map {
    /// Makes the map in a file longer, without reading its rows into memory. The longer file is
    /// written beside the old one and then renamed: if it fails, or is stopped, the old one
    /// stays. It is the file that all places at once would have made.
    ///
    /// Maps that are open stay as they are; a snapshot of a localizer is of the map that it was
    /// taken on.
    ///
    /// Parameters
    /// ----------
    /// path : str or path
    ///     The file of a map.
    /// more : Map, or images as for ``from_images``
    ///     The places that follow: a map of the same kind, or the images of a drive that goes on,
    ///     if the map was made of images. They are described as those were. Images in arrays are
    ///     numbered on.
    /// descriptor : surefix.descriptors.Descriptor, optional
    ///     The map's own descriptor, if its descriptors are learned.
    /// positions : array, shape (m, 2) or (m, 3), optional
    ///     Where the images' places are, in planar metres on the map's plane; needed if the map has
    ///     positions.
    /// progress : callable, optional
    ///     As for ``from_images``.
    /// cache : path, optional
    ///     With ``descriptor``, as for ``from_images``.
    /// skip_bad, mixed_sizes : bool
    ///     As for ``from_images``.
    /// new_segment : bool
    ///     By default the map's last segment goes on. True begins a new one.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If the file is not a map, or the places differ from its own in type, length, metric
    ///     or recipe, or one has names or positions and the other has none; if the file has
    ///     thumbnails and a map none of their size; if a closed segment would have to go on; and as
    ///     for ``from_images``.
    /// SurefixFileError
    ///     If the file cannot be read or written.
    #[staticmethod]
    #[pyo3(signature = (path, more, descriptor=None, *, positions=None, progress=None, cache=None, skip_bad=false, mixed_sizes=false, new_segment=false))]
    #[expect(clippy::too_many_arguments, reason = "the options of Python's function")]
    fn append(
        py: Python<'_>,
        path: PathBuf,
        more: &Bound<'_, PyAny>,
        descriptor: Option<&Bound<'_, PyAny>>,
        positions: Option<&Bound<'_, PyAny>>,
        progress: Option<&Bound<'_, PyAny>>,
        cache: Option<&Bound<'_, PyAny>>,
        skip_bad: bool,
        mixed_sizes: bool,
        new_segment: bool,
    ) -> PyResult<()> {
        if let Some(descriptor) = descriptor.filter(|_| !more.is_instance_of::<Self>()) {
            if !learned::is_learned(descriptor)? {
                let expected = "the map's own learned descriptor; images for Sad need none";
                let got = descriptor.get_type().name()?;
                return Err(value(py, format!("descriptor: expected {expected}, got {got}")));
            }
            let yes = PyBool::new(py, true).to_owned().into_any();
            let options = [
                ("positions", positions),
                ("progress", progress),
                ("cache", cache),
                ("skip_bad", skip_bad.then_some(&yes)),
                ("new_segment", new_segment.then_some(&yes)),
            ];
            return learned::append_images(&path, more, descriptor, options);
        }
        if descriptor.or(cache).is_some() {
            let expected = "descriptor, cache: expected images and a learned descriptor";
            let got =
                if descriptor.is_some() { "a map, which is described" } else { "no descriptor" };
            return Err(value(py, format!("{expected}, got {got}")));
        }
        let positions = places::positions(positions, None)?;
        if let Ok(more) = more.cast::<Self>() {
            if positions.is_some() {
                return Err(value(
                    py,
                    "positions: expected none beside a map, which has its own".to_owned(),
                ));
            }
            let more = &more.get().0;
            return detached(py, || {
                if new_segment {
                    surefix::Map::append_segment(path, more)
                } else {
                    surefix::Map::append(path, more)
                }
            });
        }
        let images = Images::new(more)?;
        let callback = progress_callback(py, progress, "Mapping")?;
        let count = images.len();
        with_progress(py, callback.as_ref(), |progress| {
            let terms = Terms { skip_bad, mixed_sizes };
            terms.each(py, &images, progress, |source, kept, progress| {
                let positions = positions_of(positions.as_ref(), kept, count)?;
                let mut extras = Extras::default();
                if let Some(positions) = &positions {
                    extras = extras.positions(positions);
                }
                if new_segment {
                    extras = extras.new_segment();
                }
                surefix::Map::append_images_with(&path, source, extras, progress)
            })
        })
    }
}
