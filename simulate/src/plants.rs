//! Trees, hedges, fences: parks, gardens, fields and woods.

use super::camera::NEAR;
use super::canvas::{Rgb, blend, scale};
use super::ground::PAVEMENT;
use super::look::SNOW;
use super::noise::{Dice, hash, lerp, unit};
use super::scene::Scene;
use super::scenery::{LOT, Lot};

const BARK: Rgb = [88.0, 70.0, 58.0];
const GREENS: [Rgb; 5] = [
    [76.0, 122.0, 56.0],
    [96.0, 138.0, 60.0],
    [62.0, 106.0, 62.0],
    [112.0, 142.0, 66.0],
    [84.0, 116.0, 76.0],
];

/// Lawn with a few trees, with or without a low wall.
pub(super) fn paint_park(scene: &mut Scene, lot: &Lot, start: f32) {
    let mut dice = Dice::new(lot.seed ^ 0xA1);
    for slot in (0..3_i64).rev() {
        let z = start + (slot as f32 + dice.between(0.1, 0.9)) * LOT as f32 / 3.0;
        let x = lot.side * (PAVEMENT + dice.between(1.5, 9.0));
        if dice.chance(0.8) {
            paint_tree(scene, (x, z), dice.between(5.0, 9.5), hash(lot.seed, slot));
        }
    }
    if dice.chance(0.5) {
        paint_fence(scene, lot, start, 0.9);
    }
}

/// The plants in front of a villa.
pub(super) fn paint_garden(scene: &mut Scene, lot: &Lot, start: f32) {
    let mut dice = Dice::new(lot.seed ^ 0xA2);
    if dice.chance(0.65) {
        let z = start + dice.between(0.5, 2.0);
        let x = lot.side * (PAVEMENT + dice.between(1.2, 3.0));
        paint_tree(scene, (x, z), dice.between(3.0, 6.5), hash(lot.seed, 5));
    }
    if unit(hash(lot.style, 31)) < 0.5 {
        paint_hedge(scene, lot, start, dice.between(0.8, 1.5));
    } else {
        paint_fence(scene, lot, start, 1.1);
    }
}

/// Open land: far trees now and then, a hedge or a fence along the road.
pub(super) fn paint_field(scene: &mut Scene, lot: &Lot, start: f32) {
    let mut dice = Dice::new(lot.seed ^ 0xA3);
    if dice.chance(0.35) {
        let x = lot.side * (PAVEMENT + dice.between(8.0, 30.0));
        paint_tree(scene, (x, start + 6.0), dice.between(5.0, 9.0), hash(lot.seed, 6));
    }
    if dice.chance(0.15) {
        let x = lot.side * (PAVEMENT + dice.between(4.0, 10.0));
        let look = scene.look;
        let z = start + 4.0;
        if z > NEAR {
            let bale = look.shade(look.snowed([206.0, 178.0, 96.0], 0.7), 0.95, z);
            let zoom = scene.camera.zoom(z);
            let centre = scene.camera.project(x, 0.7, z);
            scene.canvas.ellipse(centre, (0.85 * zoom, 0.7 * zoom), bale, 1.0);
        }
    }
    match unit(hash(lot.style, 33)) {
        roll if roll < 0.3 => paint_hedge(scene, lot, start, 1.1),
        roll if roll < 0.8 => paint_fence(scene, lot, start, 1.15),
        _ => {}
    }
}

/// A wall of trees.
pub(super) fn paint_woods(scene: &mut Scene, lot: &Lot, start: f32) {
    let mut dice = Dice::new(lot.seed ^ 0xA4);
    let conifers = unit(hash(lot.style, 35));
    for slot in (0..5_i64).rev() {
        let z = start + (slot as f32 + dice.between(0.0, 0.9)) * LOT as f32 / 5.0;
        let x = lot.side * (PAVEMENT + dice.between(0.5, 6.5));
        let height = dice.between(7.0, 14.0);
        if dice.chance(conifers) {
            paint_conifer(scene, (x, z), height, hash(lot.seed, slot));
        } else {
            paint_tree(scene, (x, z), height * 0.8, hash(lot.seed, slot));
        }
    }
}

/// A deciduous tree of a `height` in metres, at `(x, z)`.
pub(super) fn paint_tree(scene: &mut Scene, at: (f32, f32), height: f32, seed: u64) {
    let (x, z) = at;
    if z < NEAR {
        return;
    }
    let look = scene.look;
    let zoom = scene.camera.zoom(z);
    let foot = scene.camera.project(x, 0.0, z);
    let size = height * zoom;
    if foot.0 + size < 0.0 || foot.0 - size > scene.canvas.width() as f32 {
        return;
    }
    let mut dice = Dice::new(seed);
    let shadow = look.shade([44.0, 54.0, 52.0], 1.0, z);
    let spread = (size * 0.34, (size * 0.04).max(0.1));
    scene.canvas.ellipse((foot.0 + size * 0.08, foot.1), spread, shadow, 0.45 * look.sun);
    let bark = look.shade(look.snowed(BARK, 0.12), 0.8, z);
    let fork = (foot.0 + size * dice.between(-0.02, 0.02), foot.1 - size * 0.4);
    scene.canvas.stroke(foot, fork, size * 0.05, bark, 1.0);
    let winter = 1.0 - look.leaves;
    if winter > 0.05 {
        paint_branches(scene, fork, size, &mut Dice::new(seed ^ 0xBB), bark, winter);
    }
    if look.leaves > 0.0 {
        paint_crown(scene, foot, size, z, &mut dice);
    }
}

fn paint_crown(scene: &mut Scene, foot: (f32, f32), size: f32, z: f32, dice: &mut Dice) {
    let look = scene.look;
    let turns = dice.unit();
    let green = look.foliage(dice.pick(&GREENS), turns);
    let centre = (foot.0, foot.1 - size * 0.64);
    let fullness = look.leaves * (2.0 - look.leaves);
    let dark = look.shade(scale(green, 0.66), 0.95, z);
    let radius = size * 0.31 * lerp(0.75, 1.0, fullness);
    scene.canvas.ellipse(centre, (radius, radius * 1.08), dark, fullness);
    let (puffs, small) = match size {
        s if s < 14.0 => (4, 1.0),
        s if s < 60.0 => (9, 1.0),
        _ => (22, 0.72),
    };
    for _ in 0..puffs {
        let (dx, dy) = (dice.between(-1.0, 1.0), dice.between(-1.0, 1.0));
        let reach = 0.3 * size * (1.0 - 0.3 * dx * dx * dy * dy);
        let spot = (centre.0 + dx * reach * 0.86, centre.1 + dy * reach);
        // Lighter above and on the left, where the sun is.
        let sunny = 0.88 - 0.15 * dy - 0.09 * dx + dice.between(-0.05, 0.05);
        let r = small * size * dice.between(0.09, 0.15) * lerp(0.5, 1.0, fullness);
        let leaf = look.shade(scale(green, sunny), 1.0, z);
        scene.canvas.ellipse(spot, (r, r * 0.85), leaf, fullness);
    }
}

fn paint_branches(
    scene: &mut Scene,
    fork: (f32, f32),
    size: f32,
    dice: &mut Dice,
    bark: Rgb,
    alpha: f32,
) {
    let limbs = 6_u8;
    for limb in 0..limbs {
        let lean = (f32::from(limb) / f32::from(limbs - 1) - 0.5) * 1.7 + dice.between(-0.15, 0.15);
        let length = size * dice.between(0.3, 0.44) * (1.0 - 0.2 * lean * lean);
        let tip = (fork.0 + lean * length * 0.62, fork.1 - length * (1.15 - 0.5 * lean.abs()));
        scene.canvas.stroke(fork, tip, size * 0.018, bark, alpha);
        if size < 8.0 {
            continue;
        }
        for twig in 1..=4_u8 {
            let t = f32::from(twig) * 0.22;
            let from = (lerp(fork.0, tip.0, t), lerp(fork.1, tip.1, t));
            let turn = lean * 0.5 + if twig % 2 == 0 { 0.55 } else { -0.55 };
            let reach = length * (0.55 - 0.3 * t) * dice.between(0.8, 1.1);
            let to = (from.0 + turn * reach, from.1 - reach * 0.75);
            scene.canvas.stroke(from, to, size * 0.008, bark, alpha * 0.85);
        }
    }
}

fn paint_conifer(scene: &mut Scene, at: (f32, f32), height: f32, seed: u64) {
    let (x, z) = at;
    if z < NEAR {
        return;
    }
    let look = scene.look;
    let zoom = scene.camera.zoom(z);
    let foot = scene.camera.project(x, 0.0, z);
    let size = height * zoom;
    if foot.0 + size < 0.0 || foot.0 - size > scene.canvas.width() as f32 {
        return;
    }
    let mut dice = Dice::new(seed);
    let bark = look.shade(BARK, 0.8, z);
    scene.canvas.stroke(foot, (foot.0, foot.1 - size * 0.2), size * 0.03, bark, 1.0);
    let green = blend([40.0, 82.0, 58.0], [58.0, 96.0, 58.0], dice.unit());
    let wide = size * dice.between(0.15, 0.21);
    for tier in 0..4_u8 {
        let t = f32::from(tier) / 4.0;
        let base = foot.1 - size * (0.1 + 0.68 * t);
        let top = base - size * lerp(0.42, 0.26, t);
        let half = wide * (1.0 - 0.78 * t);
        let needles = look.shade(scale(green, 0.82 + 0.3 * t), 1.0, z);
        let tip = (foot.0, top);
        scene.canvas.convex(&[(foot.0 - half, base), tip, (foot.0 + half, base)], needles, 1.0);
        if look.snow > 0.0 {
            let snow = look.shade(SNOW, 0.96, z);
            // It lies on the left slope, and a little of it on the right.
            let left = (foot.0 - half, base);
            let right = (foot.0 + half * 0.8, lerp(top, base, 0.8));
            let thick = size * 0.045;
            let inner = (foot.0 - half * 0.55, base - thick * 0.6);
            let heart = (foot.0 - half * 0.02, top + thick * 2.2);
            scene.canvas.convex(&[left, tip, heart, inner], snow, 0.9 * look.snow);
            let rim = (foot.0 + half * 0.62, right.1);
            scene.canvas.convex(&[tip, right, rim], snow, 0.8 * look.snow);
        }
    }
}

fn paint_hedge(scene: &mut Scene, lot: &Lot, start: f32, height: f32) {
    let look = scene.look;
    let z = (start.max(NEAR), start + LOT as f32);
    let x = lot.side * (PAVEMENT + 0.3);
    let green = look.foliage([72.0, 104.0, 58.0], unit(hash(lot.seed, 41)));
    let body = blend(green, [112.0, 96.0, 78.0], 0.6 * (1.0 - look.leaves));
    let face = look.shade(body, look.facing(lot.side) * 0.9, z.0);
    scene.side(x, (0.0, height), z, face);
    let top = look.shade(look.snowed(scale(body, 1.15), 0.9), 1.0, z.0);
    scene.side(x, (height - 0.16, height), z, top);
}

/// Posts and rails along the lot.
fn paint_fence(scene: &mut Scene, lot: &Lot, start: f32, height: f32) {
    let look = scene.look;
    let x = lot.side * (PAVEMENT + 0.3);
    let wood = match unit(hash(lot.style, 43)) {
        roll if roll < 0.4 => [226.0, 224.0, 216.0],
        roll if roll < 0.75 => [134.0, 104.0, 78.0],
        _ => [92.0, 98.0, 98.0],
    };
    let near = start.max(NEAR);
    if near >= start + LOT as f32 {
        return;
    }
    let tone = look.shade(wood, look.facing(lot.side), near);
    for rail in [0.45, 0.9] {
        let y = (rail * height - 0.06, rail * height + 0.06);
        scene.side(x, y, (start, start + LOT as f32), tone);
    }
    for post in (0..6_u8).rev() {
        let z = start + f32::from(post) * 2.0;
        scene.board((x - 0.06, x + 0.06), (0.0, height), z, tone);
    }
    let snow = look.shade(SNOW, 1.0, near);
    if look.snow > 0.3 {
        let y = (0.9 * height + 0.06, 0.9 * height + 0.14);
        scene.side(x, y, (start, start + LOT as f32), snow);
    }
}
