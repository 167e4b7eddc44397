//! The answer (method 1.9, 6): the most probable place, and how sure it is.

use super::steps::arriving;
use super::sums::{CHUNK, LANES, sum};
use super::{Prediction, State, Step, Taken, Tracker};
use crate::method::argmin::first_better;
use crate::segments::{Segment, Segments};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The share of the belief on either side of [`Track::interval`].
const TAIL: f64 = 0.025;

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
    /// route that is one closed segment it may go round: the first is then the greater.
    pub interval: (usize, usize),
}

impl Tracker {
    #[inline(always)]
    pub(super) fn answer(&self, taken: &Taken<'_>, segments: &Segments) -> Track {
        let State { on, off, scale, .. } = self.state;
        let mass = self.mass(segments.places());
        let belief = Belief { mass, sums: &self.scratch.sums, on, off, scale };
        belief.answer(self.tolerance, segments, |place| {
            let Taken { step, prediction, .. } = *taken;
            taken.advance.unwrap_or_else(|| self.speed(step, prediction, place, segments))
        })
    }

    /// The mass in each place.
    pub(super) fn mass(&self, places: usize) -> &[f64] {
        if self.state.joint { &self.mass[..places] } else { &self.scratch.places }
    }

    /// The mean speed of the belief in a place, in places a query.
    fn speed(&self, step: Step, prediction: Prediction, place: usize, segments: &Segments) -> f64 {
        let (mut total, mut sum, mut speeds) = (0.0, 0.0, self.motion.speeds.iter());
        let moved = step.moved();
        self.each_row(step, |row, taps, share| {
            let keep = prediction.keep * share;
            let mut arrived = [0.0];
            arriving(row, taps, self.way(segments), keep * moved, place, &mut arrived);
            let moving = arrived[0] + prediction.anew;
            total += moving + keep * (1.0 - moved) * row[place];
            sum += moving * speeds.next().copied().unwrap_or(0.0);
        });
        // A robot that left the map for good has no belief in any place, and no speed.
        if total > 0.0 { self.motion.pace * sum / total } else { 0.0 }
    }
}

/// A belief over places.
pub(super) struct Belief<'a> {
    /// The belief in each place, divided by `scale`.
    pub(super) mass: &'a [f64],
    /// The sum of each chunk of it.
    pub(super) sums: &'a [f64],
    pub(super) on: f64,
    pub(super) off: f64,
    pub(super) scale: f64,
}

impl Belief<'_> {
    /// The most probable place and what is known of it; `speed` gives the speed there.
    #[inline(always)]
    pub(super) fn answer(
        &self,
        tolerance: usize,
        segments: &Segments,
        speed: impl FnOnce(usize) -> f64,
    ) -> Track {
        let mut best = (0, f64::NEG_INFINITY);
        for (index, chunk) in self.mass.chunks(CHUNK).enumerate() {
            if let Some((at, mass)) = first_better(chunk, best.1, |a, b| a > b) {
                best = (index * CHUNK + at, mass);
            }
        }
        let place = best.0;
        let confidence = self.near(place, tolerance, segments);
        Track {
            place,
            confidence,
            off_map: self.off,
            speed: speed(place),
            interval: self.interval(place, segments),
        }
    }

    /// The belief within `tolerance` places of a place, on its segment.
    pub(super) fn near(&self, place: usize, tolerance: usize, segments: &Segments) -> f64 {
        let segment = segments.of(place);
        let of = |places: Range<usize>| self.mass[places].iter().sum::<f64>();
        if segment.closed && tolerance < segment.len() / 2 {
            let end = |by: isize| segment.onward(place, by).unwrap_or(place);
            let (first, after) = (end(-(tolerance as isize)), end(tolerance as isize) + 1);
            if first < after {
                return self.scale * of(first..after);
            }
            return self.scale * (of(first..segment.end) + of(segment.start..after));
        }
        // Within half a lap lies the whole of a closed segment.
        let tolerance = if segment.closed { segment.len() } else { tolerance };
        let near = place.saturating_sub(tolerance).max(segment.start)
            ..place.saturating_add(1).saturating_add(tolerance).min(segment.end);
        self.scale * of(near)
    }

    /// The places beside which [`TAIL`] of the mass lies on either side, `place` or those beyond it
    /// at most. On a route that is one closed segment, the sides begin at the place opposite.
    fn interval(&self, place: usize, segments: &Segments) -> (usize, usize) {
        let places = self.mass.len();
        let seam = match segments.of(place) {
            Segment { closed: true, .. } if segments.len() == 1 => {
                (place + places.div_ceil(2)) % places
            }
            _ => 0,
        };
        let tail = TAIL * self.on / self.scale;
        let parts = || [seam..places, 0..seam];
        let (low, high) = (self.first_above(tail, parts()), self.last_above(tail, parts()));
        // How far along from the seam.
        let along = |at: usize| if at < seam { at + places - seam } else { at - seam };
        (
            if along(low) < along(place) { low } else { place },
            if along(high) > along(place) { high } else { place },
        )
    }

    /// The first place, by one part after the other, with which the mass exceeds `tail`.
    fn first_above(&self, tail: f64, parts: [Range<usize>; 2]) -> usize {
        let Self { mass, sums, .. } = *self;
        let (mut below, mut last) = (0.0, 0);
        for part in parts {
            let mut at = part.start;
            while at < part.end {
                let next = (at + CHUNK).min(mass.len());
                if at.is_multiple_of(CHUNK) && next <= part.end && below + sums[at / CHUNK] <= tail
                {
                    below += sums[at / CHUNK];
                    at = next;
                    continue;
                }
                let next = at + LANES;
                if next <= part.end && below + sum(&mass[at..next]) <= tail {
                    below += sum(&mass[at..next]);
                    at = next;
                    continue;
                }
                if below + mass[at] > tail {
                    return at;
                }
                below += mass[at];
                at += 1;
            }
            last = part.end.checked_sub(1).unwrap_or(last);
        }
        last
    }

    /// The same backwards, by the last part first.
    fn last_above(&self, tail: f64, parts: [Range<usize>; 2]) -> usize {
        let Self { mass, sums, .. } = *self;
        let (mut above, mut first) = (0.0, 0);
        for part in parts.into_iter().rev() {
            let mut at = part.end;
            while at > part.start {
                let chunk = (at - 1) / CHUNK;
                let whole = at.is_multiple_of(CHUNK) || at == mass.len();
                if whole && chunk * CHUNK >= part.start && above + sums[chunk] <= tail {
                    above += sums[chunk];
                    at = chunk * CHUNK;
                    continue;
                }
                let next = at.saturating_sub(LANES);
                if at >= part.start + LANES && above + sum(&mass[next..at]) <= tail {
                    above += sum(&mass[next..at]);
                    at = next;
                    continue;
                }
                if above + mass[at - 1] > tail {
                    return at - 1;
                }
                above += mass[at - 1];
                at -= 1;
            }
            first = part.start;
        }
        first
    }
}
