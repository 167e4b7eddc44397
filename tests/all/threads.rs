//! Several threads scan one map: the same bits as one, whatever happens.

use std::sync::Arc;
use std::thread;

use crate::cases::{DTYPES, all_bits, numbers};
use surefix::{Channels, Config, Dtype, Error, Fix, Image, Localizer, Map, Metric, Sad};

const METRICS: [Metric; 3] = [Metric::Manhattan, Metric::Euclidean, Metric::Cosine];

fn map(dtype: Dtype, places: usize, dim: usize, metric: Metric) -> Arc<Map> {
    Arc::new(Map::from_descriptors(numbers(dtype, places * dim, 7), dim, metric).unwrap())
}

fn localizer(map: &Arc<Map>, threads: usize) -> Localizer {
    Localizer::new(Arc::clone(map), Config::default()).unwrap().with_threads(Some(threads)).unwrap()
}

fn bits(distances: &[f32]) -> Vec<u32> {
    distances.iter().map(|d| d.to_bits()).collect()
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    for (places, dim) in [(2, 5), (3, 300), (101, 33), (1000, 8)] {
        for metric in METRICS {
            for dtype in DTYPES {
                let map = map(dtype, places, dim, metric);
                let mut alone = localizer(&map, 1);
                let mut pools: Vec<Localizer> =
                    [2, 3, 8].map(|threads| localizer(&map, threads)).into_iter().collect();
                for seed in 0..8 {
                    let kind = if seed % 2 == 0 { dtype } else { Dtype::F32 };
                    let query = numbers(kind, dim, 100 + seed);
                    let expected = alone.push_descriptor(&query).unwrap();
                    for pool in &mut pools {
                        let fix = pool.push_descriptor(&query).unwrap();
                        let of = format!(
                            "{dtype} {metric} {places} x {dim}, {} threads",
                            pool.threads()
                        );
                        assert_eq!(all_bits(&[fix]), all_bits(&[expected]), "{of}");
                        assert_eq!(bits(pool.distances()), bits(alone.distances()), "{of}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_map_of_many_chunks_and_frame_after_frame() {
    let map = map(Dtype::U8, 5003, 2048, Metric::Manhattan);
    let (mut alone, mut pool) = (localizer(&map, 1), localizer(&map, 2));
    for seed in 0..40 {
        let query = numbers(Dtype::U8, 2048, seed);
        let (expected, got) =
            (alone.push_descriptor(&query).unwrap(), pool.push_descriptor(&query).unwrap());
        assert_eq!(all_bits(&[got]), all_bits(&[expected]));
        assert_eq!(bits(pool.distances()), bits(alone.distances()));
    }
}

#[test]
fn a_query_that_is_refused_leaves_it_as_it_was() {
    let map = map(Dtype::F32, 50, 20, Metric::Cosine);
    let (mut pool, mut alone) = (localizer(&map, 3), localizer(&map, 1));
    let query = numbers(Dtype::F32, 20, 1);
    pool.push_descriptor(&query).unwrap();
    alone.push_descriptor(&query).unwrap();
    let mut spoilt = vec![1.0_f32; 20];
    spoilt[19] = f32::NAN;
    for _ in 0..3 {
        let before = (pool.snapshot().unwrap(), bits(pool.distances()));
        assert!(matches!(pool.push_descriptor(&spoilt), Err(Error::NotFinite { .. })));
        assert!(matches!(pool.push_descriptor(&spoilt[1..]), Err(Error::Length { .. })));
        assert!(matches!(pool.push_descriptor(&vec![1_u8; 20]), Err(Error::Dtype { .. })));
        assert_eq!((pool.snapshot().unwrap(), bits(pool.distances())), before);
        let (got, expected) =
            (pool.push_descriptor(&query).unwrap(), alone.push_descriptor(&query).unwrap());
        assert_eq!(all_bits(&[got]), all_bits(&[expected]));
    }
}

#[test]
fn numbers_of_threads_that_cannot_be_are_refused() {
    let map = map(Dtype::U8, 50, 20, Metric::Manhattan);
    for threads in [0, 1025, usize::MAX] {
        let localizer = Localizer::new(Arc::clone(&map), Config::default()).unwrap();
        let error = localizer.with_threads(Some(threads)).unwrap_err().to_string();
        assert!(error.contains("threads") && error.contains(&threads.to_string()), "{error}");
    }
    let automatic = localizer(&map, 4).with_threads(None).unwrap();
    assert_eq!(automatic.threads(), 1, "a small map is scanned by the caller alone");
}

#[test]
fn copies_have_threads_of_their_own_and_the_map_goes_with_the_last() {
    let map = map(Dtype::U8, 3000, 256, Metric::Euclidean);
    let mut first = localizer(&map, 3);
    let queries: Vec<_> = (0..50).map(|seed| numbers(Dtype::U8, 256, seed)).collect();
    first.push_descriptor(&queries[0]).unwrap();
    let copies: Vec<Localizer> = (0..3).map(|_| first.clone()).collect();
    let run = |mut localizer: Localizer| -> Vec<Fix> {
        assert_eq!(localizer.threads(), 3);
        queries.iter().map(|query| localizer.push_descriptor(query).unwrap()).collect()
    };
    let fixes: Vec<Vec<Fix>> = thread::scope(|scope| {
        let all: Vec<_> = copies.into_iter().map(|copy| scope.spawn(|| run(copy))).collect();
        all.into_iter().map(|one| one.join().unwrap()).collect()
    });
    let expected = all_bits(&run(first));
    for fixes in fixes {
        assert_eq!(all_bits(&fixes), expected);
    }
    assert_eq!(Arc::strong_count(&map), 1, "no thread holds on to the map");
}

#[test]
fn a_snapshot_knows_nothing_of_threads() {
    let map = map(Dtype::F32, 200, 30, Metric::Euclidean);
    let (mut pool, mut alone) = (localizer(&map, 3), localizer(&map, 1));
    for seed in 0..5 {
        let query = numbers(Dtype::F32, 30, seed);
        pool.push_descriptor(&query).unwrap();
        alone.push_descriptor(&query).unwrap();
    }
    let blob = pool.snapshot().unwrap();
    assert_eq!(blob, alone.snapshot().unwrap());
    let restored = Localizer::restore(Arc::clone(&map), &blob, Some(&Config::default())).unwrap();
    let mut restored = restored.with_threads(Some(2)).unwrap();
    let query = numbers(Dtype::F32, 30, 9);
    let (got, expected) =
        (restored.push_descriptor(&query).unwrap(), alone.push_descriptor(&query).unwrap());
    assert_eq!(all_bits(&[got]), all_bits(&[expected]));
}

#[test]
fn images_are_scanned_for_by_all() {
    let image = |seed: u8| {
        let pixels = (0..40_u32 * 30).map(|at| (at * (7 + u32::from(seed)) % 255) as u8).collect();
        Image::new(40, 30, Channels::Grey, pixels).unwrap()
    };
    let images: Vec<Image> = (0..20).map(image).collect();
    let sad = Sad::new((16, 8), 4, Dtype::F32).unwrap();
    let map =
        Map::from_images(&images, sad, &mut |_, _| std::ops::ControlFlow::Continue(())).unwrap();
    let mut pool = localizer(&Arc::new(map), 3);
    for (place, frame) in images.iter().enumerate() {
        assert_eq!(pool.push_image(frame).unwrap().single.place, place);
    }
}
