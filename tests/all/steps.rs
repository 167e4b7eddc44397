//! Post-processing against plain formulas.

#[cfg(feature = "pca")]
use nalgebra::DMatrix;
use proptest::prelude::*;

use surefix::{Error, Post, Running, Step, standardized};

use crate::cases::cases;
use crate::random::SplitMix64;

/// Of the vectors that a chain gives.
const WIDTH: usize = 3;

fn rows(count: usize, dim: usize, seed: u64) -> Vec<f32> {
    let mut random = SplitMix64(seed);
    let mut draw = || 2.0 * random.share() - 1.0;
    (0..count * dim).map(|index| draw() * (1 + index % dim) as f32 + (index % dim) as f32).collect()
}

fn column(rows: &[f32], dim: usize, at: usize) -> Vec<f64> {
    rows.iter().skip(at).step_by(dim).map(|&x| x.into()).collect()
}

fn mean(numbers: &[f64]) -> f64 {
    numbers.iter().sum::<f64>() / numbers.len() as f64
}

fn variance(numbers: &[f64]) -> f64 {
    mean(&numbers.iter().map(|x| (x - mean(numbers)).powi(2)).collect::<Vec<_>>())
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn standardized_rows_have_mean_0_and_deviation_1(count in 2..40_usize, dim in 1..20_usize, seed: u64) {
        let rows = rows(count, dim, seed);
        let done = standardized(&rows, dim).unwrap();
        for at in 0..dim {
            let numbers = column(&done, dim, at);
            prop_assert!(mean(&numbers).abs() < 1e-6);
            prop_assert!((variance(&numbers) - 1.0).abs() < 1e-5);
        }
    }

    /// Of both ways, by the rows' products and by the covariances.
    #[cfg(feature = "pca")]
    #[test]
    fn whitened_rows_are_uncorrelated_with_variance_1(
        (count, dim) in prop_oneof![(4..12_usize, 12..40_usize), (40..80_usize, 1..12_usize)], seed: u64,
    ) {
        let rows = rows(count, dim, seed);
        let wanted = (count - 1).min(dim).div_ceil(2);
        for whiten in [true, false] {
            let (post, done) = Post::fit(&[Step::Pca { dim: wanted, whiten }], &rows, dim).unwrap();
            prop_assert_eq!((post.input(), post.output()), (dim, wanted));
            prop_assert_eq!(&post.apply(&rows).unwrap(), &done);
            let numbers = DMatrix::from_fn(count, wanted, |row, at| f64::from(done[row * wanted + at]));
            let covariance = numbers.transpose() * &numbers / (count - 1) as f64;
            let largest = covariance[(0, 0)];
            for (row, at) in (0..wanted).flat_map(|row| (0..wanted).map(move |at| (row, at))) {
                let expected = if row != at { 0.0 } else if whiten { 1.0 } else { covariance[(at, at)] };
                prop_assert!((covariance[(row, at)] - expected).abs() < 1e-4 * largest, "{}", covariance);
            }
            if !whiten {
                // The largest variances, in order.
                let all = DMatrix::from_fn(count, dim, |row, at| f64::from(rows[row * dim + at]));
                let centre = all.row_mean();
                let centred = DMatrix::from_fn(count, dim, |row, at| all[(row, at)] - centre[at]);
                let mut expected: Vec<f64> =
                    centred.svd(false, false).singular_values.iter().map(|s| s * s / (count - 1) as f64).collect();
                expected.sort_by(|a, b| b.total_cmp(a));
                for (at, expected) in expected.into_iter().take(wanted).enumerate() {
                    prop_assert!((covariance[(at, at)] - expected).abs() < 1e-4 * largest);
                }
            }
        }
    }

    #[test]
    fn a_chain_is_its_steps_and_one_vector_is_as_many(count in 6..20_usize, dim in 16..40_usize, seed: u64) {
        let rows = rows(count, dim, seed);
        let steps = [
            Step::Standardize,
            Step::Projection { dim: 12, seed },
            #[cfg(feature = "pca")]
            Step::Pca { dim: WIDTH, whiten: true },
            #[cfg(not(feature = "pca"))]
            Step::Projection { dim: WIDTH, seed: !seed },
            Step::Normalize,
        ];
        let (post, done) = Post::fit(&steps, &rows, dim).unwrap();
        let (mut by_hand, mut width) = (rows.clone(), dim);
        for step in steps {
            let (post, next) = Post::fit(&[step], &by_hand, width).unwrap();
            (by_hand, width) = (next, post.output());
        }
        prop_assert_eq!(&by_hand, &done);
        for (row, expected) in rows.chunks_exact(dim).zip(done.chunks_exact(WIDTH)) {
            prop_assert_eq!(post.apply(row).unwrap(), expected);
            let length = expected.iter().map(|x| x * x).sum::<f32>().sqrt();
            prop_assert!((length - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn running_statistics_are_those_of_the_rows_so_far(count in 2..30_usize, dim in 1..8_usize, seed: u64) {
        let rows = rows(count, dim, seed);
        let mut running = Running::new(dim);
        let mut out = vec![f32::NAN; dim];
        for (index, row) in rows.chunks_exact(dim).enumerate() {
            let before = running.clone();
            let mut spoilt = row.to_vec();
            spoilt[dim - 1] = f32::NAN;
            let refused = matches!(running.push(&spoilt, &mut out), Err(Error::NotFinite { .. }));
            prop_assert!(refused);
            prop_assert_eq!(&running, &before);
            running.push(row, &mut out).unwrap();
            if index == 0 {
                prop_assert!(out.iter().all(|&x| x == 0.0));
                continue;
            }
            let so_far = standardized(&rows[..(index + 1) * dim], dim).unwrap();
            for (a, b) in out.iter().zip(&so_far[index * dim..]) {
                prop_assert!((a - b).abs() <= 1e-5 * (1.0 + b.abs()), "{} {}", a, b);
            }
        }
        running.reset();
        prop_assert_eq!(running, Running::new(dim));
    }
}

#[test]
fn a_projection_keeps_distances_about_and_is_the_same_everywhere() {
    let (count, dim, to) = (30, 500, 400);
    let rows: Vec<f32> = rows(count * dim, 1, 7);
    let (_, done) = Post::fit(&[Step::Projection { dim: to, seed: 3 }], &rows, dim).unwrap();
    let distance = |rows: &[f32], dim: usize, a: usize, b: usize| {
        let pairs = rows[a * dim..(a + 1) * dim].iter().zip(&rows[b * dim..(b + 1) * dim]);
        pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
    };
    for (a, b) in (0..count).flat_map(|a| (0..a).map(move |b| (a, b))) {
        let ratio = distance(&done, to, a, b) / distance(&rows, dim, a, b);
        assert!((0.8..1.2).contains(&ratio), "{ratio}");
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let flat = [1.0_f32, 2.0, 1.0, 2.0, 1.0, 2.0];
    assert_eq!(standardized(&flat, 2).unwrap(), [0.0; 6]);
    let say =
        |steps: &[Step], rows: &[f32], dim| Post::fit(steps, rows, dim).unwrap_err().to_string();
    // Zeros have no direction, and stay zeros.
    let (_, zeros) = Post::fit(&[Step::Standardize, Step::Normalize], &flat, 2).unwrap();
    assert_eq!(zeros, [0.0; 6]);
    let line = [1.0_f32, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0];
    let pca = |dim| Step::Pca { dim, whiten: true };
    if cfg!(feature = "pca") {
        assert!(Post::fit(&[pca(1)], &line, 2).is_ok());
        assert!(say(&[pca(2)], &line, 2).contains("from 1 to 1, what 4 references of 2 numbers"));
        assert!(say(&[pca(0)], &line, 2).contains("pca dim"));
    } else {
        assert!(say(&[pca(1)], &line, 2).contains("cargo feature `pca`"));
    }
    assert!(say(&[Step::Projection { dim: 0, seed: 1 }], &line, 2).contains("projection dim"));
    for dim in [1 << 21, 1 << 40, usize::MAX / 2] {
        assert!(say(&[Step::Projection { dim, seed: 1 }], &line, 2).contains("from 1 to 1048576"));
    }
    assert!(say(&[], &line, 3).contains("rows of at least one number"));
    assert!(say(&[], &line, 8).contains("at least 2 places"));
    assert!(say(&[], &[1.0, f32::NAN, 2.0, 3.0], 2).contains("NaN"));
    let huge = [f32::MAX, -f32::MAX, f32::MAX, f32::MAX];
    let huge = say(&[Step::Projection { dim: 1, seed: 0 }], &huge, 2);
    assert!(huge.contains("descriptor, projected: expected finite numbers"), "{huge}");
    let (post, _) = Post::fit(&[Step::Normalize], &line, 2).unwrap();
    assert!(matches!(post.apply(&[1.0, 2.0, 3.0]), Err(Error::Shape { .. })));
    assert_eq!(post.apply(&[3.0, 4.0, 0.0, 0.0]).unwrap(), [0.6, 0.8, 0.0, 0.0]);
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn restored_statistics_go_on_to_the_last_bit(cut in 0..20_usize, dim in 1..8_usize, seed: u64, after: bool) {
        let (queries, references) = (rows(30, dim, seed), rows(5, dim, !seed));
        let mut whole = if after { Running::after(&references, dim)? } else { Running::new(dim) };
        let (mut a, mut b) = (vec![0.0; dim], vec![0.0; dim]);
        for query in queries[..cut * dim].chunks_exact(dim) {
            whole.push(query, &mut a)?;
        }
        let blob = whole.snapshot()?;
        let mut restored = Running::restore(&blob)?;
        prop_assert_eq!(&restored, &whole);
        prop_assert_eq!(restored.snapshot()?, blob);
        for query in queries[cut * dim..].chunks_exact(dim) {
            whole.push(query, &mut a)?;
            restored.push(query, &mut b)?;
            let bits = |out: &[f32]| out.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            prop_assert_eq!(bits(&a), bits(&b));
        }
    }

    #[test]
    fn damaged_statistics_are_refused(at: prop::sample::Index, to: u8, cut: prop::sample::Index) {
        let mut running = Running::new(3);
        running.push(&[1.0, 2.0, 3.0], &mut [0.0; 3])?;
        let blob = running.snapshot()?;
        let short = &blob[..cut.index(blob.len())];
        let refused = matches!(Running::restore(short), Err(Error::Snapshot { .. }));
        prop_assert!(refused);
        let mut changed = blob.clone();
        let at = at.index(blob.len());
        changed[at] = to;
        match Running::restore(&changed) {
            // A flip in a blank, or none.
            Ok(restored) => prop_assert_eq!(restored, running),
            Err(Error::Snapshot { .. }) => {}
            Err(other) => prop_assert!(false, "{}", other),
        }
    }
}
