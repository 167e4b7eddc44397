//! What one camera frame costs, part by part: `cargo bench --bench frame`.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark stops at the first surprise")]

#[macro_use]
#[path = "../tests/all/options.rs"]
mod options;

mod random;

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array2;
use random::SplitMix64;
use surefix::Describer;
use surefix::{
    Drive, Fix, Image, Localizer, Map, Matcher, Motion, Sad, Values, match_descriptors,
    match_distances,
};
use surefix_simulate::{Conditions, Route, RouteConfig};

/// The paper's route length.
const PLACES: usize = 1800;

/// A generated route on a summer's day, and frames of a winter drive along its middle.
fn drives(width: usize, height: usize, frames: usize) -> (Arc<Map>, Vec<Image>) {
    let route = |width, height| {
        Route::new(RouteConfig { places: PLACES, width, height, ..RouteConfig::default() }).unwrap()
    };
    // Small frames are described as large ones are, and drawn in a hundredth of the time.
    let summer = route(64, 32).traverse(Conditions::reference()).unwrap();
    let winter = route(width, height).traverse(Conditions::revisit()).unwrap();
    let map =
        Map::from_images(&summer, Sad::default(), &mut |_, _| ControlFlow::Continue(())).unwrap();
    (Arc::new(map), (0..frames).map(|frame| winter.frame(PLACES / 2 + frame)).collect())
}

fn push(criterion: &mut Criterion) {
    for places in [PLACES, 100_000] {
        let mut group = criterion.benchmark_group(format!("push, n = {places}"));
        group.throughput(Throughput::Elements(places as u64));
        let columns = SplitMix64(1).drive(places, 16);
        for sequence_length in [1, 2, 3, 10, 100] {
            let mut matcher = Matcher::new(places, config! { sequence_length }).unwrap();
            for (query, column) in columns.iter().cycle().take(sequence_length.max(16)).enumerate()
            {
                // Among 100,000 places, noise now and then peaks above a true place's gradient.
                let place = matcher.push(column).unwrap().single.place;
                assert_eq!(place, places / 3 + query % 16);
            }
            let mut next = columns.iter().cycle();
            group.bench_function(format!("L = {sequence_length}"), |b| {
                b.iter(|| matcher.push(black_box(next.next().unwrap())).unwrap());
            });
        }
        let motions = [Motion::steady(), Motion::free(), Motion::any()];
        for (kind, motion) in ["steady", "free", "any"].into_iter().zip(motions) {
            let mut matcher = Matcher::new(places, config! { motion: Some(motion) }).unwrap();
            let fix = columns.iter().map(|column| matcher.push(column).unwrap()).last().unwrap();
            assert_eq!(fix.place, places / 3 + 15);
            let mut next = columns.iter().cycle();
            group.bench_function(format!("L = 2, motion {kind}"), |b| {
                b.iter(|| matcher.push(black_box(next.next().unwrap())).unwrap());
            });
        }
    }
}

fn image(criterion: &mut Criterion) {
    let (map, frames) = drives(640, 480, 8);
    let mut describer = Describer::new(Sad::default());
    let mut descriptor = Values::U8(vec![0; Sad::default().dim()]);
    let mut next = frames.iter().cycle();
    criterion.bench_function("describe, 640 x 480 RGB", |b| {
        b.iter(|| {
            describer.describe(black_box(next.next().unwrap().view()), &mut descriptor).unwrap();
        });
    });
    let mut localizer = Localizer::new(map, config! { sequence_length: 3 }).unwrap();
    let mut copy = localizer.clone();
    for frame in &frames {
        let descriptor = Sad::default().describe(frame.view()).unwrap();
        let fix = copy.push_descriptor(&descriptor).unwrap();
        assert_eq!(localizer.push_image(frame).unwrap(), fix);
    }
    criterion.bench_function("image to fix, 640 x 480 RGB, n = 1800, L = 3", |b| {
        b.iter(|| localizer.push_image(black_box(next.next().unwrap())).unwrap());
    });
}

/// Whole runs at once, which must say what the stream says.
fn batch(criterion: &mut Criterion) {
    const QUERIES: usize = 200;
    let (map, frames) = drives(64, 32, QUERIES);
    let config = config! { sequence_length: 5 };
    let descriptors: Vec<Values> =
        frames.iter().map(|frame| Sad::default().describe(frame.view()).unwrap()).collect();
    let mut stream = Localizer::new(map.clone(), config.clone()).unwrap();
    let fixes: Vec<Fix> =
        descriptors.iter().map(|one| stream.push_descriptor(one).unwrap()).collect();
    let all: Vec<u8> = descriptors
        .iter()
        .flat_map(|one| match one {
            Values::U8(bytes) => bytes.clone(),
            _ => Vec::new(),
        })
        .collect();
    let mut distances = Array2::zeros((PLACES, QUERIES));
    for (mut column, descriptor) in distances.columns_mut().into_iter().zip(&descriptors) {
        column.assign(&ndarray::Array1::from(map.distances(descriptor).unwrap()));
    }
    let go_on: &mut (dyn FnMut(usize, usize) -> ControlFlow<()> + Send) =
        &mut |_, _| ControlFlow::Continue(());
    let mut group = criterion.benchmark_group(format!("batch, n = {PLACES}, m = {QUERIES}"));
    group.throughput(Throughput::Elements(QUERIES as u64)).sample_size(20);
    let run = match_descriptors(&map, &all, &config, Drive::default(), go_on).unwrap();
    assert_eq!(run.fixes, fixes);
    group.bench_function("from descriptors", |b| {
        b.iter(|| {
            match_descriptors(&map, black_box(&all), &config, Drive::default(), go_on).unwrap()
        });
    });
    let run = match_distances(distances.view(), &config, Drive::default()).unwrap();
    assert_eq!(run.fixes, fixes);
    group.bench_function("from distances", |b| {
        b.iter(|| match_distances(black_box(distances.view()), &config, Drive::default()).unwrap());
    });
}

criterion_group!(benches, push, image, batch);
criterion_main!(benches);
