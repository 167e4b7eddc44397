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
/// distances, or, for a bound of the gradient, bounds of them. If the segment is `closed`, its last
/// place and its first are neighbours.
#[inline(always)]
pub(super) fn gradient(
    around: &[f32],
    d: &[f32],
    closed: bool,
    kind: Gradient,
    from: usize,
    out: &mut [f32],
    put: impl Fn(&mut f32, f32),
) {
    let (n, to) = (d.len(), from + out.len());
    if from == to {
        return;
    }
    if n == 1 {
        put(&mut out[0], 0.0);
        return;
    }
    let second_difference = |before: f32, d: f32, after: f32| match kind {
        Gradient::Halved => halved(before, d, after),
        Gradient::Unhalved => unhalved(before, d, after),
    };
    // At either end of an open segment one neighbour is missing.
    if from == 0 {
        let around_seam = || second_difference(around[n - 1], d[0], around[1]);
        put(&mut out[0], if closed { around_seam() } else { around[1] - d[0] });
    }
    if to == n {
        let around_seam = || second_difference(around[n - 2], d[n - 1], around[0]);
        put(&mut out[n - 1 - from], if closed { around_seam() } else { around[n - 2] - d[n - 1] });
    }
    let (first, last) = (from.max(1), to.min(n - 1));
    if first >= last {
        return;
    }
    let count = last - first;
    let (before, after) = (&around[first - 1..][..count], &around[first + 1..][..count]);
    let (d, out) = (&d[first..][..count], &mut out[first - from..][..count]);
    match kind {
        Gradient::Halved => {
            for at in 0..count {
                put(&mut out[at], halved(before[at], d[at], after[at]));
            }
        }
        Gradient::Unhalved => {
            for at in 0..count {
                put(&mut out[at], unhalved(before[at], d[at], after[at]));
            }
        }
    }
}

/// The term of a gradient that is missing because the diagonal leaves the segment or the run: the
/// mean of the current gradient, which telescopes to the segment's two ends (method 1.2). It is 0
/// if the segment has no ends, or one place.
#[inline(always)]
pub(super) fn missing_gradient(d: &[f32], closed: bool, kind: Gradient) -> f32 {
    let n = d.len();
    if closed || n == 1 {
        return 0.0;
    }
    missing_between([d[0], d[1], d[n - 2], d[n - 1]], n, kind)
}

/// The same by the distances to the first two and the last two places of an open segment of `n`.
#[inline(always)]
pub(super) fn missing_between(
    [first, second, before, last]: [f32; 4],
    n: usize,
    kind: Gradient,
) -> f32 {
    if kind == Gradient::Unhalved {
        return 0.0;
    }
    ((second - first) + (before - last)) / (2 * n) as f32
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
            peak = self.on(columns, columns, segment).peak(0..segment.len(), peak);
        }
        peak
    }

    /// The largest sum of some places of a segment, which count from its start, if it is above
    /// `peak`; `missing` stands for the terms that are missing.
    #[inline(always)]
    pub(super) fn peak_within(
        self,
        columns: &Ring,
        segment: &Segment,
        missing: f32,
        places: Range<usize>,
        peak: Peak,
    ) -> Peak {
        Enhanced { columns, around: columns, segment, missing, options: self }.peak(places, peak)
    }

    /// The sums of a segment, of distances or of bounds.
    #[inline(always)]
    fn on<'a>(self, columns: &'a Ring, around: &'a Ring, segment: &'a Segment) -> Enhanced<'a> {
        let newest = &columns.column(0)[segment.places()];
        let missing = missing_gradient(newest, segment.closed, self.gradient);
        Enhanced { columns, around, segment, missing, options: self }
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
        for segment in segments.iter().filter(|segment| !segment.closed && segment.len() > 1) {
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
                for age in 0..ages {
                    let Some(at) = segment.onward(place, -(age as isize)) else { break };
                    let mut asked = false;
                    for around in [-1, 0, 1].into_iter().filter_map(|by| segment.onward(at, by)) {
                        asked |= cells.resolve(age, around..around + 1, ask);
                    }
                    if asked {
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
        self.on(&cells.lower, cells.upper(), segment)
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
    /// The term that is missing where the diagonal leaves the segment or the run.
    missing: f32,
    options: Enhancement,
}

/// The distances of a block of places, of those before them and of those after.
type Triples<'a> = [&'a [f32; BLOCK]; 3];

impl Enhanced<'_> {
    /// The largest sum of some places, if it is above `peak`.
    #[inline(always)]
    fn peak(self, places: Range<usize>, mut peak: Peak) -> Peak {
        let inside = self.inside();
        let mut sums = [0.0_f32; BLOCK];
        let mut start = places.start;
        while start < places.end {
            let fast = inside.contains(&start);
            let until = if start < inside.start {
                inside.start
            } else if fast {
                inside.end
            } else {
                places.end
            };
            let end = until.min(start + BLOCK).min(places.end);
            // The last block overlaps the one before, to be a whole one.
            if !fast || self.any_above(peak.value, start.min(inside.end - BLOCK)) {
                let sums = &mut sums[..end - start];
                self.block(start, sums);
                if let Some((at, value)) = first_better(sums, peak.value, |a, b| a > b) {
                    peak = Peak { place: self.segment.start + start + at, value };
                }
            }
            start = end;
        }
        peak
    }

    /// The sums of the places from `start` on.
    #[inline(always)]
    fn block(&self, start: usize, sums: &mut [f32]) {
        let Segment { closed, .. } = *self.segment;
        let (missing, held) = (self.missing, self.options.smoothing.min(self.columns.len()));
        self.gradients(0, start, sums, |sum, g| *sum = g);
        for age in 1..held {
            // The first `absent` places of this block lie before the segment, `age` places back.
            let absent = age.saturating_sub(start).min(sums.len());
            let (before, within) = sums.split_at_mut(absent);
            if closed {
                self.around(age, start, before);
            } else {
                for sum in before.iter_mut() {
                    *sum += missing;
                }
            }
            self.gradients(age, (start + absent).saturating_sub(age), within, |sum, g| *sum += g);
        }
        for _ in held..self.options.smoothing {
            for sum in sums.iter_mut() {
                *sum += missing;
            }
        }
    }

    /// Adds the gradients, `age` queries and places back, of the places from `start` on, which lie
    /// before the first of a closed segment: round it, as often as it takes.
    fn around(&self, age: usize, start: usize, mut sums: &mut [f32]) {
        let mut place = self.segment.start + start;
        while !sums.is_empty() {
            let from = self.segment.before(place, age) - self.segment.start;
            let (next, later) = sums.split_at_mut(sums.len().min(self.segment.len() - from));
            self.gradients(age, from, next, |sum, g| *sum += g);
            place += next.len();
            sums = later;
        }
    }

    /// The gradients of the places from `from` on, `age` queries ago.
    #[inline(always)]
    fn gradients(&self, age: usize, from: usize, out: &mut [f32], put: impl Fn(&mut f32, f32)) {
        let (around, column) = self.column(age);
        gradient(around, column, self.segment.closed, self.options.gradient, from, out, put);
    }

    /// The places whose sums have all terms, none of them at an end of the segment, if they fill a
    /// block; none for other options than the paper's.
    #[inline(always)]
    fn inside(&self) -> Range<usize> {
        let inside = 3..self.segment.len() - 1;
        let whole = self.options.smoothing == 3 && self.columns.len() >= 3;
        if whole && inside.len() >= BLOCK { inside } else { 0..0 }
    }

    /// Whether any place of a block [`inside`](Self::inside) has a sum above `least`: few do, and
    /// no sum is written.
    #[inline(always)]
    fn any_above(&self, least: f32, start: usize) -> bool {
        let triples = |age| self.triples(age, start);
        let (Some(newest), Some(before), Some(oldest)) = (triples(0), triples(1), triples(2))
        else {
            return true;
        };
        match self.options.gradient {
            Gradient::Halved => any_above(least, newest, before, oldest, halved),
            Gradient::Unhalved => any_above(least, newest, before, oldest, unhalved),
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
        let mut sum = [0.0];
        self.block(place, &mut sum);
        sum[0]
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
