//! The answer (method 1.9, 6): the most probable place, and how sure it is.

use super::steps::arriving;
use super::sums::{CHUNK, LANES, sum};
use super::{Prediction, State, Step, Taken, Tracker};
use crate::method::argmin::first_better;
use crate::segments::Segments;
use serde::{Deserialize, Serialize};

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
    /// The first and the last place of the interval that holds 95 % of the belief on the map.
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
            arriving(row, taps, segments, keep * moved, place, &mut arrived);
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
        let (low, high) = self.interval();
        Track {
            place,
            confidence,
            off_map: self.off,
            speed: speed(place),
            interval: (low.min(place), high.max(place)),
        }
    }

    /// The belief within `tolerance` places of a place, on its segment.
    pub(super) fn near(&self, place: usize, tolerance: usize, segments: &Segments) -> f64 {
        let segment = segments.of(place);
        let near = place.saturating_sub(tolerance).max(segment.start)
            ..place.saturating_add(1).saturating_add(tolerance).min(segment.end);
        self.scale * self.mass[near].iter().sum::<f64>()
    }

    /// The places beside which [`TAIL`] of the mass lies on either side.
    fn interval(&self) -> (usize, usize) {
        let Self { mass, sums, .. } = *self;
        let tail = TAIL * self.on / self.scale;
        let (mut below, mut chunk) = (0.0, 0);
        while chunk + 1 < sums.len() && below + sums[chunk] <= tail {
            below += sums[chunk];
            chunk += 1;
        }
        let mut low = chunk * CHUNK;
        while low + LANES < mass.len() && below + sum(&mass[low..low + LANES]) <= tail {
            below += sum(&mass[low..low + LANES]);
            low += LANES;
        }
        while low + 1 < mass.len() && below + mass[low] <= tail {
            below += mass[low];
            low += 1;
        }
        let (mut above, mut chunk) = (0.0, sums.len());
        while chunk > 1 && above + sums[chunk - 1] <= tail {
            above += sums[chunk - 1];
            chunk -= 1;
        }
        let mut high = mass.len().min(chunk * CHUNK);
        while high > LANES && above + sum(&mass[high - LANES..high]) <= tail {
            above += sum(&mass[high - LANES..high]);
            high -= LANES;
        }
        while high > 1 && above + mass[high - 1] <= tail {
            above += mass[high - 1];
            high -= 1;
        }
        (low, high - 1)
    }
}
