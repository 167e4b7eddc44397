//! The lots along the road, and their use.
//!
//! The road is lined by lots of [`LOT`] metres, eight to a block. Half of the blocks are copies of
//! a few templates that come back all along the route, and the houses of a terrace are one house
//! repeated: so different places look alike.

use super::noise::{Dice, hash};

/// Metres of road that one lot takes.
pub(super) const LOT: f64 = 12.0;
const LOTS_A_BLOCK: i64 = 8;
/// Blocks that in a row belong to the same kind of district.
const BLOCKS_A_DISTRICT: i64 = 2;
/// Templates of each kind of district, the share of its blocks that are copies, and the share of a
/// copy's lots that have been rebuilt since.
const TEMPLATES: i64 = 3;
const COPIES: f32 = 0.65;
const REBUILT: f32 = 0.08;

/// Once in 28 lots the road runs between noise barriers, for 5 lots. There one place
/// looks like the next, and like the same stretch elsewhere: matches are close, and wrong.
const BARRIER_EVERY: i64 = 28;
const BARRIER_LOTS: i64 = 5;

/// The character of a stretch of road.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum District {
    Town,
    Suburb,
    Country,
    Forest,
}

/// The districts that a stretch of road comes through: in every mile there is some of each kind.
const TOUR: [District; 6] = [
    District::Town,
    District::Suburb,
    District::Country,
    District::Town,
    District::Suburb,
    District::Forest,
];

/// The use of a lot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Plot {
    /// A house of several floors, wall to wall with its neighbours.
    Terrace,
    /// A large block of flats or offices.
    Flats,
    /// A house with a garden.
    Villa,
    /// Lawn and trees.
    Park,
    /// Open fields behind a fence or hedge.
    Field,
    /// Trees, close together.
    Woods,
    /// A side street.
    Junction,
    /// A noise barrier: a bare wall, the same everywhere.
    Barrier,
}

/// One lot on one side of the road.
#[derive(Clone, Debug)]
pub(super) struct Lot {
    pub(super) district: District,
    pub(super) plot: Plot,
    /// The seed of everything on it.
    pub(super) seed: u64,
    /// The seed of its likeness to its neighbours: a terrace's facade, the spacing of
    /// poles.
    pub(super) style: u64,
    /// Its number along the route.
    pub(super) index: i64,
    /// -1 on the left of the road, 1 on the right.
    pub(super) side: f32,
}

pub(super) fn district(seed: u64, lot: i64) -> District {
    let group = lot.div_euclid(LOTS_A_BLOCK * BLOCKS_A_DISTRICT);
    let length = TOUR.len() as i64;
    // Each tour begins somewhere else, so that the order is no order.
    let shift = hash(seed ^ 0xD157, group.div_euclid(length)) >> 8;
    let stop = (group.rem_euclid(length) as u64 + shift) % TOUR.len() as u64;
    TOUR.get(stop as usize).copied().unwrap_or(District::Town)
}

impl Lot {
    /// The lot `index` of the world `seed` on one side of the road.
    pub(super) fn new(seed: u64, index: i64, side: f32) -> Self {
        let district = district(seed, index);
        let block = index.div_euclid(LOTS_A_BLOCK);
        let within = index.rem_euclid(LOTS_A_BLOCK);
        let mut dice = Dice::new(hash(seed ^ 0xB10C, block));
        let block_seed = if dice.chance(COPIES) {
            let template = (dice.unit() * TEMPLATES as f32) as i64;
            hash(seed ^ 0x7E3F, district as i64 * TEMPLATES + template)
        } else {
            hash(seed ^ 0x0417, block)
        };
        let key = within * 2 + i64::from(side > 0.0);
        let own = hash(seed ^ 0x4E8B, index * 2 + i64::from(side > 0.0));
        let rebuilt = Dice::new(own).chance(REBUILT);
        let lot_seed = if rebuilt { own } else { hash(block_seed, key) };
        // Runs of lots share a style: three or four at a time on each side.
        let run = (within / if side > 0.0 { 3 } else { 4 }) * 2 + i64::from(side > 0.0);
        let style = if rebuilt { own } else { hash(block_seed ^ 0x57, run) };
        let plot = if barrier(seed, index) {
            Plot::Barrier
        } else {
            plot(district, within, lot_seed, style)
        };
        Self { district, plot, seed: lot_seed, style, index, side }
    }
}

fn barrier(seed: u64, index: i64) -> bool {
    let cycle = index.div_euclid(BARRIER_EVERY);
    let mut dice = Dice::new(hash(seed ^ 0xBA2, cycle));
    let start = dice.between(0.0, (BARRIER_EVERY - BARRIER_LOTS) as f32) as i64;
    (start..start + BARRIER_LOTS).contains(&index.rem_euclid(BARRIER_EVERY))
}

fn plot(district: District, within: i64, seed: u64, style: u64) -> Plot {
    let own = Dice::new(seed ^ 0x91).unit();
    let common = Dice::new(style ^ 0x92).unit();
    let last = within == LOTS_A_BLOCK - 1;
    match district {
        District::Town if last => Plot::Junction,
        District::Town if own < 0.10 => Plot::Park,
        District::Town if common < 0.3 => Plot::Flats,
        District::Town => Plot::Terrace,
        District::Suburb if last && common < 0.6 => Plot::Junction,
        District::Suburb if own < 0.16 => Plot::Park,
        District::Suburb => Plot::Villa,
        District::Country if own < 0.08 => Plot::Villa,
        District::Country if own < 0.2 => Plot::Woods,
        District::Country if own < 0.3 => Plot::Park,
        District::Country => Plot::Field,
        District::Forest if own < 0.15 => Plot::Park,
        District::Forest => Plot::Woods,
    }
}
