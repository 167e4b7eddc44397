//! Weighted sequence matching (method 1.4 and 1.5, Eqs. 4 to 6).

use serde::{Deserialize, Serialize};
use std::ops::Range;

use super::argmin::{Candidate, Search, beats, first_better, first_least};
use super::estimator::{Estimator, Memory, Seen};
use super::layout::Layout;
use super::single::Single;
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

/// Eq. 4: trusted cells, drawn towards the floor.
#[derive(Clone, Copy)]
struct Weighted<'a> {
    seen: &'a Seen<'a>,
    weight: f64,
}

impl Weighted<'_> {
    /// A trusted cell's distance, as both of its bounds.
    fn cell(self, single: Single) -> [f32; 2] {
        let distance = f64::from(single.distance);
        [(distance - self.weight * (distance - self.seen.floor)) as f32; 2]
    }
}

/// The estimator of the paper: the best diagonal of the weighted window.
#[derive(Clone, Debug)]
pub(super) struct SequenceSearch {
    length: usize,
    /// `w` of Eq. 4.
    weight: f64,
    diagonals: Vec<Diagonal>,
    /// Memory for the distances of the trusted cells while the weighted ones are in their place.
    unweighted: Preallocated<Vec<[f32; 2]>>,
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
        let unweighted = Preallocated(reserved(length)?);
        Ok(Self { length, weight: config.weight, diagonals, unweighted })
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
        let best = self.best(window, seen, Own::All, ask);
        best.and_then(|best| self.sequence(best, seen))
    }
}

/// A least sum, and the index of its slope.
pub(super) type Best = (Candidate, usize);

/// The places of a window in which diagonals are to end.
#[derive(Clone, Copy)]
pub(super) enum Own<'a> {
    All,
    /// Those that a shard owns: the window's line has others beside them.
    Of(&'a Layout),
}

impl Own<'_> {
    /// Those of a segment of the window, by its index.
    fn of(self, index: usize, segment: Segment) -> Range<usize> {
        match self {
            Self::All => segment.places(),
            Self::Of(layout) => layout.pieces()[index].own(),
        }
    }

    /// Where the window has a place of the route.
    #[inline(always)]
    fn at(self, place: usize) -> Option<usize> {
        match self {
            Self::All => Some(place),
            Self::Of(layout) => layout.at(place),
        }
    }
}

impl SequenceSearch {
    /// The first of the least sums; `None` before the first full window.
    #[inline(always)]
    pub(super) fn best<E: Exact>(
        &mut self,
        window: &mut Window,
        seen: &Seen<'_>,
        own: Own<'_>,
        ask: &mut E,
    ) -> Option<Best> {
        if window.len() < self.length {
            return None;
        }
        // Eq. 4: the window is `D_w` until the sums are made. So a push costs the same however many
        // diagonals hold trusted cells.
        let weighted = Weighted { seen, weight: self.weight };
        let cells = || {
            let trusted = seen.anchors.trusted();
            trusted.filter_map(|(age, single)| Some((age, own.at(single.place)?, single)))
        };
        self.unweighted.clear();
        for (age, at, single) in cells() {
            self.unweighted.push(window.cells.replace(age, at, weighted.cell(single)));
        }
        let mut best: Option<Best> = None;
        for (index, diagonal) in self.diagonals.iter().enumerate() {
            let sums = Sums { diagonal, weighted, own };
            let before = best.map(|(least, _)| least);
            let least = if E::BOUNDS {
                sums.least_of_bounds(window, before, ask)
            } else {
                sums.least(&window.cells.lower)
            };
            if let Some(least) = least.filter(|&least| beats(least, before)) {
                best = Some((least, index));
            }
        }
        for ((age, at, _), &distance) in cells().zip(&*self.unweighted) {
            window.cells.replace(age, at, distance);
        }
        best
    }

    /// The answer of a least sum, whose place is the route's; `None` for a slope that there is not.
    pub(super) fn sequence(
        &self,
        ((sum, place), slope): Best,
        seen: &Seen<'_>,
    ) -> Option<Sequence> {
        let diagonal = self.diagonals.get(slope)?;
        let segment = seen.segments.of(place);
        let ends_here = |&(age, Single { place: at, .. }): &(usize, Single)| {
            segment.places().contains(&at)
                && segment.onward(at, diagonal.back[age] as isize) == Some(place)
        };
        let anchors = seen.anchors.trusted().filter(ends_here).count();
        // A sum of negative zeros is zero.
        let score = ((0.0 + sum) / self.length as f64) as f32;
        Some(Sequence { place, score, anchors, speed: diagonal.speed })
    }

    /// How many places back the longest diagonal leads.
    pub(super) fn reach(&self) -> usize {
        self.diagonals.iter().map(Diagonal::reach).max().unwrap_or_default()
    }
}

impl Diagonal {
    /// How many places back its oldest cell lies.
    fn reach(&self) -> usize {
        self.back.last().copied().unwrap_or(0)
    }
}

/// Eq. 5 for one slope, without the division by `L`: `S[i, j]` is the sum of `D_w[i - back(k), j -
/// k]` from the oldest query to the newest, in f64.
struct Sums<'a> {
    diagonal: &'a Diagonal,
    weighted: Weighted<'a>,
    own: Own<'a>,
}

impl Sums<'_> {
    /// The smallest sum, and the first place that has it; `None` if no diagonal fits a segment.
    #[inline(always)]
    fn least(&self, columns: &Ring) -> Option<Candidate> {
        let mut least: Candidate = (f64::INFINITY, 0);
        let mut sums = [0.0_f64; BLOCK];
        for span in self.spans() {
            let (mut start, last) = (span.places.start, span.places.end);
            while start < last {
                let end = last.min(start + BLOCK);
                // The last block overlaps the one before, to be a whole one.
                let whole = !span.around && span.places.len() >= BLOCK;
                if !whole || self.any_below(columns, start.min(last - BLOCK), least.0) {
                    let sums = &mut sums[..end - start];
                    self.along(columns, &span, start, sums);
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
                self.along(&cells.lower, &span, span.places.start + block * BLOCK, sums);
            }
        }
        let Seen { segments, anchors, .. } = self.weighted.seen;
        let sum = |place: usize, best: Option<Candidate>| {
            let segment = segments.of(place);
            let mut asked: usize = 0;
            for (age, &back) in self.diagonal.back.iter().enumerate() {
                let at = segment.onward(place, -(back as isize))?;
                if !cells.resolve(age, at..at + 1, ask) {
                    continue;
                }
                // If all of the column was resolved, its trusted cell was, too.
                let anchor = anchors.get(age);
                if anchor.trusted {
                    cells.replace(age, anchor.single.place, self.weighted.cell(anchor.single));
                }
                // A sum costs `L` additions: after 1, 2, 4, ... distances.
                asked += 1;
                if asked.is_power_of_two() && !beats((self.of(place, &cells.lower), place), best) {
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

    /// The own places that have a diagonal, in order: of an open segment those whose diagonal lies on
    /// it, of a closed one all.
    fn spans(&self) -> impl Iterator<Item = Span> {
        let reach = self.diagonal.reach();
        self.weighted.seen.segments.iter().enumerate().flat_map(move |(index, &segment)| {
            let own = self.own.of(index, segment);
            let from = segment.start.saturating_add(reach).clamp(own.start, own.end);
            let around = segment.closed.then_some(own.start..from);
            let around = around.map(|places| Span { places, segment, around: true });
            let straight = Span { places: from..own.end, segment, around: false };
            around.into_iter().chain([straight])
        })
    }

    /// The sum of the diagonal that ends in `place`, which has one.
    #[inline(always)]
    fn of(&self, place: usize, columns: &Ring) -> f64 {
        let segment = self.weighted.seen.segments.of(place);
        let mut sum = 0.0;
        for (age, &back) in self.diagonal.back.iter().enumerate().rev() {
            sum += f64::from(columns.column(age)[segment.before(place, back)]);
        }
        sum
    }

    /// Writes the sums of the diagonals that end in `start`, `start + 1`, ..., at most
    /// [`BLOCK`] places of a span.
    #[inline(always)]
    fn along(&self, columns: &Ring, span: &Span, start: usize, sums: &mut [f64]) {
        if span.around {
            return self.around(columns, span.segment, start, sums);
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

    /// [`along`](Self::along) of diagonals that go round a closed segment, a column at a time.
    #[inline(always)]
    fn around(&self, columns: &Ring, segment: Segment, start: usize, sums: &mut [f64]) {
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

    /// Whether any diagonal that ends in a block of places has a sum below `least`: few blocks
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

/// Each sum with the distances of three columns.
#[inline(always)]
fn each(
    sums: &mut [f64],
    a: &[f32],
    b: &[f32],
    c: &[f32],
    sum_of: impl Fn(f64, f64, f64, f64) -> f64,
) {
    let count = sums.len();
    let (a, b, c) = (&a[..count], &b[..count], &c[..count]);
    for at in 0..count {
        sums[at] = sum_of(sums[at], f64::from(a[at]), f64::from(b[at]), f64::from(c[at]));
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
