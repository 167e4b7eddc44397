//! How much a query speaks for each place (method 1.9, 2).

use super::exp::exp;
use super::hubness::Standard;

/// `e[i] = exp(-weight z[i])`.
#[derive(Clone, Copy)]
pub(super) struct Evidence<'a> {
    pub(super) says: Says<'a>,
    pub(super) weight: f64,
    pub(super) clip: f64,
}

/// Where a query's `z` come from.
#[derive(Clone, Copy)]
pub(super) enum Says<'a> {
    Nothing,
    /// From the column and the sums of the distances.
    Column(Standard),
    /// From several techniques together.
    Fused(&'a [f64]),
}

impl Evidence<'_> {
    /// Writes that of the places from `start` on.
    #[inline(always)]
    pub(super) fn of(self, column: &[f32], sums: &[f64], start: usize, out: &mut [f64]) {
        let Self { says, weight, clip } = self;
        let range = start..start + out.len();
        match says {
            Says::Nothing => out.fill(1.0),
            Says::Column(standard) => {
                let column = column[range.clone()].iter().zip(&sums[range]);
                for (out, (&distance, &sum)) in out.iter_mut().zip(column) {
                    *out = exp(-weight * standard.z(distance, sum).max(-clip).min(clip));
                }
            }
            Says::Fused(z) => {
                for (out, &z) in out.iter_mut().zip(&z[range]) {
                    *out = exp(-weight * z);
                }
            }
        }
    }
}
