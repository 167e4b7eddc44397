//! A place's cost on a long route and on a longer one, and learned descriptors with and without a
//! screen: `cargo bench --bench scale`. It takes 2.3 GB of memory.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark stops at the first surprise")]

#[macro_use]
#[path = "../tests/all/options.rs"]
mod options;

mod random;

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use random::SplitMix64;
use surefix::{Config, Dtype, Localizer, Map, Metric, Values};

const DIM: usize = 2048;

fn scale(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group(format!("push of a uint8 SAD descriptor of {DIM}"));
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    for places in [100_000, 1_000_000] {
        let Values::U8(rows) = SplitMix64(1).numbers(Dtype::U8, places * DIM) else { return };
        let query = rows[places / 3 * DIM..][..DIM].to_vec();
        let map = Map::from_descriptors(rows, DIM, Metric::Manhattan).unwrap();
        let mut localizer = Localizer::new(map.into(), Config::default()).unwrap();
        let fix = localizer.push_descriptor(&query).unwrap();
        assert_eq!((fix.single.place, fix.single.distance), (places / 3, 0.0));
        group.throughput(Throughput::Elements(places as u64));
        group.bench_function(format!("n = {places}"), |b| {
            b.iter(|| localizer.push_descriptor(black_box(&query)).unwrap());
        });
    }
    group.finish();
}

/// A drive along 50,000 places of 4,096 float32 numbers.
fn screen(criterion: &mut Criterion) {
    const PLACES: usize = 50_000;
    const DIM: usize = 4096;
    let mut dice = SplitMix64(2);
    let mut rows = dice.signed(PLACES * DIM);
    for at in DIM..rows.len() {
        rows[at] += 0.9 * rows[at - DIM];
    }
    let noise = dice.signed(64 * DIM);
    let drive: Vec<f32> =
        noise.iter().zip(&rows[PLACES / 3 * DIM..]).map(|(noise, row)| row + 2.0 * noise).collect();
    let map = Map::from_descriptors(rows, DIM, Metric::Cosine).unwrap();
    let config = config! { sequence_length: 3 };
    let new = |map: Map| {
        Localizer::new(map.into(), config.clone()).unwrap().with_threads(Some(1)).unwrap()
    };
    let mut localizers =
        [("plain", new(map.clone())), ("screen of int8", new(map.with_screen(Dtype::I8).unwrap()))];
    let [(_, plain), (_, screened)] = &mut localizers;
    for query in drive.chunks_exact(DIM) {
        assert_eq!(plain.push_descriptor(query).unwrap(), screened.push_descriptor(query).unwrap());
    }
    let mut group =
        criterion.benchmark_group(format!("push of a float32 descriptor of {DIM}, n = {PLACES}"));
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    group.throughput(Throughput::Elements(PLACES as u64));
    for (name, localizer) in &mut localizers {
        let mut frames = drive.chunks_exact(DIM).cycle();
        group.bench_function(*name, |b| {
            b.iter(|| localizer.push_descriptor(black_box(frames.next().unwrap())).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, scale, screen);
criterion_main!(benches);
