//! `surefix.calibrate` and `surefix.Threshold`.

use numpy::PyArray1;
use pyo3::IntoPyObjectExt as _;
use pyo3::prelude::*;
use surefix::Error;
use surefix::calibration::{Calibrate, wrong_by_truth};

use crate::align::Alignment;
use crate::arrays::{flags, floats};
use crate::batch::Run;
use crate::error::{OrRaise as _, value};
use crate::evaluate::matches_of;
use crate::fix::Fix;
use crate::options::whole;
use crate::pickle::pickled;
use crate::signals::detached;
use crate::truth::truth_along;

/// A threshold from a calibration drive, with its promise, by ``calibrate``.
///
/// Attributes
/// ----------
/// score : float or None
///     A fix of this score or less is accepted. None if nothing can be promised, so that none is.
/// confidence : float or None
///     ``1 - score`` for fixes of a track; else None.
/// wrong, sure : float
///     The promise: at most the share ``wrong`` of the accepted is wrong, with probability ``sure``.
/// promise : str
///     The same in words, or why there is none.
/// queries, accepted, errors : int, int, float
///     The queries of the drive that have a fix and a truth, how many are accepted, and how many of
///     these are wrong.
/// block : int or None
///     Consecutive queries a block, for how long errors last; None if they are independent.
/// more, more_metres : int or None, float or None
///     If nothing is promised: how much more drive would do, if it is like this one. None if no
///     length would, or the drive's is not known.
/// carried : bool
///     Whether it was carried over to other conditions, for which nothing is promised.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> matches = surefix.Matches(place=np.arange(500), score=np.arange(500) / 500)
/// >>> truth = np.where(np.arange(500) < 400, np.arange(500), 0)
/// >>> threshold = surefix.calibrate(matches, truth, wrong=0.1, block=2)
/// >>> threshold.accepted, threshold.score > 0.7
/// (418, True)
/// >>> threshold.probability(matches)[[0, 499]] > 0.5
/// array([ True, False])
#[pyclass(frozen, eq, module = "surefix")]
#[derive(Clone, PartialEq)]
pub(crate) struct Threshold(pub(crate) surefix::calibration::Threshold);

pickled!(Threshold);

impl Threshold {
    /// A fix is judged alone, all else by its arrays.
    fn judged<'py, T, A>(
        &self,
        of: &Bound<'py, PyAny>,
        alone: impl Fn(&surefix::Fix) -> T,
        each: impl Fn(f32, bool) -> A,
    ) -> PyResult<Bound<'py, PyAny>>
    where
        T: IntoPyObject<'py>,
        A: numpy::Element,
    {
        let py = of.py();
        let tracked = |given: bool| {
            if given == self.0.tracked {
                return Ok(());
            }
            let kind = |tracked| if tracked { "with a track" } else { "without a track" };
            let message = format!(
                "fixes: expected those {}, as calibrated, got those {}",
                kind(self.0.tracked),
                kind(given)
            );
            Err(value(py, message))
        };
        if let Ok(fix) = of.cast::<Fix>() {
            tracked(fix.get().0.track.is_some())?;
            return alone(&fix.get().0).into_bound_py_any(py);
        }
        if let Ok(run) = of.cast::<Run>() {
            tracked(run.get().is_tracked())?;
        }
        let matches = matches_of(of)?;
        let each = matches.iter().map(|found| each(found.score, found.ready && found.accepted));
        Ok(PyArray1::from_iter(py, each).into_any())
    }
}

#[pymethods]
impl Threshold {
    /// A fix of this score or less is accepted; None if nothing can be promised.
    #[getter]
    fn score(&self) -> Option<f32> {
        self.0.score
    }
    /// ``1 - score`` for fixes of a track; else None.
    #[getter]
    fn confidence(&self) -> Option<f64> {
        self.0.score.filter(|_| self.0.tracked).map(|score| 1.0 - f64::from(score))
    }
    /// At most this share of the accepted is wrong.
    #[getter]
    fn wrong(&self) -> f64 {
        self.0.wrong
    }
    /// The probability of that.
    #[getter]
    fn sure(&self) -> f64 {
        self.0.sure
    }
    /// The promise in words, or why there is none.
    #[getter]
    fn promise(&self) -> String {
        self.0.to_string()
    }
    /// The queries of the calibration drive that have a fix and a truth.
    #[getter]
    fn queries(&self) -> usize {
        self.0.queries
    }
    /// How many of them are accepted.
    #[getter]
    fn accepted(&self) -> usize {
        self.0.accepted
    }
    /// How many of the accepted are wrong.
    #[getter]
    fn errors(&self) -> f64 {
        self.0.errors
    }
    /// Consecutive queries a block; None if they are independent.
    #[getter]
    fn block(&self) -> Option<usize> {
        self.0.block
    }
    /// How many queries more would do, if nothing is promised.
    #[getter]
    fn more(&self) -> Option<usize> {
        self.0.more
    }
    /// The same in metres, if the length of the drive is known.
    #[getter]
    fn more_metres(&self) -> Option<f64> {
        self.0.more_metres()
    }
    /// Whether it was carried over to other conditions.
    #[getter]
    fn carried(&self) -> bool {
        self.0.carried
    }

    /// Whether a fix is accepted; of a run or matches, an array of bool, shape (m,). Fixes that are
    /// not ready are not.
    ///
    /// Parameters
    /// ----------
    /// fixes : Fix, Run or Matches
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For fixes with a track if those of the calibration had none, and the other way round.
    fn accepts<'py>(&self, fixes: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let least = self.0.score;
        self.judged(
            fixes,
            |fix| self.0.accepts(fix),
            |score, counts| counts && least.is_some_and(|least| score <= least),
        )
    }

    /// The probability that a fix is right, by isotonic regression of the calibration drive; of a
    /// run or matches, an array of float64, shape (m,). None or NaN for fixes that are not ready.
    ///
    /// Parameters
    /// ----------
    /// fixes : Fix, Run or Matches
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     As for ``accepts``.
    fn probability<'py>(&self, fixes: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let at = |score| self.0.probability().at(score);
        self.judged(
            fixes,
            |fix| self.0.probability_of(fix),
            |score, ready| if ready { at(score) } else { f64::NAN },
        )
    }

    /// The threshold for other conditions, by the scores of a drive in them and without its truth:
    /// it accepts the same share, and probabilities are carried over by quantiles. That is a guess,
    /// for which nothing is promised.
    ///
    /// Parameters
    /// ----------
    /// fixes : Run or Matches
    ///     Of the new drive.
    ///
    /// Returns
    /// -------
    /// Threshold
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If no fix is ready; as for ``accepts``.
    fn carried_to(&self, py: Python<'_>, fixes: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(run) = fixes.cast::<Run>()
            && run.get().is_tracked() != self.0.tracked
        {
            self.accepts(fixes)?;
        }
        let ready = matches_of(fixes)?.into_iter().filter(|found| found.ready);
        let scores: Vec<f32> = ready.map(|found| found.score).collect();
        self.0.carried_to(&scores).map(Self).or_raise(py)
    }

    fn __repr__(&self) -> String {
        format!("Threshold({})", self.0)
    }
}

/// The loosest threshold on a score with a promise: at most the share ``wrong`` of the accepted
/// fixes is wrong, with probability ``sure`` over drives like this one (method 1.12).
///
/// It is found by Learn then Test in a fixed sequence (Angelopoulos et al. 2021), from strict to
/// lax, with bets on blocks of consecutive queries, as their errors are not independent.
///
/// Parameters
/// ----------
/// matches : Run or Matches
///     Of a calibration drive, which nothing else was chosen on.
/// truth : Alignment, or array or pair of arrays
///     Where each query really was: as for ``evaluate``, or an alignment of the same drive.
/// wrong : float
///     Between 0 and 1.
/// sure : float
///     Between 0 and 1.
/// tolerance : float
///     As for ``evaluate``.
/// block : int, optional
///     Consecutive queries a block; by default for how long errors last (method 1.12); the root of
///     the number of queries if there are no errors.
/// independent : bool
///     Queries are independent of each other, such as one of each of many drives: the exact
///     binomial test, without blocks.
/// metres : float, optional
///     The length of the drive, for ``more_metres``.
/// only : array of bool, shape (m,), optional
///     The queries that it is calibrated on: those that nothing else was chosen on. All by default.
///
/// Returns
/// -------
/// Threshold
///
/// Raises
/// ------
/// SurefixValueError
///     If no query has a fix and a truth; for an option outside its range; for a truth of another
///     number of queries or of another route.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> run = surefix.match_distances(1 - np.eye(300, dtype=np.float32))
/// >>> threshold = surefix.calibrate(run, np.arange(300), wrong=0.1, block=1)
/// >>> threshold.score is not None, threshold.errors
/// (True, 0.0)
/// >>> bool(threshold.accepts(run)[1:].all())
/// True
#[pyfunction]
#[pyo3(
    signature = (
        matches, truth, wrong=0.05, sure=0.95, *, tolerance=1.0, block=None, independent=false,
        metres=None, only=None
    ),
    text_signature = "(matches, truth, wrong=0.05, sure=0.95, *, tolerance=1, block=None, independent=False, metres=None, only=None)"
)]
#[expect(clippy::too_many_arguments, reason = "keyword arguments")]
pub(crate) fn calibrate(
    py: Python<'_>,
    matches: &Bound<'_, PyAny>,
    truth: &Bound<'_, PyAny>,
    wrong: f64,
    sure: f64,
    tolerance: f64,
    block: Option<&Bound<'_, PyAny>>,
    independent: bool,
    metres: Option<f64>,
    only: Option<&Bound<'_, PyAny>>,
) -> PyResult<Threshold> {
    let mut options = Calibrate::default();
    (options.wrong, options.sure, options.independent, options.metres) =
        (wrong, sure, independent, metres);
    options.block = block.map(|block| whole("block", block)).transpose()?;
    let found = matches_of(matches)?;
    let run = matches.cast::<Run>().ok();
    options.tracked = run.is_some_and(|run| run.get().is_tracked());
    let each = if let Ok(alignment) = truth.cast::<Alignment>() {
        if !(tolerance >= 0.0 && tolerance.fract() == 0.0) {
            let expected = "a whole number of places, 0 or more, with an alignment".to_owned();
            let got = tolerance.to_string();
            return Err(Error::Option { name: "tolerance", expected, got }).or_raise(py);
        }
        let (alignment, places) = (&alignment.get().0, run.map(|run| run.get().0.places()));
        if let Some(expected) = places.filter(|&places| places != alignment.places()) {
            let what = "alignment: the route";
            return Err(Error::Length { what, expected, got: alignment.places() }).or_raise(py);
        }
        alignment.wrong(&found, tolerance as usize)
    } else {
        let segments = run.map(|run| &run.get().0.segments);
        let truth = truth_along(truth, tolerance, segments)?;
        if let Some(segments) = segments {
            truth.check_places(segments.places()).or_raise(py)?;
        }
        wrong_by_truth(&found, &truth)
    };
    let mut each = each.or_raise(py)?;
    if let Some(only) = only {
        let only = flags(only, "only")?;
        if only.len() != each.len() {
            let (expected, got) = (each.len(), only.len());
            return Err(Error::Length { what: "only", expected, got }).or_raise(py);
        }
        let left_out = each.iter_mut().zip(only).filter(|(_, only)| !only);
        left_out.for_each(|(wrong, _)| *wrong = None);
    }
    detached(py, || surefix::calibration::calibrate(&found, &each, &options)).map(Threshold)
}

/// The queries a block, by how long errors last: an upper bound of their correlation time (method
/// 1.12). None if all are equal.
///
/// Parameters
/// ----------
/// errors : array of float32, shape (m,)
///     How wrong each query is, from 0 to 1.
///
/// Returns
/// -------
/// int or None
#[pyfunction]
pub(crate) fn block_length(errors: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
    let errors = floats(errors, "errors", 1)?;
    let errors: Vec<f64> = errors.as_slice()?.iter().copied().map(f64::from).collect();
    Ok(surefix::evaluate::block_length(&errors))
}
