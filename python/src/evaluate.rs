//! `surefix.evaluate`.

use numpy::PyArray1;
use pyo3::prelude::*;
use surefix::evaluate::{Curve, Point, Recall};

use crate::arrays::whole_numbers;
use crate::batch::Run;
use crate::error::{OrRaise as _, value};

/// The precision-recall curve of a run against the truth: an exact sweep of its scores, equal ones together. The
/// warm-up, which has no sequence yet, is left out.
///
/// Parameters
/// ----------
/// run : Run
/// truth : array of int, shape (m,)
///     The place where each query really was; -1 where it was off the map, so that any accepted match is a mistake.
/// tolerance : int
///     How many places from the truth still count as correct.
/// recall : {"correct", "place_exists", "rejected"}
///     What recall is a share of. "correct" (the paper's wording): the queries whose match is correct. "place_exists":
///     those that have a true place. "rejected": true positives and all rejected queries (the authors' earlier code).
///
/// Returns
/// -------
/// Evaluation
///
/// Raises
/// ------
/// SurefixValueError
///     Where the truth has another length than the run, or is not of whole numbers.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> run = surefix.match_distances(1 - np.eye(5, dtype=np.float32))
/// >>> surefix.evaluate(run, np.arange(5)).auc(0.2)
/// 1.0
#[pyfunction]
#[pyo3(signature = (run, truth, tolerance=1, recall="correct"))]
pub(crate) fn evaluate(
    py: Python<'_>,
    run: &Run,
    truth: &Bound<'_, PyAny>,
    tolerance: usize,
    recall: &str,
) -> PyResult<Evaluation> {
    let recall: Recall = recall.parse().or_raise(py)?;
    let truth = whole_numbers(truth, "truth")?;
    if let Some(query) = truth.iter().position(|&place| place < -1) {
        let got = truth[query];
        let message =
            format!("truth: expected a place, or -1 where there is none, got {got} for query {query}");
        return Err(value(py, message));
    }
    let truth: Vec<Option<usize>> = truth.into_iter().map(|place| usize::try_from(place).ok()).collect();
    Ok(Evaluation(surefix::evaluate::evaluate(&run.0, &truth, tolerance, recall).or_raise(py)?))
}

/// A precision-recall curve, from the best score to the worst, and single figures from it.
#[pyclass(frozen, module = "surefix")]
pub(crate) struct Evaluation(Curve);

impl Evaluation {
    fn column<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        of: impl Fn(&Point) -> T,
    ) -> Bound<'py, PyArray1<T>> {
        PyArray1::from_iter(py, self.0.points().iter().map(of))
    }
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
    /// The area under the curve up to a recall, divided by it: 1 where all matches accepted by then are correct.
    fn auc(&self, upto: f64) -> f64 {
        self.0.auc(upto)
    }
    /// The largest recall at a precision of at least this; 0 where there is none.
    fn recall_at_precision(&self, precision: f64) -> f64 {
        self.0.recall_at_precision(precision)
    }
    /// How many wrong matches are accepted by the time that this recall is reached; None where it never is.
    fn false_positives_at(&self, recall: f64) -> Option<usize> {
        self.0.false_positives_at(recall)
    }
    /// The largest recall that the curve reaches.
    #[getter]
    fn max_recall(&self) -> f64 {
        self.0.max_recall()
    }
    fn __repr__(&self) -> String {
        let (auc, max) = (self.0.auc(0.2), self.0.max_recall());
        format!("Evaluation({} thresholds, auc(0.2)={auc:.4}, max_recall={max:.4})", self.0.points().len())
    }
}
