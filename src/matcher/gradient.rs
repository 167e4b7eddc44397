//! The gradient of a distance vector and its enhancement along the route (method 1.1 and 1.2, Eq. 1).

use super::extreme::{BLOCK, first_better};
use super::ring::Ring;
use crate::config::Gradient;

/// Where the enhanced gradient peaks: the place whose distance dips most sharply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// The place, from 0.
    pub place: usize,
    /// The enhanced gradient there, in units of distance.
    pub value: f32,
}

/// Eq. 1: the second difference of the distances `d`, into `g`. Both have the same length, at least two.
pub(super) fn gradient(d: &[f32], kind: Gradient, g: &mut [f32]) {
    with_gradient(d, kind, 0, g, |g, value| *g = value);
}

/// Eq. 1 for the places from `from` on: `put(out, gradient)` for each number of `out`.
///
/// Plain f32 operations in a fixed order: every instruction set gives the same bits.
#[inline(always)]
fn with_gradient(d: &[f32], kind: Gradient, from: usize, out: &mut [f32], put: impl Fn(&mut f32, f32)) {
    let (n, to) = (d.len(), from + out.len());
    if from == to {
        return;
    }
    if from == 0 {
        put(&mut out[0], d[1] - d[0]);
    }
    if to == n {
        put(&mut out[n - 1 - from], d[n - 2] - d[n - 1]);
    }
    let (first, last) = (from.max(1), to.min(n - 1));
    if first >= last {
        return;
    }
    let around = d[first - 1..last - 1].iter().zip(&d[first + 1..=last]);
    let inside = out[first - from..last - from].iter_mut().zip(d[first..last].iter().zip(around));
    match kind {
        Gradient::Halved => {
            inside.for_each(|(out, (d, (before, after)))| put(out, 0.5 * (after + before) - d));
        }
        Gradient::Unhalved => {
            inside.for_each(|(out, (d, (before, after)))| put(out, (after + before) - 2.0 * d));
        }
    }
}

/// What stands in for a gradient before the start of the route or of the run: the mean of the current one,
/// which telescopes to its two ends.
#[inline(always)]
pub(super) fn missing_gradient(d: &[f32], kind: Gradient) -> f32 {
    let n = d.len();
    match kind {
        Gradient::Halved => ((d[1] - d[0]) + (d[n - 2] - d[n - 1])) / (2 * n) as f32,
        Gradient::Unhalved => 0.0,
    }
}

/// Method 1.2: the peak of `G[i, j] = g_j[i] + g_{j-1}[i-1] + ...`, `smoothing` terms in this order, over all places.
///
/// The gradients (Eq. 1) are made of the newest `columns` again for each query: reading those is all that it costs, and the
/// sequence reads them anyway. `earlier` holds the gradients of queries before them, the newest first; the mean of the
/// current gradient stands in for what neither holds.
#[inline(always)]
pub(super) fn enhanced_peak(columns: &Ring, earlier: &Ring, kind: Gradient, smoothing: usize) -> Peak {
    let current = columns.column(0);
    let (n, missing) = (current.len(), missing_gradient(current, kind));
    let held = smoothing.min(columns.len() + earlier.len());
    let mut peak = Peak { place: 0, value: f32::NEG_INFINITY };
    let mut sums = [0.0_f32; BLOCK];
    for start in (0..n).step_by(BLOCK) {
        let sums = &mut sums[..BLOCK.min(n - start)];
        with_gradient(current, kind, start, sums, |sum, g| *sum = g);
        for age in 1..held {
            // The first `absent` places of this block lie before the start of the route, `age` places back.
            let absent = age.saturating_sub(start).min(sums.len());
            let (before, within) = sums.split_at_mut(absent);
            for sum in before {
                *sum += missing;
            }
            let from = (start + absent).saturating_sub(age);
            if age < columns.len() {
                with_gradient(columns.column(age), kind, from, within, |sum, g| *sum += g);
            } else {
                let terms = &earlier.column(age - columns.len())[from..from + within.len()];
                within.iter_mut().zip(terms).for_each(|(sum, g)| *sum += g);
            }
        }
        for _ in held..smoothing {
            for sum in sums.iter_mut() {
                *sum += missing;
            }
        }
        if let Some((at, value)) = first_better(sums, peak.value, |a, b| a > b) {
            peak = Peak { place: start + at, value };
        }
    }
    // Sums can overflow where distances come near f32::MAX. A NaN is never the peak; where nothing else is, place 0 stays.
    peak
}
