//! The frame that is being painted, and the shapes that several painters use.

use super::camera::{Camera, NEAR};
use super::canvas::{Canvas, Point, Rgb};
use super::look::Look;

/// The state that the painters share.
pub(super) struct Scene<'a> {
    pub(super) canvas: Canvas<'a>,
    pub(super) camera: Camera,
    pub(super) look: &'a Look,
    /// The seed of the world.
    pub(super) seed: u64,
}

impl Scene<'_> {
    /// Paints an upright rectangle that faces the camera, `z` metres away.
    pub(super) fn board(&mut self, x: (f32, f32), y: (f32, f32), z: f32, colour: Rgb) {
        if z < NEAR {
            return;
        }
        let low = self.camera.project(x.0, y.0, z);
        let high = self.camera.project(x.1, y.1, z);
        self.canvas.rect(low, high, colour, 1.0);
    }

    /// Paints an upright wall along the road, at `x`.
    pub(super) fn side(&mut self, x: f32, y: (f32, f32), z: (f32, f32), colour: Rgb) {
        let z = (z.0.max(NEAR), z.1);
        if z.1 <= z.0 {
            return;
        }
        let corners = [
            self.camera.project(x, y.0, z.0),
            self.camera.project(x, y.1, z.0),
            self.camera.project(x, y.1, z.1),
            self.camera.project(x, y.0, z.1),
        ];
        self.canvas.convex(&corners, colour, 1.0);
    }

    /// Paints a box: the face towards the camera and the side of it that can be seen.
    pub(super) fn solid(&mut self, x: (f32, f32), y: (f32, f32), z: (f32, f32), faces: (Rgb, Rgb)) {
        let visible = if x.0 + x.1 > 2.0 * self.camera.eye_x { x.0.min(x.1) } else { x.0.max(x.1) };
        self.side(visible, y, z, faces.1);
        self.board(x, y, z.0, faces.0);
    }
    /// Paints the light around a lamp after dark, fading outwards.
    pub(super) fn glow(&mut self, centre: Point, radius: f32, colour: Rgb) {
        let alpha = 0.085 * self.look.lamps;
        if alpha > 0.0 {
            let rings: u8 = if radius < 4.0 { 2 } else { 6 };
            for ring in 1..=rings {
                let reach = radius * f32::from(ring) / f32::from(rings);
                self.canvas.ellipse(centre, (reach, reach), colour, alpha);
            }
        }
    }
}
