//! The plan of a drive: its legs, and the place on the route that each frame is taken at.

use serde::{Deserialize, Serialize};
use std::ops::Range;

use surefix::Error;

/// A part of a drive: its frames, and its speed in places of the route a frame.
///
/// Places count along the whole drive without jumps, also off the map. There, each leg has a street
/// of its own that no other drive sees but one of the same legs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Leg {
    /// On along the route.
    Drive(usize, f64),
    /// Standing still, on the street of the leg before.
    Stop(usize),
    /// Backwards along the route.
    Reverse(usize, f64),
    /// Off the map along a parallel street: the drive is back on the route as far ahead as if it
    /// had stayed on it.
    Detour(usize, f64),
    /// Off the map, around and back: the drive is on the route again as far behind as it drove
    /// meanwhile, and comes to earlier places once more.
    Loop(usize, f64),
}

/// Where a frame is taken.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Stand {
    /// The place along the route, were the speed even.
    pub(super) place: f64,
    /// 0 is the route, others are off the map.
    pub(super) street: u64,
    /// The way that the camera looks: 1 if places grow ahead of it, -1 on a loop.
    pub(super) ahead: f64,
}

/// A leg in a drive: its frames, where the first one is taken, and the places from each to the
/// next.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Stretch {
    frames: Range<usize>,
    first: Stand,
    step: f64,
}

/// The legs of a drive, checked and laid end to end.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Itinerary(Vec<Stretch>);

impl Itinerary {
    /// The first frame is taken at place 0, each other one a step of its own leg further on.
    pub(super) fn new(legs: &[Leg], places: usize) -> Result<Self, Error> {
        let bad = |expected: String, got| Err(Error::Option { name: "legs", expected, got });
        if legs.is_empty() {
            return bad("1 leg or more".to_owned(), "none".to_owned());
        }
        let last = places as f64 - 1.0;
        let (mut stretches, mut start) = (Vec::with_capacity(legs.len()), 0_usize);
        let mut at = Stand { place: 0.0, street: 0, ahead: 1.0 };
        for (number, &leg) in legs.iter().enumerate() {
            let off = number as u64 + 1;
            // A stop's speed is as good as any: it is times 0.
            let (frames, speed, along, street, ahead) = match leg {
                Leg::Drive(frames, speed) => (frames, speed, 1.0, 0, 1.0),
                Leg::Stop(frames) => (frames, 1.0, 0.0, at.street, at.ahead),
                Leg::Reverse(frames, speed) => (frames, speed, -1.0, 0, 1.0),
                Leg::Detour(frames, speed) => (frames, speed, 1.0, off, 1.0),
                Leg::Loop(frames, speed) => (frames, speed, -1.0, off, -1.0),
            };
            let got = || format!("leg {number}: {leg:?}");
            if !(speed > 0.0 && speed.is_finite()) {
                return bad("a speed above 0, in places a frame".to_owned(), got());
            }
            let Some(end) = start.checked_add(frames).filter(|&end| end > start) else {
                return bad(
                    "1 frame or more a leg, and a sum that can be counted".to_owned(),
                    got(),
                );
            };
            let step = along * speed;
            let place = if start == 0 { 0.0 } else { at.place + step };
            let first = Stand { place, street, ahead };
            at = Stand { place: place + (frames - 1) as f64 * step, ..first };
            // Tenths do not add up exactly.
            if !(-1e-6..=last + 1e-6).contains(&at.place) {
                let expected = format!("legs that end at the places 0 to {last}");
                return bad(expected, format!("{}, which ends at {}", got(), at.place));
            }
            stretches.push(Stretch { frames: start..end, first, step });
            start = end;
        }
        Ok(Self(stretches))
    }

    /// The number of frames.
    pub(super) fn frames(&self) -> usize {
        self.0.last().map_or(0, |stretch| stretch.frames.end)
    }

    /// Where frame `index` is taken; an index past the end means the last frame.
    pub(super) fn stand(&self, index: usize) -> Stand {
        let index = index.min(self.frames().saturating_sub(1));
        let leg = self.0.partition_point(|stretch| stretch.frames.end <= index);
        let nowhere = Stand { place: 0.0, street: 0, ahead: 1.0 };
        self.0.get(leg).map_or(nowhere, |stretch| Stand {
            place: stretch.first.place + (index - stretch.frames.start) as f64 * stretch.step,
            ..stretch.first
        })
    }
}
