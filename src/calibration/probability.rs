//! From a score to the probability that it is right: isotonic regression.

use serde::{Deserialize, Serialize};

/// The probability that a fix is right, by its score: never more for a worse score.
///
/// It is the isotonic regression of a calibration drive (pool adjacent violators), between whose
/// scores it is linear. The drive counts as if it had one wrong query more, of its best score, and
/// one right query more, of its worst: so that no drive makes a probability of 0 or 1. Scores worse
/// than all of the drive's are unknown: there it falls linearly to 0, which it is at a confidence of
/// 0, or for other scores as far beyond the worst as that is from the best.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Probability {
    /// Scores, ascending.
    scores: Vec<f32>,
    /// The probability at each of them.
    right: Vec<f64>,
}

/// Queries in a row that have one probability.
struct Pool {
    first: f32,
    last: f32,
    right: f64,
    count: f64,
}

impl Pool {
    fn mean(&self) -> f64 {
        self.right / self.count
    }
}

impl Probability {
    /// Of queries: their scores, and how right each is, from 0 to 1.
    pub(super) fn fit(queries: impl IntoIterator<Item = (f32, f64)>, tracked: bool) -> Self {
        let mut sorted: Vec<(f32, f64)> = queries.into_iter().collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (Some(&(best, _)), Some(&(worst, _))) = (sorted.first(), sorted.last()) else {
            return Self::default();
        };
        sorted.insert(0, (best, 0.0));
        sorted.push((worst, 1.0));
        let mut pools: Vec<Pool> = Vec::new();
        for equals in sorted.chunk_by(|a, b| a.0 == b.0) {
            let right = equals.iter().map(|query| query.1).sum();
            let (first, last) = (equals[0].0, equals[0].0);
            let mut pool = Pool { first, last, right, count: equals.len() as f64 };
            while let Some(better) = pools.pop_if(|better| better.mean() <= pool.mean()) {
                pool = Pool {
                    first: better.first,
                    right: better.right + pool.right,
                    count: better.count + pool.count,
                    ..pool
                };
            }
            pools.push(pool);
        }
        let mut fitted = Self::default();
        for pool in pools {
            let scores =
                if pool.last > pool.first { vec![pool.first, pool.last] } else { vec![pool.first] };
            fitted.right.extend(scores.iter().map(|_| pool.mean()));
            fitted.scores.extend(scores);
        }
        if let Some(zero) = zero(best, worst, tracked) {
            fitted.scores.push(zero);
            fitted.right.push(0.0);
        }
        fitted
    }

    /// That of a drive with scores from `best` to `worst`: `carried` gives its score for one of the
    /// scores up to `known`, the worst of this drive.
    pub(super) fn carried(
        &self,
        known: f32,
        carried: impl Fn(f32) -> f32,
        [best, worst]: [f32; 2],
        tracked: bool,
    ) -> Self {
        let within = self.scores.partition_point(|&score| score <= known);
        let beyond = if within < self.scores.len() { zero(best, worst, tracked) } else { None };
        let scores = self.scores[..within].iter().copied().map(carried).chain(beyond);
        let scores: Vec<f32> = scores.collect();
        Self { right: self.right.iter().copied().take(scores.len()).collect(), scores }
    }

    /// The probability at a score. `NaN` has that of the worst score.
    ///
    /// ```
    /// use surefix::calibration::{Calibrate, calibrate};
    /// use surefix::evaluate::Match;
    /// let found = |score| Match { place: 0, score, ready: true, accepted: true };
    /// let matches = [found(0.1), found(0.2), found(0.6), found(0.7)];
    /// let wrong = [0.0, 0.0, 0.0, 1.0].map(Some);
    /// let threshold = calibrate(&matches, &wrong, &Calibrate::default())?;
    /// let probability = threshold.probability();
    /// assert!(probability.at(0.15) > probability.at(0.65));
    /// # Ok::<(), surefix::Error>(())
    /// ```
    pub fn at(&self, score: f32) -> f64 {
        let after = self.scores.partition_point(|&known| known <= score);
        let (Some(&first), Some(&last)) = (self.right.first(), self.right.last()) else {
            return 0.0;
        };
        if after == 0 {
            return if score.is_nan() { last } else { first };
        }
        if after == self.scores.len() {
            return last;
        }
        let (low, high) = (f64::from(self.scores[after - 1]), f64::from(self.scores[after]));
        let along = (f64::from(score) - low) / (high - low);
        self.right[after - 1] + along * (self.right[after] - self.right[after - 1])
    }

    /// Refuses numbers that no drive makes, as of a damaged file.
    pub(super) fn check(&self) -> Result<(), &'static str> {
        // Carried to a drive of few scores, some are equal.
        let ascending = self.scores.is_sorted() && finite(&self.scores);
        let falling = self.right.is_sorted_by(|a, b| a >= b);
        let shares = self.right.iter().all(|right| (0.0..=1.0).contains(right));
        if self.scores.is_empty() || self.scores.len() != self.right.len() {
            return Err("threshold.probability: expected as many of `right` as of `scores`");
        }
        if !(ascending && falling && shares) {
            return Err("threshold.probability: expected ascending scores and falling shares");
        }
        Ok(())
    }

    /// The scores between which it is linear, ascending, and the probability at each.
    pub fn knots(&self) -> impl Iterator<Item = (f32, f64)> {
        self.scores.iter().copied().zip(self.right.iter().copied())
    }
}

/// The score beyond the worst at which the probability is 0, if there is one.
fn zero(best: f32, worst: f32, tracked: bool) -> Option<f32> {
    let zero = if tracked { 1.0 } else { worst + (worst - best) };
    (zero > worst && zero.is_finite()).then_some(zero)
}

/// Whether all are numbers.
pub(super) fn finite(scores: &[f32]) -> bool {
    scores.iter().all(|score| score.is_finite())
}
