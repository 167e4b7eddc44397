//! The update (method 1.9, 5): the belief moves, is weighed by the evidence and summed, a chunk of
//! places at a time.

use super::evidence::Evidence;
use super::steps::{Steps, Way, arriving, known};
use super::{Prediction, Step, Tracker};
use crate::segments::Segments;
use crate::sums::{BLOCK, CHUNK, sum};

impl Tracker {
    #[inline(always)]
    pub(super) fn update(
        &mut self,
        column: &[f32],
        evidence: Evidence<'_>,
        step: Step,
        prediction: Prediction,
        segments: &Segments,
    ) {
        let Self { motion, steps, links, hubness, mass, before, state, scratch, .. } = self;
        let way = Way { segments, links: links.as_ref() };
        let (places, speeds) = (column.len(), motion.speeds.len());
        let row_length = mass.len() / speeds;
        let Prediction { keep, anew, off } = prediction;
        let moved = step.moved();
        let mut e = [0.0; CHUNK];
        let (mut on, mut evidence_sum) = (0.0, 0.0);
        for block in (0..places).step_by(BLOCK) {
            let (mut on_block, mut evidence_block) = (0.0, 0.0);
            for start in (block..places.min(block + BLOCK)).step_by(CHUNK) {
                let range = start..places.min(start + CHUNK);
                let e = &mut e[..range.len()];
                evidence.of(column, &hubness.sums, start, e);
                evidence_block += sum(e);
                let one = match step {
                    Step::Known { shift, part, jitter } => {
                        Some((&before[..places], &known(shift, part, jitter)[..]))
                    }
                    Step::Speeds { .. } if speeds == 1 => Some((&before[..], steps.of(0))),
                    Step::Speeds { .. } => None,
                };
                let of_places = if let Some((row, taps)) = one {
                    let out = &mut mass[range];
                    arriving(row, taps, way, keep * moved, start, out);
                    stay(row, keep * (1.0 - moved), start, out);
                    weigh(out, anew, e);
                    &*out
                } else {
                    let joint = matches!(step, Step::Speeds { joint: true, .. });
                    let chunk = &mut scratch.chunk[..];
                    for (speed, out) in chunk.chunks_exact_mut(CHUNK).enumerate() {
                        let out = &mut out[..range.len()];
                        let (row, share) = steps.row(before, speed, joint);
                        let keep = keep * share;
                        arriving(row, steps.of(speed), way, keep * moved, start, out);
                        stay(row, keep * (1.0 - moved), start, out);
                        weigh(out, anew, e);
                    }
                    let of_places = &mut scratch.places[range.clone()];
                    add_up(chunk, of_places);
                    for speed in 0..speeds {
                        let out = &mut mass[speed * row_length + start..][..range.len()];
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
}

/// Adds the mass that has not moved.
#[inline(always)]
fn stay(row: &[f64], factor: f64, start: usize, out: &mut [f64]) {
    if factor == 0.0 {
        return;
    }
    let row = &row[start..][..out.len()];
    for at in 0..out.len() {
        out[at] += factor * row[at];
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
