//! A shard's part of the tracker: what is known of its own places.

use std::collections::BTreeSet;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::answer::{FINE, asked, most_probable};
use super::evidence::{Evidence, Says};
use super::hubness::{BlockMoments, Hubness, add};
use super::line::{Line, OnLine, reach};
use super::links::Links;
use super::novelty::{Together, View};
use super::predict::{Step, each_row};
use super::said::{Numbers, TrackFirst, TrackFirstSaid, TrackSecond, TrackSecondSaid};
use super::steps::{Steps, Way, lost};
use super::update::After;
use super::{Scratch, fold};
use crate::archive::{Refusal, Tensors};
use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;
use crate::segments::{Segment, Segments};
use crate::sums::{BLOCK, CHUNK};

/// The sums of the distances at the start of a drive.
static NO_SUMS: [f64; BLOCK] = [0.0; BLOCK];

/// The names of its tensors.
const TENSORS: [&str; 3] = ["track.sums", "track.mass", "track.corrected"];

/// The belief in a shard's own places.
#[derive(Clone, Debug)]
pub(in crate::method) struct TrackerPart {
    motion: Motion,
    tolerance: usize,
    steps: Steps,
    /// Those of the whole route.
    segments: Segments,
    links: Option<Links>,
    own: Range<usize>,
    hubness: Hubness,
    /// Speed by speed and place by place, as the tracker's.
    mass: Vec<f64>,
    /// Whether only the first row of it counts.
    joint: bool,
    view: View,
    /// The belief before the move, from where it moves to own places.
    line: Line,
    /// One row of the belief, if it is not as in `mass`.
    folded: Vec<f64>,
    /// What the column in hand comes to.
    moments: Vec<BlockMoments>,
    scratch: Scratch,
}

/// Its state beside its tensors.
#[derive(Debug, Serialize, Deserialize)]
pub(in crate::method) struct PartState {
    columns: u64,
    joint: bool,
    viewed: bool,
}

impl TrackerPart {
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(in crate::method) fn new(
        motion: &Motion,
        tolerance: usize,
        segments: &Segments,
        own: Range<usize>,
    ) -> Result<Self, Error> {
        let (places, speeds) = (own.len(), motion.speeds.len());
        let zeros = |count: usize| {
            let mut zeros = reserved(count)?;
            zeros.resize(count, 0.0);
            Ok::<_, Error>(zeros)
        };
        let count = places.checked_mul(speeds).ok_or(Error::Memory { places, columns: speeds })?;
        let steps = Steps::new(motion)?;
        let reach = reach(&steps, None);
        Ok(Self {
            motion: motion.clone(),
            tolerance,
            steps,
            links: Links::new(segments),
            hubness: Hubness::new(places)?,
            mass: zeros(count)?,
            joint: true,
            view: View::new(places, motion)?,
            line: Line::new(segments, own.clone(), reach),
            folded: zeros(places)?,
            moments: vec![BlockMoments::default(); places.div_ceil(BLOCK)],
            scratch: Scratch {
                chunk: zeros(speeds * CHUNK)?,
                places: zeros(if speeds > 1 { places } else { 0 })?,
                sums: zeros(places.div_ceil(CHUNK))?,
                blocks: zeros(places.div_ceil(BLOCK))?,
            },
            segments: segments.clone(),
            own,
        })
    }

    /// What a column of its own places says. Nothing changes but the query in hand. The drive is
    /// `fresh` if it is the first.
    ///
    /// # Errors
    /// [`Error::Shard`] if it is asked for the belief in other places.
    #[inline(always)]
    pub(in crate::method) fn first(
        &mut self,
        column: &[f32],
        fresh: bool,
        asked: &TrackFirst,
    ) -> Result<TrackFirstSaid, Error> {
        let outside = |range: &&Range<usize>| {
            range.start < self.own.start || range.end > self.own.end || range.is_empty()
        };
        if let Some(range) = asked.asked.iter().find(outside) {
            let Range { start, end } = &self.own;
            let reason = format!(
                "expected places from {start} to {end} to be asked for, got {} to {}",
                range.start, range.end
            );
            return Err(Error::Shard { reason });
        }
        let mut together = Vec::new();
        let (sums, share) = (&self.hubness.sums, asked.share);
        let mut x = [0.0; CHUNK];
        for (block, column) in column.chunks(BLOCK).enumerate() {
            let start = block * BLOCK;
            let sums =
                if fresh { &NO_SUMS[..column.len()] } else { &sums[start..][..column.len()] };
            let moments = BlockMoments::of(column, sums, share);
            self.moments[block] = moments;
            if asked.compare {
                let mut both = Together::new(&moments, &self.view.blocks[block]);
                let before = self.view.x[start..].chunks(CHUNK);
                let chunks = column.chunks(CHUNK).zip(sums.chunks(CHUNK)).zip(before);
                for ((column, sums), before) in chunks {
                    let x = &mut x[..column.len()];
                    corrected_next(column, sums, share, x);
                    both.add(x, before);
                }
                together.push(both.total());
            }
        }
        self.fold(asked);
        let (rows, length) = self.rows(asked);
        let mut blocks = vec![0.0; self.moments.len()];
        let way = Way { segments: &self.segments, links: self.links.as_ref() };
        each_row(&self.steps, asked.step, |row, taps, share| {
            let row = &rows[row * length..][..length];
            lost(row, self.own.start, taps, share, way, &mut blocks);
        });
        let count = self.count(asked);
        let belief = asked.asked.iter().map(|range| {
            let places = range.start - self.own.start..range.end - self.own.start;
            let of = |row: usize| &rows[row * length..][places.clone()];
            Numbers((0..count).flat_map(of).copied().collect())
        });
        Ok(TrackFirstSaid {
            moments: self.moments.iter().flat_map(|b| [b.distance, b.x, b.squares]).collect(),
            together,
            lost: blocks,
            belief: belief.collect(),
        })
    }

    /// Makes the one row that counts, if it is not there.
    fn fold(&mut self, asked: &TrackFirst) {
        let is_folded = self.is_folded(asked);
        let Self { mass, folded, segments, .. } = self;
        if asked.anywhere {
            folded.fill(1.0 / segments.places() as f64);
        } else if is_folded {
            let (first, others) = mass.split_at(folded.len());
            folded.copy_from_slice(first);
            fold(folded, others);
        }
    }

    /// Whether one row that is not in `mass` counts.
    fn is_folded(&self, asked: &TrackFirst) -> bool {
        asked.anywhere || !(self.joint || matches!(asked.step, Step::Speeds { .. }))
    }

    /// The rows of the belief before the move, and the length of one.
    fn rows(&self, asked: &TrackFirst) -> (&[f64], usize) {
        let folded = self.is_folded(asked);
        (if folded { &self.folded } else { &self.mass }, self.folded.len())
    }

    /// How many of them count.
    fn count(&self, asked: &TrackFirst) -> usize {
        let one = asked.anywhere || self.joint || matches!(asked.step, Step::Known { .. });
        if one { 1 } else { self.steps.shares.len() }
    }

    /// Takes the belief in the places of others.
    ///
    /// # Errors
    /// [`Error::Shard`] unless it is there for all of them. Nothing has changed then.
    pub(in crate::method) fn receive(
        &mut self,
        first: &TrackFirst,
        asked: &TrackSecond,
    ) -> Result<(), Error> {
        if self.line.reach() != asked.reach {
            self.line = Line::new(&self.segments, self.own.clone(), asked.reach);
        }
        let mut line = std::mem::take(&mut self.line.mass);
        let (rows, _) = self.rows(first);
        let filled = self.line.fill(&mut line, self.count(first), rows, &asked.foreign);
        self.line.mass = line;
        filled
    }

    /// Keeps the column, and updates the belief, whose move [`receive`](Self::receive) has begun.
    #[inline(always)]
    pub(in crate::method) fn second(
        &mut self,
        column: &[f32],
        fresh: bool,
        asked: &TrackSecond,
    ) -> TrackSecondSaid {
        let Self { motion, steps, hubness, view, .. } = self;
        if fresh {
            hubness.clear();
        }
        let says = match asked.says {
            None => Says::Nothing,
            Some(standard) => {
                add(column, &mut hubness.sums);
                hubness.columns += 1;
                view.take(column, &hubness.sums, standard, &self.moments);
                Says::Column(standard)
            }
        };
        let evidence = Evidence { says, weight: asked.weight, clip: motion.clip };
        let before = OnLine { line: &self.line, links: self.links.as_ref() };
        let Scratch { chunk, places, sums, blocks } = &mut self.scratch;
        let mass = &mut self.mass[..];
        let mut after = After { mass, chunk, places, sums, evidence: blocks };
        let moves = asked.prediction.moves(steps, asked.step);
        moves.update(column, &hubness.sums, evidence, &before, &mut after);
        self.joint = matches!(asked.step, Step::Known { .. }) || steps.shares.len() == 1;
        let Scratch { places, sums, blocks, .. } = &self.scratch;
        let masses = if self.joint { &self.mass[..self.own.len()] } else { &places[..] };
        let (at, mass) = most_probable(masses);
        let speed = match asked.step {
            Step::Known { .. } => 0.0,
            Step::Speeds { .. } => moves.speed(&before, motion, at),
        };
        let best = self.own.start + at;
        let masses = self.chunks(best).into_iter().map(|chunk| {
            let start = chunk * CHUNK - self.own.start;
            (chunk, Numbers(masses[start..masses.len().min(start + CHUNK)].to_vec()))
        });
        let masses = masses.collect();
        let (evidence, sums) = (blocks.clone(), sums.clone());
        TrackSecondSaid { evidence, sums, best: (best, mass), speed, masses }
    }

    /// The chunks whose masses the answer may need, if the most probable of the own places is
    /// `best`: those near it, and those near a border, beyond which the most probable place may lie.
    fn chunks(&self, best: usize) -> BTreeSet<usize> {
        let Self { own, segments, tolerance, .. } = self;
        let all = own.start / CHUNK..own.end.div_ceil(CHUNK);
        if segments.places() <= FINE {
            return all.collect();
        }
        let near = tolerance.saturating_add(1);
        let within = |from: usize, to: usize| {
            let (from, to) = (from.max(own.start), to.min(own.end));
            if from < to { from / CHUNK..(to - 1) / CHUNK + 1 } else { 0..0 }
        };
        let first = |from: usize| within(from, from.saturating_add(near));
        let last = |to: usize| within(to.saturating_sub(near), to);
        let mut chunks: BTreeSet<usize> = asked(best, *tolerance, segments).collect();
        chunks.retain(|chunk| all.contains(chunk));
        chunks.extend(first(own.start).chain(last(own.end)));
        for &Segment { start, end, closed } in segments.within(own.clone()) {
            if closed && (start < own.start || end > own.end) {
                chunks.extend(first(start).chain(last(end)));
            }
        }
        chunks
    }
}

/// The `x` of some places, given the sums before their distances.
#[inline(always)]
fn corrected_next(column: &[f32], sums: &[f64], share: f64, x: &mut [f64]) {
    for (x, (&distance, &sum)) in x.iter_mut().zip(column.iter().zip(sums)) {
        *x = super::hubness::corrected(distance, sum + f64::from(distance), share);
    }
}

/// Snapshots.
impl TrackerPart {
    pub(in crate::method) fn state(&self) -> PartState {
        let (columns, viewed) = (self.hubness.columns, self.view.known);
        PartState { columns, joint: self.joint, viewed }
    }

    pub(in crate::method) fn tensors(&self) -> [(&'static str, &[f64]); 3] {
        let count = if self.joint { self.own.len() } else { self.mass.len() };
        let numbers = [&self.hubness.sums[..], &self.mass[..count], &self.view.x[..]];
        std::array::from_fn(|index| (TENSORS[index], numbers[index]))
    }

    /// The part that goes on from a state.
    ///
    /// # Errors
    /// One that no queries can have led to.
    pub(in crate::method) fn resumed(
        &self,
        state: &PartState,
        tensors: &Tensors<'_>,
    ) -> Result<Self, Refusal> {
        let numbers = |index: usize, length: usize| {
            let fits = |shape: &[usize]| shape == [length];
            let tensor = tensors.required::<f64>(TENSORS[index], &format!("({length})"), fits);
            tensor.map(|(_, numbers)| numbers)
        };
        let PartState { columns, joint, viewed } = *state;
        let sums = numbers(0, self.own.len())?;
        let mass = numbers(1, if joint { self.own.len() } else { self.mass.len() })?;
        let x = numbers(2, self.view.x.len())?;
        let hubness = Hubness::resumed(columns, sums);
        let known = mass.iter().all(|mass| mass.is_finite() && *mass >= 0.0)
            && x.iter().all(|x| x.is_finite());
        let (Some(hubness), true) = (hubness, known) else {
            return Err(Refusal::Foreign("an impossible belief".to_owned()));
        };
        let mut part = Self { hubness, joint, view: View::of(x, viewed), ..self.clone() };
        part.mass[..mass.len()].copy_from_slice(&mass);
        Ok(part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_other_places_than_its_own_are_asked_for() {
        let segments = Segments::one(3 * BLOCK);
        let own = BLOCK..2 * BLOCK;
        let mut part = TrackerPart::new(&Motion::any(), 1, &segments, own.clone()).unwrap();
        let column: Vec<f32> = (0..BLOCK).map(|place| (place * 7 % 64) as f32).collect();
        for (range, known) in [
            (own.clone(), true),
            (own.start..own.start + 1, true),
            (own.end - 1..own.end, true),
            (own.start - 1..own.start + 1, false),
            (own.end - 1..own.end + 1, false),
            (0..3 * BLOCK, false),
            (own.start + 5..own.start + 5, false),
            (0..1, false),
            (2 * BLOCK..2 * BLOCK + 1, false),
        ] {
            let step = Step::Speeds { joint: true, moved: 1.0 };
            let asked = vec![own.clone(), range.clone()];
            let first = TrackFirst { share: 0.5, anywhere: true, compare: false, step, asked };
            match part.first(&column, true, &first) {
                Ok(said) => assert!(known && said.belief[1].0.len() == range.len(), "{range:?}"),
                Err(refused) => assert!(!known && matches!(refused, Error::Shard { .. })),
            }
        }
    }

    /// Whichever place is the most probable of all, the shards send what its answer needs; of a long
    /// route not much more.
    #[test]
    fn masses_near_any_place_that_may_win_are_sent() {
        let list = [(0, 20_000), (20_000, 26_000), (26_000, 33_000), (33_000, 70_000)];
        for closed in 0..16_u8 {
            let of = |(at, &(start, end)): (usize, &(usize, usize))| Segment {
                start,
                end,
                closed: closed >> at & 1 == 1,
            };
            let segments = Segments::of_list(list.iter().enumerate().map(of).collect());
            for (own, tolerance) in
                [4..7, 5..9, 0..8, 8..18].into_iter().zip([0, 1, 300, 5000].into_iter().cycle())
            {
                let own = own.start * BLOCK..(own.end * BLOCK).min(70_000);
                let motion = Motion::steady();
                let part = TrackerPart::new(&motion, tolerance, &segments, own.clone()).unwrap();
                let sent = part.chunks(own.start + 4000);
                let here = own.start / CHUNK..own.end.div_ceil(CHUNK);
                assert!(sent.iter().all(|chunk| here.contains(chunk)));
                let others =
                    (0..70_000).step_by(67).chain(list.iter().flat_map(|&(start, end)| {
                        [start, start + 1, end - 1, end - 2, start + tolerance, end - 1 - tolerance]
                    }));
                let borders =
                    [own.start.wrapping_sub(1), own.start.wrapping_sub(2), own.end, own.end + 1];
                let others = others.chain(borders).filter(|place| *place < 70_000);
                for winner in others.filter(|place| !own.contains(place)).chain([own.start + 4000])
                {
                    let needed = asked(winner, tolerance, &segments);
                    let missing = needed
                        .filter(|chunk| here.contains(chunk))
                        .find(|chunk| !sent.contains(chunk));
                    assert_eq!(missing, None, "{winner}: {closed:b}, {own:?}");
                }
                // Nothing at the ends of segments that lie within its own places.
                let inside = |one: &&Segment| {
                    tolerance < 2 && own.start + 9000 < one.start && one.end < own.end
                };
                for segment in segments.iter().filter(inside) {
                    let chunk = segment.start / CHUNK + 1;
                    assert!(!sent.contains(&chunk), "{segment:?} of {own:?}");
                }
                let near = (tolerance + 1).div_ceil(CHUNK) + 1;
                assert!(sent.len() <= 7 + 6 * near, "{}", sent.len());
            }
        }
    }
}
