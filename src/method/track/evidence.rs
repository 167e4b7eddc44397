//! How much a query speaks for each place (method 1.9, 2).

use super::exp::exp;
use super::hubness::{Standard, corrected};

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
    /// From several techniques together, clipped by each.
    Fused(&'a [f64]),
}

impl Says<'_> {
    /// Writes the `z` of the places from `start` on, not yet clipped.
    #[inline(always)]
    pub(super) fn z(self, column: &[f32], sums: &[f64], start: usize, out: &mut [f64]) {
        let range = start..start + out.len();
        match self {
            Says::Nothing => out.fill(0.0),
            Says::Column(standard) => {
                let (column, sums) = (&column[range.clone()], &sums[range]);
                for at in 0..column.len() {
                    out[at] = standard.z(column[at], sums[at]);
                }
            }
            Says::Fused(z) => out.copy_from_slice(&z[range]),
        }
    }

    /// Writes what views are compared by: the corrected distances, or what several techniques say.
    #[inline(always)]
    pub(super) fn view(self, column: &[f32], sums: &[f64], start: usize, out: &mut [f64]) {
        let range = start..start + out.len();
        match self {
            Says::Column(Standard { share, .. }) => {
                let column = column[range.clone()].iter().zip(&sums[range]);
                for (out, (&distance, &sum)) in out.iter_mut().zip(column) {
                    *out = corrected(distance, sum, share);
                }
            }
            says => says.z(column, sums, start, out),
        }
    }
}

impl Evidence<'_> {
    /// Writes that of the places from `start` on.
    #[inline(always)]
    pub(super) fn of(self, column: &[f32], sums: &[f64], start: usize, out: &mut [f64]) {
        let Self { says, weight, clip } = self;
        says.z(column, sums, start, out);
        let clip = if matches!(says, Says::Fused(_)) { f64::INFINITY } else { clip };
        for out in out {
            *out = exp(-weight * out.max(-clip).min(clip));
        }
    }
}
