//! Generated cases: options for a route, and distances and descriptors of every awkward kind.
#![allow(dead_code, reason = "each test program uses its part")]

use proptest::prelude::*;
use proptest::sample::select;
use surefix::{Config, Drive, Dtype, Fix, Floor, Given, Gradient, Matcher, Motion, Values};

use crate::random::SplitMix64;
#[path = "../../src/cases.rs"]
mod property;
#[allow(unused_imports, reason = "each test program uses its part")]
pub(crate) use property::cases;

/// The file of a map that was changed, with the checksum of its new bytes.
pub(crate) fn sealed(mut file: Vec<u8>) -> Vec<u8> {
    if let Some((bytes, checksum)) = file.split_last_chunk_mut::<8>() {
        *checksum = twox_hash::XxHash3_64::oneshot(bytes).to_le_bytes();
    }
    file
}

/// Numbers from -1 to 1.
pub(crate) fn signed(count: usize, seed: u64) -> Vec<f32> {
    SplitMix64(seed).signed(count)
}

/// Kinds of distances.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    /// Whole numbers from 0 to 3: ties everywhere.
    Ties,
    Smooth,
    /// Of both signs, both zeros among them.
    Signed,
    /// Whole columns of one number.
    Constant,
    /// From 1e-30 to 1e30 side by side.
    Wild,
}

pub(crate) fn kind() -> impl Strategy<Value = Kind> {
    select(vec![Kind::Ties, Kind::Smooth, Kind::Signed, Kind::Constant, Kind::Wild])
}

/// The distances of `queries` queries to `places` places, query by query.
pub(crate) fn columns(kind: Kind, places: usize, queries: usize, seed: u64) -> Vec<Vec<f32>> {
    let mut dice = SplitMix64(seed);
    let number = |dice: &mut SplitMix64| match kind {
        Kind::Ties => dice.below(4) as f32,
        Kind::Smooth | Kind::Constant => dice.share(),
        Kind::Signed => [-1.5, -1.0, -0.0, 0.0, 0.5, dice.share() - 0.5][dice.below(6)],
        Kind::Wild => (dice.share() + 0.1) * 10_f32.powi(dice.below(61) as i32 - 30),
    };
    let column = |_| match kind {
        Kind::Constant if dice.below(2) == 0 => vec![number(&mut dice); places],
        _ => (0..places).map(|_| number(&mut dice)).collect(),
    };
    (0..queries).map(column).collect()
}

/// Whether a query's distances tell any place from another.
pub(crate) fn tells(column: &[f32]) -> bool {
    let least = column.iter().copied().fold(f32::INFINITY, f32::min);
    let most = column.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    least < most
}

/// The floor of a stream that knows the least distance of all queries that tell something.
pub(crate) fn least_of_all(columns: &[Vec<f32>]) -> Floor {
    let telling = columns.iter().filter(|column| tells(column));
    let least = telling.flatten().copied().reduce(f32::min);
    least.map_or(Floor::Running, |least| Floor::Fixed(f64::from(least)))
}

/// Numbers for descriptors of each type, none of them zero: every row has a direction.
pub(crate) fn numbers(dtype: Dtype, count: usize, seed: u64) -> Values {
    let mut dice = SplitMix64(seed);
    let mut draw = || dice.share() * 2.0 - 0.999;
    match dtype {
        Dtype::F32 => Values::F32((0..count).map(|_| draw()).collect()),
        Dtype::F16 => Values::F16((0..count).map(|_| half::f16::from_f32(draw())).collect()),
        Dtype::I8 => Values::I8((0..count).map(|_| (draw() * 127.0) as i8 | 1).collect()),
        Dtype::U8 => Values::U8((0..count).map(|_| (draw() * 127.0 + 128.0) as u8 | 1).collect()),
    }
}

pub(crate) const DTYPES: [Dtype; 4] = [Dtype::F32, Dtype::F16, Dtype::I8, Dtype::U8];

/// No tracker, or one of many motions: slow and fast, sure and doubtful. There is always a way back
/// to the map, and a restart is at least as likely as the start off the map.
pub(crate) fn motion() -> impl Strategy<Value = Option<Motion>> {
    let speeds = proptest::sample::subsequence((0..13).collect::<Vec<_>>(), 1..6);
    let likely = || select(vec![0.05, 0.1, 0.6, 1.0]);
    let unlikely = || select(vec![0.0, 0.05, 0.1, 0.6]);
    let chances = (unlikely(), likely(), unlikely(), likely());
    let jitter = select(vec![0.0, 0.01, 0.1, 0.25]);
    let pace = prop_oneof![select(vec![0.01, 0.3, 1.0, 300.0]), 0.1..20.0];
    let words = (0.0..2.0, 0.0..6.0, select(vec![0.0, 1.0, 10.0]));
    let still = (any::<bool>(), select(vec![0.0, 0.9, 1.0]));
    let custom = (speeds, chances, jitter, pace, words, still).prop_map(
        |(speeds, chances, jitter, pace, (evidence, clip, hubness), (by_distance, repeat))| {
            let mut motion = Motion::steady();
            motion.speeds = speeds.into_iter().map(|quarters| f64::from(quarters) / 4.0).collect();
            (motion.jitter, motion.pace) = (jitter, pace);
            (motion.by_distance, motion.repeat) = (by_distance, repeat);
            (motion.switching, motion.restart, motion.leave, motion.rejoin) = chances;
            (motion.evidence, motion.clip, motion.hubness) = (evidence, clip, hubness);
            Some(motion)
        },
    );
    let kinds = [Motion::steady(), Motion::free(), Motion::any()].map(Some);
    prop_oneof![3 => Just(None), 3 => select(kinds.to_vec()), 2 => custom]
}

/// Every option that a stream has, for a route of `places` places.
pub(crate) fn config(places: usize) -> impl Strategy<Value = Config> {
    let length = prop_oneof![3 => 1..=places.min(6), 1 => 1..=places];
    let weight = prop_oneof![select(vec![0.0, 0.5, 0.99, 1.0]), 0.0..=1.0];
    let smoothing = prop_oneof![4 => 1..=5_usize, 1 => 1..=2 * places];
    let gradient = select(vec![Gradient::Halved, Gradient::Unhalved]);
    let floor = prop_oneof![Just(Floor::Running), (-1.0..1.0).prop_map(Floor::Fixed)];
    let speed = prop_oneof![select(vec![0.0, 0.5, 1.0, 1.25, 1.5, 2.0, 3.0]), 0.0..3.0];
    let speeds = prop_oneof![1 => Just(vec![1.0]), 1 => proptest::collection::vec(speed, 1..5)];
    (length, weight, 0..=places, smoothing, gradient, floor, speeds, motion()).prop_map(
        move |(sequence_length, weight, tolerance, smoothing, gradient, floor, mut speeds, motion)| {
            for speed in &mut speeds {
                // A diagonal that leaves the route is refused (tests/bad_input.rs).
                if (*speed * (sequence_length - 1) as f64).round() > (places - 1) as f64 {
                    *speed = 1.0;
                }
            }
            config! { sequence_length, weight, tolerance, smoothing, gradient, floor, speeds, motion }
        },
    )
}

/// A route with options.
pub(crate) fn route(places: std::ops::Range<usize>) -> impl Strategy<Value = (usize, Config)> {
    places.prop_flat_map(|places| (Just(places), config(places)))
}

pub(crate) type Bits = [u64; 19];

/// All numbers of a fix to the last bit: `==` takes -0.0 for 0.0.
pub(crate) fn bits(fix: &Fix) -> Bits {
    let float = |x: f32| u64::from(x.to_bits());
    let (sequence, track) = (fix.sequence, fix.track);
    [
        fix.frame,
        u64::from(fix.trusted),
        u64::from(fix.blank),
        fix.place as u64,
        float(fix.score),
        fix.single.place as u64,
        float(fix.single.distance),
        fix.gradient.place as u64,
        float(fix.gradient.value),
        sequence.map_or(u64::MAX, |s| s.place as u64),
        sequence.map_or(u64::MAX, |s| float(s.score)),
        sequence.map_or(u64::MAX, |s| s.anchors as u64),
        sequence.map_or(u64::MAX, |s| s.speed.to_bits()),
        track.map_or(u64::MAX, |t| t.place as u64),
        track.map_or(u64::MAX, |t| t.confidence.to_bits()),
        track.map_or(u64::MAX, |t| t.off_map.to_bits()),
        track.map_or(u64::MAX, |t| t.speed.to_bits()),
        track.map_or(u64::MAX, |t| t.interval.0 as u64),
        track.map_or(u64::MAX, |t| t.interval.1 as u64),
    ]
}

pub(crate) fn all_bits(fixes: &[Fix]) -> Vec<Bits> {
    fixes.iter().map(bits).collect()
}

/// Any fix, to be changed: the struct cannot be made outside of the crate.
pub(crate) fn any_fix() -> Fix {
    Matcher::new(2, Config::default()).unwrap().push(&[0.0, 1.0]).unwrap()
}

/// What is known about a batch's queries.
pub(crate) fn known<'a>(trusted: Option<&'a [bool]>, gaps: &'a [usize]) -> Drive<'a> {
    let mut drive = Drive::default().gaps(gaps);
    drive.trusted = trusted;
    drive
}

/// An external predictor's flags and odometry, with stops, reverses and ways beyond the route.
#[derive(Debug)]
pub(crate) struct Told {
    trusted: Option<Vec<bool>>,
    advance: Option<Vec<f64>>,
}

impl Told {
    pub(crate) fn new(queries: usize, seed: u64, external: bool, odometry: bool) -> Self {
        let mut dice = SplitMix64(seed ^ 0xabc);
        let trusted = (0..queries).map(|_| dice.below(2) == 1).collect();
        let advance = (0..queries).map(|_| match dice.below(8) {
            0 => dice.below(200) as f64 - 100.0,
            1 => 0.0,
            2 => 0.5,
            _ => f64::from(4.0 * dice.share() - 1.0),
        });
        let advance = advance.collect();
        Self { trusted: external.then_some(trusted), advance: odometry.then_some(advance) }
    }

    pub(crate) fn drive(&self) -> Drive<'_> {
        let mut drive = known(self.trusted.as_deref(), &[]);
        drive.advance = self.advance.as_deref();
        drive
    }
}

/// What is known about a query of a drive.
pub(crate) fn given(drive: Drive<'_>, query: usize) -> Given {
    let mut given = Given::default();
    given.trusted = drive.trusted.map(|trusted| trusted[query]);
    given.advance = drive.advance.map(|advance| advance[query]);
    given
}

/// The fixes of a stream without gaps.
pub(crate) fn stream(
    places: usize,
    config: &Config,
    columns: &[Vec<f32>],
    drive: Drive<'_>,
) -> Vec<Fix> {
    let mut matcher = Matcher::new(places, config.clone()).unwrap();
    let push = |(query, column): (usize, &Vec<f32>)| {
        matcher.push_with(column, given(drive, query)).unwrap()
    };
    columns.iter().enumerate().map(push).collect()
}

/// The sum of numbers of places, in order: first for each block of 4,096.
pub(crate) fn by_blocks(numbers: &[(usize, f64)]) -> f64 {
    let blocks = numbers.chunk_by(|a, b| a.0 / 4096 == b.0 / 4096);
    blocks.map(|block| block.iter().map(|one| one.1).sum::<f64>()).sum()
}
