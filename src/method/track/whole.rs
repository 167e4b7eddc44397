//! The driver's part of the tracker: all that is not known place by place.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::answer::{Belief, Track, asked};
use super::hubness::{BlockMoments, Spread, Standard};
use super::line::reach;
use super::novelty::{Novelty, about_all, correlation};
use super::predict::{Prediction, Step};
use super::said::{Numbers, TrackFirst, TrackFirstSaid, TrackSecond, TrackSecondSaid, counted};
use super::state::State;
use super::steps::Steps;
use super::update::on;
use crate::archive::Refusal;
use crate::error::Error;
use crate::method::layout::Layout;
use crate::motion::Motion;
use crate::segments::Segments;
use crate::sums::{BLOCK, CHUNK};

/// The state of a tracker whose belief is in shards.
#[derive(Clone, Debug)]
pub(in crate::method) struct TrackerWhole {
    motion: Motion,
    tolerance: usize,
    steps: Steps,
    segments: Segments,
    /// The places of each block, shard by shard.
    blocks: Vec<Vec<usize>>,
    routes: Routes,
    state: State,
    /// How many columns said something.
    columns: u64,
    /// Whether there is a view to compare with, and its moments.
    viewed: bool,
    view: Vec<BlockMoments>,
}

/// Whose belief goes where, for moves of some reach.
#[derive(Clone, Debug)]
struct Routes {
    reach: [usize; 2],
    /// The places that each shard is asked for.
    asked: Vec<Vec<Range<usize>>>,
    /// From which shards each one gets belief, and the index among what those are asked for, in
    /// order.
    needed: Vec<Vec<(usize, usize)>>,
}

/// What is known of a query after the first answers.
#[derive(Clone, Debug)]
pub(in crate::method) struct TrackDecided {
    advance: Option<f64>,
    says: Option<Standard>,
    view: Vec<BlockMoments>,
    viewed: bool,
    step: Step,
    prediction: Prediction,
}

/// Its state between two queries, beside [`TrackerWhole::view`].
#[derive(Serialize, Deserialize)]
pub(in crate::method) struct WholeState {
    state: State,
    columns: u64,
    viewed: bool,
}

impl Routes {
    fn new(segments: &Segments, cuts: &[Range<usize>], reach: [usize; 2]) -> Self {
        let mut asked: Vec<Vec<Range<usize>>> = vec![Vec::new(); cuts.len()];
        let needed = cuts.iter().map(|own| {
            let layout = Layout::new(segments, own.clone(), reach).with_junctions(segments);
            let mut needed = Vec::new();
            for (range, _) in layout.foreign() {
                let mut start = range.start;
                while start < range.end {
                    let shard = cuts.partition_point(|cut| cut.end <= start);
                    let Some(cut) = cuts.get(shard) else { break };
                    let end = range.end.min(cut.end);
                    needed.push((shard, asked[shard].len()));
                    asked[shard].push(start..end);
                    start = end;
                }
            }
            needed
        });
        let needed = needed.collect();
        Self { reach, asked, needed }
    }
}

impl TrackerWhole {
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(in crate::method) fn new(
        motion: &Motion,
        tolerance: usize,
        segments: &Segments,
        cuts: &[Range<usize>],
    ) -> Result<Self, Error> {
        let steps = Steps::new(motion)?;
        let of = |cut: &Range<usize>| {
            let starts = cut.clone().step_by(BLOCK);
            starts.map(|start| BLOCK.min(cut.end - start)).collect()
        };
        Ok(Self {
            motion: motion.clone(),
            tolerance,
            blocks: cuts.iter().map(of).collect(),
            routes: Routes::new(segments, cuts, reach(&steps, None)),
            steps,
            segments: segments.clone(),
            state: State::START,
            columns: 0,
            viewed: false,
            view: Vec::new(),
        })
    }

    /// As the tracker's: the robot may be anywhere.
    pub(in crate::method) fn clear(&mut self) {
        self.viewed = false;
        self.state = State { travelled: self.state.travelled, ..State::START };
    }

    /// As the tracker's: the robot has moved while there were no queries.
    pub(in crate::method) fn moved(&mut self, advance: f64) {
        *self.state.pending.get_or_insert(0.0) += advance;
    }

    /// As the tracker's: forgets the statistics of the drive, too.
    pub(in crate::method) fn reset(&mut self) {
        self.clear();
        self.columns = 0;
        self.state.travelled = 0.0;
    }

    /// The advance since the query before.
    fn advance(&self, given: Option<f64>) -> Option<f64> {
        match (given, self.state.pending) {
            (Some(advance), gap) => Some(advance + gap.unwrap_or(0.0)),
            (None, gap) => gap,
        }
    }

    /// What each shard is asked first.
    pub(in crate::method) fn first(
        &mut self,
        given: Option<f64>,
        cuts: &[Range<usize>],
    ) -> Vec<TrackFirst> {
        let advance = self.advance(given);
        let novelty = Novelty::new(advance, None, self.state.fresh, &self.motion);
        let step = Step::new(&self.motion, &self.state, advance, novelty);
        let reach = reach(&self.steps, Some(step));
        if self.routes.reach != reach {
            self.routes = Routes::new(&self.segments, cuts, reach);
        }
        let each = self.routes.asked.iter().map(|asked| TrackFirst {
            share: 1.0 / ((self.columns + 1) as f64 + self.motion.hubness),
            anywhere: self.state.fresh,
            compare: self.viewed,
            step,
            asked: asked.clone(),
        });
        each.collect()
    }

    /// What the shards' first answers come to, and what each is asked next. A query is `blank` if
    /// its column says nothing.
    ///
    /// # Errors
    /// [`Error::Shard`] for answers to other questions.
    pub(in crate::method) fn second(
        &self,
        said: &[&TrackFirstSaid],
        blank: bool,
        given: Option<f64>,
    ) -> Result<(TrackDecided, Vec<TrackSecond>), Error> {
        let Self { motion, state, segments, routes, .. } = self;
        let advance = self.advance(given);
        let mut moments = Vec::new();
        for (said, blocks) in said.iter().zip(&self.blocks) {
            moments.extend(said.moments(blocks, self.viewed)?);
        }

        // 1, 2 What the column says.
        let share = 1.0 / ((self.columns + 1) as f64 + motion.hubness);
        let says = (!blank).then(|| Standard::of(&moments, share));
        let (mut viewed, mut correlated) = (self.viewed, None);
        if let Some(standard) = says.filter(|_| motion.repeat < 1.0) {
            let flat = standard.inverse == 0.0;
            let spreads = [Spread::of(&moments), Spread::of(&self.view)];
            let together = said.iter().flat_map(|said| &said.together);
            let both = moments.iter().zip(&self.view).zip(together);
            let sum = both.fold(0.0, |sum, ((new, old), &together)| {
                sum + about_all(together, [(new, spreads[0]), (old, spreads[1])])
            });
            correlated = correlation(sum, spreads, flat, &mut viewed);
        }
        let novelty = Novelty::new(advance, correlated, state.fresh, motion);
        let weight = motion.evidence * novelty.evidence;

        // 3, 4 Where the belief goes.
        let step = Step::new(motion, state, advance, novelty);
        let lost = said.iter().flat_map(|said| &said.lost).sum::<f64>();
        let prediction = Prediction::new(motion, state, step, novelty, lost, segments.places());
        let second = routes.needed.iter().map(|needed| {
            let foreign = needed.iter().map(|&(shard, index)| {
                let place = routes.asked[shard][index].start;
                let belief = said.get(shard).and_then(|said| said.belief.get(index));
                Some((place, belief?.clone()))
            });
            let foreign = foreign.collect::<Option<Vec<(usize, Numbers)>>>();
            let expected = "the belief in the places that were asked for, got less".to_owned();
            let foreign = foreign.ok_or(Error::Shard { reason: format!("expected {expected}") })?;
            let reach = routes.reach;
            Ok(TrackSecond { says, weight, step, prediction, reach, foreign })
        });
        let second = second.collect::<Result<_, Error>>()?;
        let view = if says.is_some() && motion.repeat < 1.0 { moments } else { self.view.clone() };
        Ok((TrackDecided { advance, says, view, viewed, step, prediction }, second))
    }

    /// The track of the shards' second answers.
    ///
    /// # Errors
    /// [`Error::Shard`] for answers to other questions. The tracker is then as it was.
    pub(in crate::method) fn track(
        &mut self,
        decided: TrackDecided,
        said: &[&TrackSecondSaid],
    ) -> Result<Track, Error> {
        let (places, mut blocks, mut chunks) = (self.segments.places(), 0.0, Vec::new());
        for (said, own) in said.iter().zip(&self.blocks) {
            counted("sums of evidence", own.len(), said.evidence.len())?;
            let count = own.iter().map(|places| places.div_ceil(CHUNK)).sum();
            counted("sums of chunks", count, said.sums.len())?;
            blocks = said.evidence.iter().fold(blocks, |sum, evidence| sum + evidence);
            chunks.extend_from_slice(&said.sums);
        }
        let mut best = (0, f64::NEG_INFINITY, 0.0);
        for &&TrackSecondSaid { best: (place, mass), speed, .. } in said {
            if mass > best.1 {
                best = (place, mass, speed);
            }
        }
        let (place, _, speed) = best;
        let mut masses: Vec<(usize, &[f64])> = Vec::new();
        for (chunk, Numbers(numbers)) in said.iter().flat_map(|said| &said.masses) {
            let start = chunk.saturating_mul(CHUNK).min(places);
            counted("masses of a chunk", CHUNK.min(places - start), numbers.len())?;
            masses.push((*chunk, numbers));
        }
        masses.sort_unstable_by_key(|&(chunk, _)| chunk);
        let of = |chunk: usize| {
            let index = masses.binary_search_by_key(&chunk, |&(chunk, _)| chunk).ok()?;
            Some(masses[index].1)
        };
        if place >= places
            || asked(place, self.tolerance, &self.segments).any(|at| of(at).is_none())
        {
            let reason = format!("expected the masses near place {place}, got others");
            return Err(Error::Shard { reason });
        }

        let TrackDecided { advance, says, view, viewed, step, prediction } = decided;
        let state = &mut self.state;
        state.pending = None;
        state.travelled = advance.map_or(state.travelled, |advance| state.travelled + advance);
        state.update(
            on(&chunks),
            prediction,
            blocks / places as f64,
            step,
            self.steps.shares.len(),
        );
        self.columns += u64::from(says.is_some());
        (self.view, self.viewed) = (view, viewed);
        let State { on, off, scale, .. } = *state;
        let mass = |range: Range<usize>| {
            let chunk = of(range.start / CHUNK).unwrap_or_default();
            let start = range.start % CHUNK;
            chunk.get(start..start + range.len()).unwrap_or_default()
        };
        let belief = Belief { places, mass, sums: &chunks, on, off, scale };
        Ok(belief.answer(place, self.tolerance, &self.segments, advance.unwrap_or(speed)))
    }

    pub(in crate::method) fn saved(&self) -> WholeState {
        let Self { state, columns, viewed, .. } = *self;
        WholeState { state, columns, viewed }
    }

    /// The moments of each block of the view before, if there is one.
    pub(in crate::method) fn view(&self) -> Vec<f64> {
        self.view.iter().flat_map(|block| [block.x, block.squares]).collect()
    }

    /// Goes on from a state.
    ///
    /// # Errors
    /// One that no queries can have led to.
    pub(in crate::method) fn resume(
        &mut self,
        saved: &WholeState,
        view: &[f64],
    ) -> Result<(), Refusal> {
        let WholeState { state, columns, viewed } = *saved;
        let blocks = self.blocks.iter().flatten();
        let viewing = view.is_empty() && !viewed || view.len() == 2 * blocks.clone().count();
        if !viewing || !state.is_possible() {
            return Err(Refusal::Foreign("an impossible belief".to_owned()));
        }
        (self.state, self.columns, self.viewed) = (state, columns, viewed);
        let of = |(&[x, squares], &places): (&[f64; 2], &usize)| BlockMoments {
            places,
            x,
            squares,
            distance: 0.0,
        };
        self.view = view.as_chunks().0.iter().zip(blocks).map(of).collect();
        Ok(())
    }
}
