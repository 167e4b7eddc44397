//! The tracker (method 1.9): a recursive Bayes filter over places, speeds and one state off the
//! map.
//!
//! | | | file |
//! |---|---|---|
//! | 1 | hubness | `hubness.rs` |
//! | 2 | evidence | `evidence.rs` |
//! | 3 | motion | `steps.rs` |
//! | 4 | prediction | `predict.rs` |
//! | 5 | update | `update.rs` |
//! | 6 | answer | `answer.rs` |
//!
//! A belief is kept per speed and place, after the change of speed that comes before the next move,
//! and not yet divided by its total.

mod align;
mod answer;
#[cfg(test)]
mod answer_tests;
mod evidence;
mod exp;
mod growing;
mod hubness;
mod later;
mod line;
mod links;
#[cfg(test)]
mod moments_tests;
mod novelty;
mod part;
mod predict;
mod said;
mod state;
mod steps;
#[cfg(test)]
mod tests;
mod update;
#[cfg(test)]
mod walks;
mod whole;

use super::estimator::{Estimator, Memory, Seen};
use super::window::{Exact, Window};
use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;
use crate::segments::Segments;
use crate::sums::{BLOCK, CHUNK};
pub use align::Aligned;
pub(crate) use align::{Aligner, Source, stretch};
pub use answer::Track;
use evidence::{Evidence, Says};
pub(super) use growing::GrowingHubness;
pub(super) use hubness::Hubness;
use links::Links;
use novelty::{Novelty, View};
pub(super) use part::{PartState, TrackerPart};
use predict::{Prediction, Step, each_row};
pub(super) use said::counted;
pub(super) use said::{TrackFirst, TrackFirstSaid, TrackSecond, TrackSecondSaid};
pub(super) use state::Saved;
use state::State;
use steps::{Steps, Way, lost};
use update::{After, Whole, on};
pub(super) use whole::{TrackDecided, TrackerWhole, WholeState};

/// The estimator of all queries so far.
#[derive(Clone, Debug)]
pub(super) struct Tracker {
    motion: Motion,
    tolerance: usize,
    steps: Steps,
    /// If the route has any.
    links: Option<Links>,
    hubness: Hubness,
    /// The belief, speed by speed and place by place, times `state.scale`. Only the first speed's
    /// row counts if they are `joint`. On a route that grows, rows have room for more places, at
    /// which they are 0.
    mass: Vec<f64>,
    /// That of the query before; then memory for the next.
    before: Vec<f64>,
    state: State,
    view: View,
    scratch: Scratch,
}

#[derive(Clone, Debug, Default)]
struct Scratch {
    /// A chunk's belief for each speed.
    chunk: Vec<f64>,
    /// The belief in each place, if there are several speeds.
    places: Vec<f64>,
    /// The sum of each chunk.
    sums: Vec<f64>,
    /// A number for each block.
    blocks: Vec<f64>,
}

impl Tracker {
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(super) fn new(
        motion: &Motion,
        tolerance: usize,
        segments: &Segments,
    ) -> Result<Self, Error> {
        let (places, speeds) = (segments.places(), motion.speeds.len());
        let zeros = |count: Option<usize>| {
            let count = count.ok_or(Error::Memory { places, columns: speeds })?;
            let mut zeros = reserved(count)?;
            zeros.resize(count, 0.0);
            Ok::<_, Error>(zeros)
        };
        let several = if speeds > 1 { places } else { 0 };
        let mut tracker = Self {
            motion: motion.clone(),
            tolerance,
            steps: Steps::new(motion)?,
            links: Links::new(segments),
            hubness: Hubness::new(places)?,
            mass: zeros(places.checked_mul(speeds))?,
            before: zeros(places.checked_mul(speeds))?,
            state: State::START,
            view: View::new(places, motion)?,
            scratch: Scratch {
                chunk: zeros(Some(speeds * CHUNK))?,
                places: zeros(Some(several))?,
                sums: zeros(Some(places.div_ceil(CHUNK)))?,
                blocks: zeros(Some(places.div_ceil(BLOCK)))?,
            },
        };
        tracker.clear();
        Ok(tracker)
    }

    /// The belief in each place after the newest query.
    pub(super) fn belief(&self) -> impl Iterator<Item = f64> {
        let Self { mass, state, hubness, .. } = self;
        let places = hubness.sums.len();
        // The state's own numbers: a restored tracker has no others.
        let rows = if state.joint { &mass[..places] } else { &mass[..] };
        let sum = move |place: usize| rows[place..].iter().step_by(places).sum::<f64>();
        (0..places).map(move |place| state.scale * sum(place))
    }

    /// The robot has moved by `advance` places while there were no queries.
    pub(super) fn moved(&mut self, advance: f64) {
        let pending = self.state.pending.get_or_insert(0.0);
        *pending += advance;
    }

    /// Forgets the statistics of the drive, too.
    pub(super) fn reset(&mut self) {
        self.clear();
        self.hubness.clear();
        self.state.travelled = 0.0;
    }
}

impl Estimator for Tracker {
    type Answer = Track;

    fn memory(&self) -> Memory {
        Memory::Whole
    }

    /// The robot may be anywhere. What the drive has taught about the places stays.
    fn clear(&mut self) {
        let Self { mass, state, view, .. } = self;
        view.known = false;
        let places = self.hubness.sums.len();
        mass[..places].fill(1.0 / places as f64);
        let travelled = state.travelled;
        *state = State { travelled, ..State::START };
    }

    #[inline(always)]
    fn estimate<E: Exact>(&mut self, window: &mut Window, seen: &Seen<'_>, ask: &mut E) -> Track {
        let column = window.newest(ask).unwrap_or_default();
        let taken = self.take(column, seen.evidence, seen.advance, seen.segments);
        // 6 The answer.
        self.answer(&taken, seen.segments)
    }
}

/// What one query did to the belief.
struct Taken<'a> {
    advance: Option<f64>,
    evidence: Evidence<'a>,
    novelty: Novelty,
    step: Step,
    prediction: Prediction,
}

impl Tracker {
    /// Steps 1 to 5 of one query. `z` is what several techniques say together, in place of the
    /// column.
    #[inline(always)]
    fn take<'a>(
        &mut self,
        column: &[f32],
        z: Option<&'a [f64]>,
        advance: Option<f64>,
        segments: &Segments,
    ) -> Taken<'a> {
        let advance = match (advance, self.state.pending.take()) {
            (Some(advance), gap) => Some(advance + gap.unwrap_or(0.0)),
            (None, gap) => gap,
        };

        // 1, 2 What the column says.
        let says = match z {
            Some(z) => Says::Fused(z),
            None => match self.hubness.learn(column, &self.motion) {
                Some(standard) => Says::Column(standard),
                None => Says::Nothing,
            },
        };
        let correlation = self.view.correlation(says, column, &self.hubness);
        let novelty = Novelty::new(advance, correlation, self.state.fresh, &self.motion);
        let weight = self.motion.evidence * novelty.evidence;
        let evidence = Evidence { says, weight, clip: self.motion.clip };

        // 3, 4 Where the belief goes, and what it gives to the rest of the route and to the state
        // off the map.
        let step = self.step(advance, novelty);
        let prediction = self.predict(step, novelty, segments);

        // 5 What is believed now.
        self.update(column, evidence, step, prediction, segments);
        Taken { advance, evidence, novelty, step, prediction }
    }
}

/// Adds the rows of the other speeds to that of the first.
#[inline(always)]
fn fold(first: &mut [f64], others: &[f64]) {
    for other in others.chunks_exact(first.len()) {
        for (sum, &mass) in first.iter_mut().zip(other) {
            *sum += mass;
        }
    }
}

impl Tracker {
    /// Takes the advance, if it is known. The speeds are equally likely then, so that their sum is
    /// enough.
    #[inline(always)]
    fn step(&mut self, advance: Option<f64>, novelty: Novelty) -> Step {
        let Self { motion, mass, before, state, .. } = self;
        std::mem::swap(mass, before);
        let step = Step::new(motion, state, advance, novelty);
        if advance.is_some() && !state.joint {
            let row = before.len() / motion.speeds.len();
            let (first, others) = before.split_at_mut(row);
            fold(first, others);
        }
        state.travelled = advance.map_or(state.travelled, |advance| state.travelled + advance);
        step
    }

    /// How the places follow each other.
    fn way<'a>(&'a self, segments: &'a Segments) -> Way<'a> {
        Way { segments, links: self.links.as_ref() }
    }

    fn predict(&mut self, step: Step, novelty: Novelty, segments: &Segments) -> Prediction {
        let mut blocks = std::mem::take(&mut self.scratch.blocks);
        blocks.fill(0.0);
        let row_length = self.before.len() / self.motion.speeds.len();
        each_row(&self.steps, step, |row, taps, share| {
            let row = &self.before[row * row_length..][..segments.places()];
            lost(row, 0, taps, share, self.way(segments), &mut blocks);
        });
        let lost = blocks.iter().sum::<f64>();
        self.scratch.blocks = blocks;
        let Self { motion, state, .. } = self;
        Prediction::new(motion, state, step, novelty, lost, segments.places())
    }

    /// The update: what is believed now.
    #[inline(always)]
    fn update(
        &mut self,
        column: &[f32],
        evidence: Evidence<'_>,
        step: Step,
        prediction: Prediction,
        segments: &Segments,
    ) {
        let Self { motion, steps, links, hubness, mass, before, state, scratch, .. } = self;
        let way = Way { segments, links: links.as_ref() };
        let before = Whole { rows: before, length: before.len() / motion.speeds.len(), way };
        let Scratch { chunk, places, sums, blocks } = scratch;
        let mut after = After { mass, chunk, places, sums, evidence: blocks };
        let moves = prediction.moves(steps, step);
        moves.update(column, &hubness.sums, evidence, &before, &mut after);
        let evidence = blocks.iter().sum::<f64>() / column.len() as f64;
        state.update(on(sums), prediction, evidence, step, motion.speeds.len());
    }
}
