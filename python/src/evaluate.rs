//! `surefix.evaluate` and its kin.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surefix::Error;
use surefix::evaluate::{Bootstrap, Curve, Match, Point, Recall, Verdict};

use crate::arrays::{flags, floats, matrix, whole_numbers};
use crate::batch::Run;
use crate::error::{OrRaise as _, if_it_can, value};
use crate::options::whole;
use crate::pickle::pickled;
use crate::pictures::{html, plotted};
use crate::segments::given_segments;
use crate::signals::detached;
use crate::truth::{truth_along, warn_of_units};

/// The precision-recall curve of matches against the truth: an exact sweep of the scores, equal
/// ones together. A sequence's warm-up, and queries that the truth ignores, are left out.
///
/// Parameters
/// ----------
/// matches : Run or Matches
///     Of any method.
/// truth : array or pair of arrays
///     Where each query really was. Places: int, shape (m,), -1 for a query that was off the map,
///     so that any accepted match is a mistake; or such numbers as float, NaN for a query whose
///     place is not known, which is left out. Or a matrix, shape (n, m): bool, or int with 1 (the
///     same place), 0 (not) and -1 (ignored). Or a pair of positions in planar metres, of the
///     places, shape (n, 2) or (n, 3), and of the queries, shape (m, 2) or (m, 3), a row with a NaN
///     for one that is not known (``surefix.datasets.local_metres`` turns latitude and longitude
///     into metres).
/// tolerance : float
///     How far from the truth still counts as correct: places, or metres if the truth is
///     positions. Places on either side of a break are not near each other; the last place of a
///     closed segment and its first are.
/// recall : {"correct", "place_exists", "rejected"}
///     What recall is a share of. "correct" (the paper's wording): the queries whose match is
///     correct. "place_exists": those that have a true place. "rejected": true positives and all
///     rejected queries (the authors' earlier code).
/// segments : Segments, optional
///     How the route's places follow each other, for ``Matches``; a ``Run`` knows it.
///
/// Returns
/// -------
/// Evaluation
///
/// Raises
/// ------
/// SurefixValueError
///     If the truth is of another length than the matches, of another type or shape, or an
///     option outside its range.
///
/// Warns
/// -----
/// UserWarning
///     Of 20 queries and places or more: if no query is within the tolerance of a place, or all
///     places are within it. Positions of another unit, such as degrees, make all matches wrong,
///     or right.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> run = surefix.match_distances(1 - np.eye(5, dtype=np.float32))
/// >>> surefix.evaluate(run, np.arange(5)).auc(0.2)
/// 1.0
#[pyfunction]
#[pyo3(
    signature = (matches, truth, tolerance=1.0, recall="correct", *, segments=None),
    text_signature = "(matches, truth, tolerance=1, recall='correct', *, segments=None)"
)]
pub(crate) fn evaluate(
    py: Python<'_>,
    matches: &Bound<'_, PyAny>,
    truth: &Bound<'_, PyAny>,
    tolerance: f64,
    recall: &str,
    segments: Option<&Bound<'_, PyAny>>,
) -> PyResult<Evaluation> {
    let recall: Recall = recall.parse().or_raise(py)?;
    let given = truth;
    let segments = match (matches.cast::<Run>(), given_segments(segments)?) {
        (Ok(_), Some(segments)) => {
            let expected = "none with a run, which has its own".to_owned();
            let got = format!("those of {} places", segments.places());
            return Err(Error::Option { name: "segments", expected, got }).or_raise(py);
        }
        (Ok(run), None) => Some(run.get().0.segments.clone()),
        (Err(_), segments) => segments,
    };
    let truth = truth_along(given, tolerance, segments.as_ref())?;
    if let Some(segments) = segments {
        truth.check_places(segments.places()).or_raise(py)?;
    }
    let matches = matches_of(matches)?;
    warn_of_units(given, &truth, tolerance)?;
    detached(py, || surefix::evaluate::evaluate(&matches, &truth, recall)).map(Evaluation)
}

/// Which matches are right, and which the truth judges, as by ``evaluate``: a list of two arrays of
/// bool, (m,).
#[pyfunction]
#[pyo3(signature = (place, truth, tolerance, segments))]
pub(crate) fn judged<'py>(
    py: Python<'py>,
    place: &Bound<'py, PyAny>,
    truth: &Bound<'py, PyAny>,
    tolerance: f64,
    segments: &Bound<'py, PyAny>,
) -> PyResult<[Bound<'py, PyArray1<bool>>; 2]> {
    let segments = given_segments(Some(segments))?;
    let truth = truth_along(truth, tolerance, segments.as_ref())?;
    if let Some(segments) = segments {
        truth.check_places(segments.places()).or_raise(py)?;
    }
    let places = whole_numbers(place, "place")?;
    if truth.len() != places.len() {
        let (what, expected, got) = ("truth", places.len(), truth.len());
        return Err(Error::Length { what, expected, got }).or_raise(py);
    }
    let place = |&place: &i64| usize::try_from(place).unwrap_or(usize::MAX);
    let verdicts: Vec<_> = places
        .iter()
        .map(place)
        .enumerate()
        .map(|(query, place)| truth.judge(query, place))
        .collect();
    let of = |is: fn(&Verdict) -> bool| PyArray1::from_iter(py, verdicts.iter().map(is));
    Ok([of(|it| *it == Verdict::Correct), of(|it| *it != Verdict::Ignored)])
}

/// A run's matches, or those of anything that has their arrays.
pub(crate) fn matches_of(object: &Bound<'_, PyAny>) -> PyResult<Vec<Match>> {
    if let Ok(run) = object.cast::<Run>() {
        return Ok(run.get().0.matches());
    }
    let field = |name: &str| {
        if_it_can(object.py(), object.getattr(name))?.ok_or_else(|| {
            let kind =
                object.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
            value(
                object.py(),
                format!("matches: expected a surefix.Run or surefix.Matches, got {kind}"),
            )
        })
    };
    let places = whole_numbers(&field("place")?, "matches: place")?;
    let scores = floats(&field("score")?, "matches: score", 1)?;
    let scores = scores.as_slice()?;
    let ready = flags(&field("ready")?, "matches: ready")?;
    let accepted = flags(&field("accepted")?, "matches: accepted")?;
    for (name, count) in
        [("score", scores.len()), ("ready", ready.len()), ("accepted", accepted.len())]
    {
        if count != places.len() {
            let message = format!("matches: {name}: expected {} values, got {count}", places.len());
            return Err(value(object.py(), message));
        }
    }
    let negative = places.iter().position(|&place| place < 0);
    if let Some(query) = negative {
        let message = format!(
            "matches: place: expected places from 0, got {} for query {query}",
            places[query]
        );
        return Err(value(object.py(), message));
    }
    let each = places.iter().zip(scores).zip(ready.iter().zip(&accepted));
    Ok(each
        .map(|((&place, &score), (&ready, &accepted))| Match {
            place: usize::try_from(place).unwrap_or(usize::MAX),
            score,
            ready,
            accepted,
        })
        .collect())
}

/// A precision-recall curve, from the best score to the worst, and single figures from it.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> matches = surefix.Matches(place=[0, 1, 7, 3], score=[0.1, 0.2, 0.3, 0.4])
/// >>> curve = surefix.evaluate(matches, np.arange(4), tolerance=0)
/// >>> curve.precision.round(2).tolist(), curve.false_positives_at(1.0)
/// ([1.0, 1.0, 0.67, 0.75], 1)
#[pyclass(frozen, module = "surefix")]
pub(crate) struct Evaluation(Curve);

pickled!(Evaluation);

impl Evaluation {
    fn column<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        of: impl Fn(&Point) -> T,
    ) -> Bound<'py, PyArray1<T>> {
        PyArray1::from_iter(py, self.0.points().iter().map(of))
    }
}

/// A recall is a share.
fn check_upto(py: Python<'_>, upto: f64) -> PyResult<()> {
    if (0.0..=1.0).contains(&upto) {
        return Ok(());
    }
    let expected = "a recall from 0 to 1".to_owned();
    Err(Error::Option { name: "upto", expected, got: upto.to_string() }).or_raise(py)
}

fn bootstrap(
    level: f64,
    samples: Option<&Bound<'_, PyAny>>,
    block: Option<&Bound<'_, PyAny>>,
    seed: Option<&Bound<'_, PyAny>>,
) -> PyResult<Bootstrap> {
    let standard = Bootstrap::default();
    Ok(Bootstrap {
        samples: samples.map_or(Ok(standard.samples), |samples| whole("samples", samples))?,
        block: block.map(|block| whole("block", block)).transpose()?,
        level,
        seed: seed.map_or(Ok(standard.seed), |seed| whole("seed", seed).map(|seed| seed as u64))?,
    })
}

#[pymethods]
impl Evaluation {
    /// The share found at each threshold: float64.
    #[getter]
    fn recall<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |point| point.recall)
    }
    /// The share of the accepted matches that is correct at each threshold: float64.
    #[getter]
    fn precision<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |point| point.precision)
    }
    /// The scores up to which matches are accepted: float32.
    #[getter]
    fn thresholds<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        self.column(py, |point| point.threshold)
    }
    /// How many wrong matches are accepted at each threshold: int64.
    #[getter]
    fn false_positives<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.column(py, |point| point.false_positives as i64)
    }
    /// The area under the curve up to a recall, divided by it: 1 if all matches accepted by then
    /// are correct.
    ///
    /// Trapezoids between the lowest precisions at each recall; in the segment that ``upto`` cuts,
    /// the sweep's own line, which leads to the highest precision at the next recall. The first
    /// precision is held back to recall 0. A curve that ends before adds nothing beyond its end:
    /// read it beside ``max_recall``.
    fn auc(&self, py: Python<'_>, upto: f64) -> PyResult<f64> {
        check_upto(py, upto)?;
        Ok(self.0.auc(upto))
    }
    /// An interval for ``auc(upto)``, by a bootstrap over blocks of consecutive queries, as
    /// neighbours are not independent.
    ///
    /// Parameters
    /// ----------
    /// upto : float
    /// level : float
    ///     The share of the samples inside.
    /// samples : int
    ///     How often the queries are drawn anew.
    /// block : int, optional
    ///     How many consecutive queries a block has; ``self.block`` by default.
    /// seed : int
    ///     Another seed draws other blocks.
    ///
    /// Returns
    /// -------
    /// (low, high)
    #[pyo3(
        signature = (upto, *, level=0.95, samples=None, block=None, seed=None),
        text_signature = "($self, upto, *, level=0.95, samples=1000, block=None, seed=0)"
    )]
    fn auc_interval(
        &self,
        py: Python<'_>,
        upto: f64,
        level: f64,
        samples: Option<&Bound<'_, PyAny>>,
        block: Option<&Bound<'_, PyAny>>,
        seed: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(f64, f64)> {
        check_upto(py, upto)?;
        let bootstrap = bootstrap(level, samples, block, seed)?;
        let interval = detached(py, || self.0.auc_interval(upto, &bootstrap))?;
        Ok((interval.low, interval.high))
    }
    /// The queries a block of an interval: an upper bound of how long errors last, from their
    /// autocorrelation (method 1.12). None if all matches are right, or all wrong.
    #[getter]
    fn block(&self) -> Option<usize> {
        self.0.block()
    }
    /// An interval for ``self.auc(upto) - other.auc(upto)`` on the same queries; each sample draws
    /// the same ones for both. If it holds 0, the drive does not tell which is better.
    ///
    /// Parameters
    /// ----------
    /// other : Evaluation
    ///     Of the same number of queries.
    /// upto, level, samples, block, seed
    ///     As for ``auc_interval``.
    ///
    /// Returns
    /// -------
    /// (low, high)
    #[pyo3(
        signature = (other, upto, *, level=0.95, samples=None, block=None, seed=None),
        text_signature = "($self, other, upto, *, level=0.95, samples=1000, block=None, seed=0)"
    )]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments")]
    fn auc_difference_interval(
        &self,
        py: Python<'_>,
        other: &Self,
        upto: f64,
        level: f64,
        samples: Option<&Bound<'_, PyAny>>,
        block: Option<&Bound<'_, PyAny>>,
        seed: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(f64, f64)> {
        check_upto(py, upto)?;
        let bootstrap = bootstrap(level, samples, block, seed)?;
        let interval = detached(py, || self.0.auc_difference_interval(&other.0, upto, &bootstrap))?;
        Ok((interval.low, interval.high))
    }
    /// The largest recall at a precision of at least this; 0 if there is none.
    fn recall_at_precision(&self, precision: f64) -> f64 {
        self.0.recall_at_precision(precision)
    }
    /// The number of wrong matches that are accepted when this recall is reached; None if it
    /// never is.
    fn false_positives_at(&self, recall: f64) -> Option<usize> {
        self.0.false_positives_at(recall)
    }
    /// The largest recall that the curve reaches.
    #[getter]
    fn max_recall(&self) -> f64 {
        self.0.max_recall()
    }
    /// The largest harmonic mean of precision and recall over all thresholds; 0 if nothing is
    /// correct.
    #[getter]
    fn best_f1(&self) -> f64 {
        self.0.best_f1().f1
    }
    /// The threshold of ``best_f1``.
    #[getter]
    fn best_f1_threshold(&self) -> f32 {
        self.0.best_f1().threshold
    }
    /// How many queries were judged: ready, and not ignored.
    #[getter]
    fn judged(&self) -> usize {
        self.0.judged()
    }
    /// How many of the judged matches are correct, accepted or not.
    #[getter]
    fn correct(&self) -> usize {
        self.0.correct()
    }

    /// Draws the curve, from the best score to the worst. Another curve goes onto the same axes, in
    /// the next colour: ``ax = weighted.plot(name="weighted")``, ``plain.plot(ax=ax, name="plain")``.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     Of the curve, in the legend.
    /// ax : matplotlib.axes.Axes, optional
    ///     Where to draw; by default a new figure of ``matplotlib.pyplot``.
    /// **options
    ///     As for ``surefix.plot.precision_recall``, such as ``upto``, the recall up to which the
    ///     area counts.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    ///
    /// Raises
    /// ------
    /// ModuleNotFoundError
    ///     If matplotlib is not installed.
    ///
    /// Examples
    /// --------
    /// >>> curve.plot(name="weighted").figure.savefig("curve.png")  # doctest: +SKIP
    #[pyo3(
        signature = (*, name=None, ax=None, **options),
        text_signature = "($self, *, name='', ax=None, **options)"
    )]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        name: Option<&Bound<'py, PyAny>>,
        ax: Option<&Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        plotted(slf, "of_evaluation", ax, &[("name", name)], options)
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        html(slf, "of_evaluation")
    }

    fn __repr__(&self) -> String {
        let (auc, max) = (self.0.auc(0.2), self.0.max_recall());
        format!(
            "Evaluation({} thresholds, auc(0.2)={auc:.4}, max_recall={max:.4})",
            self.0.points().len()
        )
    }
}

/// Recall at K: the share of the queries with a true place that have one among their K nearest
/// places.
///
/// Parameters
/// ----------
/// distances : array of float32, shape (n, m)
/// truth, tolerance, segments
///     As for ``evaluate``.
/// ks : sequence of int
///
/// Returns
/// -------
/// list of float, one a K
///
/// Raises
/// ------
/// SurefixValueError
///     As for ``evaluate``.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> surefix.recall_at(1 - np.eye(5, dtype=np.float32), np.arange(5), ks=(1, 5))
/// [1.0, 1.0]
#[pyfunction]
#[pyo3(
    signature = (distances, truth, ks=None, tolerance=1.0, *, segments=None),
    text_signature = "(distances, truth, ks=[1, 5, 10], tolerance=1, *, segments=None)"
)]
pub(crate) fn recall_at(
    py: Python<'_>,
    distances: &Bound<'_, PyAny>,
    truth: &Bound<'_, PyAny>,
    ks: Option<&Bound<'_, PyAny>>,
    tolerance: f64,
    segments: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<f64>> {
    let matrix = matrix(distances, "distances")?;
    let segments = given_segments(segments)?;
    let truth = truth_along(truth, tolerance, segments.as_ref())?;
    let view = matrix.as_array().into_dimensionality().map_err(|e| value(py, e.to_string()))?;
    if let Some(got) = segments.map(|segments| segments.places()).filter(|&n| n != view.nrows()) {
        let (what, expected) = ("segments", view.nrows());
        return Err(Error::Length { what, expected, got }).or_raise(py);
    }
    let ks = match ks {
        None => vec![1, 5, 10],
        Some(ks) => ks.try_iter()?.map(|k| whole("ks", &k?)).collect::<PyResult<_>>()?,
    };
    detached(py, || surefix::evaluate::recall_at(&view, &truth, &ks))
}
