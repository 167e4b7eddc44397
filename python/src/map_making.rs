//! `surefix.Map`: how one is made, from images or descriptors.

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
use crate::places::{self, positions_of, segments_of_some, with_positions};
use crate::post;
use crate::segments::segments_of;
use crate::signals::detached;

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
    /// breaks : sequence of int, optional
    ///     The images at which a new segment begins, ascending: the drive jumps there, so that
    ///     gradients, sequences and motion end (``Segments``).
    /// closed : bool or sequence of int
    ///     Whether all segments are closed, their last place followed by their first; or the
    ///     indices of those that are.
    /// thumbnails : bool or (int, int)
    ///     Keep a small grey picture of each place in the map, 1 byte a pixel: 96 pixels on the
    ///     longer side (5,184 bytes a place for images of 16 : 9), or of this width and height.
    /// origin : (float, float) or str, optional
    ///     The plane of the positions: latitude and longitude of the origin of a local one, as of
    ///     ``surefix.datasets.local_metres``; or the name of another, such as "UTM 55S".
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
    ///     two images; before any is read, for breaks, closed segments, positions or an origin that
    ///     are none of these images; for metric, post or cache with SAD, which has its own metric and needs
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
    #[pyo3(signature = (images, descriptor=None, *, positions=None, progress=None, skip_blank=false, metric=None, post=None, cache=None, levels=None, skip_bad=false, mixed_sizes=false, breaks=None, closed=None, thumbnails=None, origin=None), text_signature = "(images, descriptor=None, *, positions=None, progress=None, skip_blank=False, metric=None, post=None, cache=None, levels=None, skip_bad=False, mixed_sizes=False, breaks=None, closed=False, thumbnails=False, origin=None)")]
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
        breaks: Option<&Bound<'py, PyAny>>,
        closed: Option<&Bound<'py, PyAny>>,
        thumbnails: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, Self>> {
        if let Some(descriptor) = descriptor
            && learned::is_learned(descriptor)?
        {
            let skip = skip_bad.then(|| PyBool::new(py, true).to_owned().into_any());
            let options = [
                ("positions", positions),
                ("progress", progress),
                ("metric", metric),
                ("post", post),
                ("cache", cache),
                ("levels", levels),
                ("skip_bad", skip.as_ref()),
                ("breaks", breaks),
                ("closed", closed),
                ("thumbnails", thumbnails),
                ("origin", origin),
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
        let positions = places::positions(positions, origin)?;
        let thumbnails = places::thumbnails(thumbnails)?;
        let images = Images::new(images)?;
        let count = images.len();
        let segments = segments_of(py, count, breaks, closed, None)?;
        let callback = progress_callback(py, progress, "Mapping")?;
        let map = with_progress(py, callback.as_ref(), |progress| {
            let terms = Terms { skip_bad, mixed_sizes };
            terms.each(py, &images, progress, |source, kept, progress| {
                let positions = positions_of(positions.as_ref(), kept, count)?;
                let segments = segments_of_some(&segments, kept)?;
                let extras = places::extras(thumbnails, positions.as_ref(), &segments);
                surefix::Map::from_images_with(source, sad, extras, progress)
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
    /// images, descriptor, positions, progress, levels, skip_bad, mixed_sizes, breaks, closed, thumbnails, origin
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
    #[pyo3(signature = (path, images, descriptor=None, *, positions=None, progress=None, levels=None, skip_bad=false, mixed_sizes=false, breaks=None, closed=None, thumbnails=None, origin=None), text_signature = "(path, images, descriptor=None, *, positions=None, progress=None, levels=None, skip_bad=False, mixed_sizes=False, breaks=None, closed=False, thumbnails=False, origin=None)")]
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
        breaks: Option<&Bound<'_, PyAny>>,
        closed: Option<&Bound<'_, PyAny>>,
        thumbnails: Option<&Bound<'_, PyAny>>,
        origin: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let sad = places::levelled_recipe(py, descriptor, levels)?;
        let positions = places::positions(positions, origin)?;
        let thumbnails = places::thumbnails(thumbnails)?;
        let images = Images::new(images)?;
        let count = images.len();
        let segments = segments_of(py, count, breaks, closed, None)?;
        let callback = progress_callback(py, progress, "Mapping")?;
        with_progress(py, callback.as_ref(), |progress| {
            let terms = Terms { skip_bad, mixed_sizes };
            terms.each(py, &images, progress, |source, kept, progress| {
                let positions = positions_of(positions.as_ref(), kept, count)?;
                let segments = segments_of_some(&segments, kept)?;
                let extras = places::extras(thumbnails, positions.as_ref(), &segments);
                surefix::Map::build_with(&path, source, sad, extras, progress)
            })
        })
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
    /// breaks, closed, origin : optional
    ///     As for ``from_images``.
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
        signature = (descriptors, metric=None, positions=None, names=None, *, screen=None, post=None, recipe=None, image_size=None, breaks=None, closed=None, origin=None),
        text_signature = "(descriptors, metric='cosine', positions=None, names=None, *, screen=None, post=None, recipe=None, image_size=None, breaks=None, closed=False, origin=None)"
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
        breaks: Option<&Bound<'_, PyAny>>,
        closed: Option<&Bound<'_, PyAny>>,
        origin: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let screen = screen.map(screen_dtype).transpose().or_raise(py)?;
        let recipe = recipe.map(learned::recipe_text).transpose()?;
        let metric =
            metric.map_or_else(|| "cosine".to_owned(), ToString::to_string).parse().or_raise(py)?;
        let positions = places::positions(positions, origin)?;
        let array = as_array(descriptors, "descriptors")?;
        check_axes(&array, "descriptors", 2)?;
        let (places, dim) = (array.shape()[0], array.shape()[1]);
        if places < 2 {
            return Err(surefix::Error::TooFewPlaces { what: "map", got: places }).or_raise(py);
        }
        let segments = segments_of(py, places, breaks, closed, None)?;
        let numbers = Numbers::new(&array, "descriptors")?;
        let rows = numbers.view()?;
        let map = match post {
            None => {
                detached(py, || surefix::Map::from_descriptors(rows.try_to_values()?, dim, metric))?
            }
            Some(post) => {
                let (post, rows) = post::fitted(post, rows, dim)?;
                let dim = post.output();
                detached(py, || surefix::Map::from_descriptors(rows, dim, metric)?.with_post(post))?
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
        let map = map.with_image_size(image_size).and_then(|map| map.with_segments(segments));
        let map = map.or_raise(py)?;
        Ok(Self(Arc::new(screened(py, map, screen)?)))
    }
}
