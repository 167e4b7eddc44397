//! Buildings: boxes with window grids, shop fronts and roofs.

use super::camera::NEAR;
use super::canvas::{Rgb, blend, scale};
use super::ground::{PAVEMENT, stripes};
use super::look::SNOW;
use super::noise::{Dice, hash, unit};
use super::scene::Scene;
use super::scenery::{LOT, Lot, Plot};

const WALLS: [Rgb; 10] = [
    [176.0, 98.0, 78.0],
    [206.0, 184.0, 146.0],
    [214.0, 160.0, 96.0],
    [222.0, 214.0, 200.0],
    [150.0, 164.0, 150.0],
    [146.0, 166.0, 188.0],
    [196.0, 128.0, 108.0],
    [142.0, 112.0, 96.0],
    [232.0, 206.0, 150.0],
    [168.0, 170.0, 176.0],
];
const ROOFS: [Rgb; 4] =
    [[158.0, 82.0, 62.0], [104.0, 78.0, 72.0], [92.0, 98.0, 110.0], [136.0, 96.0, 66.0]];
const AWNINGS: [Rgb; 5] = [
    [188.0, 58.0, 54.0],
    [52.0, 112.0, 96.0],
    [60.0, 84.0, 142.0],
    [222.0, 168.0, 62.0],
    [108.0, 62.0, 92.0],
];

/// A building in metres: a box beside the road, and its face.
struct Building {
    side: f32,
    /// Distance of the front from the road's middle, and of the back.
    front: f32,
    back: f32,
    z: (f32, f32),
    height: f32,
    storey: f32,
    /// Height of the ground floor if it is a shop's, else 0.
    shop: f32,
    awning: Rgb,
    windows: u32,
    /// Share of the wall that a window takes, along and up.
    pane: (f32, f32),
    wall: Rgb,
    roof: Rgb,
    /// Height of the ridge above the eaves; 0 is a flat roof.
    rise: f32,
    seed: u64,
}

/// A house of a terrace or a block of flats, from one end of the lot to the other.
pub(super) fn paint_block(scene: &mut Scene, lot: &Lot, start: f32) {
    let mut dice = Dice::new(lot.style);
    let flats = lot.plot == Plot::Flats;
    let storey = dice.between(2.9, 3.6);
    let floors =
        if flats { dice.pick(&[5.0, 6.0, 7.0, 8.0]) } else { dice.pick(&[2.0, 3.0, 3.0, 4.0]) };
    let pitched = !flats && dice.chance(0.7);
    let mut wall = dice.pick(&WALLS);
    let shops = dice.chance(0.55);
    let windows = if flats { dice.pick(&[4, 5, 6]) } else { dice.pick(&[3, 4, 4, 5]) };
    let pane = (dice.between(0.34, 0.62), dice.between(0.44, 0.62));
    let roof = dice.pick(&ROOFS);
    let rise = if pitched { dice.between(2.0, 3.6) } else { 0.0 };
    let set_back = PAVEMENT + if flats { dice.between(1.0, 3.5) } else { dice.between(0.0, 0.8) };
    // The differences of one house from its neighbour.
    let mut own = Dice::new(lot.seed ^ 0xB1);
    if own.chance(0.45) {
        wall = own.pick(&WALLS);
    }
    let extra = if !flats && own.chance(0.25) { storey } else { 0.0 };
    let shop = if shops || own.chance(0.25) { 3.4 } else { 0.0 };
    let house = Building {
        side: lot.side,
        front: set_back,
        back: set_back + 9.0,
        z: (start, start + LOT as f32),
        height: floors * storey + extra + if shop > 0.0 { 0.9 } else { 0.4 },
        storey,
        shop,
        awning: own.pick(&AWNINGS),
        windows,
        pane,
        wall: scale(wall, own.between(0.9, 1.05)),
        roof,
        rise,
        seed: lot.seed,
    };
    house.paint(scene);
}

/// A house in its garden.
pub(super) fn paint_villa(scene: &mut Scene, lot: &Lot, start: f32) {
    let mut style = Dice::new(lot.style);
    let mut own = Dice::new(lot.seed ^ 0xB2);
    let floors = style.pick(&[1.0, 2.0, 2.0]);
    let set_back = PAVEMENT + style.between(2.6, 4.6);
    let begin = own.between(0.8, 2.4);
    let house = Building {
        side: lot.side,
        front: set_back,
        back: set_back + 8.0,
        z: (start + begin, start + begin + own.between(7.6, 9.0)),
        height: floors * 2.9 + 0.4,
        storey: 2.9,
        shop: 0.0,
        awning: AWNINGS[0],
        windows: style.pick(&[2, 3]),
        pane: (style.between(0.3, 0.5), style.between(0.4, 0.5)),
        wall: own.pick(&WALLS),
        roof: style.pick(&ROOFS),
        rise: style.between(2.0, 3.2),
        seed: lot.seed,
    };
    house.paint(scene);
    super::plants::paint_garden(scene, lot, start);
}

impl Building {
    fn x(&self, metres: f32) -> f32 {
        self.side * metres
    }

    fn paint(&self, scene: &mut Scene) {
        let look = scene.look;
        let end = self.z.0;
        let gable = look.shade(scale(self.wall, 0.86), 0.84, end.max(NEAR));
        if self.rise > 0.0 {
            self.paint_roof(scene, gable);
        }
        let (front, back) = (self.x(self.front), self.x(self.back));
        // A little higher than the eaves, so that no seam shows below the gable.
        scene.board((front, back), (0.0, self.height + 0.08), end, gable);
        self.paint_gable_windows(scene);
        self.paint_front(scene);
        if self.rise == 0.0 {
            let ledge = look.shade(look.snowed(scale(self.wall, 0.82), 0.9), 1.0, end.max(NEAR));
            let y = (self.height - 0.1, self.height + 0.4);
            scene.side(front, y, self.z, ledge);
            scene.board((front, back), y, end, ledge);
        }
    }

    /// The slope towards the road and the gable towards the camera.
    fn paint_roof(&self, scene: &mut Scene, gable: Rgb) {
        let look = scene.look;
        let z = (self.z.0.max(NEAR), self.z.1);
        if z.1 <= z.0 {
            return;
        }
        let (eaves, top) = (self.height, self.height + self.rise);
        let middle = self.x((self.front + self.back) * 0.5);
        let front = self.x(self.front - 0.3);
        let slope = [
            scene.camera.project(front, eaves, z.0),
            scene.camera.project(middle, top, z.0),
            scene.camera.project(middle, top, z.1),
            scene.camera.project(front, eaves, z.1),
        ];
        let tiles = look.shade(look.snowed(self.roof, 0.95), look.facing(self.side) + 0.06, z.0);
        scene.canvas.convex(&slope, tiles, 1.0);
        if self.z.0 > NEAR {
            let triangle =
                [slope[0], slope[1], scene.camera.project(self.x(self.back), eaves, z.0)];
            scene.canvas.convex(&triangle, gable, 1.0);
        }
    }

    /// A few small windows in the wall towards the camera.
    fn paint_gable_windows(&self, scene: &mut Scene) {
        let z = self.z.0;
        let floors = ((self.height - 0.3) / self.storey) as i64;
        if z < NEAR || scene.camera.zoom(z) < 2.0 {
            return;
        }
        for floor in 0..floors {
            for which in 0..2_i64 {
                let home = unit(hash(self.seed ^ 0x12, which * 64 + floor));
                let middle = self.front + (self.back - self.front) * (0.3 + 0.4 * which as f32);
                let sill = self.height - self.storey * (0.35 + floor as f32) - 1.3;
                let x = (self.x(middle - 0.55), self.x(middle + 0.55));
                if sill > 0.4 {
                    let pane = scene.look.pane(home, 0.84, z);
                    scene.board(x, (sill, sill + 1.3), z, pane);
                }
            }
        }
    }

    /// The wall towards the road, an image column at a time.
    fn paint_front(&self, scene: &mut Scene) {
        let z = (self.z.0.max(NEAR), self.z.1);
        if z.1 <= z.0 {
            return;
        }
        let x = self.x(self.front);
        let ends = (scene.camera.column(x, z.0), scene.camera.column(x, z.1));
        let width = scene.canvas.width() as f32;
        let (left, right) = (ends.0.min(ends.1), ends.0.max(ends.1));
        let (from, to) = (left.max(0.0), right.min(width));
        if from >= to || right - left < 0.02 {
            return;
        }
        // Along an image row, 1 / z runs evenly.
        let inverse = |u: f32| {
            let t = ((u - ends.0) / (ends.1 - ends.0)).clamp(0.0, 1.0);
            1.0 / z.0 + (1.0 / z.1 - 1.0 / z.0) * t
        };
        for column in from as usize..to.ceil() as usize {
            let (a, b) = ((column as f32).max(left), (column as f32 + 1.0).min(right));
            let (za, zb) = (1.0 / inverse(a), 1.0 / inverse(b));
            let strip = Strip {
                column,
                cover: b - a,
                z: 1.0 / inverse(0.5 * (a + b)),
                along: (za.min(zb) - self.z.0, za.max(zb) - self.z.0),
            };
            self.paint_strip(scene, &strip);
        }
    }

    fn paint_strip(&self, scene: &mut Scene, strip: &Strip) {
        let look = scene.look;
        let z = strip.z;
        let lit = look.facing(self.side);
        let wall = look.shade(self.wall, lit, z);
        let zoom = scene.camera.zoom(z);
        let base = scene.camera.row(0.0, z);
        let mut fill = |y: (f32, f32), colour: Rgb, alpha: f32| {
            let (top, bottom) = (base - y.1 * zoom, base - y.0 * zoom);
            scene.canvas.column(strip.column, top, bottom, colour, alpha * strip.cover);
        };
        fill((0.0, self.height), wall, 1.0);
        let length = self.z.1 - self.z.0;
        let pitch = length / self.windows as f32;
        let margin = 0.5 * (1.0 - self.pane.0) * pitch;
        let (from, to) = (strip.along.0 - margin, strip.along.1 - margin);
        let glass = stripes(
            f64::from(from),
            f64::from(to),
            f64::from(pitch),
            f64::from(self.pane.0 * pitch),
        );
        let which = ((strip.along.0 + strip.along.1) * 0.5 / pitch) as i64;
        let first = if self.shop > 0.0 { self.shop } else { 0.3 };
        let floors = ((self.height - first) / self.storey) as i64;
        for floor in 0..floors {
            let sill =
                first + floor as f32 * self.storey + (1.0 - self.pane.1) * 0.55 * self.storey;
            let home = unit(hash(self.seed ^ 0x11, which * 64 + floor));
            let head = sill + self.pane.1 * self.storey;
            let frame = look.shade(blend(self.wall, [240.0; 3], 0.55), lit, z);
            fill((sill - 0.16, sill), look.snowed(frame, 0.0), glass);
            fill((sill, head), look.pane(home, lit, z), glass);
            if zoom * self.storey > 26.0 {
                let bar = sill + 0.62 * (head - sill);
                fill((bar - 0.05, bar + 0.05), frame, glass);
            }
        }
        if self.shop > 0.0 {
            self.paint_shop(&mut fill, look, strip);
        } else if glass > 0.0 && which == 1 {
            fill((0.0, 2.3), look.shade([92.0, 66.0, 52.0], lit, z), glass);
        }
        let snow = look.shade(SNOW, 1.0, z);
        fill((self.height - 0.12, self.height + 0.1), snow, 0.8 * look.snow);
    }

    fn paint_shop(
        &self,
        fill: &mut impl FnMut((f32, f32), Rgb, f32),
        look: &super::look::Look,
        strip: &Strip,
    ) {
        let lit = look.facing(self.side);
        let (from, to) = (f64::from(strip.along.0 - 0.6), f64::from(strip.along.1 - 0.6));
        let display = stripes(from, to, 4.0, 2.8);
        let open = 0.4 + 0.6 * unit(hash(self.seed, 21));
        fill((0.35, 2.45), look.pane(open, lit, strip.z), display);
        let awning = look.shade(look.snowed(self.awning, 0.35), lit + 0.04, strip.z);
        fill((2.45, 3.15), awning, 1.0);
        let stripe = stripes(from, to, 1.0, 0.5);
        let pale = look.shade([238.0, 232.0, 220.0], lit + 0.04, strip.z);
        fill((2.45, 2.9), pale, 0.75 * stripe * f32::from(unit(hash(self.seed, 22)) < 0.5));
    }
}

/// One image column of a front.
struct Strip {
    column: usize,
    /// Share of the column that the front covers.
    cover: f32,
    z: f32,
    /// The metres of the front that the column sees.
    along: (f32, f32),
}
