//! Running statistics of the queries so far.

use super::fit::{check_references, fit};
use super::step::{FittedStep, Step};
use crate::error::Error;
use crate::numbers::View;
use serde::{Deserialize, Serialize};

/// Standardises vector after vector by the mean and the population standard deviation of those that
/// came, the newest among them (Welford, 1962): the statistics that a stream can know.
///
/// It gives what [`standardized`](super::standardized) would give for the newest of the rows so
/// far, up to rounding; the first vector becomes zeros, and so does a dimension that has not
/// changed.
///
/// ```
/// use surefix::Running;
/// let mut running = Running::new(2);
/// let mut out = [0.0; 2];
/// running.push(&[1.0, 5.0], &mut out)?;
/// assert_eq!(out, [0.0, 0.0]);
/// running.push(&[3.0, 5.0], &mut out)?;
/// assert_eq!(out, [1.0, 0.0]);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Running {
    pub(super) count: u64,
    pub(super) mean: Vec<f64>,
    /// The sum of squared differences from the mean.
    pub(super) square: Vec<f64>,
}

impl Running {
    /// For vectors of `dim` numbers; none has come yet.
    pub fn new(dim: usize) -> Self {
        Self { count: 0, mean: vec![0.0; dim], square: vec![0.0; dim] }
    }

    /// The same, as if one vector had come before: the references' mean, with their variance. So
    /// the first queries are standardised by the references, and later ones more and more by the
    /// queries.
    ///
    /// ```
    /// # use surefix::Running;
    /// let mut running = Running::after(&[1.0, 5.0, 3.0, 5.0], 2)?;
    /// let mut out = [0.0; 2];
    /// running.push(&[4.0, 5.0], &mut out)?;
    /// assert!(out[0] > 0.0);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// As for [`Post::fit`](super::Post::fit).
    pub fn after(references: &[f32], dim: usize) -> Result<Self, Error> {
        check_references(references, dim)?;
        Ok(Self::after_step(&fit(Step::Standardize, references, dim)?))
    }

    /// After the references that the step was fitted on.
    pub(super) fn after_step(step: &FittedStep) -> Self {
        Self { count: 1, mean: step.offset.clone(), square: step.variances().collect() }
    }

    /// [`after_step`](Self::after_step), in this one's memory.
    pub(super) fn become_after(&mut self, step: &FittedStep) {
        self.count = 1;
        self.mean.copy_from_slice(&step.offset);
        self.square
            .iter_mut()
            .zip(step.variances())
            .for_each(|(square, variance)| *square = variance);
    }

    /// Takes a vector in, and writes it standardised to `out`.
    ///
    /// # Errors
    /// [`Error::Length`] for another length, [`Error::NotFinite`] for a NaN or an infinity. The
    /// statistics are unchanged then.
    pub fn push(&mut self, vector: &[f32], out: &mut [f32]) -> Result<(), Error> {
        for (what, got) in [("descriptor", vector.len()), ("out", out.len())] {
            if got != self.mean.len() {
                return Err(Error::Length { what, expected: self.mean.len(), got });
            }
        }
        View::from(vector).check_finite("descriptor", vector.len())?;
        self.count += 1;
        let state = self.mean.iter_mut().zip(&mut self.square);
        for ((&x, out), (mean, square)) in vector.iter().zip(out).zip(state) {
            (*mean, *square, *out) = taken_in(x, *mean, *square, self.count as f64);
        }
        Ok(())
    }

    /// As [`push`](Self::push), for a vector that is checked; the statistics with it go to `next`.
    pub(super) fn peek(&self, vector: &[f32], next: &mut Self, out: &mut [f32]) {
        next.count = self.count + 1;
        let state =
            self.mean.iter().zip(&self.square).zip(next.mean.iter_mut().zip(&mut next.square));
        for ((&x, out), ((&mean, &square), (next_mean, next_square))) in
            vector.iter().zip(out).zip(state)
        {
            (*next_mean, *next_square, *out) = taken_in(x, mean, square, next.count as f64);
        }
    }

    /// The vectors that have come, the references counted as one.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The numbers of a vector.
    pub fn dim(&self) -> usize {
        self.mean.len()
    }

    /// Forgets all vectors, and the references.
    pub fn reset(&mut self) {
        self.count = 0;
        self.mean.fill(0.0);
        self.square.fill(0.0);
    }
}

/// The mean and the sum of squared differences with `x`, which is number `count`; and `x`
/// standardised by them.
fn taken_in(x: f32, mean: f64, square: f64, count: f64) -> (f64, f64, f32) {
    let x = f64::from(x);
    let before = x - mean;
    let mean = mean + before / count;
    let square = square + before * (x - mean);
    let standardized =
        if square > 0.0 { ((x - mean) / (square / count).sqrt()) as f32 } else { 0.0 };
    (mean, square, standardized)
}
