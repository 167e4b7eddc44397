//! `surefix.Map`.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes};
use surefix::{Dtype, Recipe};

use crate::arrays::{Numbers, as_array, check_axes, query, rows_to_py};
use crate::error::{OrRaise as _, value};
use crate::images::{Images, Terms, progress_callback, with_progress};
use crate::learned;
use crate::options::whole;
use crate::places::{self, positions_of, with_positions};
use crate::post::{self, Post};
use crate::sad::Sad;

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
    /// A map of the descriptors of a traverse's images, described on all cores. Places are named as
    /// the files are.
    ///
    /// Parameters
    /// ----------
    /// images : path, iterable of paths or of uint8 arrays, or an array (n, H, W) or (n, H, W, 3)
    ///     A folder or a pattern like ``"route/*.png"`` is sorted as a person would: ``frame10``
    ///     follows ``frame9``. Files, and the items of a sequence that is no list, are read when it
    ///     is their turn. All images have one size. Files and arrays of more than 8 bits (uint16)
    ///     become 8-bit ones by the map's ``levels``.
    /// descriptor : Sad or surefix.descriptors.Descriptor, optional
    ///     The recipe; ``Sad()`` by default. With a learned descriptor, images are described by
    ///     ``surefix.descriptors.extract``, a batch at a time, and may have any sizes that it
    ///     takes.
    /// positions : array, shape (n, 2) or (n, 3), optional
    ///     Where each place is, in planar metres.
    /// progress : callable, optional
    ///     Called with ``(done, total)``; returning False stops. By default a bar on a terminal;
    ///     False for none.
    /// skip_blank : bool
    ///     Leave out the places that show nothing, as ``without_blank`` does.
    /// metric, post : optional
    ///     For a learned descriptor, as for ``from_descriptors``.
    /// cache : path, optional
    ///     For a learned descriptor: a file from which it goes on after an interruption, as for
    ///     ``extract``.
    /// levels : (int, int), optional
    ///     The samples of images of more than 8 bits that are black and white; by default they are
    ///     measured on up to 32 of the images.
    /// skip_bad : bool
    ///     Pass over images that cannot be read, such as half a file, and say so by the logger
    ///     ``surefix``. ``names`` says which are left; positions are still one an image.
    /// mixed_sizes : bool
    ///     Whether images may differ in size.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For an image that cannot be read or has another size (the error names it), or fewer than
    ///     two images; for metric, post or cache with SAD, which has its own metric and needs
    ///     neither.
    /// SurefixFileError
    ///     If there is no such folder.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> route = surefix.Map.from_images(np.random.default_rng(0).integers(0, 255, (5, 48, 96), np.uint8))
    /// >>> len(route), route.dim, route.descriptor
    /// (5, 2048, Sad(size=(64, 32), patch=8, dtype='u8'))
    #[staticmethod]
    #[pyo3(signature = (images, descriptor=None, *, positions=None, progress=None, skip_blank=false, metric=None, post=None, cache=None, levels=None, skip_bad=false, mixed_sizes=false))]
    #[expect(clippy::too_many_arguments, reason = "the options of Python's function")]
    fn from_images<'py>(
        py: Python<'py>,
        images: &Bound<'py, PyAny>,
        descriptor: Option<&Bound<'py, PyAny>>,
        positions: Option<&Bound<'py, PyAny>>,
        progress: Option<&Bound<'py, PyAny>>,
        skip_blank: bool,
        metric: Option<&Bound<'py, PyAny>>,
        post: Option<&Bound<'py, PyAny>>,
        cache: Option<&Bound<'py, PyAny>>,
        levels: Option<&Bound<'py, PyAny>>,
        skip_bad: bool,
        mixed_sizes: bool,
    ) -> PyResult<Bound<'py, Self>> {
        if let Some(descriptor) = descriptor.filter(|given| learned::is_learned(given)) {
            let skip = skip_bad.then(|| PyBool::new(py, true).to_owned().into_any());
            let options = [
                ("positions", positions),
                ("progress", progress),
                ("metric", metric),
                ("post", post),
                ("cache", cache),
                ("levels", levels),
                ("skip_bad", skip.as_ref()),
            ];
            let map = learned::map_of_images(images, descriptor, options)?;
            let map: Bound<'py, Self> = map.cast_into()?;
            return if skip_blank { Bound::new(py, map.get().without_blank(py)?) } else { Ok(map) };
        }
        if [metric, post, cache].iter().any(Option::is_some) {
            let reason = "metric, post, cache: expected a learned descriptor beside them, got Sad, which needs none";
            return Err(value(py, reason.to_owned()));
        }
        let sad = places::levelled_recipe(py, descriptor, levels)?;
        let positions = places::positions(positions)?;
        let images = Images::new(images)?;
        let callback = progress_callback(py, progress, "Mapping")?;
        let count = images.len();
        let map = with_progress(py, callback.as_ref(), |progress| {
            let terms = Terms { skip_bad, mixed_sizes };
            terms.each(py, &images, progress, |source, kept, progress| {
                let map = surefix::Map::from_images(source, sad, progress)?;
                with_positions(map, positions_of(positions.as_ref(), kept, count)?)
            })
        })?;
        let map = Self(Arc::new(map));
        Bound::new(py, if skip_blank { map.without_blank(py)? } else { map })
    }

    /// Makes the map of a traverse's images straight into a file, on all cores: the file that
    /// ``from_images(...).save(path)`` would write, in the memory of one image a core. Open it
    /// afterwards.
    ///
    /// The file is written beside its place and then renamed. If it fails, or is stopped,
    /// nothing is left of it.
    ///
    /// Parameters
    /// ----------
    /// path : str or path
    ///     The file to write.
    /// images, descriptor, positions, progress, levels, skip_bad, mixed_sizes
    ///     As for ``from_images``. A list of arrays, or an array, is in memory anyway; files, and
    ///     sequences such as a data set's, are not.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     As for ``from_images``.
    /// SurefixFileError
    ///     If there is no such folder, or the file cannot be written.
    ///
    /// Examples
    /// --------
    /// >>> import pathlib, tempfile, surefix.simulate
    /// >>> drive = surefix.simulate.Route(places=30, size=(64, 32)).reference()
    /// >>> path = pathlib.Path(tempfile.mkdtemp()) / "route.safetensors"
    /// >>> surefix.Map.build(path, drive)
    /// >>> surefix.Map.append(path, drive)
    /// >>> len(surefix.Map.open(path, mmap=True))
    /// 60
    #[staticmethod]
    #[pyo3(signature = (path, images, descriptor=None, *, positions=None, progress=None, levels=None, skip_bad=false, mixed_sizes=false))]
    #[expect(clippy::too_many_arguments, reason = "the options of Python's function")]
    fn build(
        py: Python<'_>,
        path: PathBuf,
        images: &Bound<'_, PyAny>,
        descriptor: Option<&Bound<'_, PyAny>>,
        positions: Option<&Bound<'_, PyAny>>,
        progress: Option<&Bound<'_, PyAny>>,
        levels: Option<&Bound<'_, PyAny>>,
        skip_bad: bool,
        mixed_sizes: bool,
    ) -> PyResult<()> {
        let sad = places::levelled_recipe(py, descriptor, levels)?;
        let positions = places::positions(positions)?;
        let images = Images::new(images)?;
        let callback = progress_callback(py, progress, "Mapping")?;
        let count = images.len();
        with_progress(py, callback.as_ref(), |progress| {
            let terms = Terms { skip_bad, mixed_sizes };
            terms.each(py, &images, progress, |source, kept, progress| {
                let positions = positions_of(positions.as_ref(), kept, count)?;
                surefix::Map::build(&path, source, sad, positions.as_ref(), progress)
            })
        })
    }

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
    ///     Where the images' places are, in planar metres; needed if the map has positions.
    /// progress : callable, optional
    ///     As for ``from_images``.
    /// cache : path, optional
    ///     With ``descriptor``, as for ``from_images``.
    /// skip_bad, mixed_sizes : bool
    ///     As for ``from_images``.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If the file is not a map, or the places differ from its own in type, length, metric
    ///     or recipe, or one has names or positions and the other has none; and as for
    ///     ``from_images``.
    /// SurefixFileError
    ///     If the file cannot be read or written.
    #[staticmethod]
    #[pyo3(signature = (path, more, descriptor=None, *, positions=None, progress=None, cache=None, skip_bad=false, mixed_sizes=false))]
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
    ) -> PyResult<()> {
        if let Some(descriptor) = descriptor.filter(|_| !more.is_instance_of::<Self>()) {
            if !learned::is_learned(descriptor) {
                let expected = "the map's own learned descriptor; images for Sad need none";
                let got = descriptor.get_type().name()?;
                return Err(value(py, format!("descriptor: expected {expected}, got {got}")));
            }
            let skip = skip_bad.then(|| PyBool::new(py, true).to_owned().into_any());
            let options = [
                ("positions", positions),
                ("progress", progress),
                ("cache", cache),
                ("skip_bad", skip.as_ref()),
            ];
            return learned::append_images(&path, more, descriptor, options);
        }
        if descriptor.or(cache).is_some() {
            let expected = "descriptor, cache: expected images and a learned descriptor";
            let got =
                if descriptor.is_some() { "a map, which is described" } else { "no descriptor" };
            return Err(value(py, format!("{expected}, got {got}")));
        }
        let positions = places::positions(positions)?;
        if let Ok(more) = more.cast::<Self>() {
            if positions.is_some() {
                return Err(value(
                    py,
                    "positions: expected none beside a map, which has its own".to_owned(),
                ));
            }
            let more = &more.get().0;
            return py.detach(|| surefix::Map::append(path, more)).or_raise(py);
        }
        let images = Images::new(more)?;
        let callback = progress_callback(py, progress, "Mapping")?;
        let count = images.len();
        with_progress(py, callback.as_ref(), |progress| {
            let terms = Terms { skip_bad, mixed_sizes };
            terms.each(py, &images, progress, |source, kept, progress| {
                let positions = positions_of(positions.as_ref(), kept, count)?;
                surefix::Map::append_images(&path, source, positions.as_ref(), progress)
            })
        })
    }

    /// The places of this map and then those of ``more``: the map that all their descriptors at
    /// once would have made. Neither changes.
    ///
    /// Parameters
    /// ----------
    /// more : Map
    ///     A map of the same kind, with names and positions if this one has them.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If they differ in type, length, metric or recipe, or one has names or positions and
    ///     the other has none.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> half = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32))
    /// >>> len(half.extended(half))
    /// 6
    fn extended(&self, py: Python<'_>, more: &Self) -> PyResult<Self> {
        Ok(Self(Arc::new(py.detach(|| self.0.extended(&more.0)).or_raise(py)?)))
    }

    /// A map of ready descriptors, from any technique.
    ///
    /// Parameters
    /// ----------
    /// descriptors : array, shape (n, dim), of float32, float16, int8 or uint8
    ///     Kept in its own type. Copied once.
    /// metric : {"cosine", "euclidean", "manhattan"}
    ///     How descriptors are compared; "manhattan" is the mean absolute difference.
    /// positions : array, shape (n, 2) or (n, 3), optional
    ///     Where each place is, in planar metres.
    /// names : sequence of str, optional
    ///     A name for each place.
    /// screen : {"i8"}, optional
    ///     As for ``with_screen``.
    /// post : list of steps, or a fitted surefix.post.Post, optional
    ///     Post-processing of the float32 descriptors before they are kept, fitted on them; see
    ///     ``surefix.post``. Queries go through the same: from then on ``distances``,
    ///     ``Localizer.push`` and ``match`` take vectors as they are before it.
    /// recipe : mapping, optional
    ///     The origin of learned descriptors: a mapping that JSON can hold, with a "name".
    /// image_size : (int, int), optional
    ///     Width and height of the images that were described.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For fewer than two rows, another type, a NaN or an infinity (the error names its row), a
    ///     row of up to 8 zeros under the cosine, or another number of positions or names than of
    ///     rows; as for ``with_screen`` and ``surefix.post.fit``; for a recipe without a name.
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "the options of Python's function")]
    #[pyo3(
        signature = (descriptors, metric=None, positions=None, names=None, *, screen=None, post=None, recipe=None, image_size=None),
        text_signature = "(descriptors, metric='cosine', positions=None, names=None, *, screen=None, post=None, recipe=None, image_size=None)"
    )]
    fn from_descriptors(
        py: Python<'_>,
        descriptors: &Bound<'_, PyAny>,
        metric: Option<&Bound<'_, PyAny>>,
        positions: Option<&Bound<'_, PyAny>>,
        names: Option<&Bound<'_, PyAny>>,
        screen: Option<&Bound<'_, PyAny>>,
        post: Option<&Bound<'_, PyAny>>,
        recipe: Option<&Bound<'_, PyAny>>,
        image_size: Option<(usize, usize)>,
    ) -> PyResult<Self> {
        let screen = screen.map(screen_dtype).transpose().or_raise(py)?;
        let recipe = recipe.map(learned::recipe_text).transpose()?;
        let metric =
            metric.map_or_else(|| "cosine".to_owned(), ToString::to_string).parse().or_raise(py)?;
        let positions = places::positions(positions)?;
        let array = as_array(descriptors, "descriptors")?;
        check_axes(&array, "descriptors", 2)?;
        let (places, dim) = (array.shape()[0], array.shape()[1]);
        if places < 2 {
            return Err(surefix::Error::TooFewPlaces { what: "map", got: places }).or_raise(py);
        }
        let numbers = Numbers::new(&array, "descriptors")?;
        let rows = numbers.view()?;
        let map = match post {
            None => py
                .detach(|| surefix::Map::from_descriptors(rows.to_values(), dim, metric))
                .or_raise(py)?,
            Some(post) => {
                let (post, rows) = post::fitted(post, rows, dim)?;
                let dim = post.output();
                let map = py
                    .detach(|| surefix::Map::from_descriptors(rows, dim, metric)?.with_post(post));
                map.or_raise(py)?
            }
        };
        let map = match recipe {
            Some(recipe) => map.with_learned_recipe(&recipe).or_raise(py)?,
            None => map,
        };
        let map = match names {
            Some(names) => map.with_names(places::names(names)?).or_raise(py)?,
            None => map,
        };
        let map = with_positions(map, positions).or_raise(py)?;
        let map = map.with_image_size(image_size).or_raise(py)?;
        Ok(Self(Arc::new(screened(py, map, screen)?)))
    }

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
        let map = py.detach(|| {
            if mmap {
                // SAFETY: the caller has been told above to leave the file alone.
                unsafe { surefix::Map::open_mapped(path) }
            } else {
                surefix::Map::open(path)
            }
        });
        Ok(Self(Arc::new(screened(py, map.or_raise(py)?, screen)?)))
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
        py.detach(|| self.0.save(path)).or_raise(py)
    }

    /// The bytes of the file that ``save`` writes.
    ///
    /// Returns
    /// -------
    /// bytes
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &py.detach(|| self.0.to_bytes()).or_raise(py)?))
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
        let map = py.detach(|| surefix::Map::from_bytes(data)).or_raise(py)?;
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
        py.detach(|| self.0.verify()).or_raise(py)
    }

    /// The places from ``start`` to before ``stop``, as a map of their own. It shares the memory of
    /// this map's rows.
    ///
    /// Parameters
    /// ----------
    /// start, stop : int
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     Unless this map has these places, or for less than two.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> route = surefix.Map.from_descriptors(np.eye(5, dtype=np.float32))
    /// >>> len(route.slice(1, 4))
    /// 3
    fn slice(
        &self,
        py: Python<'_>,
        start: &Bound<'_, PyAny>,
        stop: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let (start, stop) = (whole("start", start)?, whole("stop", stop)?);
        Ok(Self(Arc::new(py.detach(|| self.0.slice(start..stop)).or_raise(py)?)))
    }

    /// The same map without the places that show nothing (``blank``). Those after them move up.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If fewer than two places are left.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> images = np.random.default_rng(0).integers(0, 255, (5, 48, 96), np.uint8)
    /// >>> images[2] = 0
    /// >>> route = surefix.Map.from_images(images)
    /// >>> route.blank, len(route.without_blank())
    /// (array([2]), 4)
    fn without_blank(&self, py: Python<'_>) -> PyResult<Self> {
        Ok(Self(Arc::new(py.detach(|| self.0.without_blank()).or_raise(py)?)))
    }

    /// The distances from a descriptor to every place. A place that shows nothing (``blank``) has
    /// the mean of the others' distances; a descriptor that shows nothing has one distance to all.
    ///
    /// Parameters
    /// ----------
    /// descriptor : array, shape (input_dim,)
    ///     Of the map's own type, or of float32 on a map of ready descriptors.
    ///     As it is before post-processing, if the map has any.
    ///
    /// Returns
    /// -------
    /// array of float32, shape (n,)
    ///     SAD distances are in units of ``z``, whatever the type that the map keeps.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For another length or type, a NaN or an infinity, or up to 8 zeros under the cosine.
    fn distances<'py>(
        &self,
        py: Python<'py>,
        descriptor: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let array = as_array(descriptor, "descriptor")?;
        check_axes(&array, "descriptor", 1)?;
        let numbers = query(&array, "descriptor", &self.0)?;
        let view = numbers.view()?;
        let distances = py.detach(|| self.0.distances(view)).or_raise(py)?;
        Ok(PyArray1::from_vec(py, distances))
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

    /// Where each place is, in planar metres: shape (n, 2) or (n, 3), or None.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        use numpy::PyArrayMethods as _;
        let Some(positions) = self.0.positions() else { return Ok(None) };
        let array = PyArray1::from_slice(py, positions.metres());
        Ok(Some(array.reshape([positions.len(), positions.axes()])?.into_any()))
    }

    /// How many places a robot passes in a metre, by the map's positions
    /// (``surefix.datasets.places_per_metre``); None without positions. An odometry's metres times
    /// this are the ``advance`` of ``Localizer.push``.
    #[getter]
    fn places_per_metre<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(positions) = self.positions(py)? else { return Ok(None) };
        let metres = py.import("surefix.tables.metres")?;
        metres.call_method1("places_per_metre", (positions,)).map(Some)
    }

    /// The places that show nothing, in order: int64. They are SAD descriptors of images whose tiles
    /// are nearly all flat, ready descriptors of zeros, and those that at least 5 places share; ready
    /// descriptors of up to 8 numbers are taken as they are. Nothing is matched to such a place.
    #[getter]
    fn blank<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let blank = py.detach(|| self.0.blank());
        PyArray1::from_iter(py, blank.iter().map(|&place| place as i64))
    }

    /// A name for each place, or None.
    #[getter]
    fn names(&self) -> Option<Vec<String>> {
        self.0.names().map(<[String]>::to_vec)
    }

    pub(crate) fn __repr__(&self) -> String {
        let (places, dim, dtype, metric) =
            (self.0.places(), self.0.dim(), self.0.dtype(), self.0.metric());
        let bytes = places * dim * dtype.size();
        format!("Map({places} places x {dim} {dtype}, {metric}, {:.1} MB)", bytes as f64 / 1e6)
    }
}

/// The type that a screen is asked for in.
fn screen_dtype(name: &Bound<'_, PyAny>) -> Result<Dtype, surefix::Error> {
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
fn screened(py: Python<'_>, map: surefix::Map, screen: Option<Dtype>) -> PyResult<surefix::Map> {
    match screen {
        Some(dtype) => py.detach(|| map.with_screen(dtype)).or_raise(py),
        None => Ok(map),
    }
}
