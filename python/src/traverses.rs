//! Several drives of a map's road: `surefix.Map.add_traverse`.

use std::sync::Arc;

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::{Deserialize, Serialize};
use surefix::{Drive, Floor, Motion, align_descriptors};

use crate::align::Alignment;
use crate::batch::Rows;
use crate::error::{OrRaise as _, value};
use crate::images::{path_of, progress_callback, with_progress};
use crate::inputs::descriptors;
use crate::map::Map;
use crate::options::{config, whole, wrong};
use crate::pickle::pickled;
use crate::signals::detached;

/// One drive of a map's road: its ``label``, and the ``places`` that it has a row for, int64.
#[pyclass(frozen, eq, module = "surefix")]
#[derive(PartialEq)]
pub(crate) struct MapTraverse(Drove);

#[derive(PartialEq, Serialize, Deserialize)]
struct Drove {
    label: String,
    places: Vec<usize>,
}

pickled!(MapTraverse);

#[pymethods]
impl MapTraverse {
    /// Its name, such as the drive's folder; may be empty.
    #[getter]
    fn label(&self) -> &str {
        &self.0.label
    }

    /// The places that it covers, in order: int64.
    #[getter]
    fn places<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.0.places.iter().map(|&place| place as i64))
    }

    /// How many rows it has: one for each place that it covers.
    #[getter]
    fn rows(&self) -> usize {
        self.0.places.len()
    }

    fn __repr__(&self) -> String {
        format!("MapTraverse({:?}, {} places)", self.0.label, self.0.places.len())
    }
}

#[pymethods]
impl Map {
    /// The map with one more drive of its road, such as in another season. A place then has several
    /// rows, and its distance is the least of theirs, each drive's brought to the same mean (method
    /// 1.14). It is a new map, which shares the rows of this one.
    ///
    /// Of the drive's images, those are kept whose place is sure, and for each place the surest.
    ///
    /// Parameters
    /// ----------
    /// drive : images, as for ``Map.from_images``; array of descriptors, shape (m, dim); or Map
    ///     The drive. Images are described as the map's own were, and descriptors go through its
    ///     post-processing. A map must be of the same kind.
    /// alignment : Alignment, optional
    ///     Of this drive with this map. By default, it is aligned here.
    /// least : float
    ///     Rows of a smaller confidence are left out.
    /// motion : {"any", "steady", "free"} or Motion
    ///     As for ``align``, if the drive is aligned here.
    /// label : str, optional
    ///     The traverse's name; by default that of the folder, or its number.
    /// descriptor : surefix.descriptors.Descriptor, optional
    ///     On a map of learned descriptors: what describes the images, as for ``match``.
    /// progress : callable, optional
    ///     As for ``Map.from_images``.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For a drive of another number of images than its alignment, an alignment with another
    ///     number of places, descriptors of another length, type, metric, recipe or
    ///     post-processing, a drive of no sure place, or at more than 65 traverses. For a map as
    ///     the drive if this one has post-processing and there is no alignment.
    ///
    /// Examples
    /// --------
    /// >>> import surefix
    /// >>> from surefix.simulate import Route
    /// >>> road = Route(places=60, size=(128, 64))
    /// >>> summer = surefix.Map.from_images(road.reference(), progress=False)
    /// >>> both = summer.add_traverse(road.traverse(season=0.9), label="winter", progress=False)
    /// >>> len(both), len(both.traverses), both.traverses[1].label
    /// (60, 2, 'winter')
    /// >>> both.traverses[1].rows > 50
    /// True
    #[pyo3(
        signature = (drive, alignment=None, *, least=0.9, motion=None, label=None, descriptor=None, progress=None),
        text_signature = "($self, drive, alignment=None, *, least=0.9, motion='any', label=None, descriptor=None, progress=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "the options of Python's function")]
    fn add_traverse(
        &self,
        py: Python<'_>,
        drive: &Bound<'_, PyAny>,
        alignment: Option<&Bound<'_, PyAny>>,
        least: f64,
        motion: Option<&Bound<'_, PyAny>>,
        label: Option<String>,
        descriptor: Option<&Bound<'_, PyAny>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        if !(0.0..=1.0).contains(&least) {
            let message = format!("option `least`: expected a number from 0 to 1, got {least}");
            return Err(value(py, message));
        }
        let alignment = match alignment.filter(|given| !given.is_none()) {
            None => None,
            Some(given) => match given.cast::<Alignment>() {
                Ok(alignment) => Some(alignment.get()),
                Err(_) => return wrong("alignment", "surefix.Alignment", given),
            },
        };
        if let Some(given) = alignment.filter(|given| given.0.places() != self.0.places()) {
            let (expected, got) = (self.0.places(), given.0.places());
            let message = format!(
                "alignment: expected one with this map, of {expected} places, got {got} places"
            );
            return Err(value(py, message));
        }
        let folder = path_of(drive)?;
        let label = label.unwrap_or_else(|| {
            let name = folder.as_deref().and_then(std::path::Path::file_name);
            let number = self.0.traverses().len().to_string();
            name.map_or(number, |name| name.to_string_lossy().into_owned())
        });
        let maps = [Arc::clone(&self.0)];
        let (queries, rows) = if let Ok(given) = drive.cast::<Self>() {
            let rows = Arc::clone(&given.get().0);
            if alignment.is_none() && self.0.post().is_some() {
                let expected = "an alignment of the drive, as this map has post-processing";
                return wrong("drive", expected, drive);
            }
            (None, rows)
        } else {
            let given = descriptors(descriptor, &maps)?;
            let mut each = Rows::of_each(drive, &maps, &given, progress)?;
            let queries = each.remove(0);
            let view = queries.view()?;
            let rows = detached(py, || self.0.of_same_kind(view))?;
            (Some(queries), Arc::new(rows))
        };
        let count = rows.places();
        if let Some(got) = alignment.map(|given| given.0.queries.len()).filter(|&got| got != count)
        {
            let message = format!("alignment: expected one of {count} images, got {got}");
            return Err(value(py, message));
        }
        let places = if let Some(given) = alignment {
            given.0.sure_places(least)
        } else {
            let options = PyDict::new(py);
            if let Some(motion) = motion {
                options.set_item("motion", motion)?;
            }
            let mut config = config(py, Some(&options), Floor::Running)?;
            config.motion.get_or_insert_with(Motion::any);
            config.sequence_length = 1;
            let view = if let Some(queries) = &queries {
                queries.view()?
            } else {
                // Before anything is scanned.
                detached(py, || self.0.check_traverse(&rows))?;
                rows.descriptors()
            };
            let callback = progress_callback(py, progress, "Aligning")?;
            let found = with_progress(py, callback.as_ref(), |progress| {
                let drive = Drive::default();
                Ok(py.detach(|| align_descriptors(&maps, &[view], &config, drive, &[], progress)))
            })?;
            found.sure_places(least)
        };
        if places.iter().all(Option::is_none) {
            let message = format!(
                "drive: expected images whose place is sure (a confidence of {least} or more), got none of {count}"
            );
            return Err(value(py, message));
        }
        let map = detached(py, || self.0.add_traverse(&rows, &places, &label))?;
        Ok(Self(Arc::new(map)))
    }

    /// The drives that the map's rows are of: the first, which has a row for each place, and those
    /// that were added. A list of ``MapTraverse``.
    #[getter]
    fn traverses(&self) -> Vec<MapTraverse> {
        let each = self.0.traverses();
        each.map(|one| {
            MapTraverse(Drove { label: one.label().to_owned(), places: one.places().collect() })
        })
        .collect()
    }

    /// The map without one of its traverses. If it is the first, the next that covers all places
    /// takes its part.
    ///
    /// Parameters
    /// ----------
    /// index : int
    ///     Of ``traverses``.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For a traverse that there is not, the only one, or the first if no other covers all
    ///     places.
    fn without_traverse(&self, py: Python<'_>, index: &Bound<'_, PyAny>) -> PyResult<Self> {
        let index = whole("traverse", index)?;
        Ok(Self(Arc::new(detached(py, || self.0.without_traverse(index))?)))
    }

    /// The map with a label for its first traverse.
    ///
    /// Parameters
    /// ----------
    /// label : str
    ///     At most 1024 bytes.
    ///
    /// Returns
    /// -------
    /// Map
    fn with_label(&self, py: Python<'_>, label: &str) -> PyResult<Self> {
        Ok(Self(Arc::new(surefix::Map::clone(&self.0).with_label(label).or_raise(py)?)))
    }
}
