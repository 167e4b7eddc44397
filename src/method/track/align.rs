//! Alignment (method 1.10): the tracker's model in both directions. Each query's place is that of
//! all queries, those after it too.
//!
//! The backward pass needs the belief after each query. Keeping all of them would take `queries x
//! places` numbers, so that only the tracker's state at every `sqrt(queries)`-th query is kept, and
//! the queries between two of these are tracked again.

use super::answer::Belief;
use super::state::Saved;
use super::steps::{Steps, Tap, arriving, known};
use super::sums::{CHUNK, sum};
use super::{Step, Taken, Track, Tracker};
use crate::archive::Refusal;
use crate::error::Error;
use crate::method::Given;
use crate::method::single::{Single, minimum};
use crate::motion::Motion;
use crate::segments::Segments;

/// A drive that can be read twice.
pub(crate) trait Source {
    /// How many queries it has.
    fn queries(&self) -> usize;

    /// Writes the distances of a query to all places, which are finite, and says what else is
    /// known: whether there is a gap before it, and its advance.
    fn column(&mut self, query: usize, out: &mut [f32]) -> Result<(bool, Given), Error>;
}

/// Aligns drives along a route.
pub(crate) struct Aligner<'a> {
    tracker: Tracker,
    segments: &'a Segments,
}

/// A tracker's state at a query.
struct Checkpoint {
    saved: Saved,
    tensors: [Vec<f64>; 3],
}

/// What the backward pass needs of a query.
struct Recorded {
    /// The belief, as the tracker keeps it.
    mass: Vec<f64>,
    joint: bool,
    scale: f64,
    off: f64,
    /// The evidence, and its mean.
    e: Vec<f64>,
    mean: f64,
    step: Step,
    /// The probabilities to leave, to restart and to rejoin.
    rates: [f64; 3],
    advance: Option<f64>,
    /// Whether the query before is unknown: at the start, and after a gap.
    fresh: bool,
    single: Single,
}

/// What all queries say of one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Aligned {
    /// Where it was.
    pub track: Track,
    /// Its best match alone.
    pub single: Single,
    /// The probability that this match is right, within `tolerance` places.
    pub single_right: f64,
}

/// How likely the queries after one are, for each speed and place after the change of speed, and
/// off the map.
struct Later {
    rows: Vec<f64>,
    off: f64,
}

impl<'a> Aligner<'a> {
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(crate) fn new(
        motion: &Motion,
        tolerance: usize,
        segments: &'a Segments,
    ) -> Result<Self, Error> {
        let tracker = Tracker::new(motion, tolerance, segments.places())?;
        Ok(Self { tracker, segments })
    }

    /// Each query, aligned. `report` is told how many of `2 queries` steps are done.
    ///
    /// # Errors
    /// Those of the source and of `report`.
    pub(crate) fn align(
        mut self,
        source: &mut impl Source,
        mut report: impl FnMut(usize) -> Result<(), Error>,
    ) -> Result<Vec<Aligned>, Error> {
        let queries = source.queries();
        let length = (queries as f64).sqrt().ceil().max(1.0) as usize;
        let mut column = vec![0.0; self.segments.places()];
        let mut checkpoints = Vec::new();
        for query in 0..queries {
            if query % length == 0 {
                checkpoints.push(Checkpoint::of(&self.tracker));
            }
            self.push(source, query, &mut column)?;
            report(query + 1)?;
        }
        let mut later = Later::none(&self.tracker);
        let mut aligned = Vec::with_capacity(queries);
        for (index, checkpoint) in checkpoints.iter().enumerate().rev() {
            checkpoint.restore(&mut self.tracker)?;
            let span = index * length..queries.min((index + 1) * length);
            let recorded = span.map(|query| self.push(source, query, &mut column));
            let recorded = recorded.collect::<Result<Vec<_>, _>>()?;
            for one in recorded.iter().rev() {
                aligned.push(self.answer(one, &later));
                if one.fresh {
                    later = Later::none(&self.tracker);
                } else {
                    self.step_back(one, &mut later);
                }
                report(queries + aligned.len())?;
            }
        }
        aligned.reverse();
        Ok(aligned)
    }

    /// Tracks a query.
    fn push(
        &mut self,
        source: &mut impl Source,
        query: usize,
        column: &mut [f32],
    ) -> Result<Recorded, Error> {
        use crate::method::estimator::Estimator as _;
        let (gap, given) = source.column(query, column)?;
        if gap && given.advance.is_none() {
            self.tracker.clear();
        }
        let fresh = self.tracker.state.fresh;
        let Taken { advance, evidence, novelty, step, .. } =
            self.tracker.take(column, None, given.advance, self.segments);
        let tracker = &self.tracker;
        let mut e = vec![0.0; column.len()];
        for (index, e) in e.chunks_mut(CHUNK).enumerate() {
            evidence.of(column, &tracker.hubness.sums, index * CHUNK, e);
        }
        let mean = e.chunks(CHUNK).map(sum).sum::<f64>() / column.len() as f64;
        let count = if tracker.state.joint { column.len() } else { tracker.mass.len() };
        Ok(Recorded {
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
        })
    }

    /// The answer of all queries: the belief after this one, times how likely those after it are.
    fn answer(&self, one: &Recorded, later: &Later) -> Aligned {
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
        let belief = Belief { mass: &mass, sums: &sums, on: scale * on, off: scale * off, scale };
        let track = belief.answer(*tolerance, self.segments, |place| {
            one.advance.unwrap_or(motion.pace * speed[place] / mass[place])
        });
        let single = one.single;
        let single_right = belief.near(single.place, *tolerance, self.segments);
        Aligned { track, single, single_right }
    }

    /// From how likely the queries after one are to how likely it and those are.
    fn step_back(&self, one: &Recorded, later: &mut Later) {
        let Tracker { motion, steps, .. } = &self.tracker;
        let (places, speeds) = (self.segments.places(), motion.speeds.len());
        let [leave, restart, rejoin] = one.rates;
        let keep = (1.0 - leave) * (1.0 - restart);
        // Before the change of speed, times the evidence.
        let before = later.before_the_change(steps, places, matches!(one.step, Step::Known { .. }));
        let mut h = before;
        for row in h.chunks_exact_mut(places) {
            row.iter_mut().zip(&one.e).for_each(|(h, e)| *h *= e);
        }
        let anywhere = h.chunks(CHUNK).map(sum).sum::<f64>() / h.len() as f64;
        let off = one.mean * later.off;
        let rest = (1.0 - leave) * restart * anywhere + leave * off;
        let mut rows = vec![0.0; places * speeds];
        match one.step {
            Step::Known { shift, part, jitter } => {
                let (row, others) = rows.split_at_mut(places);
                self.leading(&h, &known(shift, part, jitter), 1.0, anywhere, row);
                weigh(row, keep, rest);
                others.chunks_exact_mut(places).for_each(|other| other.copy_from_slice(row));
            }
            Step::Speeds { moved, .. } => {
                let all = rows.chunks_exact_mut(places).zip(h.chunks_exact(places));
                for (speed, (row, h)) in all.enumerate() {
                    self.leading(h, steps.of(speed), moved, anywhere, row);
                    weigh(row, keep, rest);
                }
            }
        }
        let off = rejoin * anywhere + (1.0 - rejoin) * off;
        // The size does not matter: it must only stay within the range of numbers.
        let mean = rows.chunks(CHUNK).map(sum).sum::<f64>() / rows.len() as f64;
        weigh(&mut rows, 1.0 / mean, 0.0);
        *later = Later { rows, off: off / mean };
    }

    /// For each place, the mean of `h` where a move leads from it: with probability `moved` by the
    /// taps, and to `anywhere` beyond the end of its segment; else it stays.
    fn leading(&self, h: &[f64], taps: &[Tap], moved: f64, anywhere: f64, out: &mut [f64]) {
        // The same taps, taken backwards; in the order of their shifts.
        let back: Vec<Tap> =
            taps.iter().rev().map(|tap| Tap { shift: -tap.shift, weight: tap.weight }).collect();
        let ones = vec![1.0; h.len()];
        let mut inside = [0.0; CHUNK];
        for (index, out) in out.chunks_mut(CHUNK).enumerate() {
            let start = index * CHUNK;
            let inside = &mut inside[..out.len()];
            arriving(h, &back, self.segments, moved, start, out);
            arriving(&ones, &back, self.segments, moved, start, inside);
            for ((out, &inside), &stays) in out.iter_mut().zip(&*inside).zip(&h[start..]) {
                *out += (moved - inside) * anywhere + (1.0 - moved) * stays;
            }
        }
    }
}

/// Each number times `factor`, and `more`.
fn weigh(numbers: &mut [f64], factor: f64, more: f64) {
    for number in numbers {
        *number = factor * *number + more;
    }
}

impl Later {
    /// No query follows.
    fn none(tracker: &Tracker) -> Self {
        Self { rows: vec![1.0; tracker.mass.len()], off: 1.0 }
    }

    /// The same before the change of speed; one row if the speeds are `joint`.
    fn before_the_change(&self, steps: &Steps, places: usize, joint: bool) -> Vec<f64> {
        let speeds = steps.shares.len();
        let row = |speed: usize| &self.rows[speed * places..][..places];
        let mut out = vec![0.0; if joint { places } else { self.rows.len() }];
        for to in 0..speeds {
            if joint {
                let share = steps.shares[to];
                out.iter_mut().zip(row(to)).for_each(|(out, x)| *out += share * x);
                continue;
            }
            // What the speed `to` has of its own and of its neighbours.
            let shares = steps.switches(to);
            let from = [to.checked_sub(1), Some(to), Some(to + 1).filter(|&from| from < speeds)];
            for (from, share) in from.into_iter().zip(shares) {
                let Some(from) = from else { continue };
                let out = &mut out[from * places..][..places];
                out.iter_mut().zip(row(to)).for_each(|(out, x)| *out += share * x);
            }
        }
        out
    }
}

impl Checkpoint {
    fn of(tracker: &Tracker) -> Self {
        let tensors = tracker.tensors().map(|(_, numbers)| numbers.to_vec());
        Self { saved: tracker.saved(), tensors }
    }

    fn restore(&self, tracker: &mut Tracker) -> Result<(), Error> {
        let names = tracker.tensors().map(|(name, _)| name);
        let tensor = |name: &str, _: usize| {
            let index = names.iter().position(|known| *known == name);
            let numbers = index.and_then(|index| self.tensors.get(index)).cloned();
            numbers.ok_or_else(|| Refusal::Foreign(format!("no tensor {name}")))
        };
        let resumed = tracker.resume(self.saved, tensor);
        resumed.map_err(|refusal| refusal.of_snapshot("a checkpoint"))
    }
}
