//! `surefix.Map`.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict, PyList};
use surefix::{Dtype, Recipe};

use crate::arrays::{query, rows_to_py};
use crate::batch::Rows;
use crate::error::OrRaise as _;
use crate::images::{progress_callback, with_progress};
use crate::inputs::{One, descriptors};
use crate::kept::as_matrix;
use crate::learned;
use crate::pictures::{html, plotted};
use crate::post::Post;
use crate::sad::Sad;
use crate::signals::detached;

/// A known route: one descriptor a place, in route order, and all that is needed to use them.
///
/// Make one with ``Map.from_images``, ``Map.from_descriptors`` or ``Map.open``. A map does not
/// change: many localizers, in many threads, can read one.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> route = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32), metric="cosine")
/// >>> len(route), route.dim, route.metric
/// (3, 3, 'cosine')
/// >>> route.distances(np.array([0, 1, 0], np.float32))
/// array([1., 0., 1.], dtype=float32)
#[pyclass(frozen, module = "surefix")]
pub(crate) struct Map(pub(crate) Arc<surefix::Map>);

#[pymethods]
impl Map {
    /// Opens a map that ``save`` or ``build`` wrote.
    ///
    /// Parameters
    /// ----------
    /// path : str or path
    /// mmap : bool
    ///     By default the file is read whole into memory. True maps it instead: a map of gigabytes
    ///     is open in milliseconds, what is used is read when it is used, and processes share the
    ///     memory. The danger: as long as the map lives, no process may change the file in place or
    ///     make it shorter, or the program ends (SIGBUS) or sees other numbers. To replace the
    ///     file, as ``save``, ``build`` and ``append`` do, is safe. A NaN in it is found when a
    ///     frame is pushed, not here; the first ``snapshot`` of a localizer reads the whole file
    ///     once.
    /// screen : {"i8"}, optional
    ///     As for ``with_screen``: it is not in the file, and making it reads all of it.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixFileError
    ///     If the file cannot be read.
    /// SurefixValueError
    ///     If it is truncated, damaged, not a map, or of a newer version; and as for
    ///     ``with_screen``.
    #[staticmethod]
    #[pyo3(signature = (path, mmap=false, *, screen=None))]
    #[allow(unsafe_code)]
    fn open(
        py: Python<'_>,
        path: PathBuf,
        mmap: bool,
        screen: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let screen = screen.map(screen_dtype).transpose().or_raise(py)?;
        let map = detached(py, || {
            if mmap {
                // SAFETY: the caller has been told above to leave the file alone.
                unsafe { surefix::Map::open_mapped(path) }
            } else {
                surefix::Map::open(path)
            }
        })?;
        Ok(Self(Arc::new(screened(py, map, screen)?)))
    }

    /// The same map with a screen: a copy of its rows in signed bytes, a quarter more memory; the
    /// rows are shared. A ``Localizer`` scans those, which says of each distance between which two
    /// numbers it lies, and looks only at the rows that these leave in doubt. Its answers are those
    /// that it would give without, to the last bit.
    ///
    /// This pays if the map is larger than the cache and its places differ:
    /// ``Localizer.looked_at`` says at how many rows a frame made it look. If it does not pay,
    /// the localizer notices, and scans the rows for a while before it tries again. Rows of fewer
    /// than 256 numbers are always scanned as they are. A screen is not saved with the map: making
    /// it takes about as long as a few pushes.
    ///
    /// Parameters
    /// ----------
    /// dtype : {"i8"}
    ///     The type of the screen's numbers.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For another type, a map of other numbers than float32, the manhattan distance, or too
    ///     little memory.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> rows = np.random.default_rng(0).standard_normal((5000, 512), np.float32)
    /// >>> route = surefix.Map.from_descriptors(rows).with_screen("i8")
    /// >>> localizer = surefix.Localizer(route)
    /// >>> localizer.push(rows[7]).place, localizer.looked_at < 500
    /// (7, True)
    fn with_screen(&self, py: Python<'_>, dtype: &Bound<'_, PyAny>) -> PyResult<Self> {
        let dtype = screen_dtype(dtype).or_raise(py)?;
        Ok(Self(Arc::new(screened(py, surefix::Map::clone(&self.0), Some(dtype))?)))
    }

    /// Saves the map as one safetensors file with everything that it takes to use it. It is written
    /// beside its place and then renamed: there is never half a file. Symbolic links and the mode
    /// of an old file stay.
    ///
    /// Raises
    /// ------
    /// SurefixFileError
    ///     If the file cannot be written.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        detached(py, || self.0.save(path))
    }

    /// The bytes of the file that ``save`` writes.
    ///
    /// Returns
    /// -------
    /// bytes
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &detached(py, || self.0.to_bytes())?))
    }

    /// A map from the bytes of its file. Maps are pickled this way, too.
    ///
    /// Parameters
    /// ----------
    /// data : bytes
    /// screen : {"i8"}, optional
    ///     As for ``with_screen``.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If the bytes are not a map's, are damaged, or of a newer version of the library.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> route = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32))
    /// >>> surefix.Map.from_bytes(route.to_bytes())
    /// Map(3 places x 3 float32, cosine, 0.0 MB)
    #[staticmethod]
    #[pyo3(signature = (data, screen=None))]
    fn from_bytes(
        py: Python<'_>,
        data: &[u8],
        screen: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let screen = screen.map(screen_dtype).transpose().or_raise(py)?;
        let map = detached(py, || surefix::Map::from_bytes(data))?;
        Ok(Self(Arc::new(screened(py, map, screen)?)))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, map) = (slf.py(), slf.get());
        let arguments = (map.to_bytes(py)?, map.screen());
        Ok((slf.get_type().getattr("from_bytes")?, arguments).into_pyobject(py)?.into_any())
    }

    // It never changes: a copy is the map itself.
    fn __copy__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    fn __deepcopy__<'py>(slf: Bound<'py, Self>, _memo: &Bound<'py, PyAny>) -> Bound<'py, Self> {
        slf
    }

    /// Checks a map that was opened with ``mmap=True``: reads its whole file, and compares its
    /// checksum. A map in memory was checked when it was opened.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If the file is damaged.
    fn verify(&self, py: Python<'_>) -> PyResult<()> {
        detached(py, || self.0.verify())
    }

    /// The distances from a query to every place, or from many. A place that shows nothing
    /// (``blank``) has the mean of the others' distances; a query that shows nothing has one distance
    /// to all.
    ///
    /// Parameters
    /// ----------
    /// queries : descriptor, (input_dim,), or image; or several: (m, input_dim), images as for ``match``
    ///     Descriptors are of the map's own type, or of float32 on a map of ready descriptors, and as
    ///     they are before post-processing, if the map has any. Each is taken alone: statistics that
    ///     run along a drive are those of a ``Localizer``, ``match`` and ``Run.distances``. An array
    ///     of two axes is descriptors if its rows are as long as one.
    /// descriptor : surefix.descriptors.Descriptor, optional
    ///     On a map of learned descriptors: what describes the images.
    /// progress : callable, optional
    ///     As for ``Map.from_images``.
    ///
    /// Returns
    /// -------
    /// array of float32, shape (n,) for one query, (n, m) for several
    ///     SAD distances are in units of ``z``, whatever the type that the map keeps.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For another length or type, a NaN or an infinity, or up to 8 zeros under the cosine; of
    ///     several queries, the error says which.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> road = surefix.simulate.Route(places=20, seed=1)
    /// >>> route = surefix.Map.from_images(road.reference())
    /// >>> route.distances(road.revisit()).shape, route.distances(road.revisit()[3]).shape
    /// ((20, 20), (20,))
    #[pyo3(signature = (queries, *, descriptor=None, progress=None))]
    fn distances<'py>(
        &self,
        py: Python<'py>,
        queries: &Bound<'py, PyAny>,
        descriptor: Option<&Bound<'py, PyAny>>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let described = descriptor.is_some() || self.0.recipe() != Recipe::Ready;
        let one = One::of(queries, self.0.input_dim(), described)?;
        if let One::Descriptor(array) = &one {
            let numbers = query(array, "descriptor", &self.0)?;
            let view = numbers.view()?;
            let distances = detached(py, || self.0.distances(view))?;
            return Ok(PyArray1::from_vec(py, distances).into_any());
        }
        let maps = [self.0.clone()];
        let descriptors = descriptors(descriptor, &maps)?;
        let silent = PyBool::new(py, false).to_owned().into_any();
        let alone = PyList::new(py, [queries])?.into_any();
        let is_one = matches!(one, One::Image);
        let (queries, progress) =
            if is_one { (&alone, Some(&silent)) } else { (queries, progress) };
        let rows = Rows::of_each(queries, &maps, &descriptors, progress)?;
        let callback = match rows.first() {
            // Describing has shown its own progress.
            Some(Rows::Described(_)) => None,
            _ => progress_callback(py, progress, "Comparing")?,
        };
        let views = rows.iter().map(Rows::view).collect::<PyResult<Vec<_>>>()?;
        let distances = with_progress(py, callback.as_ref(), |progress| {
            let each = views.iter().try_fold(Vec::new(), |_, view| {
                py.detach(|| self.0.distances_of_each(*view, progress))
            });
            Ok(each)
        })?;
        if is_one {
            return Ok(PyArray1::from_vec(py, distances).into_any());
        }
        as_matrix(py, distances, self.0.places())
    }

    /// Draws the route from above, by the map's positions.
    ///
    /// Parameters
    /// ----------
    /// ax : matplotlib.axes.Axes, optional
    ///     Where to draw; by default a new figure of ``matplotlib.pyplot``.
    /// **options
    ///     As for ``surefix.plot.plan``: ``names`` of the segments; ``place=run.place`` draws the
    ///     fixes of a run on it.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If the map has no positions.
    /// ModuleNotFoundError
    ///     If matplotlib is not installed.
    ///
    /// Examples
    /// --------
    /// >>> route.plot().figure.savefig("plan.png")  # doctest: +SKIP
    #[pyo3(signature = (*, ax=None, **options))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        ax: Option<&Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        plotted(slf, "of_map", ax, &[], options)
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        html(slf, "of_map")
    }

    fn __len__(&self) -> usize {
        self.0.places()
    }

    /// How many numbers a descriptor has.
    #[getter]
    fn dim(&self) -> usize {
        self.0.dim()
    }

    /// The length of a query: before post-processing, if the map has any, else ``dim``.
    #[getter]
    fn input_dim(&self) -> usize {
        self.0.input_dim()
    }

    /// The post-processing of queries and descriptors; None if
    /// there is nothing.
    #[getter]
    fn post(&self) -> Option<Post> {
        self.0.post().cloned().map(Post)
    }

    /// Where a learned map's descriptors come from, a dict with a "name"; None if none was given.
    #[getter]
    fn recipe<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let text = self.0.learned_recipe();
        text.map(|text| py.import("json")?.call_method1("loads", (text,))).transpose()
    }

    /// The type of the descriptors' numbers.
    #[getter]
    fn dtype<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("numpy")?.call_method1("dtype", (self.0.dtype().to_string(),))
    }

    /// How descriptors are compared: "cosine", "euclidean" or "manhattan".
    #[getter]
    fn metric(&self) -> String {
        self.0.metric().to_string()
    }

    /// The type of the screen's numbers, "i8"; None if the map has no screen.
    #[getter]
    fn screen(&self) -> Option<&'static str> {
        self.0.screen().map(|_| "i8")
    }

    /// The recipe that describes an image; None if the map was made of ready descriptors.
    #[getter]
    fn descriptor(&self) -> Option<Sad> {
        match self.0.recipe() {
            Recipe::Sad(sad) => Some(Sad(sad)),
            _ => None,
        }
    }

    /// Width and height of the images that the map was made of; None if that is not known, or they
    /// differ. Queries should have the same shape.
    #[getter]
    fn image_size(&self) -> Option<(usize, usize)> {
        self.0.image_size()
    }

    /// The samples of images of more than 8 bits that are black and white, (low, high), for the
    /// map's images and all queries; None for a map of 8-bit images or ready descriptors.
    #[getter]
    fn levels(&self) -> Option<(u16, u16)> {
        match self.0.recipe() {
            Recipe::Sad(sad) => sad.levels().map(Into::into),
            _ => learned::levels(&self.0),
        }
    }

    /// All descriptors, a copy: shape (n, dim).
    #[getter]
    fn descriptors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        rows_to_py(py, self.0.descriptors(), &[self.0.places(), self.0.dim()])
    }

    /// The places that show nothing, in order: int64. They are SAD descriptors of images with hardly
    /// any content, ready descriptors of zeros, and those that at least 5 places share; ready
    /// descriptors of up to 8 numbers are taken as they are. Nothing is matched to such a place.
    #[getter]
    fn blank<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let blank = py.detach(|| self.0.blank());
        PyArray1::from_iter(py, blank.iter().map(|&place| place as i64))
    }

    pub(crate) fn __repr__(&self) -> String {
        let (places, dim, dtype, metric) =
            (self.0.places(), self.0.dim(), self.0.dtype(), self.0.metric());
        let bytes = places * dim * dtype.size();
        format!("Map({places} places x {dim} {dtype}, {metric}, {:.1} MB)", bytes as f64 / 1e6)
    }
}

/// The type that a screen is asked for in.
pub(crate) fn screen_dtype(name: &Bound<'_, PyAny>) -> Result<Dtype, surefix::Error> {
    match name.extract::<&str>() {
        Ok("i8") => Ok(Dtype::I8),
        _ => Err(surefix::Error::Option {
            name: "screen",
            expected: "\"i8\" or None".to_owned(),
            got: name.repr().map_or_else(|_| "something else".to_owned(), |repr| repr.to_string()),
        }),
    }
}

/// The map, with a screen if one is asked for.
pub(crate) fn screened(
    py: Python<'_>,
    map: surefix::Map,
    screen: Option<Dtype>,
) -> PyResult<surefix::Map> {
    match screen {
        Some(dtype) => detached(py, || map.with_screen(dtype)),
        None => Ok(map),
    }
}
