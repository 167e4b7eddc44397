//! The tracker (method 1.9): a recursive Bayes filter over places, speeds and one state off the
//! map.
//!
//! | | | file |
//! |---|---|---|
//! | 1, 2 | hubness and evidence | `evidence.rs` |
//! | 3 | motion | `steps.rs` |
//! | 4, 5, 6 | prediction, update, answer | here |
//!
//! A belief is kept per speed and place, after the change of speed that comes before the next move,
//! and not yet divided by its total. Sums go by chunks of 256 places, chunks by blocks of 4,096 and
//! blocks in order, so that every instruction set gives the same bits.

mod evidence;
mod exp;
mod steps;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

use super::argmin::first_better;
use super::estimator::{Estimator, Memory, Seen};
use super::window::{Exact, Window};
use crate::archive::Refusal;
use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;
use crate::segments::Segments;
use evidence::{Hubness, Standard};
use exp::exp;
use steps::{Steps, Tap, arriving, known, lost};

/// Numbers that are added side by side.
const LANES: usize = 8;
/// Places that are updated at a time: they stay in the first-level cache.
const CHUNK: usize = 256;
/// Places whose sums are added up before they are added to those of other blocks.
const BLOCK: usize = 4096;
/// More columns than any camera has sent.
const MAX_COLUMNS: u64 = 1 << 60;
/// The belief off the map at the start.
const OFF: f64 = 0.05;
/// The share of the belief on either side of [`Track::interval`].
const TAIL: f64 = 0.025;
/// A robot with odometry that stands still learns this share of the evidence.
const LEAST_NEW: f64 = 0.05;

/// Where the robot is by all queries so far (method 1.9).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Track {
    /// The most probable place, from 0.
    pub place: usize,
    /// The probability that the robot is within `tolerance` places of it.
    pub confidence: f64,
    /// The belief that the robot is off the map. It ranks well; as a probability it is a lower
    /// bound, as places that the map lacks have no evidence of their own.
    pub off_map: f64,
    /// The speed in places a query, or the advance if it is known.
    pub speed: f64,
    /// The first and the last place of the interval that holds 95 % of the belief on the map.
    pub interval: (usize, usize),
}

/// The estimator of all queries so far.
#[derive(Clone, Debug)]
pub(super) struct Tracker {
    motion: Motion,
    tolerance: usize,
    steps: Steps,
    hubness: Hubness,
    /// The belief, speed by speed and place by place, times `state.scale`. Only the first speed's
    /// row counts if they are `joint`.
    mass: Vec<f64>,
    /// That of the query before; then memory for the next.
    before: Vec<f64>,
    state: State,
    scratch: Scratch,
}

/// The state of a tracker beside its tensors.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Saved {
    columns: u64,
    state: State,
}

/// The rest of the state.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct State {
    /// Whether all speeds were equally likely before the change of speed; the first row has their
    /// sum.
    joint: bool,
    scale: f64,
    /// The probabilities to be on and off the map.
    on: f64,
    off: f64,
    /// The sum of all advances, in places.
    travelled: f64,
    /// What a gap adds to the next advance.
    pending: Option<f64>,
    /// Whether no query has come since the start or a gap.
    fresh: bool,
}

#[derive(Clone, Debug)]
struct Scratch {
    /// A chunk's belief for each speed.
    chunk: Vec<f64>,
    /// The belief in each place, if there are several speeds.
    places: Vec<f64>,
    /// The sum of each chunk.
    sums: Vec<f64>,
}

impl Tracker {
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(super) fn new(motion: &Motion, tolerance: usize, places: usize) -> Result<Self, Error> {
        let speeds = motion.speeds.len();
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
            hubness: Hubness::new(places)?,
            mass: zeros(places.checked_mul(speeds))?,
            before: zeros(places.checked_mul(speeds))?,
            state: State::START,
            scratch: Scratch {
                chunk: zeros(Some(speeds * CHUNK))?,
                places: zeros(Some(several))?,
                sums: zeros(Some(places.div_ceil(CHUNK)))?,
            },
        };
        tracker.clear();
        Ok(tracker)
    }

    /// The belief in each place after the newest query.
    pub(super) fn belief(&self) -> impl Iterator<Item = f64> {
        let places = self.hubness.sums.len();
        let (mass, scale) = match self.state {
            State { fresh: true, on, .. } => (&self.mass[..places], on),
            State { scale, .. } => (self.mass(places), scale),
        };
        mass.iter().map(move |mass| scale * mass)
    }

    /// The state beside its tensors.
    pub(super) fn saved(&self) -> Saved {
        Saved { columns: self.hubness.columns, state: self.state }
    }

    /// The tensors of its state: the sums of the distances, and the beliefs that count.
    pub(super) fn tensors(&self) -> [(&'static str, &[f64]); 2] {
        let Self { hubness, mass, state, .. } = self;
        let count = if state.joint { hubness.sums.len() } else { mass.len() };
        [("track.sums", &hubness.sums), ("track.mass", &mass[..count])]
    }

    /// Goes on from a state; `tensor` gives one of its tensors by the name and the length.
    pub(super) fn resume(
        &mut self,
        saved: Saved,
        tensor: impl Fn(&str, usize) -> Result<Vec<f64>, Refusal>,
    ) -> Result<(), Refusal> {
        let Saved { columns, state } = saved;
        let State { joint, scale, on, off, travelled, pending, .. } = state;
        let shares = [on, off].iter().all(|share| (0.0..=1.0).contains(share));
        let advances = [travelled, pending.unwrap_or(0.0)].iter().all(|a| a.is_finite());
        let tensors = self.tensors().map(|(name, _)| name);
        let places = self.hubness.sums.len();
        let sums = tensor(tensors[0], places)?;
        let mass = tensor(tensors[1], if joint { places } else { self.mass.len() })?;
        let finite = sums.iter().chain(&mass).all(|number| number.is_finite());
        if !(shares && advances && finite && scale.is_normal() && columns <= MAX_COLUMNS) {
            return Err(Refusal::Foreign("an impossible belief".to_owned()));
        }
        self.hubness.sums.copy_from_slice(&sums);
        self.hubness.columns = columns;
        self.mass[..mass.len()].copy_from_slice(&mass);
        self.state = state;
        Ok(())
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
        let Self { mass, state, .. } = self;
        let places = self.hubness.sums.len();
        mass[..places].fill(1.0 / places as f64);
        let travelled = state.travelled;
        *state = State { travelled, ..State::START };
    }

    #[inline(always)]
    fn estimate<E: Exact>(&mut self, window: &mut Window, seen: &Seen<'_>, ask: &mut E) -> Track {
        let column = window.newest(ask).unwrap_or_default();
        let advance = match (seen.advance, self.state.pending.take()) {
            (Some(advance), gap) => Some(advance + gap.unwrap_or(0.0)),
            (None, gap) => gap,
        };

        // 1, 2 What the column says.
        let standard = self.hubness.learn(column, &self.motion);
        let evidence = Evidence::new(standard, &self.motion, self.state.weight(advance));

        // 3, 4 Where the belief goes, and what it gives to the rest of the route and to the state
        // off the map.
        let step = self.step(advance, column.len());
        let prediction = self.predict(step, seen.segments);

        // 5 What is believed now.
        self.update(column, evidence, step, prediction, seen.segments);

        // 6 The answer.
        self.answer(advance, step, prediction, seen.segments)
    }
}

/// How the belief moves: by a known advance, in places and a part of one, or as the speeds say.
#[derive(Clone, Copy)]
enum Step {
    Known {
        shift: isize,
        part: f64,
    },
    /// Whether the rows before are `joint`.
    Speeds {
        joint: bool,
    },
}

/// The prediction for each place and speed is `keep` times the arriving mass, and `anew`.
#[derive(Clone, Copy)]
struct Prediction {
    keep: f64,
    anew: f64,
    off: f64,
}

/// `e[i] = exp(-weight z[i])`.
#[derive(Clone, Copy)]
struct Evidence {
    /// `None` if the column says nothing.
    standard: Option<Standard>,
    weight: f64,
    clip: f64,
}

impl Evidence {
    fn new(standard: Option<Standard>, motion: &Motion, share: f64) -> Self {
        Self { standard, weight: motion.evidence * share, clip: motion.clip }
    }

    /// Writes that of some places.
    #[inline(always)]
    fn of(self, column: &[f32], sums: &[f64], out: &mut [f64]) {
        let Some(standard) = self.standard else { return out.fill(1.0) };
        let Self { weight, clip, .. } = self;
        for (out, (&distance, &sum)) in out.iter_mut().zip(column.iter().zip(sums)) {
            let z = standard.z(distance, sum).max(-clip).min(clip);
            *out = exp(-weight * z);
        }
    }
}

impl State {
    const START: Self = Self {
        joint: true,
        scale: 1.0,
        on: 1.0 - OFF,
        off: OFF,
        travelled: 0.0,
        pending: None,
        fresh: true,
    };

    /// A robot that stands still learns nothing new: how much evidence counts, by the advance.
    fn weight(&self, advance: Option<f64>) -> f64 {
        match advance {
            Some(advance) if !self.fresh => advance.abs().clamp(LEAST_NEW, 1.0),
            _ => 1.0,
        }
    }
}

impl Tracker {
    /// Takes the advance, if it is known. The speeds are equally likely then, so that their sum is
    /// enough.
    #[inline(always)]
    fn step(&mut self, advance: Option<f64>, places: usize) -> Step {
        let Self { motion, mass, before, state, .. } = self;
        std::mem::swap(mass, before);
        let Some(advance) = advance else { return Step::Speeds { joint: state.joint } };
        if !state.joint {
            let (sum, others) = before.split_at_mut(places);
            for other in others.chunks_exact(places) {
                for (sum, &mass) in sum.iter_mut().zip(other) {
                    *sum += mass;
                }
            }
        }
        state.joint = true;
        let travelled = state.travelled + advance;
        let (whole, part) = if motion.fractional {
            (advance.floor(), advance - advance.floor())
        } else {
            (travelled.round_ties_even() - state.travelled.round_ties_even(), 0.0)
        };
        state.travelled = travelled;
        // Beyond the route, jitter included, is as far as any further.
        let end = places as f64 + 2.0;
        Step::Known { shift: whole.clamp(-end, end) as isize, part }
    }

    fn predict(&self, step: Step, segments: &Segments) -> Prediction {
        let Self { motion, state, .. } = self;
        let mut lost_mass = 0.0;
        self.each_row(step, |row, taps, share| lost_mass += share * lost(row, taps, segments));
        // At the start, the mass is 1 before the first evidence.
        let held = if state.fresh { 1.0 } else { state.on };
        let left = state.on - (held - state.scale * lost_mass);
        let keep = (1.0 - motion.leave) * (1.0 - motion.restart);
        let anew = motion.rejoin * state.off
            + (1.0 - motion.leave) * motion.restart * state.on
            + keep * left;
        let rows = if matches!(step, Step::Known { .. }) { 1 } else { motion.speeds.len() };
        Prediction {
            keep: keep * state.scale,
            anew: anew / (rows * segments.places()) as f64,
            off: (1.0 - motion.rejoin) * state.off + motion.leave * state.on,
        }
    }

    /// Each row of the belief before, the taps that move it, and the share of the row that is
    /// meant.
    #[inline(always)]
    fn each_row(&self, step: Step, mut visit: impl FnMut(&[f64], &[Tap], f64)) {
        let Self { motion, steps, before, .. } = self;
        let speeds = motion.speeds.len();
        let places = before.len() / speeds;
        match step {
            Step::Known { shift, part } => {
                visit(&before[..places], &known(shift, part, motion.jitter), 1.0);
            }
            Step::Speeds { joint } => {
                for speed in 0..speeds {
                    let (row, share) = steps.row(before, speed, joint);
                    visit(row, steps.of(speed), share);
                }
            }
        }
    }

    #[inline(always)]
    fn update(
        &mut self,
        column: &[f32],
        evidence: Evidence,
        step: Step,
        prediction: Prediction,
        segments: &Segments,
    ) {
        let Self { motion, steps, hubness, mass, before, state, scratch, .. } = self;
        let (places, speeds) = (column.len(), motion.speeds.len());
        let Prediction { keep, anew, off } = prediction;
        let mut e = [0.0; CHUNK];
        let (mut on, mut evidence_sum) = (0.0, 0.0);
        for block in (0..places).step_by(BLOCK) {
            let (mut on_block, mut evidence_block) = (0.0, 0.0);
            for start in (block..places.min(block + BLOCK)).step_by(CHUNK) {
                let range = start..places.min(start + CHUNK);
                let e = &mut e[..range.len()];
                evidence.of(&column[range.clone()], &hubness.sums[range.clone()], e);
                evidence_block += sum(e);
                let one = match step {
                    Step::Known { shift, part } => {
                        Some((&before[..places], &known(shift, part, motion.jitter)[..]))
                    }
                    Step::Speeds { .. } if speeds == 1 => Some((&before[..], steps.of(0))),
                    Step::Speeds { .. } => None,
                };
                let of_places = if let Some((row, taps)) = one {
                    let out = &mut mass[range];
                    arriving(row, taps, segments, keep, start, out);
                    weigh(out, anew, e);
                    &*out
                } else {
                    let joint = matches!(step, Step::Speeds { joint: true });
                    let chunk = &mut scratch.chunk[..];
                    for (speed, out) in chunk.chunks_exact_mut(CHUNK).enumerate() {
                        let out = &mut out[..range.len()];
                        let (row, share) = steps.row(before, speed, joint);
                        arriving(row, steps.of(speed), segments, keep * share, start, out);
                        weigh(out, anew, e);
                    }
                    let of_places = &mut scratch.places[range.clone()];
                    add_up(chunk, of_places);
                    for speed in 0..speeds {
                        let out = &mut mass[speed * places + start..][..range.len()];
                        switched(chunk, speed, steps, out);
                    }
                    &*of_places
                };
                let total = sum(of_places);
                scratch.sums[start / CHUNK] = total;
                on_block += total;
            }
            on += on_block;
            evidence_sum += evidence_block;
        }
        let off = off * (evidence_sum / places as f64);
        let total = on + off;
        state.scale = 1.0 / total;
        (state.on, state.off) = (on / total, off / total);
        state.fresh = false;
        state.joint = matches!(step, Step::Known { .. }) || speeds == 1;
    }

    #[inline(always)]
    fn answer(
        &self,
        advance: Option<f64>,
        step: Step,
        prediction: Prediction,
        segments: &Segments,
    ) -> Track {
        let mass = self.mass(segments.places());
        let mut best = (0, f64::NEG_INFINITY);
        for (index, chunk) in mass.chunks(CHUNK).enumerate() {
            if let Some((at, mass)) = first_better(chunk, best.1, |a, b| a > b) {
                best = (index * CHUNK + at, mass);
            }
        }
        let (place, segment) = (best.0, segments.of(best.0));
        let near = place.saturating_sub(self.tolerance).max(segment.start)
            ..place.saturating_add(self.tolerance + 1).min(segment.end);
        let confidence = self.state.scale * mass[near].iter().sum::<f64>();
        let interval = self.interval(mass);
        Track {
            place,
            confidence,
            off_map: self.state.off,
            speed: advance.unwrap_or_else(|| self.speed(step, prediction, place, segments)),
            interval: (interval.0.min(place), interval.1.max(place)),
        }
    }

    /// The mass in each place.
    fn mass(&self, places: usize) -> &[f64] {
        if self.state.joint { &self.mass[..places] } else { &self.scratch.places }
    }

    /// The mean speed of the belief in a place, in places a query.
    fn speed(&self, step: Step, prediction: Prediction, place: usize, segments: &Segments) -> f64 {
        let (mut total, mut sum, mut speeds) = (0.0, 0.0, self.motion.speeds.iter());
        self.each_row(step, |row, taps, share| {
            let mut arrived = [0.0];
            arriving(row, taps, segments, prediction.keep * share, place, &mut arrived);
            let mass = arrived[0] + prediction.anew;
            total += mass;
            sum += mass * speeds.next().copied().unwrap_or(0.0);
        });
        self.motion.pace * sum / total
    }

    /// The places beside which [`TAIL`] of the mass lies on either side.
    fn interval(&self, mass: &[f64]) -> (usize, usize) {
        let tail = TAIL * self.state.on / self.state.scale;
        let sums = &self.scratch.sums;
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

/// The arriving mass becomes the prediction, and that is weighed by the evidence.
#[inline(always)]
fn weigh(mass: &mut [f64], anew: f64, e: &[f64]) {
    for (mass, &e) in mass.iter_mut().zip(e) {
        *mass = (*mass + anew) * e;
    }
}

/// The sum over the speeds.
#[inline(always)]
fn add_up(chunk: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    for row in chunk.chunks_exact(CHUNK) {
        for (out, &mass) in out.iter_mut().zip(row) {
            *out += mass;
        }
    }
}

/// The mass of a speed after the change of speed.
#[inline(always)]
fn switched(chunk: &[f64], speed: usize, steps: &Steps, out: &mut [f64]) {
    let last = steps.shares.len() - 1;
    let (below, above) = (speed.saturating_sub(1), (speed + 1).min(last));
    let [a, b, c] = steps.switches(speed);
    let count = out.len();
    let row = |speed: usize| &chunk[speed * CHUNK..][..count];
    let rows = row(below).iter().zip(row(speed)).zip(row(above));
    for (out, ((&below, &own), &above)) in out.iter_mut().zip(rows) {
        *out = a * below + b * own + c * above;
    }
}

/// The sum of numbers, side by side in lanes.
#[inline(always)]
fn sum(numbers: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let (groups, rest) = numbers.as_chunks::<LANES>();
    for group in groups {
        for lane in 0..LANES {
            lanes[lane] += group[lane];
        }
    }
    for (lane, &number) in lanes.iter_mut().zip(rest) {
        *lane += number;
    }
    total(&lanes)
}

/// The sum of the lanes.
#[inline(always)]
fn total(lanes: &[f64; LANES]) -> f64 {
    let [a, b, c, d, e, f, g, h] = *lanes;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}
