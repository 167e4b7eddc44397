//! The camera on the road: where a point of the world falls in the image.
//!
//! Coordinates of the world, in metres: `x` to the right of the road's middle, `y` up, `z` ahead of
//! the camera along the road.

use super::canvas::Point;
use super::noise::{wave, wave_and_slope};

/// Nothing nearer than this is drawn, in metres.
pub(super) const NEAR: f32 = 1.5;
/// Nothing farther than this is drawn, in metres.
pub(super) const FAR: f32 = 170.0;

/// Metres from one knot of the road's bends to the next, and how far they swing out.
const BEND_LENGTH: f64 = 150.0;
const BEND_SWING: f32 = 11.0;
/// Metres from the road's middle to the middle of the driving lane.
const LANE: f32 = 1.6;
const EYE_HEIGHT: f32 = 1.7;

/// A pinhole camera that looks along the road from the right-hand lane.
#[derive(Clone, Debug)]
pub(super) struct Camera {
    pub(super) focal: f32,
    pub(super) centre: f32,
    pub(super) horizon: f32,
    pub(super) eye_x: f32,
    /// Metres along the route.
    pub(super) position: f64,
    bends: u64,
    here: f32,
    pub(super) heading: f32,
}

impl Camera {
    pub(super) fn new(width: usize, height: usize, seed: u64, position: f64, offset: f32) -> Self {
        let (swing, slope) = wave_and_slope(seed, position / BEND_LENGTH);
        Self {
            focal: width as f32 * 0.58,
            // The road vanishes a little left of the middle: the nearer, right-hand side gets more
            // room.
            centre: width as f32 * 0.46,
            horizon: height as f32 * 0.53,
            eye_x: LANE + offset,
            position,
            bends: seed,
            here: swing * BEND_SWING,
            heading: slope * BEND_SWING / BEND_LENGTH as f32,
        }
    }

    /// How far the road has turned aside at `z`, seen from the camera that looks along its tangent.
    pub(super) fn bend(&self, z: f32) -> f32 {
        let there = wave(self.bends, (self.position + f64::from(z)) / BEND_LENGTH) * BEND_SWING;
        there - self.here - self.heading * z
    }

    /// Pixels a metre at `z`.
    pub(super) fn zoom(&self, z: f32) -> f32 {
        self.focal / z
    }

    pub(super) fn column(&self, x: f32, z: f32) -> f32 {
        self.centre + (x + self.bend(z) - self.eye_x) * self.zoom(z)
    }

    pub(super) fn row(&self, y: f32, z: f32) -> f32 {
        self.horizon + (EYE_HEIGHT - y) * self.zoom(z)
    }

    pub(super) fn project(&self, x: f32, y: f32, z: f32) -> Point {
        (self.column(x, z), self.row(y, z))
    }

    /// How far ahead the road surface is at image row `v` (below the horizon).
    pub(super) fn ground(&self, v: f32) -> f32 {
        EYE_HEIGHT * self.focal / (v - self.horizon).max(1e-3)
    }
}
