//! The sky, its clouds, and the far skyline that changes slowly along the route.

use super::canvas::{blend, mix_pixels, scale};
use super::look::SNOW;
use super::noise::{Lattice, floor64, smoothstep, wave};
use super::scene::Scene;

/// Metres along the route over which the skyline becomes another one.
const SKYLINE_LENGTH: f64 = 260.0;

/// Paints the rows above the horizon.
pub(super) fn paint_sky(scene: &mut Scene) {
    let (look, camera) = (scene.look, scene.camera.clone());
    let horizon = camera.horizon;
    let white = blend([255.0, 255.0, 255.0], look.haze, 0.25 + 0.5 * look.lamps);
    let rows = scene.canvas.rows().min(horizon.ceil() as usize + 1);
    let width = scene.canvas.width();
    for y in 0..rows {
        let up = ((horizon - y as f32) / camera.focal).max(0.0);
        let base = blend(look.haze, look.zenith, smoothstep(-0.1, 0.75, up));
        scene.canvas.row(y, 0.0, width as f32, base, 1.0);
        let fade = smoothstep(0.05, 0.3, up) * 0.85;
        if fade <= 0.0 {
            continue;
        }
        // Clouds lie on a plane overhead, so they grow and spread towards the top of the image.
        let depth = 1.0 / (up + 0.12);
        let across = f64::from(depth) * 1.1 + camera.position * 0.002 + f64::from(look.clouds);
        let (mut large, mut small) = (
            Lattice::new(scene.seed ^ 0xC1, across * 0.9),
            Lattice::new(scene.seed ^ 0xC2, across * 2.3),
        );
        let step = depth / camera.focal;
        let start = -camera.centre * step + camera.heading * 3.0;
        let mut cover = |x: usize| {
            let along = start + x as f32 * step;
            let density = 0.68 * large.value(along * 1.1) + 0.32 * small.value(along * 2.9);
            fade * ((density - 0.46) * 4.0).clamp(0.0, 1.0)
        };
        let grain = scene.canvas.grain();
        let mut from = cover(0);
        let pixels = scene.canvas.row_mut(y).chunks_mut(3 * grain);
        for (group, pixels) in pixels.enumerate() {
            let to = cover((group + 1) * grain);
            let rise = (to - from) / grain as f32;
            if from > 0.0 || to > 0.0 {
                for (number, pixel) in pixels.chunks_exact_mut(3).enumerate() {
                    mix_pixels(pixel, white, from + rise * number as f32);
                }
            }
            from = to;
        }
    }
}

/// Paints two ranges of hills behind everything that stands along the road.
pub(super) fn paint_skyline(scene: &mut Scene) {
    let (look, camera) = (scene.look, scene.camera.clone());
    let green = look.grass([96.0, 128.0, 92.0]);
    let rock = blend([112.0, 130.0, 156.0], SNOW, 0.75 * look.snow);
    let far = blend(look.shade(rock, 0.95, 40.0), look.haze, 0.45);
    let near = blend(look.shade(scale(green, 0.9), 0.9, 40.0), look.haze, 0.42);
    let floor = camera.horizon + 1.0;
    let here = camera.position / SKYLINE_LENGTH;
    for (layer, colour, height, detail) in [(1, far, 0.21, 1.6), (2, near, 0.10, 3.1)] {
        let seed = scene.seed ^ (0x5C1 * layer);
        for x in 0..scene.canvas.width() {
            // The direction of the column, in which the heading of the road takes part.
            let angle = (x as f32 - camera.centre) / camera.focal + camera.heading;
            let ridge = ridge(seed, f64::from(angle) * detail, here);
            let top = floor - height * ridge * camera.focal;
            scene.canvas.column(x, top, floor, colour, 1.0);
        }
    }
}

/// The height of a range, 0 to 1, in one direction; it changes as one drives on.
fn ridge(seed: u64, direction: f64, along: f64) -> f32 {
    let cell = floor64(along);
    let blend = smoothstep(0.0, 1.0, (along - cell) as f32);
    let part = |which: f64| {
        let seed = seed.wrapping_add(((cell + which) as i64 as u64).wrapping_mul(0x1_0003));
        0.5 + 0.36 * wave(seed, direction) + 0.14 * wave(seed ^ 0xF, direction * 3.3)
    };
    part(0.0) * (1.0 - blend) + part(1.0) * blend
}
