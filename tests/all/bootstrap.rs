//! How long errors last and how sure a figure is, beside their formulas.

use proptest::collection::vec;
use proptest::prelude::*;
use surefix::Error;
use surefix::evaluate::{
    Bootstrap, Curve, Match, Point, Recall, Truth, block_length, correlation_time, evaluate,
};

use crate::cases::cases;
use crate::random::SplitMix64;

/// Matches, a few of which are rejected or not ready, and their truth: wrong for some in a row.
fn drive() -> impl Strategy<Value = Vec<(Match, bool)>> {
    let found = (0..8_u8, 0..9_u8, 0..9_u8, any::<bool>());
    vec(found, 1..40).prop_map(|all| {
        let mut wrong = false;
        let one = |(score, ready, accepted, turns): (u8, u8, u8, bool)| {
            wrong ^= turns;
            let score = f32::from(score);
            (Match { place: 0, score, ready: ready > 0, accepted: accepted > 0 }, wrong)
        };
        all.into_iter().map(one).collect()
    })
}

/// The curve of these queries, each `times` times.
fn curve(drive: &[(Match, bool)], times: &[usize], recall: Recall) -> Curve {
    let drawn = drive.iter().zip(times).flat_map(|(one, &times)| std::iter::repeat_n(one, times));
    let (matches, truth): (Vec<Match>, Vec<Option<usize>>) =
        drawn.map(|&(found, wrong)| (found, Some(usize::from(wrong)))).unzip();
    evaluate(&matches, &Truth::places(truth, 0), recall).unwrap()
}

/// How often each query is drawn for each sample, in blocks that go on from the last query with the
/// first.
fn draws(queries: usize, block: usize, bootstrap: &Bootstrap) -> Vec<Vec<usize>> {
    let block = block.min(queries);
    let sample = |sample: usize| {
        let seed = bootstrap.seed ^ (sample as u64).wrapping_mul(0xA076_1D64_78BD_642F);
        let (mut dice, mut drawn, mut times) = (SplitMix64(seed), 0, vec![0; queries]);
        while drawn < queries {
            let start = dice.below(queries);
            for query in (start..start + block).take(queries - drawn) {
                times[query % queries] += 1;
            }
            drawn += block;
        }
        times
    };
    (0..bootstrap.samples).map(sample).collect()
}

/// The number below which a share of the numbers lies, between two of them by a line.
fn quantile(mut numbers: Vec<f64>, share: f64) -> f64 {
    numbers.sort_by(f64::total_cmp);
    let at = share * (numbers.len() - 1) as f64;
    let (below, part) = (at.floor() as usize, at.fract());
    let above = (below + 1).min(numbers.len() - 1);
    numbers[below] * (1.0 - part) + numbers[above] * part
}

proptest! {
    #![proptest_config(cases(1_000))]

    /// With blocks of a given length, and of how long the errors last.
    #[test]
    fn an_interval_holds_the_figures_of_drawn_drives(
        (drive, other) in (drive(), drive()), block in proptest::option::of(1..50_usize),
        seed: u64, level in 0.1..0.9_f64, upto in 0.1..1.0_f64,
    ) {
        let queries = drive.len().min(other.len());
        let (drive, other) = (&drive[..queries], &other[..queries]);
        let bootstrap = Bootstrap { samples: 9, block, level, seed };
        let once = vec![1; queries];
        let of = |drive: &[(Match, bool)]| curve(drive, &once, Recall::Rejected);
        let errors = |drive: &[(Match, bool)]| -> Vec<f64> {
            let ready = drive.iter().filter(|(found, _)| found.ready);
            ready.map(|&(_, wrong)| f64::from(wrong)).collect()
        };
        let auc = |drive: &[(Match, bool)], times: &[usize]| curve(drive, times, Recall::Rejected).auc(upto);
        let check = |interval: surefix::evaluate::Interval, figures: Vec<f64>| {
            let outside = (1.0 - level) / 2.0;
            let ends = [quantile(figures.clone(), outside), quantile(figures, 1.0 - outside)];
            prop_assert!((interval.low - ends[0]).abs() < 1e-12, "{interval:?} for {ends:?}");
            prop_assert!((interval.high - ends[1]).abs() < 1e-12, "{interval:?} for {ends:?}");
            Ok(())
        };
        let lasting = block_length(&errors(drive));
        prop_assert_eq!(of(drive).block(), lasting);
        let drawn = draws(queries, block.or(lasting).unwrap_or(1), &bootstrap);
        let figures = drawn.iter().map(|times| auc(drive, times)).collect();
        check(of(drive).auc_interval(upto, &bootstrap).unwrap(), figures)?;

        // Of two drives, the errors that last longer.
        let lasting = lasting.max(block_length(&errors(other)));
        let drawn = draws(queries, block.or(lasting).unwrap_or(1), &bootstrap);
        let figures = drawn.iter().map(|times| auc(drive, times) - auc(other, times)).collect();
        let interval = of(drive).auc_difference_interval(&of(other), upto, &bootstrap).unwrap();
        check(interval, figures)?;
    }

    #[test]
    fn errors_last_for_the_sum_of_their_correlations(values in vec(0..3_u8, 2..60), every in 1..6_usize) {
        // Each value some times in a row.
        let series: Vec<f64> =
            values.iter().flat_map(|&x| std::iter::repeat_n(f64::from(x), every)).collect();
        let count = series.len() as f64;
        let mean = series.iter().sum::<f64>() / count;
        let covariance = |lag: usize| -> f64 {
            (lag..series.len()).map(|at| (series[at] - mean) * (series[at - lag] - mean)).sum()
        };
        if values.iter().all(|x| x == &values[0]) {
            prop_assert_eq!((correlation_time(&series), block_length(&series)), (None, None));
            return Ok(());
        }
        let rho = |lag: usize| covariance(lag) / covariance(0);
        let (mut time, mut lag) = (-1.0, 0);
        while lag + 1 < series.len() && rho(lag) + rho(lag + 1) > 0.0 {
            time += 2.0 * (rho(lag) + rho(lag + 1));
            lag += 2;
        }
        let time = f64::max(time, 1.0);
        prop_assert!((correlation_time(&series).unwrap() - time).abs() < 1e-9);

        let low = series.iter().copied().reduce(f64::min).unwrap();
        let high = series.iter().copied().reduce(f64::max).unwrap();
        let of_most = count * (mean - low) / (high - low);
        let rarer = of_most.min(count - of_most);
        let bound = time * (1.0 + 1.64 * (10.0 * time / count + time / (2.0 * rarer)).sqrt());
        let block = block_length(&series).unwrap() as f64;
        prop_assert!(block - bound < 1.0 && block >= bound.min(count) - 1e-6, "{block} for {bound}");
        prop_assert!((1.0..=count).contains(&block));
    }

    /// A match that a mask rejects is never found, and can still be missed.
    #[test]
    fn the_best_threshold_balances_precision_and_recall(drive in drive()) {
        let curve = curve(&drive, &vec![1; drive.len()], Recall::Correct);
        let ready: Vec<&(Match, bool)> = drive.iter().filter(|(found, _)| found.ready).collect();
        let right = ready.iter().filter(|(_, wrong)| !wrong).count();
        prop_assert_eq!((curve.judged(), curve.correct()), (ready.len(), right));
        let mut best = 0.0;
        for point in curve.points() {
            let accepted = |(m, _): &&&(Match, bool)| m.accepted && m.score <= point.threshold;
            let (count, found) = ready.iter().filter(accepted).fold((0, 0), |(count, found), one| {
                (count + 1, found + usize::from(!one.1))
            });
            prop_assert_eq!(point.false_positives, count - found);
            prop_assert_eq!(point.precision, found as f64 / count as f64);
            prop_assert_eq!(point.recall, found as f64 / right.max(1) as f64);
            let f1 = 2.0 * found as f64 / (count + right) as f64;
            best = f64::max(best, f1);
        }
        let got = curve.best_f1();
        // The strictest of equals.
        prop_assert!((got.f1 - best).abs() < 1e-12, "{got:?} for {best}");
        let f1 = |p: &Point| 2.0 * p.precision * p.recall / (p.precision + p.recall);
        let first = curve.points().iter().find(|point| f1(point) >= got.f1);
        if got.f1 > 0.0 {
            let first = first.map(|point| (point.threshold, point.precision, point.recall));
            prop_assert_eq!(first, Some((got.threshold, got.precision, got.recall)));
        }
    }
}

/// Their mean is another number, by rounding.
#[test]
fn values_that_are_equal_tell_nothing() {
    assert_ne!([0.1; 3].iter().sum::<f64>() / 3.0, 0.1);
    assert_eq!((correlation_time(&[0.1; 3]), block_length(&[0.1; 3])), (None, None));
}

/// All queries in one block, wherever it begins, are the drive itself.
#[test]
fn one_block_is_the_whole_drive() {
    let found =
        |query: u8| Match { place: 0, score: f32::from(query), ready: true, accepted: true };
    let drive: Vec<(Match, bool)> = (0..20).map(|query| (found(query), query % 3 == 1)).collect();
    let curve = curve(&drive, &[1; 20], Recall::Correct);
    let bootstrap = Bootstrap { block: Some(1000), ..Bootstrap::default() };
    let interval = curve.auc_interval(1.0, &bootstrap).unwrap();
    assert_eq!((interval.low, interval.high), (curve.auc(1.0), curve.auc(1.0)));
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let found = Match { place: 0, score: 0.5, ready: true, accepted: true };
    let (two, three) = ([(found, false); 2], [(found, true); 3]);
    let (two, three) =
        (curve(&two, &[1; 2], Recall::Correct), curve(&three, &[1; 3], Recall::Correct));
    let usual = Bootstrap::default();
    let refused = two.auc_difference_interval(&three, 1.0, &usual).unwrap_err();
    assert!(matches!(refused, Error::Length { expected: 2, got: 3, .. }), "{refused}");
    for level in [0.0, 1.0, -0.5, f64::NAN] {
        let refused = two.auc_interval(1.0, &Bootstrap { level, ..usual }).unwrap_err();
        assert!(matches!(refused, Error::Option { name: "level", .. }), "{refused}");
    }
    let refused = two.auc_interval(1.0, &Bootstrap { block: Some(0), ..usual }).unwrap_err();
    assert!(matches!(refused, Error::Option { name: "block", .. }), "{refused}");
    let none = curve(&[], &[], Recall::Correct).auc_interval(1.0, &usual).unwrap();
    assert_eq!((none.low, none.high), (0.0, 0.0));
}
