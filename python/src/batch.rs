//! `surefix.match`, `surefix.match_distances` and `surefix.Run`.

use std::path::PathBuf;
use std::sync::Arc;

use ndarray::ArrayView2;
use numpy::{Element, PyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods as _};
use pyo3::exceptions::{PyIndexError, PyModuleNotFoundError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use surefix::saving::write_text;
use surefix::{Drive, Floor, Recipe, Values, View, describe_all, match_descriptors};

use crate::arrays::{
    Numbers, as_array, dtype_of, flags, matrix, numbers, query, rows_to_py, sequence_or_array,
    shape_of, whole_numbers,
};
use crate::error::{if_it_can, refused, to_py, value};
use crate::fix::Fix;
use crate::images::{Images, path_of, progress_callback, with_progress};
use crate::inputs::{descriptors, listed, maps};
use crate::kept::Distances;
use crate::learned;
use crate::options::config;
use crate::pickle::pickled;
use crate::pictures::{html, plotted};
use crate::segments::{Segments, given_segments};
use crate::signals::detached;
use crate::simulate::Traverse;

/// The fixes of a whole run, one a query: as arrays of the shape (m,), or one by one (``run[j]``).
///
/// ``place``, ``score``, ``trusted`` and ``blank`` are those of each ``Fix``; ``ready`` is False in
/// the warm-up, where ``anchors`` is 0 and ``speed`` is NaN. ``confidence`` and ``off_map`` are None
/// without the option ``motion``; with it, all queries are ready.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> run = surefix.match_distances(1 - np.eye(4, dtype=np.float32))
/// >>> run.ready.tolist(), run.anchors.tolist()
/// ([False, True, True, True], [0, 2, 2, 2])
/// >>> run[3]
/// Fix(frame=3, place=3, score=0, trusted=True)
#[pyclass(frozen, sequence, module = "surefix")]
pub(crate) struct Run(pub(crate) surefix::Run, Distances);

pickled!(Run, |run| Self(run, Distances::lost()));

impl Run {
    fn column<'py, T: Element>(
        &self,
        py: Python<'py>,
        of: impl Fn(&surefix::Fix) -> T,
    ) -> Bound<'py, PyArray1<T>> {
        PyArray1::from_iter(py, self.0.fixes.iter().map(of))
    }

    fn of_tracks<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&surefix::Fix) -> Option<f64>,
    ) -> Option<Bound<'py, PyArray1<f64>>> {
        let numbers: Option<Vec<f64>> = self.0.fixes.iter().map(of).collect();
        numbers.map(|numbers| PyArray1::from_vec(py, numbers))
    }
}

impl Run {
    /// Whether its fixes have a track.
    pub(crate) fn is_tracked(&self) -> bool {
        self.0.fixes.first().is_some_and(|fix| fix.track.is_some())
    }
}

#[pymethods]
impl Run {
    /// Where the robot was: int64.
    #[getter]
    fn place<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.column(py, |fix| fix.place as i64)
    }
    /// The index of that place's segment: int64.
    #[getter]
    fn segment<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.column(py, |fix| fix.segment as i64)
    }
    /// That place, counted from its segment's first: int64.
    #[getter]
    fn segment_place<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.column(py, |fix| fix.segment_place as i64)
    }
    /// How the route's places follow each other.
    #[getter]
    fn segments(&self) -> Segments {
        Segments(self.0.segments.clone())
    }
    /// How good the match is, less is better: float32.
    #[getter]
    fn score<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        self.column(py, |fix| fix.score)
    }
    /// Whether the single match is trusted: bool.
    #[getter]
    fn trusted<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.column(py, |fix| fix.trusted)
    }
    /// Whether the query shows nothing, so that it can never be trusted: bool.
    #[getter]
    fn blank<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.column(py, |fix| fix.blank)
    }
    /// How many trusted matches lie on the winning diagonal: int64.
    #[getter]
    fn anchors<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.column(py, |fix| fix.sequence.map_or(0, |sequence| sequence.anchors as i64))
    }
    /// Whether place and score are those of the track or of a full window: bool.
    #[getter]
    fn ready<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.column(py, surefix::Fix::is_ready)
    }
    /// The track's speed, else the slope of the winning diagonal, in places a query: float64.
    #[getter]
    fn speed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |fix| fix.speed().unwrap_or(f64::NAN))
    }
    /// The belief that the robot is within ``tolerance`` places of the track's place: float64.
    #[getter]
    fn confidence<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.of_tracks(py, surefix::Fix::confidence)
    }
    /// The belief that the robot is off the map: float64.
    #[getter]
    fn off_map<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.of_tracks(py, surefix::Fix::off_map)
    }
    /// The best match of each query alone: int64.
    #[getter]
    fn single_place<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.column(py, |fix| fix.single.place as i64)
    }
    /// Its distance: float32.
    #[getter]
    fn single_distance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        self.column(py, |fix| fix.single.distance)
    }
    /// Where the enhanced gradient peaks: int64.
    #[getter]
    fn gradient_place<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.column(py, |fix| fix.gradient.place as i64)
    }
    /// The enhanced gradient there: float32.
    #[getter]
    fn gradient_value<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        self.column(py, |fix| fix.gradient.value)
    }

    /// The distances that the method saw, to the last bit: float32, (n, m), ``distances[i, j]``
    /// between place ``i`` and query ``j``; of several techniques the fused ones, which have no unit.
    ///
    /// Of ``match`` they are computed when they are first asked for, and then kept: ``4 n m`` bytes.
    /// Until then a run keeps its map, which is shared, and the queries' descriptors: those that were
    /// given, without a copy, or those of images (2 kB an image by default). Of ``match_distances``
    /// they are the array that was given, not a copy. Arrays that were given must not change. A
    /// pickle keeps the fixes alone.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If the run comes from a pickle, or the memory does not suffice.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> rows = np.random.default_rng(0).normal(size=(30, 9)).astype(np.float32)
    /// >>> run = surefix.match(surefix.Map.from_descriptors(rows), rows[5:])
    /// >>> run.distances.shape, bool((run.distances.min(0) == run.single_distance).all())
    /// ((30, 25), True)
    #[getter]
    fn distances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.1.array(py, "run")
    }

    /// Draws the run: the distances (n, m) as tones, dark if a query looks like a place, and on them
    /// the place of each query. With the truth the marks say right or wrong, too.
    ///
    /// Parameters
    /// ----------
    /// truth : as for ``evaluate``, optional
    /// tolerance : float
    ///     As for ``evaluate``.
    /// single : bool
    ///     Draws the best match of each query alone, of which ``trusted`` speaks, in place of the fix.
    /// kind : {"matrix", "confidence"}
    ///     What to draw. "confidence": what the tracker believes along the drive, if there is
    ///     ``motion``.
    /// ax : matplotlib.axes.Axes, optional
    ///     Where to draw; by default a new figure of ``matplotlib.pyplot``.
    /// **options
    ///     As for ``surefix.plot.distance_matrix`` or ``confidence``: such as ``queries`` and
    ///     ``places`` for a close-up.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For a kind of picture that the run has no data for, or a truth as ``evaluate`` refuses it.
    /// ModuleNotFoundError
    ///     If matplotlib is not installed.
    ///
    /// Examples
    /// --------
    /// >>> run.plot(truth).figure.savefig("run.png")  # doctest: +SKIP
    #[pyo3(
        signature = (truth=None, *, tolerance=None, single=None, kind=None, ax=None, **options),
        text_signature = "($self, truth=None, *, tolerance=1, single=False, kind='matrix', ax=None, **options)"
    )]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        truth: Option<&Bound<'py, PyAny>>,
        tolerance: Option<&Bound<'py, PyAny>>,
        single: Option<&Bound<'py, PyAny>>,
        kind: Option<&Bound<'py, PyAny>>,
        ax: Option<&Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let given =
            [("truth", truth), ("tolerance", tolerance), ("single", single), ("kind", kind)];
        plotted(slf, "of_run", ax, &given, options)
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        html(slf, "of_run")
    }

    // It never changes: a copy is the run itself.
    fn __copy__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    fn __deepcopy__<'py>(slf: Bound<'py, Self>, _memo: &Bound<'py, PyAny>) -> Bound<'py, Self> {
        slf
    }

    /// Writes a CSV file: a line of names, then a line a query.
    ///
    /// Raises
    /// ------
    /// SurefixFileError
    ///     If the file cannot be written; an older one is then as it was.
    fn to_csv(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        detached(py, || {
            let io =
                |source| surefix::Error::Io { path: path.clone(), action: "write the CSV", source };
            write_text(&path, |mut out| self.0.write_csv(&mut out)).map_err(io)
        })
    }

    /// A pandas DataFrame, a row a query; its index is the frame.
    ///
    /// Raises
    /// ------
    /// ModuleNotFoundError
    ///     If pandas is not installed.
    fn to_dataframe<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let columns = PyDict::new(py);
        for name in [
            "place",
            "score",
            "trusted",
            "ready",
            "anchors",
            "speed",
            "single_place",
            "single_distance",
            "gradient_place",
            "gradient_value",
            "confidence",
            "off_map",
            "blank",
            "segment",
            "segment_place",
        ] {
            columns.set_item(name, slf.getattr(name)?)?;
        }
        let pandas = py.import("pandas").map_err(|error| name_the_extra(py, error))?;
        let frame = pandas.getattr("DataFrame")?.call1((columns,))?;
        frame.getattr("index")?.setattr("name", "frame")?;
        Ok(frame)
    }

    fn __len__(&self) -> usize {
        self.0.fixes.len()
    }

    fn __getitem__(&self, index: isize) -> PyResult<Fix> {
        let from = if index < 0 {
            self.0.fixes.len().checked_add_signed(index)
        } else {
            usize::try_from(index).ok()
        };
        let position = from.and_then(|index| self.0.positions.as_ref()?.at(index));
        let fix = from.and_then(|index| self.0.fixes.get(index)).copied();
        let fix = fix.map(|fix| Fix(fix, position));
        fix.ok_or_else(|| PyIndexError::new_err(format!("query {index} of {}", self.0.fixes.len())))
    }

    fn __repr__(&self) -> String {
        let trusted = self.0.fixes.iter().filter(|fix| fix.trusted).count();
        let count = self.0.fixes.len();
        if !self.is_tracked() {
            return format!("Run({count} queries, {trusted} trusted)");
        }
        let sure = |fix: &&surefix::Fix| fix.confidence().is_some_and(|sure| sure > 0.95);
        let sure = self.0.fixes.iter().filter(sure).count();
        format!("Run({count} queries, {trusted} trusted, {sure} of confidence above 0.95)")
    }
}

/// Matches a whole distance matrix, in parallel: the answers are those of a ``Matcher`` that is
/// pushed column by column.
///
/// Parameters
/// ----------
/// distances : array of float32, shape (n, m), in any memory layout; or a list of such
///     ``distances[i, j]`` is the distance between place ``i`` and query ``j``. Those of several
///     techniques are fused, as by ``Localizer``.
/// floor : {"global", "running"} or float
///     What trusted cells are drawn towards. "global", the default, is the paper's own: the minimum
///     of the whole matrix, which is there. ``match`` has "running" by default, so that its fixes
///     are those of a ``Localizer``, which cannot know it: give both one floor to compare them.
/// trusted : array of bool, shape (m,), optional
///     An external predictor's words in place of the consensus.
/// advance : array of float, shape (m,), optional
///     The places that the robot moved before each query, by odometry. Then gaps are bridged by it.
/// gaps : array or list of int, optional
///     The queries, in any order, before which there is a gap (``Matcher.gap``): one that does not
///     follow on the one before.
/// segments : Segments, optional
///     How the places follow each other; in one segment by default.
/// **options
///     As for ``Matcher``.
///
/// Returns
/// -------
/// Run
///
/// Raises
/// ------
/// SurefixValueError
///     For another shape or type, a NaN or an infinity (the error says where), an option outside
///     its range, a gap before a query that there is not, or segments of other places.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> distances = 1 - np.eye(4, dtype=np.float32)
/// >>> surefix.match_distances(distances, sequence_length=2).place
/// array([0, 1, 2, 3])
/// >>> surefix.match_distances(distances, sequence_length=2, gaps=[2]).ready
/// array([False,  True, False,  True])
#[pyfunction]
#[pyo3(
    signature = (distances, *, trusted=None, advance=None, gaps=None, segments=None, **options)
)]
pub(crate) fn match_distances(
    py: Python<'_>,
    distances: &Bound<'_, PyAny>,
    trusted: Option<&Bound<'_, PyAny>>,
    advance: Option<&Bound<'_, PyAny>>,
    gaps: Option<&Bound<'_, PyAny>>,
    segments: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Run> {
    let config = config(py, options, Floor::Global)?;
    let matrices = matrices(distances)?;
    let trusted = trusted.map(|trusted| flags(trusted, "trusted")).transpose()?;
    let advance = advance.map(|advance| numbers(advance, "advance")).transpose()?;
    let gaps = gaps.map(self::gaps).transpose()?.unwrap_or_default();
    let mut drive = Drive::default().gaps(&gaps);
    (drive.trusted, drive.advance) = (trusted.as_deref(), advance.as_deref());
    let segments = given_segments(segments)?;
    drive.segments = segments.as_ref();
    let views = views(py, &matrices)?;
    let run = detached(py, || match views[..] {
        [view] => surefix::match_distances(view, &config, drive),
        _ => surefix::match_fused_distances(&views, &config, drive),
    })?;
    let given = matrices.iter().map(|matrix| matrix.as_any().clone());
    Ok(Run(run, Distances::of_matrices(given, config)))
}

/// Matches all queries against a map, in parallel: the answers are those of a ``Localizer`` that is
/// pushed one by one.
///
/// Parameters
/// ----------
/// map : Map or list of Map
///     The known route. Several maps are fused, as by ``Localizer``.
/// queries : array of descriptors, shape (m, dim); or images, as for ``Map.from_images``
///     Descriptors are of the map's own type, or of float32 on a map of ready descriptors. On
///     several maps, images, or a list of such arrays, one for each map.
/// trusted : array of bool, shape (m,), optional
///     An external predictor's words in place of the consensus.
/// advance : array of float, shape (m,), optional
///     The places that the robot moved before each query, by odometry. Then gaps are bridged by it.
/// gaps : array or list of int, optional
///     The queries, in any order, before which there is a gap (``Localizer.gap``).
/// descriptor : surefix.descriptors.Descriptor, optional
///     On a map of learned descriptors: what describes the images, as for ``Localizer``.
/// progress : callable, optional
///     As for ``Map.from_images``.
/// **options
///     As for ``Matcher``, with its defaults, so that the fixes are those of a ``Localizer``;
///     ``floor="global"`` too, that of ``match_distances``, which scans the map twice.
///
/// Returns
/// -------
/// Run
///
/// Raises
/// ------
/// SurefixValueError
///     As for ``Localizer.push`` and ``Map.from_images``, and for a gap before a query that there
///     is not.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> route = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
/// >>> surefix.match(route, np.eye(4, dtype=np.float32)[1:]).place
/// array([1, 2, 3])
/// >>> surefix.match(route, np.eye(4, dtype=np.float32), gaps=[2]).ready
/// array([False,  True, False,  True])
#[pyfunction]
#[pyo3(
    name = "match",
    signature = (map, queries, *, trusted=None, advance=None, gaps=None, descriptor=None, progress=None, **options)
)]
#[expect(clippy::too_many_arguments, reason = "the options of Python's function")]
pub(crate) fn match_(
    py: Python<'_>,
    map: &Bound<'_, PyAny>,
    queries: &Bound<'_, PyAny>,
    trusted: Option<&Bound<'_, PyAny>>,
    advance: Option<&Bound<'_, PyAny>>,
    gaps: Option<&Bound<'_, PyAny>>,
    descriptor: Option<&Bound<'_, PyAny>>,
    progress: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Run> {
    let config = config(py, options, Floor::Running)?;
    let trusted = trusted.map(|trusted| flags(trusted, "trusted")).transpose()?;
    let advance = advance.map(|advance| numbers(advance, "advance")).transpose()?;
    let gaps = gaps.map(self::gaps).transpose()?.unwrap_or_default();
    let mut drive = Drive::default().gaps(&gaps);
    (drive.trusted, drive.advance) = (trusted.as_deref(), advance.as_deref());
    let maps = maps(map)?;
    let descriptors = descriptors(descriptor, &maps)?;
    let rows = Rows::of_each(queries, &maps, &descriptors, progress)?;
    let views = rows.iter().map(Rows::view).collect::<PyResult<Vec<_>>>()?;
    // Describing has shown its own progress.
    let described = rows.iter().any(|rows| matches!(rows, Rows::Described(_)));
    let progress = if described { None } else { progress_callback(py, progress, "Matching")? };
    let run = with_progress(py, progress.as_ref(), |progress| {
        Ok(py.detach(|| match (&maps[..], &views[..]) {
            ([map], [queries]) => match_descriptors(map, *queries, &config, drive, progress),
            _ => surefix::match_fused(&maps, &views, &config, drive, progress),
        }))
    })?;
    drop(views);
    Ok(Run(run, Distances::of_queries(maps, rows, config)))
}

/// The queries' descriptors for each map, (m, dim): images are described, ready ones are as given.
#[pyfunction]
#[pyo3(signature = (map, queries, descriptor=None, progress=None))]
pub(crate) fn described<'py>(
    map: &Bound<'py, PyAny>,
    queries: &Bound<'py, PyAny>,
    descriptor: Option<&Bound<'py, PyAny>>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let maps = maps(map)?;
    let descriptors = descriptors(descriptor, &maps)?;
    let rows = Rows::of_each(queries, &maps, &descriptors, progress)?;
    let array = |(rows, map): (&Rows<'py>, &Arc<surefix::Map>)| match rows {
        Rows::Given(numbers) => Ok(numbers.object()),
        Rows::Described(values) => {
            let dim = map.input_dim();
            rows_to_py(queries.py(), values.view(), &[values.len() / dim, dim])
        }
    };
    rows.iter().zip(&maps).map(array).collect()
}

/// Matrices of distances: one, or a list of those of several techniques.
pub(crate) fn matrices<'py>(
    distances: &Bound<'py, PyAny>,
) -> PyResult<Vec<PyReadonlyArrayDyn<'py, f32>>> {
    match listed(distances)? {
        Some(each) if is_matrices(&each)? => {
            each.iter().map(|each| matrix(each, "distances")).collect()
        }
        _ => Ok(vec![matrix(distances, "distances")?]),
    }
}

/// The same, as the crate takes them.
pub(crate) fn views<'a>(
    py: Python<'_>,
    matrices: &'a [PyReadonlyArrayDyn<'_, f32>],
) -> PyResult<Vec<ArrayView2<'a, f32>>> {
    let views = matrices.iter().map(|matrix| matrix.as_array().into_dimensionality());
    views.collect::<Result<_, _>>().map_err(|e| value(py, e.to_string()))
}

/// The descriptors of all queries, for one map.
pub(crate) enum Rows<'py> {
    Given(Numbers<'py>),
    Described(Values),
}

impl<'py> Rows<'py> {
    /// Those for each of some maps, from images for all of them, or a list of descriptors.
    pub(crate) fn of_each(
        queries: &Bound<'py, PyAny>,
        maps: &[Arc<surefix::Map>],
        descriptors: &[Option<Py<PyAny>>],
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Self>> {
        let py = queries.py();
        let stacked = stacked(queries)?;
        let queries = stacked.as_ref().unwrap_or(queries);
        // Images for all maps, or a list of descriptors for each. What a map has described by itself
        // may be grey images, which have two axes, too.
        let fits = |index: usize, each: &Bound<'_, PyAny>| {
            let described = maps[index].recipe() != Recipe::Ready || descriptors[index].is_some();
            let width = as_array(each, "queries").map(|a| a.shape()[1]);
            let width = if_it_can(py, width)?;
            Ok::<_, PyErr>(!described || width == Some(maps[index].input_dim()))
        };
        let mut each = listed(queries)?;
        if let Some(list) = &each {
            let mut all = maps.len() > 1 && list.len() == maps.len() && is_matrices(list)?;
            for (index, one) in list.iter().enumerate() {
                all = all && fits(index, one)?;
            }
            each = each.filter(|_| all);
        }
        let rows = maps.iter().zip(descriptors).enumerate().map(|(index, (map, descriptor))| {
            let queries = each.as_ref().map_or(queries, |each| &each[index]);
            Self::new(queries, map, descriptor.as_ref().map(|given| given.bind(py)), progress)
        });
        rows.collect()
    }

    fn new(
        queries: &Bound<'py, PyAny>,
        map: &surefix::Map,
        descriptor: Option<&Bound<'py, PyAny>>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let py = queries.py();
        let array = match as_array(queries, "queries") {
            Ok(_) if is_images(queries)? => None,
            Err(refused) if !is_images(queries)? && queries.hasattr("__array__")? => {
                return Err(refused);
            }
            array => if_it_can(py, array)?,
        };
        let are_rows = array.as_ref().is_some_and(|array| array.ndim() == 2);
        let extracted = match descriptor.filter(|_| !are_rows) {
            None => None,
            Some(descriptor) => Some(learned::extracted(queries, descriptor, progress)?),
        };
        let array = match &extracted {
            Some(extracted) => Some(as_array(extracted, "queries")?),
            None => array,
        };
        if let Some(array) = array.as_ref().filter(|array| array.ndim() == 2) {
            if array.shape()[1] != map.input_dim() {
                let (expected, got) = (map.input_dim(), array.shape()[1]);
                let what = "queries: each row";
                return Err(to_py(py, &surefix::Error::Length { what, expected, got }));
            }
            return query(array, "queries", map).map(Self::Given);
        }
        let Recipe::Sad(sad) = map.recipe() else {
            let dim = map.input_dim();
            let expected = format!(
                "descriptors (m, {dim}), as this map was made of ready ones, or descriptor="
            );
            let has =
                |name: &str| Ok::<_, PyErr>(if_it_can(py, queries.hasattr(name))?.unwrap_or(false));
            let got = match (&array, path_of(queries)?) {
                (Some(array), _) => shape_of(array),
                (None, Some(path)) => format!("the path {}", path.display()),
                // Images come in a list, one after the other, or by an object that makes them.
                (None, None) if has("__getitem__")? || has("__next__")? => "images".to_owned(),
                (None, None) => queries.get_type().name()?.to_string(),
            };
            return Err(value(py, format!("queries: expected {expected}, got {got}")));
        };
        let images = Images::new(queries)?;
        let callback = progress_callback(py, progress, "Describing")?;
        let values = with_progress(py, callback.as_ref(), |progress| {
            images.with_source(py, |source| describe_all(&sad, source, progress))
        })?;
        Ok(Self::Described(values))
    }

    pub(crate) fn view(&self) -> PyResult<View<'_>> {
        match self {
            Self::Given(numbers) => numbers.view(),
            Self::Described(values) => Ok(values.view()),
        }
    }
}

/// Whether these are arrays of two axes, and no images: floats, or rows of bytes of a list.
fn is_matrices(each: &[Bound<'_, PyAny>]) -> PyResult<bool> {
    for one in each {
        let array = if_it_can(one.py(), as_array(one, "queries"))?;
        if array.is_none_or(|array| array.ndim() != 2) || path_of(one)?.is_some() {
            return Ok(false);
        }
    }
    Ok(!each.is_empty())
}

/// The queries before which there is a gap; whether there are such queries is for the crate to say.
pub(crate) fn gaps(given: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
    indices(given, "gaps", "queries")
}

/// The indices that an argument lists, of queries or places.
pub(crate) fn indices(
    given: &Bound<'_, PyAny>,
    name: &'static str,
    of: &str,
) -> PyResult<Vec<usize>> {
    let py = given.py();
    let given = sequence_or_array(given, name)?;
    if dtype_of(&given) == "bool" {
        let advice = format!(
            "{name}: expected indices of {of}, got bool; convert a mask with np.flatnonzero(mask)"
        );
        return Err(value(py, advice));
    }
    let indices = whole_numbers(given.as_any(), name)?.into_iter().map(|index| {
        usize::try_from(index).map_err(|_| {
            let (expected, got) = (format!("indices of {of}, from 0"), index.to_string());
            to_py(py, &surefix::Error::Option { name, expected, got })
        })
    });
    indices.collect()
}

/// A list of descriptors as one array of rows; nothing for anything else.
fn stacked<'py>(queries: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyAny>>> {
    let listed = queries.is_instance_of::<PyList>() || queries.is_instance_of::<PyTuple>();
    let Some(first) = (listed && queries.len()? > 0).then(|| queries.get_item(0)).transpose()?
    else {
        return Ok(None);
    };
    let axes = if_it_can(queries.py(), as_array(&first, "queries"))?.map(|first| first.ndim());
    if path_of(&first)?.is_some() || axes != Some(1) {
        return Ok(None);
    }
    if first.is_instance_of::<PyList>() || first.is_instance_of::<PyTuple>() {
        return as_array(queries, "queries").map(|array| Some(array.into_any()));
    }
    let py = queries.py();
    let stacked = py.import("numpy")?.call_method1("stack", (queries,));
    Ok(Some(stacked.map_err(|e| refused(py, e, |e| format!("queries: {e}")))?))
}

/// Whether the queries can only be images: paths, a generated traverse, or a list (of arrays).
fn is_images(queries: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(path_of(queries)?.is_some()
        || queries.is_instance_of::<Traverse>()
        || queries.is_instance_of::<PyList>()
        || queries.is_instance_of::<PyTuple>())
}

/// If pandas itself is missing, the error names the extra to install; any other error as it is.
fn name_the_extra(py: Python<'_>, error: PyErr) -> PyErr {
    let missing = error.is_instance_of::<PyModuleNotFoundError>(py)
        && error.value(py).getattr("name").is_ok_and(|name| name.eq("pandas").unwrap_or(false));
    if !missing {
        return error;
    }
    PyModuleNotFoundError::new_err(
        "a DataFrame needs pandas, which is not installed: pip install 'surefix[dataframe]'",
    )
}
