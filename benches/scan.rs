//! The scan of a map: every type, metric and instruction set: `cargo bench --bench scan`.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark stops at the first surprise")]

mod random;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use random::SplitMix64;
use surefix::{Dtype, Isa, Map, Metric};

const PLACES: usize = 1800;

fn scan(criterion: &mut Criterion) {
    let mut dice = SplitMix64(1);
    for (dtype, dim) in
        [(Dtype::U8, 2048), (Dtype::I8, 4096), (Dtype::F16, 4096), (Dtype::F32, 4096)]
    {
        let (rows, query) = (dice.numbers(dtype, PLACES * dim), dice.numbers(dtype, dim));
        for metric in [Metric::Manhattan, Metric::Euclidean, Metric::Cosine] {
            let map = Map::from_descriptors(rows.clone(), dim, metric).unwrap();
            let plain = map.clone().with_isa(Isa::Scalar).unwrap().distances(&query).unwrap();
            let mut group =
                criterion.benchmark_group(format!("{dtype} {metric}, {PLACES} x {dim}"));
            group.throughput(Throughput::Bytes((PLACES * dim * dtype.size()) as u64));
            for isa in Isa::available() {
                let map = map.clone().with_isa(isa).unwrap();
                let mut out = map.distances(&query).unwrap();
                assert_eq!(out, plain, "{isa} gives the distances of the plain kernels");
                group.bench_function(isa.to_string(), |b| {
                    b.iter(|| map.distances_into(black_box(query.view()), &mut out).unwrap());
                });
            }
        }
    }
}

criterion_group!(benches, scan);
criterion_main!(benches);
