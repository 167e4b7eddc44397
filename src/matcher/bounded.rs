//! The same fixes from distances of which the bounds are known, and few of the distances themselves
//! (method 1.9).
//!
//! A push is told between which two numbers each distance lies. The least distance, the largest
//! gradient and the least sum are then each found in the same way: every candidate has a bound; the
//! most promising one is looked at, which means that its distances are asked for, and after it
//! those that may still be better, until none is left. Every addition here is the method's own, in
//! its order, on bounds instead of distances. Rounding keeps the order of numbers, so that the
//! results are bounds again, rounding included.

use std::collections::VecDeque;
use std::ops::Range;

use super::best_first::{Candidate, Found, beats, first_least};
use super::consensus::{Single, consensus, minimum};
use super::gradient::{Enhanced, Peak};
use super::ring::Ring;
use super::sequence::{Anchor, Sequence, Window, weigh_anchored};
use super::{Fix, Matcher};
use crate::error::Error;
use crate::preallocated::Preallocated;
use crate::simd::Compiled;

/// Where more than one place in so many is in doubt, all of the column is looked at: in order, that
/// is no slower.
const CROWD: usize = 4;

/// Knows the distances of the newest queries.
pub(crate) trait Exact {
    /// Writes the distances of the query of `age` pushes ago to some places into `out`.
    fn distances(&mut self, age: usize, places: Range<usize>, out: &mut [f32]);
}

/// A [`Matcher`] that is told bounds. Its fixes are those of one that is told the distances, to the
/// last bit.
#[derive(Clone, Debug)]
pub(crate) struct Bounded {
    /// The method's state; its columns are lower bounds.
    matcher: Matcher,
    /// Upper bounds. A distance that has been looked at is both.
    upper: Ring,
    /// How many rows of each column have been looked at, the newest column's first.
    looked: Preallocated<VecDeque<usize>>,
    /// Room for the negated upper bounds of the gradients.
    gradients: Vec<f32>,
    /// Room for the lower bounds of the sums.
    sums: Preallocated<Vec<f64>>,
    candidates: Preallocated<Vec<Candidate>>,
}

impl Bounded {
    /// Goes on from a matcher whose columns are distances.
    ///
    /// # Errors
    /// [`Error::Memory`] where there is not enough for a second window.
    pub(crate) fn new(matcher: Matcher) -> Result<Self, Error> {
        let (columns, places) = (matcher.columns.capacity(), matcher.places);
        let refused = |_| Error::Memory { places, columns };
        let mut upper = Ring::new(columns, places)?;
        for age in (0..matcher.columns.len()).rev() {
            upper.advance().copy_from_slice(matcher.columns.column(age));
        }
        let mut looked = VecDeque::new();
        looked.try_reserve_exact(columns + 1).map_err(refused)?;
        looked.extend(std::iter::repeat_n(places, matcher.columns.len()));
        let (mut gradients, mut sums, mut candidates) = (Vec::new(), Vec::new(), Vec::new());
        gradients.try_reserve_exact(places).map_err(refused)?;
        sums.try_reserve_exact(places).map_err(refused)?;
        candidates.try_reserve_exact(places).map_err(refused)?;
        gradients.resize(places, 0.0);
        let (looked, sums, candidates) =
            (Preallocated(looked), Preallocated(sums), Preallocated(candidates));
        Ok(Self { matcher, upper, looked, gradients, sums, candidates })
    }

    /// Takes bounds of the distances from the current query to every place, all finite and so small
    /// that sums of them do not overflow, and says where the robot is, and how many rows have been
    /// looked at. Without `upper`, `lower` is the distances themselves, of any size if all older
    /// ones have been looked at.
    pub(crate) fn push(
        &mut self,
        lower: &[f32],
        upper: Option<&[f32]>,
        external: Option<bool>,
        exact: &mut impl Exact,
    ) -> (Fix, usize) {
        let isa = self.matcher.isa;
        isa.run(Step { bounded: self, lower, upper, external, exact })
    }

    /// The method, step by step as in [`Matcher`].
    #[inline(always)]
    fn method(
        &mut self,
        lower: &[f32],
        upper: Option<&[f32]>,
        external: Option<bool>,
        exact: &mut impl Exact,
    ) -> (Fix, usize) {
        self.matcher.columns.advance().copy_from_slice(lower);
        self.upper.advance().copy_from_slice(upper.unwrap_or(lower));
        self.looked.truncate(self.matcher.columns.len() - 1);
        self.looked.push_front(if upper.is_some() { 0 } else { lower.len() });
        let before: usize = self.looked.iter().sum();

        let single = self.single(lower, exact);
        let peak = self.peak(exact);
        let trusted =
            external.unwrap_or_else(|| consensus(single, peak, self.matcher.config.tolerance));
        let frame = self.matcher.remember(Anchor { single, trusted });
        let sequence = self.sequence(frame, exact);

        let (place, score) =
            sequence.map_or((single.place, single.distance), |s| (s.place, s.score));
        let rows = self.looked.iter().sum::<usize>() - before;
        (Fix { frame, trusted, place, score, single, gradient: peak, sequence }, rows)
    }

    /// Eq. 2, of the newest column.
    fn single(&mut self, lower: &[f32], exact: &mut impl Exact) -> Single {
        let mut cells = Cells {
            lower: &mut self.matcher.columns,
            upper: &mut self.upper,
            looked: &mut self.looked,
            exact,
        };
        let distance = |place: usize, _: Option<Candidate>| {
            cells.settle(0, place..place + 1);
            Some(cells.lower.column(0)[place].into())
        };
        match first_least(lower, 0, None, lower.len() / CROWD, &mut self.candidates, distance) {
            Found::Best(Some((distance, place))) => Single { place, distance: distance as f32 },
            Found::Best(None) | Found::Crowd => {
                cells.settle_all(0);
                minimum(cells.lower.column(0))
            }
        }
    }

    /// Method 1.2.
    #[inline(always)]
    fn peak(&mut self, exact: &mut impl Exact) -> Peak {
        let Self { matcher, upper, looked, gradients, candidates, .. } = self;
        let Matcher { columns, earlier, config, places, .. } = matcher;
        let (kind, smoothing, places) = (config.gradient, config.smoothing, *places);
        let mut cells = Cells { lower: columns, upper, looked, exact };
        // What the mean of the gradient is made of.
        cells.settle(0, 0..2);
        cells.settle(0, places - 2..places);
        loop {
            let enhanced = Enhanced {
                columns: cells.lower,
                upper: Some(cells.upper),
                earlier,
                kind,
                smoothing,
            };
            let ages = enhanced.held().min(cells.lower.len());
            let Some(doubtful) = (0..ages).find(|&age| cells.looked[age] < places) else {
                return Enhanced { upper: None, ..enhanced }.peak();
            };
            enhanced.sums(|start: usize, sums: &mut [f32]| {
                let bounds = &mut gradients[start..start + sums.len()];
                bounds.iter_mut().zip(sums).for_each(|(bound, sum)| *bound = -*sum);
            });
            let negated = |place: usize, best: Option<Candidate>| {
                for age in 0..ages.min(place + 1) {
                    let at = place - age;
                    if cells.settle(age, at.saturating_sub(1)..places.min(at + 2)) {
                        let bound = Enhanced {
                            columns: cells.lower,
                            upper: Some(cells.upper),
                            earlier,
                            kind,
                            smoothing,
                        };
                        if !beats((-f64::from(bound.sum(place)), place), best) {
                            return None;
                        }
                    }
                }
                let known =
                    Enhanced { columns: cells.lower, upper: None, earlier, kind, smoothing };
                Some(-f64::from(known.sum(place)))
            };
            match first_least(gradients, 0, None, places / CROWD, candidates, negated) {
                Found::Best(Some((negated, place))) => {
                    return Peak { place, value: -negated as f32 };
                }
                Found::Best(None) | Found::Crowd => cells.settle_all(doubtful),
            }
        }
    }

    /// Eqs. 4 to 6, once the window is full.
    #[inline(always)]
    fn sequence(&mut self, frame: u64, exact: &mut impl Exact) -> Option<Sequence> {
        let Self { matcher, upper, looked, sums, candidates, .. } = self;
        let (weight, floor) = (matcher.config.weight, matcher.floor());
        let Matcher { columns, anchors, search, places, .. } = matcher;
        let full = columns.len() >= search.diagonals[0].back.len();
        let mut cells = Cells { lower: columns, upper, looked, exact };
        let mut best: Option<Candidate> = None;
        let mut chosen = 0;
        for (index, diagonal) in search.diagonals.iter_mut().enumerate() {
            let window = Window { frame, columns: cells.lower, anchors, weight, floor };
            weigh_anchored(diagonal, window, &mut search.anchored);
            sums.clear();
            diagonal.sums(window.columns, frame, |_: usize, some: &mut [f64]| {
                sums.extend_from_slice(some)
            });
            if !full {
                continue;
            }
            let first = diagonal.first();
            for &(place, sum) in search.anchored.iter() {
                sums[place - first] = sum;
            }
            let back = &diagonal.back;
            let sum = |place: usize, best: Option<Candidate>| {
                for (age, back) in back.iter().enumerate() {
                    if cells.settle(age, place - back..place - back + 1) {
                        let window = Window { frame, columns: cells.lower, anchors, weight, floor };
                        if !beats((window.weighted_sum(place, &diagonal.back), place), best) {
                            return None;
                        }
                    }
                }
                let window = Window { frame, columns: cells.lower, anchors, weight, floor };
                Some(window.weighted_sum(place, &diagonal.back))
            };
            let before = best;
            if let Found::Best(found) = first_least(sums, first, best, *places, candidates, sum) {
                best = found;
            }
            if best != before {
                chosen = index;
            }
        }
        let (sum, place) = best?;
        let window = Window { frame, columns: cells.lower, anchors, weight, floor };
        Some(window.sequence(place, sum, &search.diagonals[chosen]))
    }

    /// Looks at all places of all queries of the window: the matcher that was told the distances.
    pub(crate) fn settled(&self, exact: &mut impl Exact) -> Matcher {
        let mut settled = self.clone();
        settled.settle_window(exact);
        settled.matcher
    }

    /// The newest query's distances, all of them looked at; nothing before the first, and right
    /// after a gap.
    pub(crate) fn newest(&mut self, exact: &mut impl Exact) -> Option<&[f32]> {
        if self.matcher.columns.len() > 0 {
            self.settle_all(0, exact);
        }
        self.matcher.newest()
    }

    /// Looks at all places of all queries of the window.
    pub(crate) fn settle_window(&mut self, exact: &mut impl Exact) {
        for age in 0..self.matcher.columns.len() {
            self.settle_all(age, exact);
        }
    }

    fn settle_all(&mut self, age: usize, exact: &mut impl Exact) {
        let Self { matcher, upper, looked, .. } = self;
        Cells { lower: &mut matcher.columns, upper, looked, exact }.settle_all(age);
    }

    /// Of how many queries it remembers bounds or distances at most.
    pub(crate) fn window(&self) -> usize {
        self.upper.capacity()
    }

    /// Of how many it does now.
    pub(crate) fn remembered(&self) -> usize {
        self.upper.len()
    }

    /// As [`Matcher::gap`].
    pub(crate) fn gap(&mut self) {
        self.matcher.gap();
        self.upper.clear();
        self.looked.clear();
    }

    pub(crate) fn reset(&mut self) {
        self.gap();
        self.matcher.reset();
    }

    /// The matcher's options and counters.
    pub(crate) fn matcher(&self) -> &Matcher {
        &self.matcher
    }
}

/// One query, compiled for each instruction set.
struct Step<'a, E> {
    bounded: &'a mut Bounded,
    lower: &'a [f32],
    upper: Option<&'a [f32]>,
    external: Option<bool>,
    exact: &'a mut E,
}

impl<E: Exact> Compiled for Step<'_, E> {
    type Out = (Fix, usize);

    #[inline(always)]
    fn run(self) -> Self::Out {
        self.bounded.method(self.lower, self.upper, self.external, self.exact)
    }
}

/// The bounds of the distances of the newest queries, and who knows the distances.
struct Cells<'a, E> {
    lower: &'a mut Ring,
    upper: &'a mut Ring,
    looked: &'a mut VecDeque<usize>,
    exact: &'a mut E,
}

impl<E: Exact> Cells<'_, E> {
    /// Looks at those of the places that are in doubt, and says whether any was.
    fn settle(&mut self, age: usize, places: Range<usize>) -> bool {
        let all = self.lower.height();
        if self.looked[age] == all {
            return false;
        }
        let mut any = false;
        for place in places {
            let (low, high) = (self.lower.column(age)[place], self.upper.column(age)[place]);
            if low.to_bits() == high.to_bits() {
                continue;
            }
            if self.looked[age] >= all / CROWD {
                self.settle_all(age);
                return true;
            }
            let mut distance = [0.0];
            self.exact.distances(age, place..place + 1, &mut distance);
            debug_assert!((low..=high).contains(&distance[0]), "{distance:?} from {low} to {high}");
            self.lower.column_mut(age)[place] = distance[0];
            self.upper.column_mut(age)[place] = distance[0];
            self.looked[age] += 1;
            any = true;
        }
        any
    }

    /// Looks at all places.
    fn settle_all(&mut self, age: usize) {
        let (places, lower) = (self.lower.height(), self.lower.column_mut(age));
        if self.looked[age] < places {
            self.exact.distances(age, 0..places, lower);
            self.upper.column_mut(age).copy_from_slice(lower);
            self.looked[age] = places;
        }
    }
}
