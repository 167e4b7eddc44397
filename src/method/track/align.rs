//! Alignment (method 1.10): the tracker's model in both directions. Each query's place is that of
//! all queries, those after it too.
//!
//! The backward pass needs the belief after each query. Keeping all of them would take `queries x
//! places` numbers, so that only the tracker's state at every `sqrt(queries)`-th query is kept, and
//! the queries between two of these are tracked again.

use super::answer::{Belief, most_probable};
use super::later::Later;
use super::state::Saved;
use super::{Hubness, Step, Taken, Track, Tracker};
use crate::archive::Refusal;
use crate::config::Config;
use crate::error::Error;
use crate::interrupt::check;
use crate::method::fusion::Fusion;
use crate::method::single::{Single, minimum};
use crate::method::{Column, Given};
use crate::segments::Segments;
use crate::simd::Isa;
use crate::sums::{CHUNK, sum};
use serde::{Deserialize, Serialize};

/// A drive that can be read twice.
pub(crate) trait Source {
    /// How many queries it has.
    fn queries(&self) -> usize;

    /// Writes a technique's distances of a query to all places, which are finite.
    fn column(&mut self, technique: usize, query: usize, out: &mut [f32]) -> Result<(), Error>;

    /// What else is known of a query: whether there is a gap before it, and its advance.
    fn given(&self, query: usize) -> Result<(bool, Given), Error>;
}

/// How many queries are between two checkpoints: they are read in order, twice.
pub(crate) fn stretch(queries: usize) -> usize {
    (queries as f64).sqrt().ceil().max(1.0) as usize
}

/// Aligns drives along a route.
pub(crate) struct Aligner<'a> {
    tracker: Tracker,
    /// If there are several techniques.
    fusion: Option<Fusion>,
    segments: &'a Segments,
    isa: Isa,
    /// The distances of a query by each technique.
    columns: Vec<Vec<f32>>,
}

/// A tracker's state at a query.
struct Checkpoint {
    saved: Saved,
    tensors: [Vec<f64>; 3],
    techniques: Vec<Hubness>,
}

/// What the backward pass needs of a query.
pub(super) struct Recorded {
    query: usize,
    /// The belief, as the tracker keeps it.
    mass: Vec<f64>,
    joint: bool,
    scale: f64,
    off: f64,
    /// The evidence, and its mean.
    pub(super) e: Vec<f64>,
    pub(super) mean: f64,
    pub(super) step: Step,
    /// The probabilities to leave, to restart and to rejoin.
    pub(super) rates: [f64; 3],
    advance: Option<f64>,
    /// Whether the query before is unknown: at the start, and after a gap.
    fresh: bool,
    single: Single,
}

/// What all queries say of one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Aligned {
    /// Where it was.
    pub track: Track,
    /// Its best match alone.
    pub single: Single,
    /// The belief that this match is right, within `tolerance` places.
    pub single_right: f64,
}

impl<'a> Aligner<'a> {
    /// Of drives of some techniques, at least 1, with the motion of `config`.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(crate) fn new(
        config: &Config,
        techniques: usize,
        segments: &'a Segments,
    ) -> Result<Self, Error> {
        let places = segments.places();
        let motion = config.motion.clone().unwrap_or_default();
        let several = (techniques > 1).then(|| Fusion::new(techniques, places, config));
        Ok(Self {
            tracker: Tracker::new(&motion, config.tolerance, segments)?,
            fusion: several.transpose()?,
            segments,
            isa: Isa::best(),
            columns: vec![vec![0.0; places]; techniques],
        })
    }

    /// Each query, aligned; and for each list of places in `at`, one a query, the probability that
    /// the query is within `tolerance` places of it. `report` is told how many of `2 queries` steps
    /// are done.
    ///
    /// # Errors
    /// Those of the source and of `report`.
    pub(crate) fn align(
        mut self,
        source: &mut impl Source,
        at: &[&[usize]],
        mut report: impl FnMut(usize) -> Result<(), Error>,
    ) -> Result<(Vec<Aligned>, Vec<Vec<f64>>), Error> {
        let queries = source.queries();
        let length = stretch(queries);
        let mut checkpoints = Vec::new();
        for query in 0..queries {
            if query % length == 0 {
                checkpoints.push(Checkpoint::of(&self.tracker, self.fusion.as_ref()));
            }
            self.push(source, query, |_| ())?;
            report(query + 1)?;
        }
        let mut later = Later::none(&self.tracker);
        let mut aligned = Vec::with_capacity(queries);
        let mut right = vec![vec![0.0; queries]; at.len()];
        for (index, checkpoint) in checkpoints.into_iter().enumerate().rev() {
            checkpoint.restore(&mut self.tracker, self.fusion.as_mut())?;
            let span = index * length..queries.min((index + 1) * length);
            let recorded = span.map(|query| self.push(source, query, |recorded| recorded()));
            let recorded = recorded.collect::<Result<Vec<_>, _>>()?;
            for one in recorded.iter().rev() {
                check()?;
                let asked = at.iter().zip(&mut right);
                let asked = asked.map(|(at, right)| (at[one.query], &mut right[one.query]));
                aligned.push(self.answer(one, &later, asked));
                if one.fresh {
                    later = Later::none(&self.tracker);
                } else {
                    let Self { tracker, segments, isa, .. } = &self;
                    isa.run(|| later.step_back(one, tracker, tracker.way(segments)));
                }
                report(queries + aligned.len())?;
            }
        }
        aligned.reverse();
        Ok((aligned, right))
    }

    /// Tracks a query; `keep` is given what makes the record of it.
    fn push<T>(
        &mut self,
        source: &mut impl Source,
        query: usize,
        keep: impl FnOnce(&dyn Fn() -> Recorded) -> T,
    ) -> Result<T, Error> {
        use crate::method::estimator::Estimator as _;
        let Self { tracker, fusion, segments, isa, columns } = self;
        check()?;
        for (technique, column) in columns.iter_mut().enumerate() {
            source.column(technique, query, column)?;
        }
        let Column { lower: column, evidence: z, .. } = match fusion {
            None => Column::exact(&columns[0]),
            Some(fusion) => {
                fusion.fuse(|technique| &columns[technique])?;
                fusion.column()
            }
        };
        let (gap, given) = source.given(query)?;
        if gap && given.advance.is_none() {
            tracker.clear();
        }
        let fresh = tracker.state.fresh;
        let Taken { advance, evidence, novelty, step, .. } =
            isa.run(|| tracker.take(column, z, given.advance, segments));
        let tracker = &*tracker;
        Ok(keep(&|| {
            let mut e = vec![0.0; column.len()];
            for (index, e) in e.chunks_mut(CHUNK).enumerate() {
                evidence.of(column, &tracker.hubness.sums, index * CHUNK, e);
            }
            let mean = e.chunks(CHUNK).map(sum).sum::<f64>() / column.len() as f64;
            let count = if tracker.state.joint { column.len() } else { tracker.mass.len() };
            Recorded {
                query,
                mass: tracker.mass[..count].to_vec(),
                joint: tracker.state.joint,
                scale: tracker.state.scale,
                off: tracker.state.off,
                e,
                mean,
                step,
                rates: tracker.motion.rates(novelty.happens),
                advance,
                fresh,
                single: minimum(column),
            }
        }))
    }

    /// The answer of all queries: the belief after this one, times how likely those after it are.
    /// Writes how much of it is near each place that is asked about.
    fn answer<'b>(
        &self,
        one: &Recorded,
        later: &Later,
        asked: impl Iterator<Item = (usize, &'b mut f64)>,
    ) -> Aligned {
        let Tracker { motion, steps, tolerance, .. } = &self.tracker;
        let places = self.segments.places();
        let mut mass = vec![0.0; places];
        let mut speed = vec![0.0; places];
        for (index, &v) in motion.speeds.iter().enumerate() {
            let (start, share) =
                if one.joint { (0, steps.shares[index]) } else { (index * places, 1.0) };
            let (row, factor) = (&one.mass[start..][..places], one.scale * share);
            let later = &later.rows[index * places..][..places];
            let out = mass.iter_mut().zip(&mut speed);
            for ((mass, speed), (&belief, &later)) in out.zip(row.iter().zip(later)) {
                let part = factor * belief * later;
                *mass += part;
                *speed += part * v;
            }
        }
        let sums: Vec<f64> = mass.chunks(CHUNK).map(sum).collect();
        let (on, off) = (sums.iter().sum::<f64>(), one.off * later.off);
        let scale = 1.0 / (on + off);
        let masses = &mass[..];
        let belief = Belief {
            places,
            mass: |places| &masses[places],
            sums: &sums,
            on: scale * on,
            off: scale * off,
            scale,
        };
        let (place, _) = most_probable(masses);
        let speed = one.advance.unwrap_or(motion.pace * speed[place] / mass[place]);
        let track = belief.answer(place, *tolerance, self.segments, speed);
        let near = |place| belief.near(place, *tolerance, self.segments);
        asked.for_each(|(place, right)| *right = near(place));
        let single = one.single;
        let single_right = near(single.place);
        Aligned { track, single, single_right }
    }
}

impl Checkpoint {
    fn of(tracker: &Tracker, fusion: Option<&Fusion>) -> Self {
        let tensors = tracker.tensors().map(|(_, numbers)| numbers.to_vec());
        let techniques = fusion.map(Fusion::known).unwrap_or_default();
        Self { saved: tracker.saved(), tensors, techniques }
    }

    fn restore(self, tracker: &mut Tracker, fusion: Option<&mut Fusion>) -> Result<(), Error> {
        let names = tracker.tensors().map(|(name, _)| name);
        let tensor = |name: &str, _: usize| {
            let index = names.iter().position(|known| *known == name);
            let numbers = index.and_then(|index| self.tensors.get(index)).cloned();
            numbers.ok_or_else(|| Refusal::Foreign(format!("no tensor {name}")))
        };
        let resumed = tracker.resume(self.saved, tensor);
        if let Some(fusion) = fusion {
            fusion.resume(self.techniques);
        }
        resumed.map_err(|refusal| refusal.of_snapshot("a checkpoint"))
    }
}
