//! The prediction (method 1.9, 4): how the belief moves, and what it gives to the rest of the route
//! and to the state off the map.

use serde::{Deserialize, Serialize};

use super::novelty::Novelty;
use super::state::State;
use super::steps::{Steps, Tap, known};
use super::update::Move;
use crate::motion::{MAX_JITTER, Motion};

/// The longest move: all whole numbers up to it are known exactly.
const MAX_SHIFT: f64 = (1_u64 << 53) as f64;

/// How the belief moves.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) enum Step {
    /// By a known advance, in places and a part of one.
    Known { shift: isize, part: f64, jitter: f64 },
    /// As the speeds say, with the probability `moved`; `joint` if the rows before are.
    Speeds { joint: bool, moved: f64 },
}

impl Step {
    /// By the advance, if it is known.
    pub(super) fn new(
        motion: &Motion,
        state: &State,
        advance: Option<f64>,
        novelty: Novelty,
    ) -> Self {
        let Some(advance) = advance else {
            return Self::Speeds { joint: state.joint, moved: novelty.moved };
        };
        let travelled = state.travelled + advance;
        let (whole, part) = if motion.by_distance {
            (advance.floor(), advance - advance.floor())
        } else {
            (travelled.round_ties_even() - state.travelled.round_ties_even(), 0.0)
        };
        let jitter = (motion.jitter * novelty.jitter).min(MAX_JITTER);
        Self::Known { shift: whole.clamp(-MAX_SHIFT, MAX_SHIFT) as isize, part, jitter }
    }

    /// The probability that the robot has moved as this says, and not stayed.
    pub(super) fn moved(self) -> f64 {
        match self {
            Self::Known { .. } => 1.0,
            Self::Speeds { moved, .. } => moved,
        }
    }
}

/// The prediction for each place and speed is `keep` times the arriving mass, and `anew`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Prediction {
    pub(super) keep: f64,
    pub(super) anew: f64,
    pub(super) off: f64,
}

impl Prediction {
    /// Of the belief before, of which `lost` (before the scale) left the map.
    pub(super) fn new(
        motion: &Motion,
        state: &State,
        step: Step,
        novelty: Novelty,
        lost: f64,
        places: usize,
    ) -> Self {
        let left = step.moved() * state.scale * lost;
        let [leave, restart, rejoin] = motion.rates(novelty.happens);
        let keep = (1.0 - leave) * (1.0 - restart);
        let anew = rejoin * state.off + (1.0 - leave) * restart * state.on + keep * left;
        let rows = if matches!(step, Step::Known { .. }) { 1 } else { motion.speeds.len() };
        Self {
            keep: keep * state.scale,
            anew: anew / (rows * places) as f64,
            off: (1.0 - rejoin) * state.off + leave * state.on,
        }
    }

    pub(super) fn moves(self, steps: &Steps, step: Step) -> Move<'_> {
        Move { steps, step, keep: self.keep, anew: self.anew }
    }
}

/// Each row of a belief by its index, the taps that move it, and the share of the row that is
/// meant.
#[inline(always)]
pub(super) fn each_row(steps: &Steps, step: Step, mut visit: impl FnMut(usize, &[Tap], f64)) {
    match step {
        Step::Known { shift, part, jitter } => visit(0, &known(shift, part, jitter), 1.0),
        Step::Speeds { joint, .. } => {
            for speed in 0..steps.shares.len() {
                let (row, share) = steps.row(speed, joint);
                visit(row, steps.of(speed), share);
            }
        }
    }
}
