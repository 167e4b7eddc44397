//! The gradient of a distance vector and its enhancement along the route (method 1.1 and 1.2, Eq. 1).

use super::extreme::{extreme, first_equal};
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
///
/// Plain f32 operations in a fixed order: every instruction set gives the same bits.
pub(super) fn gradient(d: &[f32], kind: Gradient, g: &mut [f32]) {
    let n = d.len();
    g[0] = d[1] - d[0];
    g[n - 1] = d[n - 2] - d[n - 1];
    let inside = g[1..n - 1].iter_mut().zip(d.windows(3));
    match kind {
        Gradient::Halved => inside.for_each(|(g, d)| *g = 0.5 * (d[2] + d[0]) - d[1]),
        Gradient::Unhalved => inside.for_each(|(g, d)| *g = (d[2] + d[0]) - 2.0 * d[1]),
    }
}

/// What stands in for a gradient before the start of the route or of the run: the mean of the current one,
/// which telescopes to its two ends.
pub(super) fn missing_gradient(d: &[f32], kind: Gradient) -> f32 {
    let n = d.len();
    match kind {
        Gradient::Halved => ((d[1] - d[0]) + (d[n - 2] - d[n - 1])) / (2 * n) as f32,
        Gradient::Unhalved => 0.0,
    }
}

/// Method 1.2: the peak of `G[i, j] = g_j[i] + g_{j-1}[i-1] + ...`, `smoothing` terms in this order, over all places.
///
/// `gradients` holds the newest gradients, the current one first; `missing` replaces those it does not hold.
pub(super) fn enhanced_peak(gradients: &Ring, smoothing: usize, missing: f32) -> Peak {
    const BLOCK: usize = 64;
    let n = gradients.column(0).len();
    let held = gradients.len().min(smoothing);
    let mut peak = Peak { place: 0, value: f32::NEG_INFINITY };
    let mut sums = [0.0_f32; BLOCK];
    for start in (0..n).step_by(BLOCK) {
        let sums = &mut sums[..BLOCK.min(n - start)];
        sums.copy_from_slice(&gradients.column(0)[start..start + sums.len()]);
        for age in 1..held {
            // The first `absent` places of this block lie before the start of the route, `age` places back.
            let absent = age.saturating_sub(start).min(sums.len());
            let (before, within) = sums.split_at_mut(absent);
            for sum in before {
                *sum += missing;
            }
            let from = start + absent - age.min(start + absent);
            let terms = &gradients.column(age)[from..from + within.len()];
            within.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
        for _ in held..smoothing {
            for sum in sums.iter_mut() {
                *sum += missing;
            }
        }
        let highest = extreme(sums, f32::NEG_INFINITY, |a, b| if b > a { b } else { a });
        if highest > peak.value {
            peak = Peak { place: start + first_equal(sums, highest), value: highest };
        }
    }
    // Sums can overflow where distances come near f32::MAX. A NaN is never the peak; where nothing else is, place 0 stays.
    peak
}
