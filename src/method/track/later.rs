//! The backward pass of an alignment (method 1.10).

use super::align::Recorded;
use super::steps::{Steps, Tap, Way, arriving, beyond, known};
use super::{Step, Tracker};
use crate::sums::{CHUNK, sum};

/// How likely the queries after one are, for each speed and place after the change of speed, and
/// off the map.
pub(super) struct Later {
    pub(super) rows: Vec<f64>,
    pub(super) off: f64,
}

impl Later {
    /// No query follows.
    pub(super) fn none(tracker: &Tracker) -> Self {
        Self { rows: vec![1.0; tracker.mass.len()], off: 1.0 }
    }

    /// From how likely the queries after one are to how likely it and those are.
    #[inline(always)]
    pub(super) fn step_back(&mut self, one: &Recorded, tracker: &Tracker, way: Way<'_>) {
        let Tracker { motion, steps, .. } = tracker;
        let (places, speeds) = (way.segments.places(), motion.speeds.len());
        let [leave, restart, rejoin] = one.rates;
        let keep = (1.0 - leave) * (1.0 - restart);
        // Before the change of speed, times the evidence.
        let mut h = self.before_the_change(steps, places, matches!(one.step, Step::Known { .. }));
        for row in h.chunks_exact_mut(places) {
            row.iter_mut().zip(&one.e).for_each(|(h, e)| *h *= e);
        }
        let anywhere = mean(&h);
        let off = one.mean * self.off;
        let rest = (1.0 - leave) * restart * anywhere + leave * off;
        let rows = &mut self.rows;
        match one.step {
            Step::Known { shift, part, jitter } => {
                let (row, others) = rows.split_at_mut(places);
                leading(&h, &known(shift, part, jitter), 1.0, anywhere, way, row);
                weigh(row, keep, rest);
                others.chunks_exact_mut(places).for_each(|other| other.copy_from_slice(row));
            }
            Step::Speeds { moved, .. } => {
                debug_assert_eq!(h.len(), places * speeds);
                let all = rows.chunks_exact_mut(places).zip(h.chunks_exact(places));
                for (speed, (row, h)) in all.enumerate() {
                    leading(h, steps.of(speed), moved, anywhere, way, row);
                    weigh(row, keep, rest);
                }
            }
        }
        let off = rejoin * anywhere + (1.0 - rejoin) * off;
        // The size does not matter: it must only stay within the range of numbers.
        let mean = mean(rows);
        weigh(rows, 1.0 / mean, 0.0);
        self.off = off / mean;
    }

    /// The same before the change of speed; one row if the speeds are `joint`.
    #[inline(always)]
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

/// For each place, the mean of `h` where a move leads from it: with probability `moved` by the
/// taps, and to `anywhere` beyond the end of its segment; else it stays.
#[inline(always)]
pub(super) fn leading(
    h: &[f64],
    taps: &[Tap],
    moved: f64,
    anywhere: f64,
    way: Way<'_>,
    out: &mut [f64],
) {
    // The same taps, taken backwards; in the order of their shifts.
    let back: Vec<Tap> =
        taps.iter().rev().map(|tap| Tap { shift: -tap.shift, weight: tap.weight }).collect();
    let along = Way { links: None, ..way };
    let stays = 1.0 - moved;
    for (index, out) in out.chunks_mut(CHUNK).enumerate() {
        let start = index * CHUNK;
        arriving(h, &back, along, moved, start, out);
        out.iter_mut().zip(&h[start..]).for_each(|(out, h)| *out += stays * h);
    }
    beyond(taps, along, |weight, places| {
        out[places].iter_mut().for_each(|out| *out += moved * weight * anywhere);
    });
    if let Some(links) = way.links {
        let divided = |place: usize, mean: f64| out[place] = moved * mean + stays * h[place];
        links.leading(h, taps, anywhere, divided);
    }
}

#[inline(always)]
fn mean(numbers: &[f64]) -> f64 {
    numbers.chunks(CHUNK).map(sum).sum::<f64>() / numbers.len() as f64
}

/// Each number times `factor`, and `more`.
#[inline(always)]
fn weigh(numbers: &mut [f64], factor: f64, more: f64) {
    for number in numbers {
        *number = factor * *number + more;
    }
}
