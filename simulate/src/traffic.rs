//! Other traffic: vehicles that move, walkers, and parked cars that were not there before.

use super::camera::{FAR, NEAR};
use super::canvas::{Rgb, blend, scale};
use super::ground::ROAD;
use super::look::Look;
use super::noise::{Dice, hash, smoothstep};
use super::scene::Scene;
use super::scenery::{LOT, Lot};

/// Vehicles seen in one frame at most.
const CROWD: usize = 6;
/// Frames from one vehicle of a stream to the next.
const ONCOMING: usize = 14;
const LEADING: usize = 44;

#[derive(Clone, Copy)]
struct Mover {
    seed: u64,
    x: f32,
    z: f32,
    oncoming: bool,
}

/// The traffic of one frame.
pub(super) struct Traffic {
    amount: f32,
    seed: u64,
    movers: [Option<Mover>; CROWD],
}

impl Traffic {
    /// The traffic at frame `index`, an `amount` from 0 to 1.
    pub(super) fn new(amount: f32, seed: u64, index: usize) -> Self {
        let mut movers = [None; CROWD];
        if amount > 0.0 {
            let (coming, leading) = movers.split_at_mut(CROWD / 2);
            for (back, slot) in coming.iter_mut().enumerate() {
                *slot = oncoming(amount, seed, index, back);
            }
            for (back, slot) in leading.iter_mut().take(1).enumerate() {
                *slot = leader(amount, seed, index, back);
            }
        }
        Self { amount, seed, movers }
    }

    /// Paints the vehicles from `from` to `to` metres ahead.
    pub(super) fn paint_between(&self, scene: &mut Scene, from: f32, to: f32) {
        for mover in self.movers.iter().flatten() {
            if (from..to).contains(&mover.z) {
                Car::new(mover.seed).paint(scene, mover.x, mover.z, mover.oncoming);
            }
        }
    }

    /// Paints the car that is parked at a lot, if there is one.
    pub(super) fn paint_parked(&self, scene: &mut Scene, lot: &Lot, z: f32) {
        if let Some(seed) = self.parked(lot) {
            let x = lot.side * (ROAD - 0.75);
            Car::new(seed).paint(scene, x, z, lot.side < 0.0);
        }
    }

    /// The seed of the car that is parked at a lot: the one of the reference drive, or another one,
    /// or none.
    fn parked(&self, lot: &Lot) -> Option<u64> {
        let mut usual = Dice::new(lot.seed ^ 0xCA);
        let seed = usual.chance(0.4).then_some(lot.seed ^ 0xC0);
        let place = lot.index * 2 + i64::from(lot.side > 0.0);
        let mut today = Dice::new(hash(self.seed ^ 0xCA12, place));
        if today.chance(self.amount * 0.8) {
            let other = hash(self.seed ^ 0xCA13, place);
            return today.chance(0.45).then_some(other);
        }
        seed
    }

    /// Paints the walker on the pavement, if there is one.
    pub(super) fn paint_walker(&self, scene: &mut Scene, lot: &Lot, start: f32) {
        let place = lot.index * 2 + i64::from(lot.side > 0.0);
        let mut dice = Dice::new(hash(self.seed ^ 0x3A1, place));
        if !dice.chance(self.amount * 0.45) {
            return;
        }
        let z = start + dice.between(0.0, LOT as f32);
        if z < NEAR {
            return;
        }
        let look = scene.look;
        let x = lot.side * (ROAD + dice.between(0.8, 2.2));
        let coat: Rgb = dice.pick(&[
            [62.0, 70.0, 96.0],
            [150.0, 60.0, 56.0],
            [86.0, 96.0, 72.0],
            [196.0, 176.0, 132.0],
        ]);
        let zoom = scene.camera.zoom(z);
        let legs = look.shade([52.0, 52.0, 62.0], 0.9, z);
        let tall = dice.between(0.92, 1.05);
        for leg in [-0.11, 0.11] {
            scene.board((x + leg - 0.08, x + leg + 0.08), (0.0, 0.85 * tall), z, legs);
        }
        let body = look.shade(scale(coat, 0.95), 0.95, z);
        scene.board((x - 0.24, x + 0.24), (0.75 * tall, 1.45 * tall), z, body);
        let head = scene.camera.project(x, 1.6 * tall, z);
        let skin = look.shade([196.0, 152.0, 124.0], 0.95, z);
        scene.canvas.ellipse(head, (0.12 * zoom, 0.15 * zoom), skin, 1.0);
    }
}

/// The vehicle that comes the other way, `back` slots ago.
fn oncoming(amount: f32, seed: u64, index: usize, back: usize) -> Option<Mover> {
    let slot = (index / ONCOMING).checked_sub(back)?;
    let seed = hash(seed ^ 0x0C0, slot as i64);
    let mut dice = Dice::new(seed);
    if !dice.chance(amount * 0.75) {
        return None;
    }
    // It is met some frames after it has come into sight, at the sum of both speeds.
    let age = (index - slot * ONCOMING) as f32;
    let start = dice.between(90.0, 150.0);
    let z = start - age * dice.between(4.5, 7.0);
    (z > NEAR).then_some(Mover { seed, x: -1.75, z, oncoming: true })
}

/// The vehicle ahead in the same lane: it is caught up with, followed, and lost again.
fn leader(amount: f32, seed: u64, index: usize, back: usize) -> Option<Mover> {
    let slot = (index / LEADING).checked_sub(back)?;
    let seed = hash(seed ^ 0x1EAD, slot as i64);
    let mut dice = Dice::new(seed);
    if !dice.chance(amount * 0.9) {
        return None;
    }
    let t = (index % LEADING) as f32 / LEADING as f32;
    let away = smoothstep(0.3, 0.0, t) + smoothstep(0.7, 1.0, t);
    let z = dice.between(8.0, 18.0) + 140.0 * away;
    Some(Mover { seed, x: 1.7, z, oncoming: false })
}

const PAINTS: [Rgb; 8] = [
    [188.0, 42.0, 44.0],
    [40.0, 76.0, 136.0],
    [222.0, 224.0, 226.0],
    [52.0, 54.0, 60.0],
    [146.0, 152.0, 158.0],
    [64.0, 108.0, 92.0],
    [214.0, 166.0, 58.0],
    [108.0, 44.0, 60.0],
];

/// A car, van or lorry.
struct Car {
    paint: Rgb,
    half: f32,
    length: f32,
    /// Heights of the body and of the roof, in metres.
    body: f32,
    roof: f32,
}

impl Car {
    fn new(seed: u64) -> Self {
        let mut dice = Dice::new(seed);
        let paint = dice.pick(&PAINTS);
        match dice.unit() {
            r if r < 0.66 => Self { paint, half: 0.88, length: 4.2, body: 0.92, roof: 1.46 },
            r if r < 0.88 => Self { paint, half: 0.98, length: 5.2, body: 1.2, roof: 2.3 },
            _ => Self { paint, half: 1.2, length: 7.0, body: 3.0, roof: 3.3 },
        }
    }

    /// Paints it with its near end at `(x, z)`; `oncoming` shows its front.
    fn paint(&self, scene: &mut Scene, x: f32, z: f32, oncoming: bool) {
        if !(NEAR..=FAR).contains(&z) {
            return;
        }
        let look = scene.look;
        let side = if x > scene.camera.eye_x { 1.0 } else { -1.0 };
        let skin = |by: f32| look.shade(scale(self.paint, by), 0.95, z);
        let ends = (z, z + self.length);
        let sides = (x - self.half, x + self.half);
        let zoom = scene.camera.zoom(z);
        let foot = scene.camera.project(x, 0.0, z);
        let shadow = look.shade([30.0, 32.0, 40.0], 1.0, z);
        let spread = (self.half * 1.12 * zoom, 0.16 * zoom);
        scene.canvas.ellipse(foot, spread, shadow, 0.6);
        let tyre = look.shade([34.0, 34.0, 38.0], 1.0, z);
        for wheel in [-0.72, 0.72] {
            let middle = x + wheel * self.half;
            scene.board((middle - 0.13, middle + 0.13), (0.0, 0.5), z, tyre);
        }
        scene.solid(sides, (0.28, self.body), ends, (skin(0.92), skin(look.facing(side) * 0.86)));
        let glass = look.shade([56.0, 68.0, 82.0], 0.95, z);
        let cabin = (x - self.half * 0.86, x + self.half * 0.86);
        let boot = (z + 0.5, z + self.length - 1.2);
        if self.body < 2.0 {
            let side_glass = scale(glass, 0.9);
            scene.solid(cabin, (self.body, self.roof), boot, (skin(0.86), side_glass));
            let roof = (self.roof - 0.1, self.roof);
            scene.solid(cabin, roof, boot, (skin(1.0), skin(1.0)));
            let pane = (x - self.half * 0.72, x + self.half * 0.72);
            scene.board(pane, (self.body + 0.06, self.roof - 0.12), boot.0, glass);
            let deck = look.shade(look.snowed(self.paint, 0.35), 1.0, z);
            scene.board(sides, (self.body - 0.08, self.body), z, deck);
        }
        self.paint_lights(scene, look, x, z, oncoming);
    }

    fn paint_lights(&self, scene: &mut Scene, look: &Look, x: f32, z: f32, oncoming: bool) {
        let (colour, by_day) = if oncoming {
            ([255.0, 244.0, 214.0], [226.0, 228.0, 226.0])
        } else {
            ([255.0, 60.0, 44.0], [168.0, 34.0, 34.0])
        };
        let zoom = scene.camera.zoom(z);
        let lamp = blend(look.shade(by_day, 1.0, z), look.veil(colour, z), look.lamps);
        for which in [-0.74, 0.74] {
            let centre = scene.camera.project(x + which * self.half, 0.72, z);
            scene.canvas.ellipse(centre, (0.15 * zoom, 0.1 * zoom), lamp, 1.0);
            let glow = if oncoming { 0.6 } else { 0.4 };
            scene.glow(centre, glow * zoom, colour);
        }
        let plate = look.shade([236.0, 234.0, 214.0], 0.95, z);
        scene.board((x - 0.25, x + 0.25), (0.42, 0.55), z, plate);
    }
}
