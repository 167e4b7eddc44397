//! The bounds of a screen against the distances, for every place.

use proptest::prelude::*;
use proptest::sample::select;

use super::{EncodedQuery, MAX_SCREENED};
use crate::cases::cases;
use crate::distance::Metric;
use crate::dtype::Dtype;
use crate::map::Map;
use crate::numbers::View;
use crate::random::SplitMix64;
use crate::simd::Isa;

/// From -1 to 1, with a few far outside.
fn any(random: &mut SplitMix64) -> f32 {
    let number = 2.0 * random.share() - 1.0;
    if random.below(50) == 0 { 20.0 * number } else { number }
}

/// Numbers of many sizes, by a power of ten for the whole, for a dimension and for a row.
fn number(
    random: &mut SplitMix64,
    (whole, spread, offset): (i32, i32, f32),
    row: usize,
    at: usize,
) -> f32 {
    let power = whole + (row as i32 % 3) * spread - (at as i32 % 4) * spread;
    (offset + any(random)) * 10_f32.powi(power)
}

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn every_distance_lies_within_its_bounds(
        places in 2..8_usize, dim in prop_oneof![4 => 1..70_usize, 1 => 70..700_usize],
        metric in select(vec![Metric::Euclidean, Metric::Cosine]),
        shape in (prop_oneof![3 => Just(0), 1 => -40..36_i32], 0..6_i32, select(vec![0.0, 1.0, 300.0])),
        near in select(vec![1.0, 1e-3, 1e-6, 0.0]), seed: u64,
    ) {
        let mut random = SplitMix64(seed);
        let rows: Vec<f32> = (0..places * dim).map(|i| number(&mut random, shape, i / dim, i % dim)).collect();
        let Ok(map) = Map::from_descriptors(rows.clone(), dim, metric) else { return Ok(()) };
        // A row, a vector near it, or any vector.
        let mut query = |query: usize| -> Vec<f32> {
            (0..dim)
                .map(|at| (1.0 - near) * rows[query % places * dim + at] + near * number(&mut random, shape, query, at))
                .collect()
        };
        let queries = [0, 1, 2, 3].map(&mut query);
        for isa in Isa::available() {
            let map = map.clone().with_isa(isa).unwrap().with_screen(Dtype::I8).unwrap();
            let codes = map.codes().unwrap();
            for query in &queries {
                let Ok(query) = map.query(View::F32(query)) else { continue };
                let mut encoded = EncodedQuery::new(dim);
                codes.encode(isa, metric, query, &mut encoded);
                let mut sums = vec![f32::NAN; places];
                codes.scan(isa, &encoded.codes, 0..places, &mut sums);
                let (mut low, mut high) = (vec![f32::NAN; places], vec![f32::NAN; places]);
                let near = map.bounds(&encoded, &sums, &mut low, &mut high);
                let mut distances = vec![f32::NAN; places];
                map.scan(query, 0..places, &mut distances);
                for (place, d) in distances.into_iter().enumerate() {
                    let (low, high) = (low[place], high[place]);
                    prop_assert!(
                        (low..=high).contains(&d),
                        "{}, place {}: {:e} from {:e} to {:e}", isa, place, d, low, high
                    );
                    prop_assert!(!near || high < MAX_SCREENED);
                }
            }
        }
    }
}

/// Bounds can hold and be useless: these are about as close as a byte allows.
#[test]
fn the_bounds_are_close() {
    const DIM: usize = 1000;
    let rows = SplitMix64(1).signed(100 * DIM);
    for metric in [Metric::Euclidean, Metric::Cosine] {
        let map = Map::from_descriptors(rows.clone(), DIM, metric)
            .unwrap()
            .with_screen(Dtype::I8)
            .unwrap();
        let (codes, mut encoded) = (map.codes().unwrap(), EncodedQuery::new(DIM));
        let query = map.query(View::F32(&rows[..DIM])).unwrap();
        codes.encode(map.isa(), metric, query, &mut encoded);
        let [mut sums, mut low, mut high] = [(); 3].map(|()| vec![0.0; 100]);
        codes.scan(map.isa(), &encoded.codes, 0..100, &mut sums);
        assert!(map.bounds(&encoded, &sums, &mut low, &mut high));
        // A byte's step is a 127th of the largest number, its error at most half of that, and a
        // root of 12 less than the step in the mean: relative to a row's length a 254th; twice that
        // between the bounds. A distance is about 1.4 lengths.
        let widest = low[1..]
            .iter()
            .zip(&high[1..])
            .map(|(low, high)| (high - low) / high)
            .fold(0.0, f32::max);
        assert!(widest < 2.0 * 1.1 / 254.0, "{metric}: {widest}");
    }
}
