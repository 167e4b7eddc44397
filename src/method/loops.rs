//! Loop closure (method 1.14): the tracker on a route that grows by a place a query.

use super::Track;
use super::track::{GrowingHubness, Tracker};
use crate::error::Error;
use crate::motion::Motion;
use crate::segments::Segments;
use crate::simd::{Compiled, Isa};

/// The tracker of a loop closer, and the route behind the robot.
#[derive(Clone, Debug)]
pub(crate) struct LoopFilter {
    motion: Motion,
    tracker: Tracker,
    hubness: GrowingHubness,
    segments: Segments,
    /// Places that there is memory for.
    room: usize,
    isa: Isa,
}

impl LoopFilter {
    /// # Errors
    /// [`Error::Option`] for a motion outside its range.
    pub(crate) fn new(motion: &Motion, tolerance: usize) -> Result<Self, Error> {
        motion.validate()?;
        Ok(Self {
            motion: motion.clone(),
            tracker: Tracker::of_no_places(motion, tolerance)?,
            hubness: GrowingHubness::default(),
            segments: Segments::one(0),
            room: 0,
            isa: Isa::best(),
        })
    }

    pub(crate) fn set_isa(&mut self, isa: Isa) {
        self.isa = isa;
    }

    pub(crate) fn places(&self) -> usize {
        self.segments.places()
    }

    /// Places that there is memory for.
    pub(crate) fn room(&self) -> usize {
        self.room
    }

    /// Bytes of memory for each place.
    pub(crate) fn bytes_a_place(&self) -> usize {
        Tracker::bytes_a_place(&self.motion) + GrowingHubness::BYTES_A_PLACE
    }

    /// Makes room for `places` in all.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough. The filter is then as it was.
    pub(crate) fn reserve(&mut self, places: usize) -> Result<(), Error> {
        if places > self.room {
            self.hubness.reserve(places)?;
            self.tracker.reserve(places)?;
            self.room = places;
        }
        Ok(())
    }

    /// One place more, for which there is room; the first of a segment if it is `new`.
    pub(crate) fn grow(&mut self, new: bool) {
        debug_assert!(self.places() < self.room, "reserved by the caller");
        self.segments.lengthen(new);
        self.hubness.grow();
        self.tracker.grow(self.segments.places());
    }

    /// The robot may be anywhere, and most likely off the map.
    pub(crate) fn gap(&mut self) {
        self.tracker.leave();
    }

    /// The robot has moved while there were no queries.
    pub(crate) fn moved(&mut self, advance: f64) {
        self.tracker.moved(advance);
    }

    /// Takes a query's distances to all places, of which there are at least two. Those of a query
    /// that shows nothing are equal.
    pub(crate) fn push(&mut self, column: &[f32], advance: Option<f64>) -> Track {
        self.isa.run(Push { filter: self, column, advance })
    }

    /// The belief in each place.
    pub(crate) fn belief(&self) -> impl Iterator<Item = f64> {
        self.tracker.belief_in(self.places())
    }
}

/// One query, compiled for each instruction set.
struct Push<'a> {
    filter: &'a mut LoopFilter,
    column: &'a [f32],
    advance: Option<f64>,
}

impl Compiled for Push<'_> {
    type Out = Track;

    #[inline(always)]
    fn run(self) -> Track {
        let Self { filter, column, advance } = self;
        let LoopFilter { motion, tracker, hubness, segments, .. } = filter;
        let z = hubness.learn(column, motion);
        tracker.follow(column, z, advance, segments)
    }
}
