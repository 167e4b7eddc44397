//! The gradient of a distance vector and its enhancement along the route (method 1.1 and 1.2, Eq.
//! 1).

use std::ops::Range;

use super::extreme::{BLOCK, first_better};
use super::ring::Ring;
use super::visit::Visit;
use crate::config::Gradient;

/// Where the enhanced gradient peaks: the place whose distance dips most sharply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// The place, from 0.
    pub place: usize,
    /// The enhanced gradient there, in units of distance.
    pub value: f32,
}

/// Eq. 1: the second difference of the distances `d`, into `g`. Both have the same length, at least
/// two.
pub(super) fn gradient(d: &[f32], kind: Gradient, g: &mut [f32]) {
    with_gradient(d, d, kind, 0, g, |g, value| *g = value);
}

/// Eq. 1 for the places from `from` on: `put(out, gradient)` for each number of `out`. A place's
/// own distance is that of `d`, those of its neighbours are of `around`: the same, or, for a bound
/// of the gradient, bounds of the distances.
///
/// Plain f32 operations in a fixed order: every instruction set gives the same bits.
#[inline(always)]
fn with_gradient(
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

/// Eq. 1 inside the route.
#[inline(always)]
fn halved(before: f32, d: f32, after: f32) -> f32 {
    0.5 * (after + before) - d
}

/// The same without the half.
#[inline(always)]
fn unhalved(before: f32, d: f32, after: f32) -> f32 {
    (after + before) - 2.0 * d
}

/// The distances of a block of places, of those before them and of those after.
type Triples<'a> = [&'a [f32; BLOCK]; 3];

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

/// What stands in for a gradient before the start of the route or of the run: the mean of the
/// current one, which telescopes to its two ends.
#[inline(always)]
pub(super) fn missing_gradient(d: &[f32], kind: Gradient) -> f32 {
    let n = d.len();
    match kind {
        Gradient::Halved => ((d[1] - d[0]) + (d[n - 2] - d[n - 1])) / (2 * n) as f32,
        Gradient::Unhalved => 0.0,
    }
}

/// What the enhancement adds up (method 1.2): the newest columns, whose gradients (Eq. 1) are made
/// again for each query, as reading them is all that it costs, and the sequence reads them anyway;
/// and the gradients of queries before them.
#[derive(Clone, Copy)]
pub(super) struct Enhanced<'a> {
    pub(super) columns: &'a Ring,
    /// For upper bounds of the sums, upper bounds of the distances, where `columns` are lower ones.
    pub(super) upper: Option<&'a Ring>,
    /// Gradients, the newest first.
    pub(super) earlier: &'a Ring,
    pub(super) kind: Gradient,
    /// How many terms a sum has. The mean of the current gradient stands in for what there is
    /// neither distance nor gradient of.
    pub(super) smoothing: usize,
}

impl Visit<f32> for &mut Peak {
    #[inline(always)]
    fn to_beat(&self, _places: Range<usize>) -> Option<f32> {
        Some(self.value)
    }

    #[inline(always)]
    fn visit(&mut self, start: usize, sums: &mut [f32]) {
        if let Some((at, value)) = first_better(sums, self.value, |a, b| a > b) {
            **self = Peak { place: start + at, value };
        }
    }
}

impl Enhanced<'_> {
    /// The place of the largest sum.
    #[inline(always)]
    pub(super) fn peak(self) -> Peak {
        // Sums can overflow where distances come near f32::MAX. A NaN is never the peak; where
        // nothing else is, place 0 stays.
        let mut peak = Peak { place: 0, value: f32::NEG_INFINITY };
        self.sums(&mut peak);
        peak
    }

    /// `G[i, j] = g_j[i] + g_{j-1}[i-1] + ...`, `smoothing` terms in this order, of all places, at
    /// most a few hundred at a time.
    #[inline(always)]
    pub(super) fn sums(self, mut visit: impl Visit<f32>) {
        let n = self.columns.height();
        let mut sums = [0.0_f32; BLOCK];
        for start in (0..n).step_by(BLOCK) {
            let sums = &mut sums[..BLOCK.min(n - start)];
            let places = start..start + sums.len();
            if let Some(largest) = visit.to_beat(places.clone())
                && self.none_above(largest, places)
            {
                continue;
            }
            self.block(start, sums);
            visit.visit(start, sums);
        }
    }

    /// The sums of the places from `start` on.
    #[inline(always)]
    fn block(&self, start: usize, sums: &mut [f32]) {
        let Self { columns, upper, earlier, kind, smoothing } = *self;
        let (missing, held) = (self.missing(), self.held());
        let column = columns.column(0);
        let around = upper.map_or(column, |upper| upper.column(0));
        with_gradient(around, column, kind, start, sums, |sum, g| *sum = g);
        for age in 1..held {
            // The first `absent` places of this block lie before the start of the route, `age`
            // places back.
            let absent = age.saturating_sub(start).min(sums.len());
            let (before, within) = sums.split_at_mut(absent);
            for sum in before {
                *sum += missing;
            }
            let from = (start + absent).saturating_sub(age);
            if age < columns.len() {
                let column = columns.column(age);
                let around = upper.map_or(column, |upper| upper.column(age));
                with_gradient(around, column, kind, from, within, |sum, g| *sum += g);
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
    }

    /// Whether it is sure that none of these places has a sum above `least`: known of most blocks,
    /// without a sum being written anywhere, and never of those at the ends of the route.
    #[inline(always)]
    fn none_above(&self, least: f32, places: Range<usize>) -> bool {
        let inside = places.start > self.smoothing && places.end < self.columns.height();
        if !inside || self.upper.is_some() || self.smoothing != 3 || self.columns.len() < 3 {
            return false;
        }
        let triples = (
            self.triples(0, places.start),
            self.triples(1, places.start),
            self.triples(2, places.start),
        );
        let (Some(newest), Some(before), Some(oldest)) = triples else { return false };
        match self.kind {
            Gradient::Halved => !any_above(least, newest, before, oldest, halved),
            Gradient::Unhalved => !any_above(least, newest, before, oldest, unhalved),
        }
    }

    /// The distances, `age` queries and places back, of a block of places inside the route, each
    /// between its neighbours'.
    #[inline(always)]
    fn triples(&self, age: usize, start: usize) -> Option<Triples<'_>> {
        let column = &self.columns.column(age)[start - age - 1..];
        Some([column.first_chunk()?, column[1..].first_chunk()?, column[2..].first_chunk()?])
    }

    /// The sum of one place: the same to the last bit.
    pub(super) fn sum(self, place: usize) -> f32 {
        let missing = self.missing();
        let mut sum = 0.0;
        for age in 0..self.smoothing {
            let term = if age > place || age >= self.held() {
                missing
            } else if age < self.columns.len() {
                let mut g = [0.0];
                let around = self.upper.unwrap_or(self.columns).column(age);
                let column = self.columns.column(age);
                with_gradient(around, column, self.kind, place - age, &mut g, |g, value| {
                    *g = value
                });
                g[0]
            } else {
                self.earlier.column(age - self.columns.len())[place - age]
            };
            sum = if age == 0 { term } else { sum + term };
        }
        sum
    }

    /// What stands in for a gradient before the start of the route or of the run.
    fn missing(&self) -> f32 {
        missing_gradient(self.columns.column(0), self.kind)
    }

    /// Of how many queries there are distances or gradients for the sum.
    pub(super) fn held(&self) -> usize {
        self.smoothing.min(self.columns.len() + self.earlier.len())
    }
}
