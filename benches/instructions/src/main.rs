//! Each hot piece of work, run a known number of times: `instructions.py` counts its instructions
//! under callgrind.
//!
//! It prints a line for each case, `name<TAB>times`, after one call of `measured`. On its own it
//! measures nothing.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    missing_docs,
    reason = "a benchmark stops at the first surprise"
)]

#[macro_use]
#[path = "../../../tests/all/options.rs"]
mod options;

mod adversaries;
#[path = "../../random/mod.rs"]
mod random;

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::Arc;

use random::SplitMix64;
use surefix::Describer;
use surefix::{
    Channels, Config, Dtype, Image, Isa, Localizer, Map, Matcher, Metric, Motion, Sad, Segments,
    Values, View,
};

/// Rows of a map: few, as each costs the same.
const ROWS: usize = 48;
/// Not a multiple of any register's width, so that the ends of rows are counted as well.
const DIM: usize = 2051;
/// The paper's route length.
const PLACES: usize = 1800;
const METRICS: [Metric; 3] = [Metric::Manhattan, Metric::Euclidean, Metric::Cosine];
const DTYPES: [Dtype; 4] = [Dtype::U8, Dtype::I8, Dtype::F16, Dtype::F32];

/// What callgrind counts: it is told this name.
#[inline(never)]
fn measured(work: &mut dyn FnMut()) {
    work();
    // So that the call above is no tail call, which would leave this function too early.
    black_box(());
}

fn case(name: &str, times: usize, mut work: impl FnMut()) {
    // Once before: what is done on the first call only is no part of it.
    work();
    measured(&mut || (0..times).for_each(|_| work()));
    println!("{name}\t{times}");
}

fn main() {
    // `cargo bench` gives arguments of its own.
    let asked = |flag: &str| std::env::args().any(|argument| argument == flag);
    println!("isa\t{}", Isa::best());
    if asked("--adversaries") {
        return adversaries::all();
    }
    if asked("--few") {
        distances(&[Dtype::U8, Dtype::F32], false);
        push(&[3]);
        return;
    }
    distances(&DTYPES, true);
    push(&[2, 3, 10, 100]);
    segments();
    track();
    screened();
    image();
}

fn distances(dtypes: &[Dtype], float_queries: bool) {
    let mut dice = SplitMix64(1);
    for &dtype in dtypes {
        let (rows, own, float) = (
            dice.numbers(dtype, ROWS * DIM),
            dice.numbers(dtype, DIM),
            dice.numbers(Dtype::F32, DIM),
        );
        for metric in METRICS {
            let map = Map::from_descriptors(rows.clone(), DIM, metric).unwrap();
            let scan = |name: String, query: View<'_>| {
                let mut out = vec![0.0; ROWS];
                case(&name, 2, || map.distances_into(black_box(query), &mut out).unwrap());
            };
            scan(format!("distances, {dtype} {metric}, {ROWS} x {DIM}"), own.view());
            if float_queries && dtype != Dtype::F32 {
                scan(
                    format!("distances, {dtype} {metric}, {ROWS} x {DIM}, float32 query"),
                    float.view(),
                );
            }
        }
    }
}

fn push(lengths: &[usize]) {
    let columns = SplitMix64(2).drive(PLACES, 16);
    for &sequence_length in lengths {
        let mut matcher = Matcher::new(PLACES, config! { sequence_length }).unwrap();
        let mut frames = columns.iter().cycle();
        let mut push = || {
            black_box(matcher.push(black_box(frames.next().unwrap())).unwrap());
        };
        (0..2 * sequence_length).for_each(|_| push());
        // As many as the sequence is long: not all of them need cost the same.
        case(&format!("push, n = {PLACES}, L = {sequence_length}"), sequence_length.max(16), push);
    }
}

/// Roads of a town, each shorter than the paper's route.
fn segments() {
    const ROAD: usize = 450;
    let columns = SplitMix64(2).drive(PLACES, 16);
    let breaks: Vec<usize> = (1..PLACES / ROAD).map(|road| road * ROAD).collect();
    for (name, closed) in [("open", false), ("closed", true)] {
        let indices: Vec<usize> = (0..if closed { PLACES / ROAD } else { 0 }).collect();
        let roads = Segments::new(PLACES, &breaks).and_then(|roads| roads.with_closed(&indices));
        let mut matcher = Matcher::along(roads.unwrap(), config! { sequence_length: 3 }).unwrap();
        let mut frames = columns.iter().cycle();
        let mut push = || {
            black_box(matcher.push(black_box(frames.next().unwrap())).unwrap());
        };
        (0..6).for_each(|_| push());
        case(&format!("push, n = {PLACES}, L = 3, {name} segments of {ROAD}"), 16, push);
    }
}

/// The tracker, beside a sequence of 2.
fn track() {
    let columns = SplitMix64(2).drive(PLACES, 16);
    for (kind, motion) in [("steady", Motion::steady()), ("free", Motion::free())] {
        let mut matcher = Matcher::new(PLACES, config! { motion: Some(motion) }).unwrap();
        let mut frames = columns.iter().cycle();
        let mut push = || {
            black_box(matcher.push(black_box(frames.next().unwrap())).unwrap());
        };
        // The first queries' answers are wide, and wide intervals are found sooner.
        (0..16).for_each(|_| push());
        case(&format!("push, n = {PLACES}, L = 2, motion {kind}"), 16, push);
    }
}

/// A drive past places that the screen tells apart.
fn screened() {
    const KNOWN: usize = 480;
    let mut dice = SplitMix64(4);
    let (rows, noise) = (dice.signed(KNOWN * DIM), dice.signed(16 * DIM));
    for metric in [Metric::Euclidean, Metric::Cosine] {
        let map = Map::from_descriptors(rows.clone(), DIM, metric)
            .unwrap()
            .with_screen(Dtype::I8)
            .unwrap();
        let config = config! { sequence_length: 3 };
        let mut localizer = Localizer::new(Arc::new(map), config).unwrap();
        let drive: Vec<f32> =
            noise.iter().zip(&rows).map(|(noise, row)| row + 0.5 * noise).collect();
        let mut frames = drive.chunks_exact(DIM).cycle();
        let mut push = || {
            black_box(localizer.push_descriptor(black_box(frames.next().unwrap())).unwrap());
        };
        push();
        case(&format!("screened push, {metric}, {KNOWN} x {DIM}"), 8, push);
        assert!(localizer.looked_at() < KNOWN / 10, "what is counted is the screen");
    }
}

fn image() {
    const KNOWN: usize = 64;
    let mut dice = SplitMix64(3);
    let frame = dice.image(640, 480, Channels::Rgb).unwrap();
    let mut describer = Describer::new(Sad::default());
    let mut descriptor = Values::U8(vec![0; Sad::default().dim()]);
    case("describe, 640 x 480 RGB", 1, || {
        describer.describe(black_box(frame.view()), &mut descriptor).unwrap();
    });

    let known: Vec<Image> =
        (0..KNOWN).map(|_| dice.image(64, 32, Channels::Grey).unwrap()).collect();
    let map =
        Map::from_images(&known, Sad::default(), &mut |_, _| ControlFlow::Continue(())).unwrap();
    let mut localizer = Localizer::new(Arc::new(map), Config::default()).unwrap();
    localizer.push_image(&frame).unwrap();
    let name = format!("image to fix, 640 x 480 RGB, n = {KNOWN}");
    case(&name, 1, || {
        black_box(localizer.push_image(black_box(&frame)).unwrap());
    });
}
