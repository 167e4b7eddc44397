//! `surefix.Alarm`.

use pyo3::prelude::*;
use surefix::calibration;

use crate::arrays::floats;
use crate::error::{OrRaise as _, busy};
use crate::options::whole;
use crate::pickle::pickled;

/// Notices that scores have become worse than those of a calibration drive, so that what was
/// measured there (a threshold, a probability) holds no longer. It needs no truth.
///
/// A score is better the smaller it is. Frames are averaged in blocks, as neighbours are not
/// independent, and each block's mean is bet upon once: a conformal test martingale (Vovk, Gammerman
/// and Shafer, *Algorithmic Learning in a Random World*, 2005), whose money mixes over when the
/// change came. Scores that become better raise no alarm, and neither does a robot that is sure and
/// wrong: only what the scores show is noticed.
///
/// Parameters
/// ----------
/// scores : array of float32, shape (m,)
///     Of the calibration drive, one a frame. A last block that is not complete is left out. The
///     fewer blocks there are, the longer it takes to notice a change: if all scores are worse than
///     any of these, 7 blocks after a calibration of 30, 23 after one of 8.
/// block : int
///     How many frames are averaged: at least twice the correlation time of the scores, after which
///     their autocorrelation is below 1 / e; three times it for drives of more than 1,000 blocks.
/// level : float
///     The probability, at most, that a drive like the calibration's raises the alarm: on average
///     over calibration drives, not for each of them.
///
/// Raises
/// ------
/// SurefixValueError
///     For an option outside its range, fewer scores than a block, a NaN or an infinity.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> calibration = np.float32(np.arange(300) * 7 % 11 / 100)
/// >>> alarm = surefix.Alarm(calibration, block=10)
/// >>> any(alarm.push(score) for score in calibration)
/// False
/// >>> [alarm.push(0.9) for _ in range(70)].index(True)
/// 69
#[pyclass(module = "surefix")]
pub(crate) struct Alarm(calibration::Alarm);

pickled!(Alarm);

#[pymethods]
impl Alarm {
    #[new]
    #[pyo3(
        signature = (scores, block, level=0.01),
        text_signature = "(scores, block, level=0.01)"
    )]
    fn new(
        py: Python<'_>,
        scores: &Bound<'_, PyAny>,
        block: &Bound<'_, PyAny>,
        level: f64,
    ) -> PyResult<Self> {
        let scores = floats(scores, "scores", 1)?;
        let block = whole("block", block)?;
        Ok(Self(calibration::Alarm::new(scores.as_slice()?, block, level).or_raise(py)?))
    }

    /// The next frame's score; whether the alarm is raised. Once raised, it stays so until
    /// ``reset``.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For a NaN or an infinity; nothing has changed then.
    fn push(slf: &Bound<'_, Self>, score: f32) -> PyResult<bool> {
        let py = slf.py();
        slf.try_borrow_mut().map_err(|_| busy(py, "Alarm"))?.0.push(score).or_raise(py)
    }

    /// Whether the alarm has been raised.
    #[getter]
    fn raised(&self) -> bool {
        self.0.raised()
    }

    /// What has become of an initial 1 by betting that scores are worse: the martingale. The alarm
    /// is raised at ``1 / level**2``.
    #[getter]
    fn evidence(&self) -> f64 {
        self.0.evidence()
    }

    /// Forgets the drive, for a new one.
    fn reset(slf: &Bound<'_, Self>) -> PyResult<()> {
        slf.try_borrow_mut().map_err(|_| busy(slf.py(), "Alarm"))?.0.reset();
        Ok(())
    }

    fn __repr__(&self) -> String {
        format!("Alarm(raised={}, evidence={:.3})", self.0.raised(), self.0.evidence())
    }
}
