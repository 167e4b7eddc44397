//! Thresholds with a promise, and what is carried to other conditions (method 1.12), beside their
//! definitions.

use proptest::collection::vec;
use proptest::prelude::*;
use surefix::calibration::{Alarm, Calibrate, Threshold, calibrate, wrong_by_truth};
use surefix::evaluate::{Match, Truth};
use surefix::{Config, Error, Localizer, Map, Metric, Motion, Settings};

use crate::cases::cases;

pub(crate) fn matches(scores: &[f32]) -> Vec<Match> {
    let found = |(place, &score)| Match { place, score, ready: true, accepted: true };
    scores.iter().enumerate().map(found).collect()
}

/// The thresholds that are tried, from the strictest on: each accepts a tenth more, and the last all.
pub(crate) fn lines_tried(scores: &[f32], most: f64, sure: f64) -> Vec<f32> {
    let mut strict = scores.to_vec();
    strict.sort_by(f32::total_cmp);
    let fewest = ((1.0 - sure).ln() / (1.0 - most).ln()).ceil();
    let counts = std::iter::successors(Some(fewest), |count| Some(count * 1.1));
    let counts = counts.map(|count| count as usize).take_while(|&count| count < scores.len());
    counts.chain([scores.len()]).map(|count| strict[count - 1]).collect()
}

fn threshold(scores: &[f32], wrong: &[bool], options: &Calibrate) -> Threshold {
    let wrong: Vec<_> = wrong.iter().map(|&wrong| Some(f64::from(wrong))).collect();
    calibrate(&matches(scores), &wrong, options).unwrap()
}

fn promise(wrong: f64, sure: f64) -> Calibrate {
    let mut options = Calibrate::default();
    (options.wrong, options.sure) = (wrong, sure);
    options
}

/// Scores up to 1, among them equal ones; or, with `apart`, none.
fn scores(count: std::ops::Range<usize>, apart: bool) -> impl Strategy<Value = Vec<f32>> {
    vec(0..60_u16, count).prop_map(move |drawn| {
        let spread = |(at, drawn): (usize, u16)| f32::from(drawn) + at as f32 / 1024.0;
        let of = |one: (usize, u16)| if apart { spread(one) } else { f32::from(one.1) };
        drawn.into_iter().enumerate().map(|one| of(one) / 64.0).collect()
    })
}

proptest! {
    #![proptest_config(cases(2_000))]

    /// The drive in other light has the same fixes, and each score is another, in the same order.
    #[test]
    fn what_is_carried_has_the_same_fixes(
        scores in scores(2..40, false), wrong in vec(any::<bool>(), 40), tracked: bool, at: bool,
    ) {
        let mut options = promise(0.6, 0.5);
        (options.tracked, options.block) = (tracked, Some(1));
        let here = threshold(&scores, &wrong[..scores.len()], &options);
        let other = |score: f32| if at { score / 2.0 + 0.25 } else { score * score };
        let there = here.carried_to(&scores.iter().map(|&score| other(score)).collect::<Vec<_>>()).unwrap();
        prop_assert_eq!(there.score.is_some(), here.score.is_some());
        if let (Some(before), Some(after)) = (here.score, there.score) {
            for &score in &scores {
                prop_assert_eq!(other(score) <= after, score <= before);
            }
        }
        for &score in &scores {
            let before = here.probability().at(score);
            let after = there.probability().at(other(score));
            prop_assert!((before - after).abs() < 1e-4, "{}: {}, carried {}", score, before, after);
        }
        // Beyond the worst it falls to 0, as it does here.
        let best = scores.iter().copied().fold(f32::INFINITY, f32::min);
        let worst = scores.iter().copied().fold(0.0, f32::max);
        let end = |best: f32, worst: f32| if tracked { 1.0 } else { worst + (worst - best) };
        for share in [0.25, 0.5, 1.0, 2.0] {
            let beyond = |best: f32, worst: f32| worst + share * (end(best, worst) - worst);
            let before = here.probability().at(beyond(best, worst));
            let after = there.probability().at(beyond(other(best), other(worst)));
            prop_assert!((before - after).abs() < 1e-4, "{}: {}, carried {}", share, before, after);
        }
    }

    /// A query more at most, and none less, than the share that was accepted.
    #[test]
    fn a_carried_threshold_accepts_the_same_share(
        scores_here in scores(1..60, true), wrong in vec(any::<bool>(), 60), there in scores(1..60, true),
    ) {
        let mut options = promise(0.6, 0.5);
        options.block = Some(1);
        let here = threshold(&scores_here, &wrong[..scores_here.len()], &options);
        let carried = here.carried_to(&there).unwrap();
        prop_assert_eq!(carried.score.is_some(), here.score.is_some());
        if let Some(score) = carried.score {
            let accepted = there.iter().filter(|&&other| other <= score).count();
            prop_assert_eq!(accepted, (here.accepted * there.len()).div_ceil(here.queries));
        }
    }
}

proptest! {
    #![proptest_config(cases(50))]

    /// The exact binomial test, in a fixed sequence of thresholds.
    #[test]
    fn independent_queries_are_tested_one_by_one(
        scores in scores(1..120, false), share in prop::sample::select(vec![0.0_f32, 0.05, 0.2]),
        dice in vec(0.0_f32..1.0, 120), (most, sure) in prop::sample::select(vec![
            (0.05, 0.95), (0.3, 0.9), (0.1, 0.5), (0.5, 0.99),
        ]),
    ) {
        let wrong: Vec<bool> = scores.iter().zip(&dice).map(|(score, dice)| *dice < share * score).collect();
        let mut options = promise(most, sure);
        options.independent = true;
        let found = threshold(&scores, &wrong, &options);

        let count = scores.len();
        // The probability of so few errors, if the promise is broken.
        let chance = |errors: usize, accepted: usize| {
            let (mut log, mut sum) = (accepted as f64 * (1.0_f64 - most).ln(), 0.0);
            for k in 0..=errors.min(accepted) {
                sum += log.exp();
                if sum > 1.0 - sure {
                    break;
                }
                log += ((accepted - k) as f64 / (k + 1) as f64 * most / (1.0 - most)).ln();
            }
            sum
        };
        let passes = |errors: usize, accepted: usize| chance(errors, accepted) <= 1.0 - sure;
        let lines = lines_tried(&scores, most, sure);
        let accepted = |line: f32| scores.iter().filter(|&&score| score <= line).count();
        let errors = |line: f32| {
            let each = scores.iter().zip(&wrong);
            each.filter(|&(&score, &wrong)| score <= line && wrong).count()
        };
        let supposed = |line: f32, few: f64| {
            (0..accepted(line)).map(|_| few * most).sum::<f64>().ceil() as usize
        };
        let first = [1.0 / 3.0, 1.0 / 6.0, 0.0].into_iter().find_map(|few| {
            lines.iter().position(|&line| passes(supposed(line, few), accepted(line)))
        });
        let mut expected = None;
        for &line in &lines[first.unwrap_or(lines.len())..] {
            if !passes(errors(line), accepted(line)) {
                break;
            }
            expected = Some(line);
        }
        prop_assert_eq!(found.score, expected);
        prop_assert_eq!((found.queries, found.block), (count, None));
        prop_assert_eq!(found.accepted, expected.map_or(0, accepted));
        prop_assert_eq!(found.errors, expected.map_or(0.0, |line| errors(line) as f64));
        // How many more such queries would do for the threshold that needs the fewest.
        let needed = |line: f32| {
            let mut times: f64 = 1.0;
            for _ in 0..100 {
                let up = |number: usize| (times * number as f64).ceil() as usize;
                if passes(up(errors(line)), up(accepted(line))) {
                    return Some(up(count));
                }
                times *= 1.1;
            }
            None
        };
        let more = lines.iter().filter_map(|&line| needed(line)).min();
        let more = more.map(|needed| (needed - count).max(1));
        prop_assert_eq!(found.more, if expected.is_some() { None } else { more });
    }
}

/// Whatever the scores of the other drive, few, equal or many.
#[test]
fn a_carried_threshold_judges_a_localizer_and_is_kept_in_a_file() {
    let map = Map::from_descriptors(vec![1.0_f32, 0.0, 0.0, 1.0], 2, Metric::Euclidean).unwrap();
    let map = std::sync::Arc::new(map);
    let scores: Vec<f32> = (0..300).map(|query| (query * 7 % 100) as f32 / 128.0).collect();
    let wrong: Vec<bool> = scores.iter().map(|&score| score > 0.6).collect();
    for tracked in [false, true] {
        let mut options = promise(0.1, 0.9);
        (options.tracked, options.block) = (tracked, Some(1));
        let here = threshold(&scores, &wrong, &options);
        assert!(here.score.is_some());
        let equal = threshold(&[0.5; 300], &[false; 300], &options);
        assert_eq!(equal.scores().scores(), [0.5; 257]);
        let many: Vec<f32> = (0..999).map(|query| query as f32 / 1000.0).collect();
        let drives = [&[0.5][..], &[0.25; 30], &[0.25, 0.5], &[0.0, 1.0], &many];
        for (here, there) in [&here, &equal].into_iter().flat_map(|of| drives.map(|to| (of, to))) {
            let carried = here.carried_to(there).unwrap();
            let mut config = Config::default();
            config.motion = tracked.then(Motion::steady);
            let localizer = Localizer::new(map.clone(), config).unwrap();
            assert!(localizer.with_threshold(carried.clone()).is_ok(), "{there:?}");
            let mut settings = Settings::default();
            settings.threshold = Some(carried);
            #[cfg(feature = "toml")]
            assert_eq!(Settings::from_toml(&settings.to_toml().unwrap()).unwrap(), settings);
        }
    }
}

#[test]
fn a_promise_is_told_in_words() {
    let scores: Vec<f32> = (0..200).map(|query| query as f32 / 256.0).collect();
    let few = |metres: Option<f64>, block: Option<usize>, independent: bool| {
        let mut options = promise(1.0 / 30.0, 0.95);
        (options.metres, options.block, options.independent) = (metres, block, independent);
        threshold(&scores[..20], &[false; 20], &options)
    };
    let begin = "nothing can be promised: 20 queries are too few to tell whether at most 3.3333 % \
                 of the accepted are wrong";
    for (block, independent, words) in [
        (Some(1), false, ""),
        (Some(5), false, ", as errors last: 5 queries count as one"),
        (None, true, ""),
    ] {
        let more = few(None, block, independent).more.unwrap();
        for (metres, far) in [(None, None), (Some(1.0), Some(" m,")), (Some(900.0), Some(" km,"))] {
            let said = few(metres, block, independent);
            let length = metres.map(|metres| metres / 20.0 * more as f64);
            assert_eq!(said.more_metres(), length);
            let length = match (length, far) {
                (Some(metres), Some(" km,")) => format!(", {:.1} km,", metres / 1000.0),
                (Some(metres), _) => format!(", {metres:.0} m,"),
                _ => String::new(),
            };
            let expected = format!("{begin}{words}; {more} more like these{length} would do");
            assert_eq!(said.to_string(), expected);
        }
    }
    let never = threshold(&scores[..20], &[true; 20], &promise(0.05, 0.9));
    let expected = "nothing can be promised: the 20 queries have no threshold at which surely at \
                    most 5 % are wrong, and more like these would not change that";
    assert_eq!((never.to_string(), never.more_metres()), (expected.to_owned(), None));

    for (block, words) in [(Some(1), ""), (Some(2), " in blocks of 2")] {
        let mut options = promise(0.125, 0.95);
        options.block = block;
        let sure = threshold(&scores, &[false; 200], &options);
        let score = sure.score.unwrap();
        let begin = format!("accept a score of at most {score}: ");
        let rest = "at most 12.5 % of the accepted are wrong, with 95 % probability; \
                    here 0.0 of 200, of 200 queries";
        assert_eq!(sure.to_string(), format!("{begin}{rest}{words}"));
        options.tracked = true;
        let sure = threshold(&scores, &[false; 200], &options);
        let begin = format!("accept a confidence of at least {:.4}: ", 1.0 - f64::from(score));
        assert_eq!(sure.to_string(), format!("{begin}{rest}{words}"));
        let carried = sure.carried_to(&scores).unwrap();
        let rest = "the share of the calibration drive; nothing is promised here";
        assert_eq!(carried.to_string(), format!("{begin}{rest}"));
    }
}

#[test]
fn a_match_is_as_wrong_as_the_truth_says() {
    let cells = ndarray::arr2(&[[1_i8, 0, -1], [0, 0, 1]]);
    let truth = Truth::cells(&cells.view(), 0).unwrap();
    let found = |place| Match { place, score: 0.5, ready: true, accepted: true };
    let judged = wrong_by_truth(&[found(0), found(0), found(0)], &truth).unwrap();
    assert_eq!(judged, [Some(0.0), Some(1.0), None]);
    let judged = wrong_by_truth(&[found(1), found(1), found(1)], &truth).unwrap();
    assert_eq!(judged, [Some(1.0), Some(1.0), Some(0.0)]);
    for short in [0, 2, 4] {
        let refused = wrong_by_truth(&vec![found(0); short], &truth);
        assert!(
            matches!(refused, Err(Error::Length { expected, got: 3, .. }) if expected == short)
        );
    }
}

/// Equal scores say nothing: all fixes have the share of the right ones, one wrong and one right
/// query more among them.
#[test]
fn equal_scores_have_one_probability() {
    for tracked in [false, true] {
        let mut options = promise(0.5, 0.5);
        options.tracked = tracked;
        let wrong = [true, false, false, false, true, false, false];
        let probability = threshold(&[0.5; 7], &wrong, &options);
        assert!((probability.probability().at(0.5) - 6.0 / 9.0).abs() < 1e-12);
    }
}

#[test]
fn shares_and_levels_lie_between_0_and_1() {
    let scores: Vec<f32> = (0..50).map(|query| query as f32 / 64.0).collect();
    let sure = threshold(&scores, &[false; 50], &promise(0.2, 0.9));
    let refused = |result: Result<(), Error>| {
        assert!(matches!(result, Err(Error::Option { .. } | Error::Settings { .. })), "{result:?}");
    };
    for outside in [0.0, 1.0, -0.5, 1.5, f64::NAN] {
        refused(calibrate(&matches(&scores), &[Some(0.0); 50], &promise(outside, 0.9)).map(drop));
        refused(calibrate(&matches(&scores), &[Some(0.0); 50], &promise(0.2, outside)).map(drop));
        refused(Alarm::new(&scores, 1, outside).map(drop));
        refused(sure.alarm(outside).map(drop));
    }
    for (wrong, sure) in [(0.0, 0.9), (1.0, 0.9), (0.2, 0.0), (0.2, 1.0)] {
        let mut spoilt = threshold(&scores, &[false; 50], &promise(0.2, 0.9));
        (spoilt.wrong, spoilt.sure) = (wrong, sure);
        let map =
            Map::from_descriptors(vec![1.0_f32, 0.0, 0.0, 1.0], 2, Metric::Euclidean).unwrap();
        let localizer = Localizer::new(std::sync::Arc::new(map), Config::default()).unwrap();
        refused(localizer.with_threshold(spoilt).map(drop));
    }
    let mut options = promise(0.2, 0.9);
    options.metres = Some(0.0);
    assert!(calibrate(&matches(&scores), &[Some(0.0); 50], &options).is_ok());
}
