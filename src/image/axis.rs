//! The weights along one axis of a resize.

use std::ops::Range;

/// Bits behind the point of a weight: an 8-bit pixel times a weight, summed, fits 32 bits with a
/// sign.
pub(super) const PRECISION: u32 = 32 - 8 - 2;
/// Ends a target pixel's weights, none of which is negative.
pub(super) const END: i32 = -1;

/// The weighted source pixels of each target pixel along one axis.
#[derive(Clone, Debug, Default)]
pub(super) struct Axis {
    pub(super) source: usize,
    pub(super) target: usize,
    /// For each target pixel: its first source pixel, and the range of its weights and their `END`.
    taps: Vec<(usize, Range<usize>)>,
    /// The weights of one target pixel after the other, each with an `END`. (A loop that ends at a
    /// mark is one that the compiler leaves alone: with a count, it would vectorise along the
    /// weights, which are few, and not along the rows.)
    weights: Vec<i32>,
}

impl Axis {
    /// The triangle filter, widened by the factor of reduction (so that it does not alias),
    /// normalised, and rounded to `PRECISION` bits.
    pub(super) fn prepare(&mut self, source: usize, target: usize) {
        if (self.source, self.target) == (source, target) {
            return;
        }
        (self.source, self.target) = (source, target);
        self.taps.clear();
        self.weights.clear();
        let scale = source as f64 / target as f64;
        let support = scale.max(1.0);
        for index in 0..target {
            let centre = (index as f64 + 0.5) * scale;
            let first = (centre - support + 0.5).max(0.0) as usize;
            let last = ((centre + support + 0.5) as usize).min(source);
            let triangle = |pixel: usize| {
                let distance = (pixel as f64 - centre + 0.5) * (1.0 / support);
                (1.0 - distance.abs()).max(0.0)
            };
            let total: f64 = (first..last).map(triangle).sum();
            let one = f64::from(1_u32 << PRECISION);
            let start = self.weights.len();
            self.weights
                .extend((first..last).map(|pixel| (0.5 + triangle(pixel) / total * one) as i32));
            self.weights.push(END);
            self.taps.push((first, start..self.weights.len()));
        }
    }

    /// For each target pixel: its first source pixel, and the weights from there on, with the
    /// `END`.
    #[inline(always)]
    pub(super) fn each(&self) -> impl Iterator<Item = (usize, &[i32])> {
        self.taps.iter().map(|(first, weights)| (*first, &self.weights[weights.clone()]))
    }
}
