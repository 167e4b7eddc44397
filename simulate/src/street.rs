//! The kerb: lamps, poles and wires, signs, street trees, parked cars.

use super::camera::NEAR;
use super::canvas::{Rgb, blend};
use super::ground::ROAD;
use super::noise::{Dice, hash, unit};
use super::plants::paint_tree;
use super::scene::Scene;
use super::scenery::{District, LOT, Lot, Plot};
use super::traffic::Traffic;

const SIGNS: [Rgb; 4] =
    [[206.0, 52.0, 48.0], [48.0, 92.0, 170.0], [232.0, 190.0, 60.0], [236.0, 236.0, 232.0]];

/// Paints the kerb of one lot, from far to near.
pub(super) fn paint_kerb(scene: &mut Scene, lot: &Lot, start: f32, traffic: &Traffic) {
    let urban = matches!(lot.district, District::Town | District::Suburb);
    if lot.plot == Plot::Junction {
        paint_sign(scene, lot, start + 0.5);
        return;
    }
    if lot.plot == Plot::Barrier {
        return;
    }
    let mut dice = Dice::new(lot.seed ^ 0xE1);
    if urban && unit(hash(lot.style, 51)) < 0.45 {
        let x = lot.side * (ROAD + 1.1);
        let height = dice.between(4.2, 6.0);
        paint_tree(scene, (x, start + 9.0), height, hash(lot.style, 52));
    }
    if urban {
        traffic.paint_walker(scene, lot, start);
    }
    if lot.district == District::Town {
        traffic.paint_parked(scene, lot, start + 3.0);
    }
    if !urban {
        if lot.side > 0.0 && lot.index.rem_euclid(3) == 0 {
            paint_pole(scene, lot, start + 1.0);
        }
    } else if (lot.index + i64::from(lot.side > 0.0)).rem_euclid(2) == 0 {
        paint_lamp(scene, lot, start + 1.0);
    }
    if dice.chance(0.14) {
        paint_sign(scene, lot, start + 0.5);
    }
}

/// A concrete wall between posts, two panels a lot.
pub(super) fn paint_barrier(scene: &mut Scene, lot: &Lot, start: f32) {
    let look = scene.look;
    let x = lot.side * (ROAD + 1.6);
    let near = start.max(NEAR);
    let lit = look.facing(lot.side);
    let end = start + LOT as f32;
    if near >= end {
        return;
    }
    // In pieces, so that the haze deepens along the wall.
    for half in [1.0, 0.0] {
        let z = (start + half * 6.0, start + half * 6.0 + 6.0);
        let at = z.0.max(NEAR);
        let panel = look.shade([164.0, 166.0, 158.0], lit, at);
        let band = look.shade([116.0, 138.0, 118.0], lit, at);
        let foot = look.shade([118.0, 118.0, 114.0], lit, at);
        scene.side(x, (0.0, 3.9), z, panel);
        scene.side(x, (2.5, 3.5), z, band);
        scene.side(x, (0.0, 0.5), z, foot);
        let cap = look.shade(look.snowed([190.0, 190.0, 184.0], 0.9), 1.0, at);
        scene.side(x, (3.9, 4.1), z, cap);
        let post = look.shade([92.0, 96.0, 94.0], 0.9, at);
        let face = (x - lot.side * 0.12, x + lot.side * 0.1);
        scene.side(face.0, (0.0, 4.1), (z.0, z.0 + 0.3), post);
        scene.board(face, (0.0, 4.1), z.0, post);
    }
}

fn paint_lamp(scene: &mut Scene, lot: &Lot, z: f32) {
    if z < NEAR {
        return;
    }
    let look = scene.look;
    let zoom = scene.camera.zoom(z);
    let x = lot.side * (ROAD + 0.5);
    let metal = look.shade([70.0, 74.0, 78.0], 0.9, z);
    let top = scene.camera.project(x, 6.2, z);
    let foot = scene.camera.project(x, 0.0, z);
    let head = (top.0 - lot.side * 1.5 * zoom, top.1 - 0.15 * zoom);
    scene.canvas.stroke(foot, top, 0.14 * zoom, metal, 1.0);
    scene.canvas.stroke(top, head, 0.11 * zoom, metal, 1.0);
    let bulb = blend(look.shade([226.0, 226.0, 220.0], 1.0, z), [255.0, 226.0, 160.0], look.lamps);
    let size = 0.3 * zoom;
    scene.canvas.ellipse((head.0, head.1 + 0.1 * zoom), (size, size * 0.45), bulb, 1.0);
    if look.lamps > 0.0 {
        scene.glow(head, 1.5 * zoom, [255.0, 210.0, 140.0]);
    }
}

/// A wooden pole whose wires run on to the next one, three lots ahead.
fn paint_pole(scene: &mut Scene, lot: &Lot, z: f32) {
    let look = scene.look;
    let x = ROAD + 2.2;
    let span = 3.0 * LOT as f32;
    let wood = look.shade([92.0, 76.0, 62.0], 0.85, z.max(NEAR));
    let wire = look.shade([64.0, 66.0, 72.0], 0.9, z.max(NEAR));
    for arm in [-0.9_f32, 0.9] {
        // A hanging wire, in four straight pieces.
        for piece in 0..4_u8 {
            let at = |t: f32| (z + span * t, 7.2 - 2.4 * t * (1.0 - t));
            let (from, to) = (at(f32::from(piece) * 0.25), at(f32::from(piece + 1) * 0.25));
            if from.0 >= NEAR {
                let a = scene.camera.project(x + arm, from.1, from.0);
                let b = scene.camera.project(x + arm, to.1, to.0);
                let thick = 0.04 * scene.camera.zoom(from.0);
                scene.canvas.stroke(a, b, thick.max(0.35), wire, 0.8);
            }
        }
    }
    if z < NEAR {
        return;
    }
    let zoom = scene.camera.zoom(z);
    let lean = 0.2 * (unit(hash(lot.seed, 53)) - 0.5);
    let foot = scene.camera.project(x, 0.0, z);
    let top = scene.camera.project(x + lean, 7.8, z);
    scene.canvas.stroke(foot, top, 0.26 * zoom, wood, 1.0);
    let a = scene.camera.project(x - 1.1, 7.2, z);
    let b = scene.camera.project(x + 1.1, 7.2, z);
    scene.canvas.stroke(a, b, 0.16 * zoom, wood, 1.0);
}

fn paint_sign(scene: &mut Scene, lot: &Lot, z: f32) {
    if z < NEAR {
        return;
    }
    let look = scene.look;
    let mut dice = Dice::new(lot.seed ^ 0xE2);
    let zoom = scene.camera.zoom(z);
    let x = lot.side * (ROAD + 0.6);
    let metal = look.shade([120.0, 122.0, 124.0], 0.9, z);
    let centre = scene.camera.project(x, 2.5, z);
    let foot = scene.camera.project(x, 0.0, z);
    scene.canvas.stroke(foot, centre, 0.09 * zoom, metal, 1.0);
    let plate = dice.pick(&SIGNS);
    let face = look.shade(plate, 0.95, z);
    let rim = look.shade([240.0, 240.0, 236.0], 0.95, z);
    let r = 0.48 * zoom;
    if dice.chance(0.5) {
        scene.canvas.ellipse(centre, (r, r), rim, 1.0);
        scene.canvas.ellipse(centre, (r * 0.8, r * 0.8), face, 1.0);
    } else {
        let wide = r * dice.between(0.9, 1.7);
        let (a, b) = ((centre.0 - wide, centre.1 - r), (centre.0 + wide, centre.1 + r));
        scene.canvas.rect(a, b, rim, 1.0);
        let (a, b) = (
            (centre.0 - wide * 0.86, centre.1 - r * 0.8),
            (centre.0 + wide * 0.86, centre.1 + r * 0.8),
        );
        scene.canvas.rect(a, b, face, 1.0);
    }
}
