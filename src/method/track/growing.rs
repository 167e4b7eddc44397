//! A tracker on a route that grows by a place a query (method 1.14): rows with room for more, and
//! the hubness of places that were not there from the start.

use super::hubness::FLAT;
use super::novelty::View;
use super::state::State;
use super::steps::Steps;
use super::{Hubness, Scratch, Tracker};
use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;
use crate::segments::Segments;
use crate::sums::{BLOCK, CHUNK, sum, sum_of};

impl Tracker {
    /// On a route of no places: the robot is off the map.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(in crate::method) fn of_no_places(
        motion: &Motion,
        tolerance: usize,
    ) -> Result<Self, Error> {
        let chunk = vec![0.0; motion.speeds.len() * CHUNK];
        Ok(Self {
            motion: motion.clone(),
            tolerance,
            steps: Steps::new(motion)?,
            links: None,
            // What a query says comes from `GrowingHubness`.
            hubness: Hubness::new(0)?,
            mass: Vec::new(),
            before: Vec::new(),
            state: State::OFF_THE_MAP,
            view: View::new(0, motion)?,
            scratch: Scratch { chunk, ..Scratch::default() },
        })
    }

    /// Bytes of memory for each place.
    pub(in crate::method) fn bytes_a_place(motion: &Motion) -> usize {
        let several = usize::from(motion.speeds.len() > 1);
        let viewed = usize::from(motion.repeat < 1.0);
        (2 * motion.speeds.len() + several + viewed) * size_of::<f64>()
    }

    /// Makes room for `places` in all, more than there is room for.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough. The tracker is then as it was.
    pub(in crate::method) fn reserve(&mut self, places: usize) -> Result<(), Error> {
        let Self { motion, mass, before, view, scratch, .. } = self;
        let speeds = motion.speeds.len();
        let count = places.checked_mul(speeds).ok_or(Error::Memory { places, columns: speeds })?;
        let (mut longer, mut spare) = (reserved(count)?, reserved(count)?);
        let kept = |numbers: &[f64], capacity: usize| {
            let mut longer = reserved(capacity)?;
            longer.extend_from_slice(numbers);
            Ok::<_, Error>(longer)
        };
        let of_places = kept(&scratch.places, if speeds > 1 { places } else { 0 })?;
        let sums = kept(&scratch.sums, places.div_ceil(CHUNK))?;
        let blocks = reserved(places.div_ceil(BLOCK))?;
        view.reserve(places, motion)?;
        let row = mass.len() / speeds;
        for speed in 0..speeds {
            longer.extend_from_slice(&mass[speed * row..][..row]);
            longer.resize((speed + 1) * places, 0.0);
        }
        spare.resize(count, 0.0);
        (*mass, *before) = (longer, spare);
        (scratch.places, scratch.sums, scratch.blocks) = (of_places, sums, blocks);
        Ok(())
    }

    /// One place more, the last of `places`, for which there is room. It has no belief of its own.
    pub(in crate::method) fn grow(&mut self, places: usize) {
        let Self { motion, view, scratch, .. } = self;
        view.grow(motion);
        if motion.speeds.len() > 1 {
            scratch.places.push(0.0);
        }
        scratch.sums.resize(places.div_ceil(CHUNK), 0.0);
        scratch.blocks.resize(places.div_ceil(BLOCK), 0.0);
    }

    /// The robot is off the map.
    pub(in crate::method) fn leave(&mut self) {
        let Self { mass, state, view, .. } = self;
        mass.fill(0.0);
        view.known = false;
        *state = State { travelled: state.travelled, ..State::OFF_THE_MAP };
    }

    /// The answer to a column. `z` is what it says, if it says anything; else the column is
    /// constant.
    #[inline(always)]
    pub(in crate::method) fn follow(
        &mut self,
        column: &[f32],
        z: Option<&[f64]>,
        advance: Option<f64>,
        segments: &Segments,
    ) -> super::Track {
        let taken = self.take(column, z, advance, segments);
        self.answer(&taken, segments)
    }

    /// The belief in each of the first places.
    pub(in crate::method) fn belief_in(&self, places: usize) -> impl Iterator<Item = f64> {
        let Self { mass, state, motion, .. } = self;
        let row = mass.len() / motion.speeds.len();
        let rows = if state.joint { &mass[..row] } else { &mass[..] };
        let sum = move |place: usize| rows[place..].iter().step_by(row.max(1)).sum::<f64>();
        (0..places).map(move |place| state.scale * sum(place))
    }
}

/// The mean of what each place's distances are beyond those of all places, over the columns that
/// it was there for. (On a route that does not grow, that is the mean of its distances, but for a
/// constant.)
#[derive(Clone, Debug, Default)]
pub(in crate::method) struct GrowingHubness {
    /// The sum over the columns of the distance minus the column's mean.
    sums: Vec<f64>,
    /// The columns before the place was there.
    before: Vec<u64>,
    columns: u64,
    /// What the newest column says.
    z: Vec<f64>,
}

impl GrowingHubness {
    pub(in crate::method) const BYTES_A_PLACE: usize = 2 * size_of::<f64>() + size_of::<u64>();

    /// Makes room for `places` in all.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(in crate::method) fn reserve(&mut self, places: usize) -> Result<(), Error> {
        let Self { sums, before, z, .. } = self;
        let more = places.saturating_sub(sums.len());
        let refused = |_| Error::Memory { places, columns: 1 };
        sums.try_reserve_exact(more).map_err(refused)?;
        before.try_reserve_exact(more).map_err(refused)?;
        z.try_reserve_exact(more).map_err(refused)
    }

    /// One place more.
    pub(in crate::method) fn grow(&mut self) {
        self.sums.push(0.0);
        self.before.push(self.columns);
        self.z.push(0.0);
    }

    /// Adds a column; its `z`, clipped, or `None` if it says nothing: then nothing has changed.
    #[inline(always)]
    pub(in crate::method) fn learn(&mut self, column: &[f32], motion: &Motion) -> Option<&[f64]> {
        let first = *column.first()?;
        if column.iter().all(|&d| d == first) {
            return None;
        }
        let Self { sums, before, columns, z } = self;
        let places = column.len() as f64;
        let mean = column.chunks(BLOCK).map(|block| sum_of(block, f64::from)).sum::<f64>() / places;
        *columns += 1;
        let known = sums.iter_mut().zip(&*before);
        for ((z, &distance), (sum, &before)) in z.iter_mut().zip(column).zip(known) {
            let distance = f64::from(distance);
            *sum += distance - mean;
            *z = distance - *sum / ((*columns - before) as f64 + motion.hubness);
        }
        let centre = z.chunks(BLOCK).map(sum).sum::<f64>() / places;
        for z in &mut *z {
            *z -= centre;
        }
        let squares = z.chunks(BLOCK).map(|block| sum_of(block, |z| z * z)).sum::<f64>();
        let std = (squares / places).sqrt();
        let inverse = if std <= FLAT * mean.abs() { 0.0 } else { 1.0 / std };
        let clip = motion.clip;
        for z in &mut *z {
            *z = (*z * inverse).max(-clip).min(clip);
        }
        Some(z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Within what is reserved, no memory is taken, and no more than that is reserved.
    #[test]
    fn places_that_are_reserved_take_no_more_memory() {
        let mut blind = Motion::any();
        blind.repeat = 1.0;
        for motion in [Motion::loops(), Motion::steady(), Motion::any(), blind] {
            let mut tracker = Tracker::of_no_places(&motion, 1).unwrap();
            let mut hubness = GrowingHubness::default();
            let room = |tracker: &Tracker, hubness: &GrowingHubness| {
                let Tracker { scratch, view, .. } = tracker;
                let GrowingHubness { sums, before, z, .. } = hubness;
                [
                    sums.capacity(),
                    before.capacity(),
                    z.capacity(),
                    view.x.capacity(),
                    scratch.places.capacity(),
                    scratch.sums.capacity(),
                    scratch.blocks.capacity(),
                    view.blocks.capacity(),
                ]
            };
            let mut known = 0;
            for places in [300, 5000] {
                tracker.reserve(places).unwrap();
                hubness.reserve(places).unwrap();
                let [viewed, several] = [motion.repeat < 1.0, motion.speeds.len() > 1];
                let of = |given: bool| if given { places } else { 0 };
                let (chunks, blocks) = (places.div_ceil(CHUNK), places.div_ceil(BLOCK));
                let reserved = room(&tracker, &hubness);
                let exact = [places, places, places, of(viewed), of(several), chunks, blocks];
                assert_eq!(reserved[..7], exact);
                assert_eq!(viewed, reserved[7] >= blocks);
                for place in known..places {
                    tracker.grow(place + 1);
                    hubness.grow();
                }
                assert_eq!(room(&tracker, &hubness), reserved);
                known = places;
            }
        }
    }

    /// All of a first column is taken off if nothing is known beside it: what is left is rounding.
    #[test]
    fn a_column_of_which_rounding_is_left_says_nothing() {
        let mut motion = Motion::loops();
        motion.hubness = 0.0;
        for size in [1e-9, 1e-3, 1.0, 3e6_f32] {
            let mut hubness = GrowingHubness::default();
            let column: Vec<f32> =
                (0..500).map(|at| size * (1.0 + (at % 7) as f32 / 3.0)).collect();
            hubness.reserve(500).unwrap();
            for _ in &column {
                hubness.grow();
            }
            let z = hubness.learn(&column, &motion).unwrap();
            assert!(z.iter().all(|&z| z == 0.0), "{size}");
            let other: Vec<f32> = column.iter().rev().copied().collect();
            assert!(hubness.learn(&other, &motion).unwrap().iter().any(|&z| z != 0.0));
        }
    }
}
