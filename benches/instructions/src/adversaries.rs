//! Adversaries: data and flags that make a push as dear as they can. `instructions.py` holds each to
//! three times the usual push of the same configuration, which comes first.

use std::hint::black_box;
use std::sync::Arc;

use surefix::{
    Channels, Config, Describer, Dtype, Given, Image, Input, Localizer, LoopCloser, LoopConfig,
    Map, Matcher, Metric, Motion, Sad, Segments, Values, View,
};

use crate::{case, random::SplitMix64};

const PLACES: usize = 1200;
/// Columns that are pushed in turn.
const COLUMNS: usize = 16;

type Number = fn(&mut SplitMix64, usize) -> f32;
type Columns = fn(&mut SplitMix64, usize) -> Vec<Vec<f32>>;
/// What is done before the push of a query, and what is said with it.
type Said = fn(&mut Matcher, usize) -> Given;

const ADVERSARIES: &[(&str, Columns, Said)] = &[
    ("a drive", drive, nothing),
    ("a drive, all trusted", drive, trusted),
    ("standing still", still, nothing),
    ("standing still, all trusted", still, trusted),
    ("a dip anywhere", |dice, n| columns(|_, _| 1.0, dice, n, true), nothing),
    ("constant", |dice, n| columns(|_, _| 0.5, dice, n, false), trusted),
    ("constant but for the last place", |_, n| vec![but_for_the_last(n); COLUMNS], trusted),
    ("falling", |dice, n| columns(|i, n| (n - i) as f32, dice, n, false), trusted),
    ("rising", |dice, n| columns(|i, _| i as f32, dice, n, false), trusted),
    // The minimum, the gradient and the sums become better with each place.
    ("ever better", |dice, n| columns(ever_better, dice, n, false), trusted),
    ("ties", |dice, n| columns(|i, _| (i / 3 % 2) as f32, dice, n, false), trusted),
    ("aliased", |dice, n| columns(|i, _| (i % 7) as f32 / 7.0, dice, n, false), trusted),
    ("off the map", |dice, n| scaled(dice, n, 1.0), nothing),
    ("denormal", |dice, n| scaled(dice, n, 1e-40), trusted),
    ("as large as can be", |dice, n| scaled(dice, n, f32::MAX), trusted),
    ("odometry that jumps", drive, |_, query| {
        Given::default().advance([1e12, -1e12, 0.0, 0.5, -700.0, 900.25][query % 6])
    }),
    ("gaps", drive, |matcher, query| {
        if query.is_multiple_of(2) {
            matcher.gap();
        } else {
            drop(matcher.gap_with_advance(1e9));
        }
        Given::default()
    }),
];

fn nothing(_: &mut Matcher, _: usize) -> Given {
    Given::default()
}

fn trusted(_: &mut Matcher, _: usize) -> Given {
    Given::default().trusted(true)
}

fn drive(dice: &mut SplitMix64, places: usize) -> Vec<Vec<f32>> {
    dice.drive(places, COLUMNS)
}

fn still(dice: &mut SplitMix64, places: usize) -> Vec<Vec<f32>> {
    vec![dice.drive(places, 1).concat(); COLUMNS]
}

/// Columns of one number a place, and perhaps a sharp dip in each at a place of its own.
fn columns(
    of: fn(usize, usize) -> f32,
    dice: &mut SplitMix64,
    places: usize,
    dip: bool,
) -> Vec<Vec<f32>> {
    let column = |_| {
        let mut column: Vec<f32> = (0..places).map(|place| of(place, places)).collect();
        if dip {
            column[dice.below(places)] = 0.0;
        }
        column
    };
    (0..COLUMNS).map(column).collect()
}

fn but_for_the_last(places: usize) -> Vec<f32> {
    let mut column = vec![1.0; places];
    column[places - 1] = 2.0;
    column
}

fn ever_better(place: usize, places: usize) -> f32 {
    let along = place as f32 / places as f32;
    along.powi(3) - 4.0 * along
}

fn scaled(dice: &mut SplitMix64, places: usize, scale: f32) -> Vec<Vec<f32>> {
    (0..COLUMNS).map(|_| (0..places).map(|_| scale * dice.share()).collect()).collect()
}

pub(crate) fn all() {
    let moving = |motion: Motion| config! { motion: Some(motion) };
    let one = || Segments::one(PLACES);
    let breaks = |road: usize| (1..PLACES / road).map(|index| index * road).collect::<Vec<_>>();
    let round = one().with_closed(&[0]).unwrap();
    let roads = Segments::new(PLACES, &breaks(40)).unwrap();
    let links: Vec<(usize, usize)> = (1..30).map(|road| (40 * road - 1, 40 * road)).collect();
    let town = roads.clone().with_links(&links).unwrap();
    let speeds = vec![0.8, 0.9, 1.0, 1.1, 1.2];
    matched("L = 2", &Config::default(), &one());
    matched(
        "smoothing = 7",
        &config! { smoothing: 7, gradient: surefix::Gradient::Unhalved },
        &one(),
    );
    matched("L = 10", &config! { sequence_length: 10 }, &one());
    matched("L = 100", &config! { sequence_length: 100 }, &one());
    matched("L = 1000", &config! { sequence_length: 1000 }, &one());
    matched("L = 50, 5 speeds", &config! { sequence_length: 50, speeds }, &one());
    matched("L = 50, a closed segment", &config! { sequence_length: 50 }, &round);
    matched("L = 10, 30 segments", &config! { sequence_length: 10 }, &roads);
    matched("motion steady", &moving(Motion::steady()), &one());
    matched("motion free", &moving(Motion::free()), &one());
    matched("motion any", &moving(Motion::any()), &one());
    matched("motion free, a closed segment", &moving(Motion::free()), &round);
    matched("motion any, 30 segments and 29 links", &moving(Motion::any()), &town);
    fused();
    loops();
    images();
    screened();
}

/// A matcher, on each of the list.
fn matched(name: &str, config: &Config, segments: &Segments) {
    let length = config.sequence_length;
    for (adversary, columns, said) in ADVERSARIES {
        let columns = columns(&mut SplitMix64(2), PLACES);
        let mut matcher = Matcher::along(segments.clone(), config.clone()).unwrap();
        let mut query = 0;
        let mut push = || {
            let given = said(&mut matcher, query);
            let column = black_box(&columns[query % COLUMNS]);
            black_box(matcher.push_with(column, given).unwrap());
            query += 1;
        };
        // Until the window is full, and with it the list of anchors.
        (0..length.max(8)).for_each(|_| push());
        case(&format!("{name}; {adversary}"), if length > 500 { 2 } else { 6 }, push);
    }
}

/// Three techniques.
fn fused() {
    const DIM: usize = 16;
    let kinds: [(&str, Number); 3] = [
        ("a drive", |dice, _| 2.0 * dice.share() - 1.0),
        ("all rows are one", |_, at| (at % DIM) as f32 + 1.0),
        ("ever farther", |_, at| (at / DIM + at % DIM) as f32 + 1.0),
    ];
    for (name, number) in kinds {
        let mut dice = SplitMix64(5);
        let rows: Vec<f32> = (0..PLACES * DIM).map(|at| number(&mut dice, at)).collect();
        let map = Map::from_descriptors(rows.clone(), DIM, Metric::Euclidean).unwrap();
        let (map, config) = (Arc::new(map), config! { motion: Some(Motion::free()) });
        let mut localizer = Localizer::fused(vec![map; 3], config).unwrap();
        let mut rows = rows.chunks_exact(DIM).cycle();
        case(&format!("three techniques; {name}"), 6, || {
            let query = [Input::Descriptor(View::F32(rows.next().unwrap())); 3];
            black_box(localizer.push_inputs(&query, Given::default()).unwrap());
        });
    }
}

/// A route that grows.
fn loops() {
    const DIM: usize = 32;
    let (one, mut other) = (SplitMix64(6).signed(DIM), SplitMix64(7));
    for (name, same) in [("a drive", false), ("standing still", true)] {
        let mut closer =
            LoopCloser::of_descriptors(DIM, Metric::Cosine, LoopConfig::default()).unwrap();
        let mut push = || {
            let frame = if same { one.clone() } else { other.signed(DIM) };
            black_box(closer.push_descriptor(frame.as_slice()).unwrap());
        };
        // The memory of 512 places is full soon, and grows.
        (0..500).for_each(|_| push());
        case(&format!("a loop closer; {name}"), 30, push);
    }
}

/// A camera's image.
fn images() {
    const SIZE: (usize, usize) = (200, 150);
    let mut dice = SplitMix64(8);
    let noise = dice.image(SIZE.0, SIZE.1, Channels::Rgb).unwrap();
    let of = |of: fn(usize) -> u8| {
        let pixels = (0..3 * SIZE.0 * SIZE.1).map(of).collect();
        Image::new(SIZE.0, SIZE.1, Channels::Rgb, pixels).unwrap()
    };
    let all = [("noise", noise), ("black", of(|_| 0)), ("stripes", of(|at| (at % 2 * 255) as u8))];
    for (name, image) in all {
        let mut describer = Describer::new(Sad::default());
        let mut out = Values::U8(vec![0; Sad::default().dim()]);
        let describe = || describer.describe(black_box(image.view()), &mut out).unwrap();
        case(&format!("an image; {name}"), 1, describe);
    }
}

/// A map with a screen, beside the same map without: what a screen saves is a fact about the data.
/// Twelve frames in a row, as its back-off counts frames.
fn screened() {
    const KNOWN: usize = 240;
    const DIM: usize = 512;
    const FRAMES: usize = 12;
    let mut dice = SplitMix64(4);
    let (rows, noise) = (dice.signed(KNOWN * DIM), dice.signed(FRAMES * DIM));
    let one = &rows[..DIM];
    let aliased: Vec<f32> = one.iter().copied().cycle().take(KNOWN * DIM).collect();
    let mut spoilt = rows.clone();
    spoilt[7] = 1e6;
    let near: Vec<f32> = noise.iter().zip(&rows).map(|(noise, row)| row + 0.5 * noise).collect();
    let kinds: [(&str, &[f32], &[f32], bool); 6] = [
        ("without a screen", &rows, &near, false),
        ("a drive", &rows, &near, true),
        ("off the map", &rows, &noise, true),
        ("aliased rows", &aliased, &near, true),
        ("one number of 1e6", &spoilt, &near, true),
        ("aliased rows and queries", &aliased, &aliased[..FRAMES * DIM], true),
    ];
    for metric in [Metric::Euclidean, Metric::Cosine] {
        for (name, rows, frames, screen) in kinds {
            let map = Map::from_descriptors(rows.to_vec(), DIM, metric).unwrap();
            let map = if screen { map.with_screen(Dtype::I8).unwrap() } else { map };
            let config = config! { sequence_length: 3 };
            let mut localizer = Localizer::new(Arc::new(map), config).unwrap();
            case(&format!("a screen, {metric}; {name}"), 1, || {
                localizer.reset();
                for frame in frames.chunks_exact(DIM) {
                    black_box(localizer.push_descriptor(black_box(frame)).unwrap());
                }
            });
        }
    }
}
