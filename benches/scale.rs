//! A place's cost on a long route and on a longer one: `cargo bench --bench scale`. It takes 2.3 GB of memory.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark stops at the first surprise")]

mod dice;

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use dice::Dice;
use surefix::{Config, Dtype, Localizer, Map, Metric, Values};

const DIM: usize = 2048;

fn scale(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group(format!("push of a uint8 SAD descriptor of {DIM}"));
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    for places in [100_000, 1_000_000] {
        let Values::U8(rows) = Dice(1).numbers(Dtype::U8, places * DIM) else { return };
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

criterion_group!(benches, scale);
criterion_main!(benches);
