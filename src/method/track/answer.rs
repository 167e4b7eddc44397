//! The answer (method 1.9, 6): the most probable place, and how sure it is.

use super::update::Whole;
use super::{State, Taken, Tracker};
use crate::method::argmin::first_better;
use crate::segments::{Segment, Segments};
use crate::sums::{CHUNK, LANES, sum};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The share of the belief on either side of [`Track::interval`].
const TAIL: f64 = 0.025;

/// On a route of more places, the interval's ends far from the most probable place are those of
/// chunks: their masses need not be known place by place.
pub(super) const FINE: usize = 1 << 16;

/// Where the robot is by all queries so far (method 1.9).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Track {
    /// The most probable place, from 0.
    pub place: usize,
    /// The belief that the robot is within `tolerance` places of it.
    pub confidence: f64,
    /// The belief that the robot is off the map. It ranks well; as a probability it is a lower
    /// bound, as places that the map lacks have no evidence of their own.
    pub off_map: f64,
    /// The speed in places a query, or the advance if it is known.
    pub speed: f64,
    /// The first and the last place of the interval that holds 95 % of the belief on the map. On a
    /// route that is one closed segment it may go round: the first is then the greater. On more
    /// than 65,536 places, ends far from `place` are rounded outwards, by up to 255 places.
    pub interval: (usize, usize),
}

impl Tracker {
    #[inline(always)]
    pub(super) fn answer(&self, taken: &Taken<'_>, segments: &Segments) -> Track {
        let State { on, off, scale, .. } = self.state;
        let places = segments.places();
        let masses = self.mass(places);
        let (place, _) = most_probable(masses);
        let Taken { step, prediction, .. } = *taken;
        let speed = taken.advance.unwrap_or_else(|| {
            let Self { motion, steps, before, .. } = self;
            let length = before.len() / motion.speeds.len();
            let before = Whole { rows: before, length, way: self.way(segments) };
            prediction.moves(steps, step).speed(&before, motion, place)
        });
        let (mass, sums) = (|places| &masses[places], &self.scratch.sums[..]);
        let belief = Belief { places, mass, sums, on, off, scale };
        belief.answer(place, self.tolerance, segments, speed)
    }

    /// The mass in each place.
    pub(super) fn mass(&self, places: usize) -> &[f64] {
        if self.state.joint { &self.mass[..places] } else { &self.scratch.places }
    }
}

/// The most probable of the places that these masses are in, the first of equals, and its mass.
#[inline(always)]
pub(super) fn most_probable(mass: &[f64]) -> (usize, f64) {
    let mut best = (0, f64::NEG_INFINITY);
    for (index, chunk) in mass.chunks(CHUNK).enumerate() {
        if let Some((at, mass)) = first_better(chunk, best.1, |a, b| a > b) {
            best = (index * CHUNK + at, mass);
        }
    }
    best
}

/// A belief over places.
pub(super) struct Belief<'a, M> {
    pub(super) places: usize,
    /// Gives the belief in some places of one chunk, divided by `scale`. On a route of more than
    /// [`FINE`] places, it is asked for no others than those within the tolerance, and those of the
    /// chunk of the most probable place and of the two beside it.
    pub(super) mass: M,
    /// The sum of each chunk of it.
    pub(super) sums: &'a [f64],
    pub(super) on: f64,
    pub(super) off: f64,
    pub(super) scale: f64,
}

impl<'a, M: Fn(Range<usize>) -> &'a [f64]> Belief<'a, M> {
    /// What is known of the most probable place, at which the robot has this speed.
    #[inline(always)]
    pub(super) fn answer(
        &self,
        place: usize,
        tolerance: usize,
        segments: &Segments,
        speed: f64,
    ) -> Track {
        Track {
            place,
            confidence: self.near(place, tolerance, segments),
            off_map: self.off,
            speed,
            interval: self.interval(place, segments),
        }
    }

    /// The belief within `tolerance` places of a place, on its segment.
    pub(super) fn near(&self, place: usize, tolerance: usize, segments: &Segments) -> f64 {
        let [first, again] = near(place, tolerance, segments);
        self.scale * (self.within(first) + self.within(again))
    }

    /// The mass in some places: whole chunks at once, the others one by one.
    fn within(&self, places: Range<usize>) -> f64 {
        let mut total = 0.0;
        for part in parts(places) {
            if self.is_chunk(&part) {
                total += self.sums[part.start / CHUNK];
            } else {
                for mass in (self.mass)(part) {
                    total += mass;
                }
            }
        }
        total
    }

    fn is_chunk(&self, part: &Range<usize>) -> bool {
        let whole = part.end.is_multiple_of(CHUNK) || part.end == self.places;
        part.start.is_multiple_of(CHUNK) && whole
    }

    /// The places beside which [`TAIL`] of the mass lies on either side, `place` or those beyond it
    /// at most. On a route that is one closed segment, the sides begin at the place opposite.
    fn interval(&self, place: usize, segments: &Segments) -> (usize, usize) {
        let places = self.places;
        let seam = match segments.of(place) {
            Segment { closed: true, .. } if segments.len() == 1 => {
                let opposite = (place + places.div_ceil(2)) % places;
                if places > FINE { opposite - opposite % CHUNK } else { opposite }
            }
            _ => 0,
        };
        let in_order = || parts(seam..places).chain(parts(0..seam));
        let low = self.end(place, in_order(), false);
        let high = self.end(place, in_order().rev(), true);
        // The places before the seam come last.
        let along = |at: usize| (at < seam, at);
        let of_two = |other: usize| [other, place].into_iter();
        (
            of_two(low).min_by_key(|&at| along(at)).unwrap_or(place),
            of_two(high).max_by_key(|&at| along(at)).unwrap_or(place),
        )
    }

    /// The place, by one part after the other, with which the mass exceeds [`TAIL`]; `place` if
    /// there is none. On a route of more than [`FINE`] places, if its chunk is not near `place`, the
    /// first of the chunk.
    fn end(
        &self,
        place: usize,
        parts: impl Iterator<Item = Range<usize>>,
        backwards: bool,
    ) -> usize {
        let tail = TAIL * self.on / self.scale;
        let mut beside = 0.0;
        for part in parts {
            let chunk = part.start / CHUNK;
            if self.is_chunk(&part) && beside + self.sums[chunk] <= tail {
                beside += self.sums[chunk];
                continue;
            }
            if self.places > FINE && chunk.abs_diff(place / CHUNK) > 1 {
                return if backwards { part.end - 1 } else { part.start };
            }
            if let Some(at) = exceeding((self.mass)(part.clone()), tail, &mut beside, backwards) {
                return part.start + at;
            }
        }
        place
    }
}

/// The places within `tolerance` places of a place, on its segment; two ranges if they go round a
/// seam.
fn near(place: usize, tolerance: usize, segments: &Segments) -> [Range<usize>; 2] {
    let segment = segments.of(place);
    if segment.closed && tolerance < segment.len() / 2 {
        let end = |by: isize| segment.onward(place, by).unwrap_or(place);
        let (first, after) = (end(-(tolerance as isize)), end(tolerance as isize) + 1);
        if after > first {
            return [first..after, 0..0];
        }
        return [first..segment.end, segment.start..after];
    }
    // Within half a lap lies the whole of a closed segment.
    let tolerance = if segment.closed { segment.len() } else { tolerance };
    let near = place.saturating_sub(tolerance).max(segment.start)
        ..place.saturating_add(1).saturating_add(tolerance).min(segment.end);
    [near, 0..0]
}

/// The chunks whose masses a [`Belief`] is asked for, if the route's most probable place is this
/// one.
pub(super) fn asked(
    place: usize,
    tolerance: usize,
    segments: &Segments,
) -> impl Iterator<Item = usize> {
    let places = segments.places();
    let all = 0..if places > FINE { 0 } else { places.div_ceil(CHUNK) };
    let chunk = place / CHUNK;
    let beside = chunk.saturating_sub(1)..(chunk + 2).min(places.div_ceil(CHUNK));
    let ends = near(place, tolerance, segments).into_iter().filter(|range| !range.is_empty());
    let ends = ends.flat_map(|range| [range.start / CHUNK, (range.end - 1) / CHUNK]);
    all.chain(beside).chain(ends)
}

/// Some places by chunks.
fn parts(places: Range<usize>) -> impl DoubleEndedIterator<Item = Range<usize>> {
    let chunks = places.start / CHUNK..places.end.div_ceil(CHUNK);
    chunks
        .map(move |chunk| (chunk * CHUNK).max(places.start)..((chunk + 1) * CHUNK).min(places.end))
}

/// The index of the number with which `so_far` exceeds `limit`; else all are added to it.
fn exceeding(mass: &[f64], limit: f64, so_far: &mut f64, backwards: bool) -> Option<usize> {
    for group in 0..mass.len().div_ceil(LANES) {
        let (near, far) = (group * LANES, mass.len().min((group + 1) * LANES));
        let mut at = if backwards { mass.len() - far..mass.len() - near } else { near..far };
        let all = sum(&mass[at.clone()]);
        if *so_far + all <= limit {
            *so_far += all;
            continue;
        }
        while let Some(at) = if backwards { at.next_back() } else { at.next() } {
            if *so_far + mass[at] > limit {
                return Some(at);
            }
            *so_far += mass[at];
        }
    }
    None
}
