//! `surefix.Map`: how one is made, from images or descriptors, and made longer.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyUntypedArrayMethods as _;
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::arrays::{Numbers, as_array, check_axes};
use crate::error::{OrRaise as _, value};
use crate::images::{Images, Terms, progress_callback, with_progress};
use crate::learned;
use crate::map::{Map, screen_dtype, screened};
use crate::places::{self, positions_of, with_positions};
use crate::post;

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
}
