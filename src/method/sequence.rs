//! Weighted sequence matching (method 1.4 and 1.5, Eqs. 4 to 6).

use serde::{Deserialize, Serialize};
use std::ops::Range;

use super::argmin::{Candidate, Search, beats, first_better, first_least};
use super::estimator::{Estimator, Memory, Seen};
use super::window::{Exact, Ring, Window};
use crate::config::{Config, reach};
use crate::error::Error;
use crate::preallocated::{Preallocated, reserved};
use crate::segments::Segment;

/// Sums that are made at a time: they stay in the first-level cache.
const BLOCK: usize = 256;

/// The best match of the last `L` queries together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sequence {
    /// The current query's place, from 0.
    pub place: usize,
    /// The mean of the weighted distances along the diagonal that ends there (Eq. 5).
    pub score: f32,
    /// How many trusted matches lie on that diagonal, from 0 to `L`.
    pub anchors: usize,
    /// The slope of that diagonal, in places a query.
    pub speed: f64,
}

/// Eq. 4: the trusted cell's distance, drawn towards the floor by `weight`.
fn weighted(distance: f32, weight: f64, floor: f64) -> f32 {
    let distance = f64::from(distance);
    (distance - weight * (distance - floor)) as f32
}

/// The estimator of the paper: the best diagonal of the weighted window.
#[derive(Clone, Debug)]
pub(super) struct SequenceSearch {
    length: usize,
    /// `w` of Eq. 4.
    weight: f64,
    diagonals: Vec<Diagonal>,
    /// Memory for the diagonals with trusted cells, by the place where they end.
    anchored: Preallocated<Vec<(usize, f64)>>,
}

/// A slope, and how many places back its diagonals lie `k` queries ago: `round(v k)`.
#[derive(Clone, Debug)]
struct Diagonal {
    speed: f64,
    back: Vec<usize>,
}

impl SequenceSearch {
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(super) fn new(config: &Config) -> Result<Self, Error> {
        let length = config.sequence_length;
        let mut diagonals: Vec<Diagonal> = Vec::with_capacity(config.speeds.len());
        for &speed in &config.speeds {
            // Of equal sums the speed named first wins: a second one of the same name never does.
            if diagonals.iter().all(|named| named.speed != speed) {
                let mut back = reserved(length)?;
                back.extend((0..length).map(|age| reach(speed, age) as usize));
                diagonals.push(Diagonal { speed, back });
            }
        }
        let anchored = Preallocated(reserved(length)?);
        Ok(Self { length, weight: config.weight, diagonals, anchored })
    }
}

impl Estimator for SequenceSearch {
    /// `None` before the first full window.
    type Answer = Option<Sequence>;

    fn memory(&self) -> Memory {
        Memory::Queries(self.length)
    }

    /// It keeps nothing: the window is cleared.
    fn clear(&mut self) {}

    /// Eq. 6: the diagonal with the smallest mean; of equals the lowest place, then the speed named
    /// first.
    #[inline(always)]
    fn estimate<E: Exact>(
        &mut self,
        window: &mut Window,
        seen: &Seen<'_>,
        ask: &mut E,
    ) -> Option<Sequence> {
        if window.len() < self.length {
            return None;
        }
        let mut best: Option<(Candidate, &Diagonal)> = None;
        for diagonal in &self.diagonals {
            let sums = Sums { diagonal, seen, weight: self.weight };
            sums.of_anchored(&window.cells.lower, &mut self.anchored);
            let before = best.map(|(least, _)| least);
            let least = if E::BOUNDS {
                sums.least_of_bounds(window, &self.anchored, before, ask)
            } else {
                sums.least(&window.cells.lower, &self.anchored)
            };
            if let Some(least) = least.filter(|&least| beats(least, before)) {
                best = Some((least, diagonal));
            }
        }
        best.map(|((sum, place), diagonal)| {
            let segment = seen.segments.of(place);
            let ends_here = |&(age, at): &(usize, usize)| {
                segment.places().contains(&at)
                    && segment.onward(at, diagonal.back[age] as isize) == Some(place)
            };
            let anchors = seen.anchors.trusted().filter(ends_here).count();
            // A sum of negative zeros is zero.
            let score = ((0.0 + sum) / self.length as f64) as f32;
            Sequence { place, score, anchors, speed: diagonal.speed }
        })
    }
}

/// Eq. 5 for one slope, without the division by `L`: `S[i, j]` is the sum of `D_w[i - back(k), j -
/// k]` from the oldest query to the newest, in f64. The raw sums are made for all places together;
/// the few diagonals with trusted cells have sums of their own, with the weights of this query.
struct Sums<'a> {
    diagonal: &'a Diagonal,
    seen: &'a Seen<'a>,
    weight: f64,
}

impl Sums<'_> {
    /// The smallest sum, and the first place that has it; `None` if no diagonal fits a segment.
    #[inline(always)]
    fn least(&self, columns: &Ring, mut anchored: &[(usize, f64)]) -> Option<Candidate> {
        let mut least: Candidate = (f64::INFINITY, 0);
        let mut sums = [0.0_f64; BLOCK];
        for span in self.spans() {
            let (mut start, last) = (span.places.start, span.places.end);
            while start < last {
                let end = last.min(start + BLOCK);
                let plain = anchored.first().is_none_or(|&(place, _)| place >= end);
                // The last block overlaps the one before, to be a whole one.
                let whole = !span.around && span.places.len() >= BLOCK;
                let known = whole && plain;
                if !known || self.any_below(columns, start.min(last - BLOCK), least.0) {
                    let sums = &mut sums[..end - start];
                    self.raw(columns, &span, start, sums);
                    overwrite(&mut anchored, start, sums);
                    if let Some((at, sum)) = first_better(sums, least.0, |a, b| a < b) {
                        least = (sum, start + at);
                    }
                }
                start = end;
            }
        }
        least.0.is_finite().then_some(least)
    }

    /// [`least`](Self::least) by lower bounds of the sums; `None` if none beats `best`.
    fn least_of_bounds<E: Exact>(
        &self,
        window: &mut Window,
        mut anchored: &[(usize, f64)],
        best: Option<Candidate>,
        ask: &mut E,
    ) -> Option<Candidate> {
        let Window { cells, scratch } = window;
        let places = cells.lower.height();
        // Places without a diagonal are never the best.
        scratch.sums.fill(f64::INFINITY);
        for span in self.spans() {
            let bounds = &mut scratch.sums[span.places.clone()];
            for (block, sums) in bounds.chunks_mut(BLOCK).enumerate() {
                self.raw(&cells.lower, &span, span.places.start + block * BLOCK, sums);
            }
            overwrite(&mut anchored, span.places.start, bounds);
        }
        let sum = |place: usize, best: Option<Candidate>| {
            let segment = self.seen.segments.of(place);
            for (age, &back) in self.diagonal.back.iter().enumerate() {
                let at = segment.onward(place, -(back as isize))?;
                if cells.resolve(age, at..at + 1, ask)
                    && !beats((self.of(place, &cells.lower), place), best)
                {
                    return None;
                }
            }
            Some(self.of(place, &cells.lower))
        };
        match first_least(&scratch.sums, 0, best, places, &mut scratch.candidates, sum) {
            Search::Best(found) => found,
            // There are no more candidates than places.
            Search::TooMany => best,
        }
    }

    /// The places that have a diagonal, in order: of an open segment those whose diagonal lies on
    /// it, of a closed one all.
    fn spans(&self) -> impl Iterator<Item = Span> {
        let reach = self.reach();
        self.seen.segments.iter().flat_map(move |&segment| {
            let from = segment.start.saturating_add(reach).min(segment.end);
            let around = segment.closed.then_some(segment.start..from);
            let around = around.map(|places| Span { places, segment, around: true });
            let straight = Span { places: from..segment.end, segment, around: false };
            around.into_iter().chain([straight])
        })
    }

    /// How many places back the diagonal's oldest cell lies.
    fn reach(&self) -> usize {
        self.diagonal.back.last().copied().unwrap_or(0)
    }

    /// The sum of the diagonal that ends in `place`, which has one, its trusted cells weighted.
    #[inline(always)]
    fn of(&self, place: usize, columns: &Ring) -> f64 {
        let Seen { segments, anchors, floor, .. } = *self.seen;
        let segment = segments.of(place);
        let mut sum = 0.0;
        for (age, &back) in self.diagonal.back.iter().enumerate().rev() {
            let at = segment.before(place, back);
            let anchor = anchors.get(age);
            sum += f64::from(if anchor.trusted && anchor.single.place == at {
                weighted(anchor.single.distance, self.weight, floor)
            } else {
                columns.column(age)[at]
            });
        }
        sum
    }

    /// The diagonals that hold trusted cells, by the place where they end, in order, each with its
    /// weighted sum.
    #[inline(always)]
    fn of_anchored(&self, columns: &Ring, anchored: &mut Vec<(usize, f64)>) {
        anchored.clear();
        for (age, at) in self.seen.anchors.trusted() {
            let segment = self.seen.segments.of(at);
            let first = if segment.closed { segment.start } else { segment.start + self.reach() };
            let place = segment.onward(at, self.diagonal.back[age] as isize);
            // On a drive that is followed well, all lie on one diagonal.
            let known = |place| anchored.last().is_some_and(|&(last, _)| last == place);
            if let Some(place) = place.filter(|&place| place >= first && !known(place)) {
                anchored.push((place, 0.0));
            }
        }
        anchored.sort_unstable_by_key(|&(place, _)| place);
        anchored.dedup_by_key(|&mut (place, _)| place);
        for (place, sum) in anchored {
            *sum = self.of(*place, columns);
        }
    }

    /// Writes the raw sums of the diagonals that end in `start`, `start + 1`, ..., at most
    /// [`BLOCK`] places of a span.
    #[inline(always)]
    fn raw(&self, columns: &Ring, span: &Span, start: usize, sums: &mut [f64]) {
        if span.around {
            return self.raw_around(columns, span.segment, start, sums);
        }
        let count = sums.len();
        let term = |age: usize| &columns.column(age)[start - self.diagonal.back[age]..][..count];
        // Three columns a pass: a sum is read and written a third of the times.
        let length = self.diagonal.back.len();
        let oldest = length - 1;
        match length {
            1 => each(sums, term(0), term(0), term(0), |_, a, _, _| a),
            2 => each(sums, term(1), term(0), term(0), |_, a, b, _| a + b),
            _ => {
                each(sums, term(oldest), term(oldest - 1), term(oldest - 2), |_, a, b, c| {
                    a + b + c
                });
            }
        }
        let mut left = length.saturating_sub(3);
        while left >= 3 {
            each(sums, term(left - 1), term(left - 2), term(left - 3), |sum, a, b, c| {
                sum + a + b + c
            });
            left -= 3;
        }
        match left {
            0 => {}
            1 => each(sums, term(0), term(0), term(0), |sum, a, _, _| sum + a),
            _ => each(sums, term(1), term(0), term(0), |sum, a, b, _| sum + a + b),
        }
    }

    /// [`raw`](Self::raw) of diagonals that go round a closed segment, a column at a time.
    #[inline(always)]
    fn raw_around(&self, columns: &Ring, segment: Segment, start: usize, sums: &mut [f64]) {
        sums.fill(0.0);
        for (age, &back) in self.diagonal.back.iter().enumerate().rev() {
            let column = &columns.column(age)[segment.places()];
            let from = segment.before(start, back) - segment.start;
            let (ahead, again) = sums.split_at_mut(sums.len().min(column.len() - from));
            for (sum, &d) in ahead.iter_mut().zip(&column[from..]) {
                *sum += f64::from(d);
            }
            for (sum, &d) in again.iter_mut().zip(column) {
                *sum += f64::from(d);
            }
        }
    }

    /// Whether any diagonal that ends in a block of places has a raw sum below `least`: few blocks
    /// of windows of up to three columns have, and no sum is written.
    #[inline(always)]
    fn any_below(&self, columns: &Ring, start: usize, least: f64) -> bool {
        let back = &self.diagonal.back;
        if back.len() > 3 {
            return true;
        }
        let oldest = back.len() - 1;
        let term = |age: usize| columns.column(age)[start - back[age]..].first_chunk();
        let (Some(a), Some(b), Some(c)) = (term(oldest), term(oldest.min(1)), term(0)) else {
            return true;
        };
        match back.len() {
            1 => any_of(a, b, c, |a, _, _| a < least),
            2 => any_of(a, b, c, |a, _, c| a + c < least),
            _ => any_of(a, b, c, |a, b, c| a + b + c < least),
        }
    }
}

/// Places of a segment in which diagonals end that go round it, or that do not.
struct Span {
    places: Range<usize>,
    segment: Segment,
    around: bool,
}

/// Puts the sums of anchored diagonals in place of the raw ones, from `start` on.
#[inline(always)]
fn overwrite(anchored: &mut &[(usize, f64)], start: usize, sums: &mut [f64]) {
    while let Some((&(place, sum), later)) = anchored.split_first()
        && place < start + sums.len()
    {
        sums[place - start] = sum;
        *anchored = later;
    }
}

/// Each sum with the distances of three columns.
#[inline(always)]
fn each(
    sums: &mut [f64],
    a: &[f32],
    b: &[f32],
    c: &[f32],
    sum_of: impl Fn(f64, f64, f64, f64) -> f64,
) {
    for (sum, ((&a, &b), &c)) in sums.iter_mut().zip(a.iter().zip(b).zip(c)) {
        *sum = sum_of(*sum, f64::from(a), f64::from(b), f64::from(c));
    }
}

/// Whether it holds of any three of the numbers. Without an early exit, it runs in vector
/// registers.
#[inline(always)]
fn any_of(
    a: &[f32; BLOCK],
    b: &[f32; BLOCK],
    c: &[f32; BLOCK],
    holds: impl Fn(f64, f64, f64) -> bool,
) -> bool {
    let mut any = false;
    for at in 0..BLOCK {
        any |= holds(a[at].into(), b[at].into(), c[at].into());
    }
    any
}
