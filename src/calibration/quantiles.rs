//! The scores of a drive, in short.

use serde::{Deserialize, Serialize};

use super::probability::finite;

/// How many scores are kept of a drive at most.
pub(super) const KEPT: usize = 257;

/// The distribution of the scores of a drive: the scores themselves, or, of more than 257, as many
/// quantiles at equal shares.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Quantiles(Vec<f32>);

impl Quantiles {
    /// Of scores in ascending order.
    pub(super) fn new(sorted: &[f32]) -> Self {
        let count = sorted.len().min(KEPT);
        let of = |index: usize| sorted[index * (sorted.len() - 1) / (count - 1).max(1)];
        Self((0..count).map(of).collect())
    }

    /// Refuses numbers that no drive makes, as of a damaged file.
    pub(super) fn check(&self) -> Result<(), &'static str> {
        if self.0.is_empty() || !self.0.is_sorted() || !finite(&self.0) {
            return Err("threshold.scores: expected at least one number, ascending");
        }
        Ok(())
    }

    /// The scores, ascending.
    pub fn scores(&self) -> &[f32] {
        &self.0
    }

    /// The score that has the same share of `to`'s scores below it as `score` has of these.
    pub(super) fn carried(&self, score: f32, to: &[f32]) -> f32 {
        let below = self.0.partition_point(|&known| known < score);
        let upto = self.0.partition_point(|&known| known <= score);
        let last = |scores: &[f32]| scores.len().saturating_sub(1).max(1) as f64;
        // In the middle of equal scores; between two scores, linearly.
        let rank = if upto > below {
            (below + upto - 1) as f64 / 2.0
        } else if below == 0 || below == self.0.len() {
            (below as f64).min(last(&self.0))
        } else {
            let (low, high) = (f64::from(self.0[below - 1]), f64::from(self.0[below]));
            (below - 1) as f64 + (f64::from(score) - low) / (high - low)
        };
        let rank = rank / last(&self.0) * last(to);
        let (low, high) = (to[rank.floor() as usize], to[(rank.ceil() as usize).min(to.len() - 1)]);
        (f64::from(low) + rank.fract() * (f64::from(high) - f64::from(low))) as f32
    }
}
