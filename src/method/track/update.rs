//! The update (method 1.9, 5): the belief moves, is weighed by the evidence and summed, a chunk of
//! places at a time.

use super::evidence::Evidence;
use super::predict::{Step, each_row};
use super::steps::{Steps, Tap, Way, arriving, known};
use crate::motion::Motion;
use crate::sums::{BLOCK, CHUNK, sum};

/// A belief before it moves.
pub(super) trait Before {
    /// Writes what arrives from one of its rows at the places from `start` on: `factor` times the
    /// sum over the taps of the weight and the mass where it comes from.
    fn arriving(&self, row: usize, taps: &[Tap], factor: f64, start: usize, out: &mut [f64]);

    /// Adds `factor` times what one of its rows has in the places from `start` on.
    fn staying(&self, row: usize, factor: f64, start: usize, out: &mut [f64]);
}

/// That of a whole route.
#[derive(Clone, Copy)]
pub(super) struct Whole<'a> {
    pub(super) rows: &'a [f64],
    /// Numbers of a row.
    pub(super) length: usize,
    pub(super) way: Way<'a>,
}

impl Before for Whole<'_> {
    #[inline(always)]
    fn arriving(&self, row: usize, taps: &[Tap], factor: f64, start: usize, out: &mut [f64]) {
        let row = &self.rows[row * self.length..][..self.length];
        arriving(row, taps, self.way, factor, start, out);
    }

    #[inline(always)]
    fn staying(&self, row: usize, factor: f64, start: usize, out: &mut [f64]) {
        add(factor, &self.rows[row * self.length + start..], out);
    }
}

/// A belief afterwards, in some whole blocks.
pub(super) struct After<'a> {
    /// Speed by speed and place by place.
    pub(super) mass: &'a mut [f64],
    /// A chunk's for each speed.
    pub(super) chunk: &'a mut [f64],
    /// In each place, if there are several speeds.
    pub(super) places: &'a mut [f64],
    /// In each chunk.
    pub(super) sums: &'a mut [f64],
    /// The sum of each block's evidence.
    pub(super) evidence: &'a mut [f64],
}

/// How a belief moves.
#[derive(Clone, Copy)]
pub(super) struct Move<'a> {
    pub(super) steps: &'a Steps,
    pub(super) step: Step,
    /// What the prediction for each place and speed has of the arriving mass, and beside it.
    pub(super) keep: f64,
    pub(super) anew: f64,
}

impl Move<'_> {
    /// The belief in the places of a column, and its sums. `hubs` are the sums of the distances.
    #[inline(always)]
    pub(super) fn update(
        self,
        column: &[f32],
        hubs: &[f64],
        evidence: Evidence<'_>,
        before: &impl Before,
        after: &mut After<'_>,
    ) {
        let Self { steps, step, keep, anew } = self;
        let (places, speeds) = (column.len(), steps.shares.len());
        let row_length = after.mass.len() / speeds;
        let moved = step.moved();
        let mut e = [0.0; CHUNK];
        for block in (0..places).step_by(BLOCK) {
            let mut evidence_block = 0.0;
            for start in (block..places.min(block + BLOCK)).step_by(CHUNK) {
                let range = start..places.min(start + CHUNK);
                let e = &mut e[..range.len()];
                evidence.of(column, hubs, start, e);
                evidence_block += sum(e);
                let known_taps;
                let one = match step {
                    Step::Known { shift, part, jitter } => {
                        known_taps = known(shift, part, jitter);
                        Some(&known_taps[..])
                    }
                    Step::Speeds { .. } if speeds == 1 => Some(steps.of(0)),
                    Step::Speeds { .. } => None,
                };
                let of_places = if let Some(taps) = one {
                    let out = &mut after.mass[range];
                    before.arriving(0, taps, keep * moved, start, out);
                    stay(before, 0, keep * (1.0 - moved), start, out);
                    weigh(out, anew, e);
                    &*out
                } else {
                    let joint = matches!(step, Step::Speeds { joint: true, .. });
                    for (speed, out) in after.chunk.chunks_exact_mut(CHUNK).enumerate() {
                        let out = &mut out[..range.len()];
                        let (row, share) = steps.row(speed, joint);
                        let keep = keep * share;
                        before.arriving(row, steps.of(speed), keep * moved, start, out);
                        stay(before, row, keep * (1.0 - moved), start, out);
                        weigh(out, anew, e);
                    }
                    let of_places = &mut after.places[range.clone()];
                    add_up(after.chunk, of_places);
                    for speed in 0..speeds {
                        let out = &mut after.mass[speed * row_length + start..][..range.len()];
                        switched(after.chunk, speed, steps, out);
                    }
                    &*of_places
                };
                after.sums[start / CHUNK] = sum(of_places);
            }
            after.evidence[block / BLOCK] = evidence_block;
        }
    }

    /// The mean speed of the belief in a place, in places a query.
    pub(super) fn speed(self, before: &impl Before, motion: &Motion, place: usize) -> f64 {
        let Self { steps, step, keep, anew } = self;
        let (mut total, mut sum, mut speeds) = (0.0, 0.0, motion.speeds.iter());
        let moved = step.moved();
        each_row(steps, step, |row, taps, share| {
            let keep = keep * share;
            let (mut arrived, mut stayed) = ([0.0], [0.0]);
            before.arriving(row, taps, keep * moved, place, &mut arrived);
            before.staying(row, keep * (1.0 - moved), place, &mut stayed);
            let moving = arrived[0] + anew;
            total += moving + stayed[0];
            sum += moving * speeds.next().copied().unwrap_or(0.0);
        });
        // A robot that left the map for good has no belief in any place, and no speed.
        if total > 0.0 { motion.pace * sum / total } else { 0.0 }
    }
}

/// The belief on the map, of the sums of all chunks.
pub(super) fn on(sums: &[f64]) -> f64 {
    sums.chunks(BLOCK / CHUNK).map(|chunks| chunks.iter().sum::<f64>()).sum()
}

/// Adds the mass that has not moved.
#[inline(always)]
fn stay(before: &impl Before, row: usize, factor: f64, start: usize, out: &mut [f64]) {
    if factor != 0.0 {
        before.staying(row, factor, start, out);
    }
}

/// Adds `factor` times the numbers.
#[inline(always)]
pub(super) fn add(factor: f64, numbers: &[f64], out: &mut [f64]) {
    let numbers = &numbers[..out.len()];
    for at in 0..out.len() {
        out[at] += factor * numbers[at];
    }
}

/// The arriving mass becomes the prediction, and that is weighed by the evidence.
#[inline(always)]
fn weigh(mass: &mut [f64], anew: f64, e: &[f64]) {
    let e = &e[..mass.len()];
    for at in 0..mass.len() {
        mass[at] = (mass[at] + anew) * e[at];
    }
}

/// The sum over the speeds.
#[inline(always)]
fn add_up(chunk: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    for row in chunk.chunks_exact(CHUNK) {
        let row = &row[..out.len()];
        for at in 0..out.len() {
            out[at] += row[at];
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
    let (below, own, above) = (row(below), row(speed), row(above));
    for at in 0..count {
        out[at] = a * below[at] + b * own[at] + c * above[at];
    }
}
