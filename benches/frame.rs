//! What one camera frame costs, part by part: `cargo bench`.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark stops at the first surprise")]

use std::hint::black_box;
use std::ops::ControlFlow;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use surefix::descriptor::Describer;
use surefix::simulate::{Conditions, Route, RouteConfig};
use surefix::{Config, Map, Matcher, Sad, Values};

/// The paper's route length.
const PLACES: usize = 1800;

fn frame(criterion: &mut Criterion) {
    let config = RouteConfig { places: PLACES, width: 64, height: 32, ..RouteConfig::default() };
    let drive = Route::new(config).unwrap().traverse(Conditions::reference()).unwrap();
    let map = Map::from_images(&drive, Sad::default(), &mut |_, _| ControlFlow::Continue(())).unwrap();
    let query = Sad::default().describe(drive.frame(900).view()).unwrap();
    let mut distances = map.distances(&query).unwrap();
    assert_eq!(distances[900], 0.0);

    let mut group = criterion.benchmark_group("distances");
    group.throughput(Throughput::Bytes((PLACES * map.dim()) as u64));
    group.bench_function("u8 SAD, 1800 x 2048", |b| {
        b.iter(|| map.distances_into(black_box(query.view()), &mut distances).unwrap());
    });
    group.finish();

    let mut group = criterion.benchmark_group("push");
    group.throughput(Throughput::Elements(PLACES as u64));
    for sequence_length in [2, 3, 10, 100] {
        let mut matcher = Matcher::new(PLACES, Config { sequence_length, ..Config::default() }).unwrap();
        group.bench_function(format!("n = 1800, L = {sequence_length}"), |b| {
            b.iter(|| matcher.push(black_box(&distances)).unwrap());
        });
    }
    group.finish();

    let config = RouteConfig { places: 2, width: 640, height: 480, ..RouteConfig::default() };
    let image = Route::new(config).unwrap().traverse(Conditions::reference()).unwrap().frame(0);
    let mut describer = Describer::new(Sad::default());
    let mut descriptor = Values::U8(vec![0; Sad::default().dim()]);
    criterion.bench_function("describe, 640 x 480 RGB", |b| {
        b.iter(|| describer.describe(black_box(image.view()), &mut descriptor).unwrap());
    });
}

criterion_group!(benches, frame);
criterion_main!(benches);
