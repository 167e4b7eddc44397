//! Shards give a localizer's fixes, to the last bit, wherever they are cut.

use std::sync::Arc;

use proptest::prelude::*;
use proptest::sample::select;
use surefix::shard::{Driver, Next, Question, Shard, Stage};
use surefix::{
    Config, Error, Fix, Floor, Given, Gradient, Input, Localizer, Map, Metric, Motion, Segments,
    View,
};

use crate::cases::{bits, cases, motion};
use crate::random::SplitMix64;

/// The places of a block.
const BLOCK: usize = 4096;

/// A driver and its shards in one process.
struct Sharded {
    map: Arc<Map>,
    config: Config,
    driver: Driver,
    shards: Vec<Shard>,
    /// The driver's and the shards' snapshots, after the newest query.
    saved: Vec<Vec<u8>>,
    dice: SplitMix64,
}

impl Sharded {
    fn new(map: &Arc<Map>, config: &Config, count: usize, seed: u64) -> Result<Self, Error> {
        let shard = |index| Shard::new(Arc::clone(map), config, index, count);
        let shards = (0..count).map(shard).collect::<Result<Vec<_>, _>>()?;
        let driver = Driver::new(Arc::clone(map), config, count)?;
        let (map, config) = (Arc::clone(map), config.clone());
        Ok(Self { map, config, driver, shards, saved: Vec::new(), dice: SplitMix64(seed) })
    }

    fn save(&mut self) {
        self.saved = self.shards.iter().map(|shard| shard.snapshot().unwrap()).collect();
    }

    /// The shard as a new process has it, which goes on from its snapshot.
    fn restart(&mut self, index: usize) {
        let count = self.shards.len();
        let mut shard = Shard::new(Arc::clone(&self.map), &self.config, index, count).unwrap();
        shard.restore(&self.saved[index]).unwrap();
        self.shards[index] = shard;
    }

    /// Questions that are asked twice, queries that are given up and shards that are started again
    /// do not show.
    fn push(&mut self, query: View<'_>, given: Given) -> Result<Fix, Error> {
        self.save();
        if self.dice.below(4) == 0 {
            let other = [0.25; 16];
            let other = View::F32(&other[..self.map.dim()]);
            if let Ok(Next::Ask(questions)) = self.driver.push(Input::Descriptor(other), given) {
                let asked = self.dice.below(self.shards.len() + 1);
                for (shard, question) in self.shards.iter_mut().zip(&questions).take(asked) {
                    shard.answer(question).unwrap();
                }
                self.driver.abandon().unwrap();
            }
        }
        let mut next = self.driver.push(Input::Descriptor(query), given)?;
        let mut before: Vec<Question> = Vec::new();
        loop {
            let questions = match next {
                Next::Ask(questions) => questions,
                Next::Fix(fix) => return Ok(fix),
            };
            if self.dice.below(6) == 0 {
                let index = self.dice.below(self.shards.len());
                self.restart(index);
                if questions[0].stage() == Stage::Second {
                    self.shards[index].answer(&questions[index]).unwrap_err();
                    self.shards[index].answer(&before[index]).unwrap();
                }
            }
            let twice = questions[0].stage() != Stage::Second && self.dice.below(4) == 0;
            let each = self.shards.iter_mut().zip(&questions);
            let answers = each.map(|(shard, question)| {
                if twice {
                    shard.answer(question)?;
                }
                shard.answer(question)
            });
            let answers = answers.collect::<Result<Vec<_>, _>>()?;
            before = questions;
            next = self.driver.answer(&answers)?;
        }
    }

    /// Goes on as other processes would.
    fn move_on(&mut self) {
        self.save();
        (0..self.shards.len()).for_each(|index| self.restart(index));
        let snapshot = self.driver.snapshot().unwrap();
        let count = self.shards.len();
        self.driver = Driver::new(Arc::clone(&self.map), &self.config, count).unwrap();
        self.driver.restore(&snapshot).unwrap();
    }
}

/// A segment's border near a block's, or anywhere.
fn border(places: usize) -> impl Strategy<Value = usize> {
    let blocks = places / BLOCK;
    let near =
        (0..=blocks, 0..13_usize).prop_map(|(block, off)| (block * BLOCK + off).saturating_sub(6));
    prop_oneof![3 => near, 1 => 1..places]
}

fn segments(places: usize) -> impl Strategy<Value = Segments> {
    let borders = proptest::collection::vec(border(places), 0..7);
    let links = prop_oneof![
        2 => Just(Vec::new()),
        1 => proptest::collection::vec((border(places), border(places)), 1..5),
    ];
    (borders, any::<u8>(), links).prop_map(move |(mut breaks, closed, links)| {
        breaks.retain(|&at| at > 0 && at < places);
        breaks.sort_unstable();
        breaks.dedup();
        let segments = Segments::new(places, &breaks).unwrap();
        let closes = |&(index, len): &(usize, usize)| len > 2 && closed >> (index % 8) & 1 == 1;
        let lengths = segments.iter().map(surefix::Segment::len).enumerate();
        let closed: Vec<usize> = lengths.filter(closes).map(|(index, _)| index).collect();
        let segments = segments.with_closed(&closed).unwrap();
        let mut possible: Vec<(usize, usize)> = Vec::new();
        for link in links {
            let more = [&possible[..], &[link]].concat();
            if segments.clone().with_links(&more).is_ok() {
                possible = more;
            }
        }
        segments.with_links(&possible).unwrap()
    })
}

/// Options for a route of these segments.
fn config(segments: &Segments, motions: bool) -> impl Strategy<Value = Config> + use<> {
    let closed = segments.iter().any(|segment| segment.closed);
    let longest = segments.iter().map(surefix::Segment::len).max().unwrap();
    let longest = if closed { segments.places() } else { longest };
    let length = prop_oneof![4 => 1..=6_usize, 1 => 1..=30_usize];
    let smoothing = prop_oneof![4 => 1..=5_usize, 1 => 1..=50_usize];
    let speed = prop_oneof![select(vec![0.0, 0.5, 1.0, 1.5, 2.0, 40.0]), 0.0..3.0];
    let speeds = prop_oneof![1 => Just(vec![1.0]), 1 => proptest::collection::vec(speed, 1..4)];
    let tolerance = prop_oneof![0..6_usize, 0..=300_usize];
    let weight = select(vec![0.0, 0.5, 0.99, 1.0]);
    let gradient = select(vec![Gradient::Halved, Gradient::Unhalved]);
    let floor = prop_oneof![Just(Floor::Running), (-1.0..1.0).prop_map(Floor::Fixed)];
    let motion = if motions { motion().boxed() } else { Just(None::<Motion>).boxed() };
    (length, weight, tolerance, smoothing, gradient, floor, speeds, motion).prop_map(
        move |(length, weight, tolerance, smoothing, gradient, floor, mut speeds, motion)| {
            let sequence_length = length.min(longest);
            for speed in &mut speeds {
                if (*speed * (sequence_length - 1) as f64).round() > (longest - 1) as f64 {
                    *speed = 1.0;
                }
            }
            config! { sequence_length, weight, tolerance, smoothing, gradient, floor, speeds, motion }
        },
    )
}

#[derive(Clone, Copy, Debug)]
enum Rows {
    /// Whole numbers from 0 to 3: ties everywhere.
    Ties,
    /// Numbers from 0 to 1.
    Shares,
    /// Such numbers, of which some are too far from some queries for a float.
    Far,
    /// All equal.
    Equal,
}

fn rows(kind: Rows, count: usize, seed: u64) -> Vec<f32> {
    let mut dice = SplitMix64(seed);
    let number = |_| match kind {
        Rows::Ties => dice.below(4) as f32,
        Rows::Far if dice.below(60_000) == 0 => 3e38,
        Rows::Shares | Rows::Far => dice.share(),
        Rows::Equal => 1.0,
    };
    (0..count).map(number).collect()
}

/// A map with all that a route can have.
#[derive(Clone, Debug)]
struct Route {
    map: Arc<Map>,
    config: Config,
    shards: usize,
}

/// What else a map has.
#[derive(Clone, Copy, Debug)]
struct More {
    /// Some places that show nothing, of each traverse.
    blank: bool,
    traverses: usize,
}

/// The rows of some places, and of the first traverse all.
fn traverse(kind: Rows, places: usize, dim: usize, blank: bool, seed: u64) -> Map {
    let mut rows = rows(kind, places * dim, seed);
    if blank {
        let first = seed as usize % 30;
        rows.chunks_mut(dim).skip(first).step_by(37).for_each(|row| row.fill(0.0));
    }
    let metric = if seed.is_multiple_of(2) { Metric::Manhattan } else { Metric::Euclidean };
    Map::from_descriptors(rows, dim, metric).unwrap()
}

fn route(
    blocks: std::ops::RangeInclusive<usize>,
    motions: bool,
    more: bool,
) -> impl Strategy<Value = Route> {
    let places = (blocks, 0..BLOCK).prop_map(|(blocks, rest)| blocks * BLOCK - rest);
    let places = places.prop_map(|places| places.max(2));
    let kinds = [Rows::Ties, Rows::Ties, Rows::Shares, Rows::Shares, Rows::Far, Rows::Equal];
    let (blank, traverses) =
        if more { (any::<bool>().boxed(), 0..3_usize) } else { (Just(false).boxed(), 0..1_usize) };
    let more = (blank, traverses).prop_map(|(blank, traverses)| More { blank, traverses });
    let fixed = (select(kinds.to_vec()), 1..=4_usize, 1..=4_usize, any::<u64>(), more);
    (places.prop_flat_map(segments), fixed).prop_flat_map(
        move |(segments, (kind, dim, shards, seed, more))| {
            let config = config(&segments, motions);
            config.prop_map(move |config| {
                let places = segments.places();
                // Rows of 8 numbers and fewer always show something.
                let dim = if more.blank { dim + 8 } else { dim };
                let mut map = traverse(kind, places, dim, more.blank, seed);
                for further in 1..=more.traverses {
                    let seed = seed.wrapping_add(2 * further as u64);
                    let rows = traverse(kind, places / 3 + 1, dim, more.blank, seed);
                    let at = (0..rows.places()).map(|row| (3 * row + further) % places);
                    let mut at: Vec<_> = at.map(Some).collect();
                    let first = at[0];
                    at[1..].iter_mut().filter(|at| **at == first).for_each(|at| *at = None);
                    map = match map.add_traverse(&rows, &at, "") {
                        Ok(more) => more,
                        Err(_) => map,
                    };
                }
                let map = map.with_segments(segments.clone()).unwrap();
                let shards = shards.min(places.div_ceil(BLOCK));
                Route { map: Arc::new(map), config, shards }
            })
        },
    )
}

/// Drives both along the route, and compares all that they say.
fn drive(route: &Route, queries: usize, seed: u64) {
    let Route { map, config, shards } = route;
    let mut localizer = Localizer::new(Arc::clone(map), config.clone()).unwrap();
    let mut sharded = Sharded::new(map, config, *shards, !seed).unwrap();
    let mut dice = SplitMix64(seed);
    let mut at = dice.below(map.places());
    let whole = map.descriptors();
    for query in 0..queries {
        let advance = match dice.below(12) {
            0 => 0.0,
            1 => dice.below(2 * map.places()) as f64 - map.places() as f64,
            2 => f64::from(600.0 * dice.share() - 300.0),
            3 => 1e12,
            _ => f64::from(3.0 * dice.share() - 0.7),
        };
        match dice.below(14) {
            0 => {
                localizer.gap();
                sharded.driver.gap().unwrap();
            }
            1 => {
                localizer.gap_with_advance(advance).unwrap();
                sharded.driver.gap_with_advance(advance).unwrap();
            }
            2 if query > 3 => {
                localizer.reset();
                sharded.driver.reset().unwrap();
            }
            3 => sharded.move_on(),
            _ => {}
        }
        at = (at + dice.below(3)) % map.places();
        let mut given = Given::default();
        if dice.below(4) == 0 {
            given.trusted = Some(dice.below(2) == 0);
        }
        if dice.below(3) == 0 {
            given.advance = Some(advance);
        }
        let Some(View::F32(row)) = whole.row(at, map.dim()) else { panic!("float32 rows") };
        let row: Vec<f32> = row.iter().map(|x| x + 0.1 * dice.share()).collect();
        let (row, given) = match dice.below(16) {
            0 => (vec![f32::NAN; row.len()], given),
            1 => (row, given.advance(f64::INFINITY)),
            2 => (vec![0.0; row.len()], given),
            3 => (vec![-2e38; row.len()], given),
            _ => (row, given),
        };
        let expected = localizer.push_descriptor_with(&row[..], given);
        let got = sharded.push(View::F32(&row), given);
        match (expected, got) {
            (Ok(expected), Ok(got)) => {
                assert_eq!(bits(&got), bits(&expected), "{expected:?} {got:?}");
            }
            (Err(expected), Err(got)) => assert_eq!(got.to_string(), expected.to_string()),
            (expected, got) => panic!("{expected:?}, {got:?}"),
        }
    }
}

proptest! {
    #![proptest_config(cases(40))]

    #[test]
    fn the_papers_part(route in route(1..=5, false, false), queries in 1..24_usize, seed: u64) {
        drive(&route, queries, seed);
    }

    #[test]
    fn with_a_track(route in route(1..=5, true, false), queries in 1..24_usize, seed: u64) {
        drive(&route, queries, seed);
    }

    #[test]
    fn of_several_traverses_and_blank_places(
        route in route(1..=4, true, true), queries in 1..16_usize, seed: u64,
    ) {
        drive(&route, queries, seed);
    }
}

proptest! {
    #![proptest_config(cases(6))]

    /// The interval is rounded there, and not all masses are sent.
    #[test]
    fn of_more_than_65_536_places(route in route(17..=19, true, false), queries in 1..12_usize, seed: u64) {
        drive(&route, queries, seed);
    }
}

/// The query after one that shows nothing is compared with the last that showed something.
#[test]
fn a_query_that_shows_nothing_leaves_the_view_before_it() {
    let (places, dim) = (BLOCK + 300, 16);
    let map = Map::from_descriptors(rows(Rows::Shares, places * dim, 3), dim, Metric::Euclidean);
    let map = Arc::new(map.unwrap());
    let config = config! { motion: Some(Motion::any()), sequence_length: 2 };
    let mut localizer = Localizer::new(Arc::clone(&map), config.clone()).unwrap();
    let mut sharded = Sharded::new(&map, &config, 2, 1).unwrap();
    for place in [Some(5), Some(6), None, Some(6), None, None, Some(7), Some(7), None, Some(20)] {
        let row =
            place.map_or(View::F32(&[0.0; 16]), |place| map.descriptors().row(place, dim).unwrap());
        let View::F32(row) = row else { panic!("float32 rows") };
        let expected = localizer.push_descriptor(row).unwrap();
        let got = sharded.push(View::F32(row), Given::default()).unwrap();
        assert_eq!(bits(&got), bits(&expected), "{place:?}");
    }
}
