//! What is kept between queries beside the beliefs, and snapshots of it.

use serde::{Deserialize, Serialize};

use super::novelty::View;
use super::predict::{Prediction, Step};
use super::{Hubness, Tracker};
use crate::archive::Refusal;

/// Farther than a robot gets by advances of the longest that is accepted.
const MAX_WAY: f64 = 1e30;
/// A corrected distance is at most the distance and the mean of such ones together, and a little
/// more for rounding.
const MAX_X: f64 = 2.01 * f32::MAX as f64;
/// How far the belief's total may be from 1, and its sum from what is said of it, by rounding.
const ROUNDING: f64 = 1e-6;
/// The belief off the map at the start.
const OFF: f64 = 0.05;

/// The state of a tracker beside its tensors.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(in crate::method) struct Saved {
    columns: u64,
    state: State,
    /// Whether there is a view to compare with, a tensor.
    viewed: bool,
}

/// The rest of the state.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct State {
    /// Whether all speeds were equally likely before the change of speed; the first row has their
    /// sum.
    pub(super) joint: bool,
    pub(super) scale: f64,
    /// The probabilities to be on and off the map.
    pub(super) on: f64,
    pub(super) off: f64,
    /// The sum of all advances, in places.
    pub(super) travelled: f64,
    /// What a gap adds to the next advance.
    pub(super) pending: Option<f64>,
    /// Whether no query has come since the start or a gap.
    pub(super) fresh: bool,
}

impl State {
    pub(super) const START: Self = Self {
        joint: true,
        scale: 1.0 - OFF,
        on: 1.0 - OFF,
        off: OFF,
        travelled: 0.0,
        pending: None,
        fresh: true,
    };
    /// Wholly off the map.
    pub(super) const OFF_THE_MAP: Self = Self { scale: 1.0, on: 0.0, off: 1.0, ..Self::START };

    /// Whether queries can have led to it.
    pub(super) fn is_possible(&self) -> bool {
        let Self { scale, on, off, travelled, pending, .. } = *self;
        scale.is_normal()
            && [on, off].iter().all(|share| (0.0..=1.0).contains(share))
            && (on + off - 1.0).abs() <= ROUNDING
            && [travelled, pending.unwrap_or(0.0)].iter().all(|way| way.abs() <= MAX_WAY)
    }

    /// After a query: `on` is the belief on the map before the scale, `evidence` the mean of all
    /// places'.
    #[inline(always)]
    pub(super) fn update(
        &mut self,
        on: f64,
        prediction: Prediction,
        evidence: f64,
        step: Step,
        speeds: usize,
    ) {
        let off = prediction.off * evidence;
        let total = on + off;
        self.scale = 1.0 / total;
        (self.on, self.off) = (on / total, off / total);
        self.fresh = false;
        self.joint = matches!(step, Step::Known { .. }) || speeds == 1;
    }
}

impl Tracker {
    /// The state beside its tensors.
    pub(in crate::method) fn saved(&self) -> Saved {
        Saved { columns: self.hubness.columns, state: self.state, viewed: self.view.known }
    }

    /// The tensors of its state: the sums of the distances, and the beliefs that count.
    pub(in crate::method) fn tensors(&self) -> [(&'static str, &[f64]); 3] {
        let Self { hubness, mass, state, view, .. } = self;
        let count = if state.joint { hubness.sums.len() } else { mass.len() };
        [
            ("track.sums", &hubness.sums),
            ("track.mass", &mass[..count]),
            ("track.corrected", &view.x),
        ]
    }

    /// Goes on from a state; `tensor` gives one of its tensors by the name and the length.
    pub(in crate::method) fn resume(
        &mut self,
        saved: Saved,
        tensor: impl Fn(&str, usize) -> Result<Vec<f64>, Refusal>,
    ) -> Result<(), Refusal> {
        let Saved { columns, state, viewed } = saved;
        let State { joint, scale, on, .. } = state;
        let tensors = self.tensors().map(|(name, _)| name);
        let places = self.hubness.sums.len();
        let sums = tensor(tensors[0], places)?;
        let mass = tensor(tensors[1], if joint { places } else { self.mass.len() })?;
        let view = tensor(tensors[2], self.view.x.len())?;
        let belief = mass.iter().all(|mass| *mass >= 0.0)
            && state.is_possible()
            && (scale * mass.iter().sum::<f64>() - on).abs() <= ROUNDING;
        let hubness = Hubness::resumed(columns, sums);
        let (Some(hubness), true) = (hubness, belief && view.iter().all(|x| x.abs() <= MAX_X))
        else {
            return Err(Refusal::Foreign("an impossible belief".to_owned()));
        };
        self.hubness = hubness;
        self.mass[..mass.len()].copy_from_slice(&mass);
        self.view = View::of(view, viewed);
        self.state = state;
        Ok(())
    }
}
