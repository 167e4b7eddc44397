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
        let last = self.0.len().saturating_sub(1) as f64;
        // In the middle of equal scores; between two scores, linearly.
        let rank = if upto > below {
            (below + upto - 1) as f64 / 2.0
        } else if below == 0 || below == self.0.len() {
            (below as f64).min(last)
        } else {
            let (low, high) = (f64::from(self.0[below - 1]), f64::from(self.0[below]));
            (below - 1) as f64 + (f64::from(score) - low) / (high - low)
        };
        let rank = rank / last.max(1.0) * (to.len() - 1) as f64;
        let (low, high) = (to[rank.floor() as usize], to[rank.ceil() as usize]);
        (f64::from(low) + rank.fract() * (f64::from(high) - f64::from(low))) as f32
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::cases::cases;

    /// The number at a position among others, linearly between two.
    fn at(numbers: &[f32], position: f64) -> f64 {
        let (low, part) = (position.floor() as usize, position.fract());
        let number = |index: usize| f64::from(numbers[index.min(numbers.len() - 1)]);
        number(low) * (1.0 - part) + number(low + 1) * part
    }

    fn ascending(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<f32>> {
        let some = vec((0..40_i32).prop_map(|tenths| tenths as f32 / 8.0), count);
        some.prop_map(|mut scores| {
            scores.sort_by(f32::total_cmp);
            scores
        })
    }

    proptest! {
        #![proptest_config(cases(5_000))]

        #[test]
        fn a_score_is_carried_to_the_same_share(
            known in ascending(2..12), to in ascending(1..12), score in (-8..48_i32),
        ) {
            let (score, last) = (score as f32 / 8.0, known.len() - 1);
            let equal: Vec<usize> = (0..=last).filter(|&index| known[index] == score).collect();
            let position = if let (Some(first), Some(last)) = (equal.first(), equal.last()) {
                (first + last) as f64 / 2.0
            } else if score < known[0] {
                0.0
            } else if score > known[last] {
                last as f64
            } else {
                // Where the line from one score to the next has this one.
                let below = known.partition_point(|&other| other < score) - 1;
                let (low, high) = (known[below], known[below + 1]);
                below as f64 + f64::from((score - low) / (high - low))
            };
            let expected = at(&to, position / last as f64 * (to.len() - 1) as f64);
            let got = f64::from(Quantiles(known).carried(score, &to));
            prop_assert!((got - expected).abs() < 1e-5, "{got}, expected {expected}");
        }
    }

    #[test]
    fn of_many_scores_257_are_kept() {
        for count in [1_usize, 2, 256, 257, 258, 513, 10_000] {
            let sorted: Vec<f32> = (0..count).map(|score| score as f32).collect();
            let kept = Quantiles::new(&sorted);
            let (kept, last) = (kept.scores(), count - 1);
            assert_eq!(kept.len(), count.min(257));
            assert_eq!((kept[0], kept[kept.len() - 1]), (0.0, last as f32));
            for (index, &score) in kept.iter().enumerate() {
                let share = index as f64 / (kept.len() - 1).max(1) as f64;
                assert!((share * last as f64 - f64::from(score)).abs() < 1.0, "{index} of {count}");
            }
        }
    }
}
