//! Queries that are standardised by those of their drive so far: a stream is a batch is what is
//! done by hand, also after a restart.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::cases::{cases, signed};
use proptest::prelude::*;
use surefix::Running;
use surefix::{
    Config, Drive, Dtype, Error, Floor, Localizer, Map, Metric, Post, Step, match_descriptors,
};

const TO: usize = 7;

/// Two steps that run along, each on what comes before it.
const STEPS: [Step; 4] = [
    Step::StandardizeRunning,
    Step::Projection { dim: TO, seed: 1 },
    Step::StandardizeRunning,
    Step::Normalize,
];

fn route(raw: &[f32], dim: usize, metric: Metric) -> Map {
    let (post, rows) = Post::fit(&STEPS, raw, dim).unwrap();
    Map::from_descriptors(rows, TO, metric).unwrap().with_post(post).unwrap()
}

/// The queries as the steps make them, one step after the other; and the references' rows.
fn by_hand(raw: &[f32], queries: &[f32], dim: usize) -> (Vec<f32>, Vec<f32>) {
    let (mut rows, mut queries, mut width) = (raw.to_vec(), queries.to_vec(), dim);
    for step in STEPS {
        if step == Step::StandardizeRunning {
            let mut running = Running::after(&rows, width).unwrap();
            let mut out = vec![0.0; width];
            for query in queries.chunks_exact_mut(width) {
                running.push(query, &mut out).unwrap();
                query.copy_from_slice(&out);
            }
            rows = Post::fit(&[Step::Standardize], &rows, width).unwrap().1;
        } else {
            let (post, done) = Post::fit(&[step], &rows, width).unwrap();
            queries = post.apply(&queries).unwrap();
            (rows, width) = (done, post.output());
        }
    }
    (queries, rows)
}

proptest! {
    #![proptest_config(cases(200))]

    #[test]
    fn a_stream_is_a_batch_is_what_is_done_by_hand(
        places in 8..30_usize, dim in 3..20_usize, seed: u64, length in 1..4_usize, stop in 0..20_usize,
    ) {
        for (metric, floor) in [(Metric::Euclidean, Floor::Running), (Metric::Cosine, Floor::Fixed(0.0))] {
            let raw = signed(places * dim, seed);
            let queries: Vec<f32> = signed(20 * dim, !seed).iter().map(|x| 3.0 * x + 1.0).collect();
            let map = Arc::new(route(&raw, dim, metric));
            let config = config! { sequence_length: length, floor };
            let (done, rows) = by_hand(&raw, &queries, dim);
            let plain = Map::from_descriptors(rows, TO, metric).unwrap();
            prop_assert_eq!(plain.descriptors(), map.descriptors());
            let mut other = Localizer::new(Arc::new(plain), config.clone()).unwrap();
            let expected: Vec<_> =
                done.chunks_exact(TO).map(|query| other.push_descriptor(query).unwrap()).collect();

            let batch = match_descriptors(&map, &queries, &config, Drive::default(), &mut |_, _| ControlFlow::Continue(()));
            prop_assert_eq!(&batch.unwrap().fixes, &expected);
            let mut localizer = Localizer::new(Arc::clone(&map), config.clone()).unwrap();
            // A drive before, which a reset forgets.
            localizer.push_descriptor(&queries[dim..2 * dim]).unwrap();
            localizer.reset();
            for (index, (query, expected)) in queries.chunks_exact(dim).zip(&expected).enumerate() {
                if index == stop {
                    let snapshot = localizer.snapshot().unwrap();
                    localizer = Localizer::restore(Arc::clone(&map), &snapshot, Some(&config)).unwrap();
                    prop_assert_eq!(localizer.snapshot().unwrap(), snapshot);
                }
                let mut spoilt = query.to_vec();
                spoilt[dim - 1] = f32::NAN;
                let refused = localizer.push_descriptor(&spoilt).is_err()
                    && localizer.push_descriptor(&query[1..]).is_err();
                prop_assert!(refused);
                prop_assert_eq!(&localizer.push_descriptor(query).unwrap(), expected);
            }
        }
    }
}

/// What all steps take in, and the metric refuses, does not count.
#[test]
fn a_query_without_a_direction_does_not_count() {
    let (post, rows) = Post::fit(&[Step::StandardizeRunning], &[1.0, 5.0, 3.0, 5.0], 2).unwrap();
    let map = Map::from_descriptors(rows, 2, Metric::Cosine).unwrap().with_post(post).unwrap();
    let mut localizer = Localizer::new(Arc::new(map), Config::default()).unwrap();
    let before = localizer.snapshot().unwrap();
    // The references' mean: all zeros when it is standardised.
    assert!(matches!(
        localizer.push_descriptor(&[2.0_f32, 5.0][..]),
        Err(Error::NoDirection { .. })
    ));
    assert_eq!(localizer.snapshot().unwrap(), before);
}

/// However long the drive, beside the mean and the deviation of all its vectors, computed afresh.
#[test]
fn a_long_drive_is_standardised_by_all_of_it() {
    const DIM: usize = 3;
    let vectors: Vec<f32> =
        signed(400 * DIM, 9).iter().enumerate().map(|(at, x)| x + at as f32 / 300.0).collect();
    let mut running = Running::new(DIM);
    let mut out = [0.0; DIM];
    for (index, vector) in vectors.chunks_exact(DIM).enumerate() {
        running.push(vector, &mut out).unwrap();
        for (dim, &got) in out.iter().enumerate() {
            let seen: Vec<f64> =
                vectors.iter().skip(dim).step_by(DIM).take(index + 1).map(|&x| x.into()).collect();
            let count = seen.len() as f64;
            let mean = seen.iter().sum::<f64>() / count;
            let deviation =
                (seen.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count).sqrt();
            let expected =
                if index == 0 { 0.0 } else { (f64::from(vector[dim]) - mean) / deviation };
            assert!(
                (f64::from(got) - expected).abs() < 1e-5,
                "{got} for {expected}, vector {index}"
            );
        }
    }
}

#[test]
fn a_localizer_does_so_on_a_long_drive() {
    let (dim, raw) = (4, signed(12 * 4, 6));
    let queries: Vec<f32> = signed(150 * dim, 7).iter().map(|x| 2.0 * x + 1.0).collect();
    let (done, rows) = by_hand(&raw, &queries, dim);
    let mut localizer =
        Localizer::new(Arc::new(route(&raw, dim, Metric::Euclidean)), Config::default()).unwrap();
    let plain = Map::from_descriptors(rows, TO, Metric::Euclidean).unwrap();
    let mut other = Localizer::new(Arc::new(plain), Config::default()).unwrap();
    for (query, done) in queries.chunks_exact(dim).zip(done.chunks_exact(TO)) {
        assert_eq!(localizer.push_descriptor(query).unwrap(), other.push_descriptor(done).unwrap());
    }
}

#[test]
fn in_a_batch_the_whole_of_the_route_can_be_the_floor() {
    let (dim, raw) = (6, signed(20 * 6, 3));
    let queries: Vec<f32> =
        raw.iter().zip(signed(20 * 6, 4)).map(|(x, y)| 2.0 * x + 0.1 * y + 3.0).collect();
    let map = route(&raw, dim, Metric::Euclidean);
    let run = |floor| {
        let config = config! { floor };
        match_descriptors(&map, &queries, &config, Drive::default(), &mut |_, _| {
            ControlFlow::Continue(())
        })
        .unwrap()
    };
    let lowest = run(Floor::Running)
        .fixes
        .iter()
        .map(|fix| fix.single.distance)
        .fold(f32::INFINITY, f32::min);
    assert_eq!(
        run(Floor::Global),
        run(Floor::Fixed(lowest.into())),
        "the drive begins anew for the second scan"
    );
}

#[test]
fn a_screen_changes_nothing() {
    let (dim, places) = (400, 60);
    let raw = signed(places * dim, 5);
    let steps = [Step::StandardizeRunning, Step::Normalize];
    let (post, rows) = Post::fit(&steps, &raw, dim).unwrap();
    let map = Map::from_descriptors(rows, dim, Metric::Cosine).unwrap().with_post(post).unwrap();
    let mut plain = Localizer::new(Arc::new(map.clone()), Config::default()).unwrap();
    let screened = Arc::new(map.with_screen(Dtype::I8).unwrap());
    let mut localizer = Localizer::new(Arc::clone(&screened), Config::default()).unwrap();
    for (index, row) in raw.chunks_exact(dim).enumerate() {
        if index % 20 == 10 {
            assert_eq!(localizer.snapshot().unwrap(), plain.snapshot().unwrap());
            localizer = Localizer::restore(Arc::clone(&screened), &plain.snapshot().unwrap(), None)
                .unwrap();
        }
        assert_eq!(plain.push_descriptor(row).unwrap(), localizer.push_descriptor(row).unwrap());
    }
}

#[test]
fn a_file_keeps_the_step_and_places_that_follow_are_references() {
    let (dim, raw) = (5, signed(12 * 5, 2));
    let map = route(&raw, dim, Metric::Euclidean);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    map.save(&path).unwrap();
    let opened = Map::open(&path).unwrap();
    assert_eq!(opened.post(), map.post());
    assert_eq!(opened.post().unwrap().steps(), STEPS);
    // By the references' own statistics, whatever came before.
    let again = opened.post().unwrap().apply(&raw).unwrap();
    assert_eq!(surefix::View::from(&again), map.descriptors());
    assert_eq!(opened.distances(&raw[..dim]).unwrap()[0], 0.0);
}

/// Every flipped bit, and one taken on the same map's rows without the step.
#[test]
fn a_damaged_snapshot_is_refused() {
    let (dim, raw) = (5, signed(12 * 5, 2));
    let map = Arc::new(route(&raw, dim, Metric::Euclidean));
    let mut localizer = Localizer::new(Arc::clone(&map), Config::default()).unwrap();
    for row in raw.chunks_exact(dim) {
        localizer.push_descriptor(row).unwrap();
    }
    let snapshot = localizer.snapshot().unwrap();
    for at in 0..snapshot.len() {
        let mut spoilt = snapshot.clone();
        spoilt[at] ^= 4;
        let refused = Localizer::restore(Arc::clone(&map), &spoilt, None);
        assert!(matches!(refused, Err(Error::Snapshot { .. })), "byte {at}");
        assert!(Localizer::restore(Arc::clone(&map), &snapshot[..at], None).is_err());
    }
    let bare = Map::from_descriptors(map.descriptors().to_values(), TO, Metric::Euclidean).unwrap();
    assert!(matches!(
        Localizer::restore(Arc::new(bare), &snapshot, None),
        Err(Error::Snapshot { .. })
    ));
}
