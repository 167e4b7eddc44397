//! Several techniques fused: stream is batch, and the whole equals its parts in plain words.

use std::ops::ControlFlow;
use std::sync::Arc;

use ndarray::Array2;
use proptest::prelude::*;
use proptest::sample::select;
use surefix::{
    Config, Drive, Dtype, Error, Fix, Given, Input, Localizer, Map, Metric, Motion, Post, Step,
    Values, View, match_fused, match_fused_distances,
};

use crate::cases::{cases, numbers};
use crate::random::SplitMix64;

fn maps(places: usize, seed: u64) -> Vec<Arc<Map>> {
    let rows = |dtype, dim: usize, metric| {
        let rows = numbers(dtype, places * dim, seed + dim as u64);
        Arc::new(Map::from_descriptors(rows, dim, metric).unwrap())
    };
    vec![
        rows(Dtype::F32, 3, Metric::Euclidean),
        rows(Dtype::U8, 2, Metric::Manhattan),
        rows(Dtype::F32, 5, Metric::Manhattan),
    ]
}

fn bits(fixes: &[Fix]) -> String {
    format!("{fixes:?}")
}

/// The mean of the standardised distances of columns in order: method 1.9, word for word.
fn naive(columns: &[Vec<Vec<f32>>]) -> Vec<Vec<f64>> {
    let (techniques, places) = (columns[0].len(), columns[0][0].len());
    let mut sums = vec![vec![0.0; places]; techniques];
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let fuse = |(query, columns): (usize, &Vec<Vec<f32>>)| {
        let k = query as f64 + 1.0;
        let mut fused = vec![0.0; places];
        for (column, sums) in columns.iter().zip(&mut sums) {
            let d: Vec<f64> = column.iter().map(|&d| d.into()).collect();
            sums.iter_mut().zip(&d).for_each(|(sum, d)| *sum += d);
            let mu: Vec<f64> = sums.iter().map(|sum| sum / k).collect();
            let all = mean(&mu);
            let x: Vec<f64> =
                d.iter().zip(&mu).map(|(d, mu)| d - k / (k + 10.0) * (mu - all)).collect();
            let centre = mean(&x);
            let std = mean(&x.iter().map(|x| (x - centre).powi(2)).collect::<Vec<_>>()).sqrt();
            for (fused, x) in fused.iter_mut().zip(&x) {
                *fused += (x - centre) / std / techniques as f64;
            }
        }
        fused
    };
    columns.iter().enumerate().map(fuse).collect()
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn a_fused_stream_is_its_batch_its_matrices_and_its_snapshots(
        places in 4..40_usize,
        count in 1..12_usize,
        seed in any::<u32>(),
        motion in select(vec![None, Some(Motion::free()), Some(Motion::any())]),
        length in 1..4_usize,
        odometry in any::<bool>(),
    ) {
        let maps = maps(places, seed.into());
        let config = config! { motion: motion, sequence_length: length };
        let queries: Vec<Values> = maps.iter().map(|map| numbers(map.dtype(), count * map.dim(), u64::from(seed) + 99)).collect();
        let row = |map: usize, query: usize| queries[map].view().row(query, maps[map].dim()).unwrap();
        let advance: Vec<f64> = (0..count).map(|query| query as f64 % 3.0 - 0.5).collect();
        let mut drive = Drive::default();
        if odometry {
            drive = drive.advance(&advance);
        }
        let mut localizer = Localizer::fused(maps.clone(), config.clone()).unwrap();
        let mut matrices = vec![Array2::zeros((places, count)); maps.len()];
        let mut stream = Vec::new();
        for (query, &advance) in advance.iter().enumerate() {
            let inputs: Vec<Input<'_>> = (0..maps.len()).map(|map| Input::Descriptor(row(map, query))).collect();
            let mut given = Given::default();
            given.advance = odometry.then_some(advance);
            stream.push(localizer.push_inputs(&inputs, given).unwrap());
            for (index, (map, matrix)) in maps.iter().zip(&mut matrices).enumerate() {
                let distances = map.distances(row(index, query)).unwrap();
                matrix.column_mut(query).iter_mut().zip(distances).for_each(|(to, from)| *to = from);
            }
            if query == count / 2 {
                let blob = localizer.snapshot().unwrap();
                prop_assert!(Localizer::restore(maps[0].clone(), &blob, None).is_err(), "of other maps");
                localizer = Localizer::restore_fused(maps.clone(), &blob, Some(&config)).unwrap();
            }
        }
        let views: Vec<View<'_>> = queries.iter().map(Values::view).collect();
        let mut go_on = |_, _| ControlFlow::Continue(());
        let batch = match_fused(&maps, &views, &config, drive, &mut go_on).unwrap();
        prop_assert_eq!(bits(&batch.fixes), bits(&stream));
        let of_matrices: Vec<_> = matrices.iter().map(|m| m.view()).collect();
        let run = match_fused_distances(&of_matrices, &config, drive).unwrap();
        prop_assert_eq!(bits(&run.fixes), bits(&stream));

        // In plain words.
        let columns: Vec<Vec<Vec<f32>>> = (0..count).map(|query| matrices.iter().map(|m| m.column(query).to_vec()).collect()).collect();
        for (fix, mean) in stream.iter().zip(naive(&columns)) {
            let least = mean.iter().copied().fold(f64::INFINITY, f64::min);
            prop_assert!((mean[fix.single.place] - least).abs() < 1e-4 && (f64::from(fix.single.distance) - least).abs() < 1e-4);
        }
    }
}

/// One technique beside itself is that technique, and its evidence weighs `sqrt(2)` times as much.
#[test]
fn a_technique_twice_is_one_technique_with_more_evidence() {
    let mut random = SplitMix64(7);
    let mut matrix = Array2::from_shape_fn((30, 20), |_| random.share());
    // The robot stands, and the camera is covered for one frame.
    let view = matrix.column(9).to_owned();
    matrix
        .slice_mut(ndarray::s![.., 10..15])
        .columns_mut()
        .into_iter()
        .for_each(|mut c| c.assign(&view));
    matrix.column_mut(12).fill(0.5);
    let mut any = Motion::any();
    any.clip = 20.0;
    for motion in [Motion::free(), any] {
        let mut double = motion.clone();
        double.evidence *= 2.0_f64.sqrt();
        let (twice, once) = (config! { motion: Some(motion) }, config! { motion: Some(double) });
        let twice =
            match_fused_distances(&[matrix.view(), matrix.view()], &twice, Drive::default());
        let once = surefix::match_distances(matrix.view(), &once, Drive::default());
        for (a, b) in twice.unwrap().fixes.iter().zip(once.unwrap().fixes) {
            let (a, b) = (a.track.unwrap(), b.track.unwrap());
            assert_eq!(a.place, b.place);
            assert!((a.confidence - b.confidence).abs() < 1e-9, "{a:?} {b:?}");
        }
    }
}

/// However small: their squares need not be numbers.
#[test]
fn weights_are_shares_of_their_sum() {
    let mut random = SplitMix64(11);
    let [a, b] = [(); 2].map(|()| Array2::from_shape_fn((20, 12), |_| random.share()));
    let fixes = |weights: [f64; 2]| {
        let config = config! {
            motion: Some(Motion::free()), sequence_length: 2, technique_weights: weights.to_vec(),
        };
        match_fused_distances(&[a.view(), b.view()], &config, Drive::default()).unwrap().fixes
    };
    let expected = bits(&fixes([0.75, 3.0]));
    for scale in [-1000, -600, -1, 1, 17] {
        let scale = 2.0_f64.powi(scale);
        assert_eq!(bits(&fixes([0.75 * scale, 3.0 * scale])), expected, "{scale:e}");
    }
    assert_ne!(bits(&fixes([3.0, 0.75])), expected);
}

/// A refusal of the last technique, or of the advance, leaves the first ones as they were.
#[test]
fn what_is_refused_leaves_no_trace_in_any_technique() {
    let map = |seed: u64| {
        let Values::F32(raw) = numbers(Dtype::F32, 12 * 4, seed) else { unreachable!() };
        let (post, rows) = Post::fit(&[Step::StandardizeRunning], &raw, 4).unwrap();
        let map = Map::from_descriptors(rows, 4, Metric::Euclidean).unwrap();
        Arc::new(map.with_post(post).unwrap())
    };
    let maps = vec![map(1), map(2), map(3)];
    let config = config! { motion: Some(Motion::any()) };
    let [mut tried, mut spared] =
        [(); 2].map(|()| Localizer::fused(maps.clone(), config.clone()).unwrap());
    for query in 0..12 {
        let rows: Vec<Values> =
            (0..3).map(|map| numbers(Dtype::F32, 4, 100 + 3 * query + map)).collect();
        let good: Vec<Input<'_>> = rows.iter().map(|row| Input::Descriptor(row.view())).collect();
        let bad = [good[1], good[2], Input::Descriptor(View::F32(&[0.1, f32::NAN, 0.2, 0.3]))];
        let before = tried.snapshot().unwrap();
        assert!(tried.push_inputs(&bad, Given::default()).is_err());
        assert!(tried.push_inputs(&good, Given::default().advance(f64::NAN)).is_err());
        assert!(tried.push_inputs(&good[1..], Given::default()).is_err());
        assert!(tried.gap_with_advance(f64::INFINITY).is_err());
        assert_eq!(tried.snapshot().unwrap(), before);
        if query == 5 {
            tried.gap_with_advance(1.5).unwrap();
            assert!(
                tried.push_inputs(&bad, Given::default()).is_err(),
                "the gap's advance is kept"
            );
            tried =
                Localizer::restore_fused(maps.clone(), &tried.snapshot().unwrap(), None).unwrap();
            spared.gap_with_advance(1.5).unwrap();
        }
        let [a, b] =
            [&mut tried, &mut spared].map(|l| l.push_inputs(&good, Given::default()).unwrap());
        assert_eq!(bits(&[a]), bits(&[b]));
    }
}

#[test]
fn a_reset_forgets_the_statistics_of_all_techniques() {
    let maps = maps(9, 3);
    let config = config! { motion: Some(Motion::any()) };
    let mut localizer = Localizer::fused(maps.clone(), config).unwrap();
    let drive = |localizer: &mut Localizer| -> Vec<Fix> {
        let query = |query: u64| {
            let of = |map: &Arc<Map>| numbers(map.dtype(), map.dim(), query);
            let rows: Vec<Values> = maps.iter().map(of).collect();
            let inputs: Vec<_> = rows.iter().map(|row| Input::Descriptor(row.view())).collect();
            localizer.push_inputs(&inputs, Given::default()).unwrap()
        };
        (0..6).map(query).collect()
    };
    let first = drive(&mut localizer);
    let second = drive(&mut localizer);
    assert_ne!(bits(&first), bits(&second));
    localizer.reset();
    assert_eq!(bits(&drive(&mut localizer)), bits(&first));
}

#[test]
fn what_cannot_be_fused_is_refused_in_words() {
    let said = |error: Result<Localizer, Error>| error.unwrap_err().to_string();
    assert_eq!(
        said(Localizer::fused(vec![], Config::default())),
        "option `maps`: expected 1 to 32 maps, got 0"
    );
    let two = vec![maps(5, 1)[0].clone(), maps(6, 1)[1].clone()];
    let refused = said(Localizer::fused(two, Config::default()));
    assert_eq!(refused, "places of a map, as of the first: expected 5 values, got 6");

    let mut localizer = Localizer::fused(maps(5, 1), Config::default()).unwrap();
    let before = localizer.snapshot().unwrap();
    let good = [0.5_f32, 0.1, 0.2];
    let refused = localizer.push_descriptor(good.as_slice()).unwrap_err().to_string();
    assert_eq!(refused, "inputs, one for each map: expected 3 values, got 1");
    let bad = [0.1, f32::NAN, 0.0, 0.0, 0.0];
    let inputs = [View::F32(&good), View::U8(&[1, 2]), View::F32(&bad)].map(Input::Descriptor);
    assert!(matches!(
        localizer.push_inputs(&inputs, Given::default()),
        Err(Error::NotFinite { .. })
    ));
    assert_eq!(localizer.snapshot().unwrap(), before, "a refused query leaves nothing behind");
}
