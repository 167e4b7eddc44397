//! The gradient of a distance vector, its enhancement along the route, and the peak of both (method
//! 1.1 to 1.3, Eqs. 1 and 2).
//!
//! The gradients of earlier queries are computed again for each query: reading their columns is all
//! that costs anything, and the sequence reads them anyway.

use serde::{Deserialize, Serialize};
use std::ops::Range;

use super::argmin::{BLOCK, Search, beats, first_better, first_least};
use super::window::{Cells, Exact, MAX_OPEN, Ring, Window};
use crate::config::Gradient;
use crate::segments::{Segment, Segments};

/// Where the enhanced gradient peaks: the place whose distance dips most sharply.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Peak {
    /// The place, from 0.
    pub place: usize,
    /// The enhanced gradient there, in units of distance.
    pub value: f32,
}

/// Eq. 1 inside a segment. Plain f32 operations in a fixed order: every instruction set gives the
/// same bits.
#[inline(always)]
fn halved(before: f32, d: f32, after: f32) -> f32 {
    0.5 * (after + before) - d
}

/// The same without the half.
#[inline(always)]
fn unhalved(before: f32, d: f32, after: f32) -> f32 {
    (after + before) - 2.0 * d
}

/// Eq. 1 for the places of the segment `d` from `from` on: `put(out, gradient)` for each number of
/// `out`. A place's own distance is that of `d`, its neighbours' are those of `around`: the same
/// distances, or, for a bound of the gradient, bounds of them.
#[inline(always)]
pub(super) fn gradient(
    around: &[f32],
    d: &[f32],
    kind: Gradient,
    from: usize,
    out: &mut [f32],
    put: impl Fn(&mut f32, f32),
) {
    let (n, to) = (d.len(), from + out.len());
    if from == to {
        return;
    }
    // At either end one neighbour is missing.
    if from == 0 {
        put(&mut out[0], around[1] - d[0]);
    }
    if to == n {
        put(&mut out[n - 1 - from], around[n - 2] - d[n - 1]);
    }
    let (first, last) = (from.max(1), to.min(n - 1));
    if first >= last {
        return;
    }
    let around = around[first - 1..last - 1].iter().zip(&around[first + 1..=last]);
    let inside = out[first - from..last - from].iter_mut().zip(d[first..last].iter().zip(around));
    match kind {
        Gradient::Halved => {
            inside.for_each(|(out, (&d, (&before, &after)))| put(out, halved(before, d, after)));
        }
        Gradient::Unhalved => {
            inside.for_each(|(out, (&d, (&before, &after)))| put(out, unhalved(before, d, after)));
        }
    }
}

/// The term of a gradient that is missing because the diagonal leaves the segment or the run: the
/// mean of the current gradient, which telescopes to its two ends (method 1.2).
#[inline(always)]
pub(super) fn missing_gradient(d: &[f32], kind: Gradient) -> f32 {
    let n = d.len();
    match kind {
        Gradient::Halved => ((d[1] - d[0]) + (d[n - 2] - d[n - 1])) / (2 * n) as f32,
        Gradient::Unhalved => 0.0,
    }
}

/// The options of the enhancement.
#[derive(Clone, Copy)]
pub(super) struct Enhancement {
    pub(super) gradient: Gradient,
    /// Terms of a sum.
    pub(super) smoothing: usize,
}

impl Enhancement {
    /// Eq. 2: `i_g = argmax G`, the place of the largest enhanced gradient.
    #[inline(always)]
    pub(super) fn peak<E: Exact>(
        self,
        window: &mut Window,
        segments: &Segments,
        ask: &mut E,
    ) -> Peak {
        if E::BOUNDS
            && let Some(peak) = self.peak_of_bounds(window, segments, ask)
        {
            return peak;
        }
        // Sums can overflow if distances come near f32::MAX. A NaN is never the peak; if there is
        // nothing else, it is place 0.
        let mut peak = Peak { place: 0, value: f32::NEG_INFINITY };
        let columns = &window.cells.lower;
        for segment in segments.iter() {
            peak = Enhanced { columns, around: columns, segment, options: self }.peak(peak);
        }
        peak
    }

    /// [`peak`](Self::peak) by upper bounds of the sums; `None` if all columns are resolved.
    fn peak_of_bounds<E: Exact>(
        self,
        window: &mut Window,
        segments: &Segments,
        ask: &mut E,
    ) -> Option<Peak> {
        let Window { cells, scratch } = window;
        // The mean of the gradient is made of these.
        for segment in segments.iter() {
            cells.resolve(0, segment.start..segment.start + 2, ask);
            cells.resolve(0, segment.end - 2..segment.end, ask);
        }
        let places = segments.places();
        loop {
            let ages = self.smoothing.min(cells.lower.len());
            let open = (0..ages).find(|&age| !cells.is_resolved(age))?;
            for segment in segments.iter() {
                let bounds = self.bounds(cells, segment);
                for start in segment.places().step_by(BLOCK) {
                    let sums = &mut scratch.gradients[start..segment.end.min(start + BLOCK)];
                    bounds.block(start - segment.start, sums);
                    // The largest sum is the least negated one.
                    for sum in sums {
                        *sum = -*sum;
                    }
                }
            }
            let negated = |place: usize, best: Option<(f64, usize)>| {
                let segment = segments.of(place);
                for age in 0..ages.min(place - segment.start + 1) {
                    let at = place - age;
                    let around = at.max(segment.start + 1) - 1..segment.end.min(at + 2);
                    if cells.resolve(age, around, ask) {
                        let bound = self.bounds(cells, segment).sum(place - segment.start);
                        if !beats((-f64::from(bound), place), best) {
                            return None;
                        }
                    }
                }
                Some(-f64::from(self.bounds(cells, segment).sum(place - segment.start)))
            };
            let (gradients, candidates) = (&scratch.gradients, &mut scratch.candidates);
            match first_least(gradients, 0, None, places / MAX_OPEN, candidates, negated) {
                Search::Best(Some((negated, place))) => {
                    return Some(Peak { place, value: -negated as f32 });
                }
                Search::Best(None) | Search::TooMany => cells.resolve_all(open, ask),
            }
        }
    }

    /// Upper bounds of the sums: a place's least distance between its neighbours' largest.
    fn bounds<'a>(self, cells: &'a Cells, segment: &'a Segment) -> Enhanced<'a> {
        Enhanced { columns: &cells.lower, around: cells.upper(), segment, options: self }
    }
}

/// `G[i, j] = g_j[i] + g_{j-1}[i-1] + ...` on one segment, added in this order (method 1.2).
/// Places count from the segment's start.
#[derive(Clone, Copy)]
struct Enhanced<'a> {
    columns: &'a Ring,
    /// The neighbours' distances: `columns`, or upper bounds.
    around: &'a Ring,
    segment: &'a Segment,
    options: Enhancement,
}

/// The distances of a block of places, of those before them and of those after.
type Triples<'a> = [&'a [f32; BLOCK]; 3];

impl Enhanced<'_> {
    /// The largest sum of the segment, if it is above `peak`.
    #[inline(always)]
    fn peak(self, mut peak: Peak) -> Peak {
        let mut sums = [0.0_f32; BLOCK];
        for start in (0..self.segment.len()).step_by(BLOCK) {
            let sums = &mut sums[..BLOCK.min(self.segment.len() - start)];
            if self.none_above(peak.value, start..start + sums.len()) {
                continue;
            }
            self.block(start, sums);
            if let Some((at, value)) = first_better(sums, peak.value, |a, b| a > b) {
                peak = Peak { place: self.segment.start + start + at, value };
            }
        }
        peak
    }

    /// The sums of the places from `start` on.
    #[inline(always)]
    fn block(&self, start: usize, sums: &mut [f32]) {
        let Enhancement { gradient: kind, smoothing } = self.options;
        let (missing, held) = (self.missing(), smoothing.min(self.columns.len()));
        let (around, column) = self.column(0);
        gradient(around, column, kind, start, sums, |sum, g| *sum = g);
        for age in 1..held {
            // The first `absent` places of this block lie before the segment, `age` places back.
            let absent = age.saturating_sub(start).min(sums.len());
            let (before, within) = sums.split_at_mut(absent);
            for sum in before {
                *sum += missing;
            }
            let from = (start + absent).saturating_sub(age);
            let (around, column) = self.column(age);
            gradient(around, column, kind, from, within, |sum, g| *sum += g);
        }
        for _ in held..smoothing {
            for sum in sums.iter_mut() {
                *sum += missing;
            }
        }
    }

    /// Whether surely none of these places has a sum above `least`: true for most blocks, found
    /// without writing a sum. Always false at the ends of the segment, and for other options than
    /// the paper's.
    #[inline(always)]
    fn none_above(&self, least: f32, places: Range<usize>) -> bool {
        let inside = places.start > self.options.smoothing && places.end < self.segment.len();
        if !inside || self.options.smoothing != 3 || self.columns.len() < 3 {
            return false;
        }
        let triples = |age| self.triples(age, places.start);
        let (Some(newest), Some(before), Some(oldest)) = (triples(0), triples(1), triples(2))
        else {
            return false;
        };
        match self.options.gradient {
            Gradient::Halved => !any_above(least, newest, before, oldest, halved),
            Gradient::Unhalved => !any_above(least, newest, before, oldest, unhalved),
        }
    }

    /// The distances, `age` queries and places back, of a block of places inside the segment, each
    /// between its neighbours'.
    #[inline(always)]
    fn triples(&self, age: usize, start: usize) -> Option<Triples<'_>> {
        let column = &self.column(age).1[start - age - 1..];
        Some([column.first_chunk()?, column[1..].first_chunk()?, column[2..].first_chunk()?])
    }

    /// The sum of one place: the same bits as in a block.
    fn sum(self, place: usize) -> f32 {
        let Enhancement { gradient: kind, smoothing } = self.options;
        let (missing, held) = (self.missing(), smoothing.min(self.columns.len()));
        let term = |age: usize| {
            if age > place || age >= held {
                return missing;
            }
            let mut g = [0.0];
            let (around, column) = self.column(age);
            gradient(around, column, kind, place - age, &mut g, |g, value| *g = value);
            g[0]
        };
        (1..smoothing).fold(term(0), |sum, age| sum + term(age))
    }

    #[inline(always)]
    fn missing(&self) -> f32 {
        missing_gradient(self.column(0).1, self.options.gradient)
    }

    /// The neighbours' and the places' own distances of `age` queries ago.
    #[inline(always)]
    fn column(&self, age: usize) -> (&[f32], &[f32]) {
        let segment = || self.segment.places();
        (&self.around.column(age)[segment()], &self.columns.column(age)[segment()])
    }
}

/// Whether a sum of three gradients is above `least`.
#[inline(always)]
fn any_above(
    least: f32,
    [a, b, c]: Triples<'_>,
    [d, e, f]: Triples<'_>,
    [g, h, i]: Triples<'_>,
    of: impl Fn(f32, f32, f32) -> f32,
) -> bool {
    let mut any = false;
    for at in 0..BLOCK {
        any |= of(a[at], b[at], c[at]) + of(d[at], e[at], f[at]) + of(g[at], h[at], i[at]) > least;
    }
    any
}
