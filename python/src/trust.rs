//! `surefix.evaluate_trust` and what it returns.

use pyo3::prelude::*;
use surefix::evaluate::TrustTable;

use crate::batch::Run;
use crate::error::OrRaise as _;
use crate::truth::truth_of;

/// The confusion table of a run's trust flags, which speak of its single matches: positive is
/// trusted, true is correct.
///
/// Parameters
/// ----------
/// run : Run
/// truth, tolerance
///     As for ``evaluate``.
///
/// Returns
/// -------
/// Trust
///
/// Raises
/// ------
/// SurefixValueError
///     As for ``evaluate``.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> run = surefix.match_distances(1 - np.eye(5, dtype=np.float32))
/// >>> trust = surefix.evaluate_trust(run, np.arange(5))
/// >>> trust.precision, trust.share_trusted
/// (1.0, 1.0)
#[pyfunction]
#[pyo3(
    signature = (run, truth, tolerance=1.0),
    text_signature = "(run, truth, tolerance=1)"
)]
pub(crate) fn evaluate_trust(
    py: Python<'_>,
    run: &Run,
    truth: &Bound<'_, PyAny>,
    tolerance: f64,
) -> PyResult<Trust> {
    let truth = truth_of(truth, tolerance)?;
    Ok(Trust(surefix::evaluate::evaluate_trust(&run.0, &truth).or_raise(py)?))
}

/// The confusion table of a trust flag: positive is trusted, true is a correct single match.
#[pyclass(frozen, module = "surefix")]
pub(crate) struct Trust(TrustTable);

#[pymethods]
impl Trust {
    /// Trusted, and correct.
    #[getter]
    fn true_positives(&self) -> usize {
        self.0.true_positives
    }
    /// Trusted, but wrong.
    #[getter]
    fn false_positives(&self) -> usize {
        self.0.false_positives
    }
    /// Correct, but not trusted.
    #[getter]
    fn false_negatives(&self) -> usize {
        self.0.false_negatives
    }
    /// Not trusted, and wrong.
    #[getter]
    fn true_negatives(&self) -> usize {
        self.0.true_negatives
    }
    /// The share of the trusted matches that is correct; 0 where none is trusted.
    #[getter]
    fn precision(&self) -> f64 {
        self.0.precision()
    }
    /// The share of the correct matches that is trusted (the true positive rate); 0 where none is
    /// correct.
    #[getter]
    fn recall(&self) -> f64 {
        self.0.recall()
    }
    /// The share of the wrong matches that is trusted; 0 where none is wrong.
    #[getter]
    fn false_positive_rate(&self) -> f64 {
        self.0.false_positive_rate()
    }
    /// The share of all matches that is trusted.
    #[getter]
    fn share_trusted(&self) -> f64 {
        self.0.share_trusted()
    }
    fn __repr__(&self) -> String {
        let TrustTable { true_positives, false_positives, false_negatives, true_negatives } =
            self.0;
        format!(
            "Trust(true_positives={true_positives}, false_positives={false_positives}, \
             false_negatives={false_negatives}, true_negatives={true_negatives})"
        )
    }
}
