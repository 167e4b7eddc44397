//! The ground: road, kerbs, lawns, fields, road markings and the shadows that fall on them.

use super::camera::{FAR, NEAR};
use super::canvas::{Rgb, blend, scale};
use super::look::SNOW;
use super::noise::{Lattice, floor64, hash, smoothstep, unit};
use super::scene::Scene;
use super::scenery::{District, LOT, Lot, Plot};

/// Half the width of the road, in metres.
pub(super) const ROAD: f32 = 3.6;
/// Where the pavement ends and the lots begin, in metres from the road's middle.
pub(super) const PAVEMENT: f32 = 6.2;

/// Lawns and fields get no paler from here on, in metres.
const HAZE_END: f32 = 85.0;

const ASPHALT: Rgb = [98.0, 99.0, 104.0];
const PAVING: Rgb = [170.0, 164.0, 156.0];
const LAWN: Rgb = [104.0, 148.0, 70.0];
const PAINT: Rgb = [232.0, 230.0, 222.0];

/// How much of `[from, to]` lies in the stripes of `width` at the start of each `period`.
pub(super) fn stripes(from: f64, to: f64, period: f64, width: f64) -> f32 {
    let painted = |x: f64| {
        let whole = floor64(x / period);
        whole * width + (x - whole * period).min(width)
    };
    (((painted(to) - painted(from)) / (to - from).max(1e-6)) as f32).clamp(0.0, 1.0)
}

/// The two lots that a row of ground lies in.
struct Sides {
    index: i64,
    lots: [Lot; 2],
}

impl Sides {
    fn new(seed: u64, index: i64) -> Self {
        let lots = [Lot::new(seed, index, -1.0), Lot::new(seed, index, 1.0)];
        Self { index, lots }
    }
}

/// Paints the rows below the horizon.
pub(super) fn paint_ground(scene: &mut Scene) {
    let first = scene.camera.horizon.max(0.0) as usize;
    let mut sides = Sides::new(scene.seed, i64::MIN / 4);
    for y in first..scene.canvas.rows() {
        // Rows at the horizon stand for everything that is far away.
        let z = scene.camera.ground(y as f32 + 0.5).min(FAR);
        let index = floor64((scene.camera.position + f64::from(z)) / LOT) as i64;
        if index != sides.index {
            sides = Sides::new(scene.seed, index);
        }
        paint_row(scene, y, z, &sides.lots);
    }
}

fn paint_row(scene: &mut Scene, y: usize, z: f32, lots: &[Lot; 2]) {
    let look = scene.look;
    // Open ground meets the hills behind it without a white line of haze.
    let veiled = z.min(HAZE_END);
    let road = look.shade(look.snowed(ASPHALT, 0.35), 1.0, z);
    let width = scene.canvas.width() as f32;
    // The road first and right across: the buffer's old pixels must not shine through any seam.
    scene.canvas.row(y, 0.0, width, road, 1.0);
    let zoom = scene.camera.zoom(z);
    let middle = scene.camera.column(0.0, z);
    for lot in lots {
        let edge = |metres: f32| middle + lot.side * metres * zoom;
        let mut span = |from: f32, to: f32, colour: Rgb| {
            scene.canvas.row(y, from.min(to), from.max(to), colour, 1.0);
        };
        let beyond = if lot.side < 0.0 { 0.0 } else { width };
        let side = if lot.plot == Plot::Junction {
            road
        } else {
            look.shade(yard(look, lot), 1.0, veiled)
        };
        span(edge(ROAD), beyond, side);
        if paved(lot) {
            let slabs = look.snowed(PAVING, 0.72);
            span(edge(ROAD), edge(PAVEMENT), look.shade(slabs, 1.0, z));
            span(edge(ROAD), edge(ROAD + 0.16), look.shade(scale(slabs, 1.16), 1.0, z));
        }
    }
    paint_markings(scene, y, z, middle, lots);
    paint_shadow(scene, y, z, middle, &lots[0]);
    paint_grain(scene, y, z);
}

fn paved(lot: &Lot) -> bool {
    matches!(lot.district, District::Town | District::Suburb)
        && !matches!(lot.plot, Plot::Barrier | Plot::Junction)
}

fn yard(look: &super::look::Look, lot: &Lot) -> Rgb {
    let roll = unit(hash(lot.style, 7));
    match lot.plot {
        Plot::Terrace | Plot::Flats | Plot::Barrier => look.snowed(PAVING, 0.8),
        Plot::Field if roll < 0.35 => look.grass([196.0, 176.0, 92.0]),
        Plot::Field if roll < 0.5 => look.grass([134.0, 106.0, 78.0]),
        Plot::Woods => look.grass([88.0, 112.0, 60.0]),
        _ => look.grass(blend(LAWN, [126.0, 156.0, 74.0], roll)),
    }
}

fn paint_markings(scene: &mut Scene, y: usize, z: f32, middle: f32, lots: &[Lot; 2]) {
    let look = scene.look;
    let zoom = scene.camera.zoom(z);
    let far_edge = scene.camera.ground(y as f32).min(FAR + 40.0);
    let near_edge = scene.camera.ground(y as f32 + 1.0);
    let from = scene.camera.position + f64::from(near_edge);
    let to = scene.camera.position + f64::from(far_edge.max(near_edge + 0.01));
    let worn = 0.9 - 0.65 * look.snow;
    let paint = look.shade(PAINT, 1.0, z);
    let mut stripe = |x: f32, half: f32, alpha: f32| {
        let (left, right) = (middle + (x - half) * zoom, middle + (x + half) * zoom);
        scene.canvas.row(y, left, right, paint, alpha * worn);
    };
    let junction = lots[0].plot == Plot::Junction || lots[1].plot == Plot::Junction;
    let within = (from / LOT - floor64(from / LOT)) * LOT;
    if junction {
        // A zebra crossing where the side street begins.
        if within < 3.0 {
            for bar in 0..6 {
                stripe(bar as f32 * 1.15 - 2.9, 0.27, 1.0);
            }
        }
    } else {
        stripe(0.0, 0.08, stripes(from, to, LOT / 2.0, 2.4));
        if !paved(&lots[0]) {
            stripe(-ROAD + 0.3, 0.07, 0.9);
            stripe(ROAD - 0.3, 0.07, 0.9);
        }
    }
    if look.snow > 0.0 {
        // Wheels keep two tracks free; between and beside them the snow stays.
        let snow = look.shade(SNOW, 0.97, z);
        for (x, half) in
            [(0.0, 0.55), (-ROAD + 0.35, 0.5), (ROAD - 0.35, 0.5), (1.8, 0.3), (-1.8, 0.3)]
        {
            let (left, right) = (middle + (x - half) * zoom, middle + (x + half) * zoom);
            scene.canvas.row(y, left, right, snow, 0.62 * look.snow);
        }
    }
}

/// The shadow of the left side, where the sun is.
fn paint_shadow(scene: &mut Scene, y: usize, z: f32, middle: f32, lot: &Lot) {
    let reach = match lot.plot {
        Plot::Terrace => 5.0 + 2.0 * unit(hash(lot.style, 3)),
        Plot::Flats => 7.5,
        Plot::Woods => 4.0 + 2.5 * unit(hash(lot.seed, 3)),
        Plot::Villa | Plot::Park => 1.5 * unit(hash(lot.seed, 3)),
        Plot::Barrier => 2.2,
        Plot::Field | Plot::Junction => return,
    };
    let zoom = scene.camera.zoom(z);
    let (left, right) = (middle - 14.0 * zoom, middle + (reach - PAVEMENT) * zoom);
    let dark = scene.look.shade([38.0, 44.0, 62.0], 1.0, z);
    let fade = smoothstep(FAR, NEAR, z);
    scene.canvas.row(y, left, right, dark, 0.38 * scene.look.sun * fade);
}

/// Patches of wear and growth that are fixed to the ground.
fn paint_grain(scene: &mut Scene, y: usize, z: f32) {
    let strength = 0.26 * smoothstep(60.0, 10.0, z);
    if strength <= 0.0 {
        return;
    }
    let camera = &scene.camera;
    let mut lattice = Lattice::new(scene.seed ^ 0x66, (camera.position + f64::from(z)) * 0.7);
    let step = 1.1 / camera.zoom(z);
    let start = (camera.eye_x - camera.bend(z)) * 1.1 - camera.centre * step;
    let mut factor =
        |x: usize| 256.0 * (1.0 + strength * (lattice.value(start + x as f32 * step) - 0.5));
    let grain = scene.canvas.grain();
    let mut from = factor(0);
    let pixels = scene.canvas.row_mut(y).chunks_mut(3 * grain);
    for (group, pixels) in pixels.enumerate() {
        let to = factor((group + 1) * grain);
        let rise = (to - from) / grain as f32;
        for (number, pixel) in pixels.chunks_exact_mut(3).enumerate() {
            let factor = (from + rise * number as f32) as u32;
            for channel in pixel {
                *channel = ((u32::from(*channel) * factor) >> 8).min(255) as u8;
            }
        }
        from = to;
    }
}
