//! One frame: the world seen from one place, painted from far to near.

use super::camera::{Camera, FAR, NEAR};
use super::canvas::{Canvas, Rgb};
use super::look::Look;
use super::noise::smoothstep;
use super::scenery::{LOT, Lot, Plot};
use super::traffic::Traffic;
use super::{building, ground, plants, sky, street};

/// What the painters share.
pub(super) struct Scene<'a> {
    pub(super) canvas: Canvas<'a>,
    pub(super) camera: Camera,
    pub(super) look: &'a Look,
    /// The seed of the world.
    pub(super) seed: u64,
}

impl Scene<'_> {
    /// Paints everything. The painter's algorithm: what is nearer is painted later, over what is
    /// behind it.
    pub(super) fn paint(&mut self, traffic: &Traffic) {
        sky::paint_sky(self);
        sky::paint_skyline(self);
        ground::paint_ground(self);
        let here = self.camera.position;
        let nearest = ((here + f64::from(NEAR)) / LOT).floor() as i64;
        let farthest = ((here + f64::from(FAR)) / LOT).floor() as i64;
        for index in (nearest..=farthest).rev() {
            let start = (index as f64 * LOT - here) as f32;
            self.canvas.opacity = smoothstep(FAR, FAR * 0.82, start);
            for side in [-1.0, 1.0] {
                let lot = Lot::new(self.seed, index, side);
                self.paint_lot(&lot, start);
                street::paint_kerb(self, &lot, start, traffic);
            }
            traffic.paint_between(self, start, start + LOT as f32);
        }
        self.canvas.opacity = 1.0;
    }

    fn paint_lot(&mut self, lot: &Lot, start: f32) {
        match lot.plot {
            Plot::Terrace | Plot::Flats => building::paint_block(self, lot, start),
            Plot::Villa => building::paint_villa(self, lot, start),
            Plot::Park => plants::paint_park(self, lot, start),
            Plot::Field => plants::paint_field(self, lot, start),
            Plot::Woods => plants::paint_woods(self, lot, start),
            Plot::Barrier => street::paint_barrier(self, lot, start),
            Plot::Junction => {}
        }
    }

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
}
