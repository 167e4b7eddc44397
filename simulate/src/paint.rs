//! One frame: the world seen from one place, painted from far to near.

use super::camera::{FAR, NEAR};
use super::noise::smoothstep;
use super::scene::Scene;
use super::scenery::{LOT, Lot, Plot};
use super::traffic::Traffic;
use super::{building, ground, plants, sky, street};

/// Paints everything. The painter's algorithm: nearer things are painted later, over
/// farther ones.
pub(super) fn paint(scene: &mut Scene, traffic: &Traffic) {
    sky::paint_sky(scene);
    sky::paint_skyline(scene);
    ground::paint_ground(scene);
    let here = scene.camera.position;
    let nearest = ((here + f64::from(NEAR)) / LOT).floor() as i64;
    let farthest = ((here + f64::from(FAR)) / LOT).floor() as i64;
    for index in (nearest..=farthest).rev() {
        let start = (index as f64 * LOT - here) as f32;
        scene.canvas.opacity = smoothstep(FAR, FAR * 0.82, start);
        for side in [-1.0, 1.0] {
            let lot = Lot::new(scene.seed, index, side);
            paint_lot(scene, &lot, start);
            street::paint_kerb(scene, &lot, start, traffic);
        }
        traffic.paint_between(scene, start, start + LOT as f32);
    }
    scene.canvas.opacity = 1.0;
}

fn paint_lot(scene: &mut Scene, lot: &Lot, start: f32) {
    match lot.plot {
        Plot::Terrace | Plot::Flats => building::paint_block(scene, lot, start),
        Plot::Villa => building::paint_villa(scene, lot, start),
        Plot::Park => plants::paint_park(scene, lot, start),
        Plot::Field => plants::paint_field(scene, lot, start),
        Plot::Woods => plants::paint_woods(scene, lot, start),
        Plot::Barrier => street::paint_barrier(scene, lot, start),
        Plot::Junction => {}
    }
}
