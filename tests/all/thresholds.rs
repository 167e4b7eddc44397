//! Thresholds of a calibration: what they accept, and what is refused (method 1.12).

use std::sync::Arc;

use serde_json::{Value, json};
use surefix::calibration::{Alarm, Calibrate, Threshold, calibrate};
use surefix::evaluate::block_length;
use surefix::{Config, Error, Localizer, Map, Matcher, Metric, Motion};

use crate::calibration::matches;
use crate::random::SplitMix64;

/// A file that says what no calibration does.
#[test]
fn an_impossible_threshold_is_refused_by_the_name_of_its_number() {
    let rows: Vec<f32> = (0..12).map(|at| (at * at % 7) as f32).collect();
    let map = Arc::new(Map::from_descriptors(rows, 2, Metric::Euclidean).unwrap());
    let scores: Vec<f32> = (0..40).map(|query| query as f32 / 64.0).collect();
    for tracked in [false, true] {
        let mut options = Calibrate::default();
        (options.tracked, options.wrong, options.metres) = (tracked, 0.3, Some(100.0));
        let wrong: Vec<_> = (0..40).map(|query| Some(f64::from(query > 30))).collect();
        let good = calibrate(&matches(&scores), &wrong, &options).unwrap();
        let mut config = Config::default();
        config.motion = tracked.then(Motion::steady);
        let taken = |threshold: Threshold| {
            let localizer = Localizer::new(map.clone(), config.clone()).unwrap();
            match localizer.with_threshold(threshold) {
                Ok(_) => None,
                Err(Error::Settings { reason }) => Some(reason),
                Err(other) => panic!("{other}"),
            }
        };
        assert_eq!(taken(good.clone()), None);
        let with = |change: &dyn Fn(&mut Threshold)| {
            let mut threshold = good.clone();
            change(&mut threshold);
            taken(threshold)
        };
        let refused = |reason: Option<String>, name: &str| {
            let named = reason
                .as_ref()
                .is_some_and(|reason| reason.starts_with(&format!("threshold.{name}: ")));
            assert!(named, "{name}: {reason:?}");
        };
        for score in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            refused(with(&|threshold| threshold.score = Some(score)), "score");
        }
        for score in [-0.5, 1.5] {
            let reason = with(&|threshold| threshold.score = Some(score));
            if tracked { refused(reason, "score") } else { assert_eq!(reason, None) }
        }
        for score in [0.0, 1.0] {
            assert_eq!(with(&|threshold| threshold.score = Some(score)), None);
        }
        assert_eq!(with(&|threshold| threshold.score = None), None);
        refused(with(&|threshold| (threshold.queries, threshold.accepted) = (0, 0)), "queries");
        refused(with(&|threshold| threshold.accepted = 41), "queries");
        assert_eq!(with(&|threshold| (threshold.accepted, threshold.errors) = (40, 40.0)), None);
        assert_eq!(with(&|threshold| (threshold.accepted, threshold.errors) = (0, 0.0)), None);
        refused(with(&|threshold| (threshold.accepted, threshold.errors) = (7, 7.5)), "errors");
        refused(with(&|threshold| threshold.errors = -0.5), "errors");
        refused(with(&|threshold| threshold.errors = f64::NAN), "errors");
        refused(with(&|threshold| threshold.block = Some(0)), "block");
        assert_eq!(with(&|threshold| threshold.block = Some(1)), None);
        assert_eq!(with(&|threshold| threshold.block = None), None);
        for metres in [-0.5, f64::INFINITY, f64::NAN] {
            refused(with(&|threshold| threshold.metres = Some(metres)), "metres");
        }
        assert_eq!(with(&|threshold| threshold.metres = Some(0.0)), None);

        // What has no name outside.
        let written = |change: &dyn Fn(&mut Value)| {
            let mut value = serde_json::to_value(&good).unwrap();
            change(&mut value);
            taken(serde_json::from_value(value).unwrap())
        };
        assert_eq!(written(&|_| ()), None);
        refused(written(&|value| value["means"]["block"] = 0.into()), "means");
        for probability in [
            json!({"scores": [], "right": []}),
            json!({"scores": [0.1, 0.2], "right": [0.5]}),
            json!({"scores": [0.1], "right": [0.5, 0.25]}),
            json!({"scores": [0.2, 0.1], "right": [0.5, 0.25]}),
            json!({"scores": [0.1, 1e39], "right": [0.5, 0.25]}),
            json!({"scores": [0.1, 0.2], "right": [0.25, 0.5]}),
            json!({"scores": [0.1, 0.2], "right": [1.5, 0.5]}),
            json!({"scores": [0.1, 0.2], "right": [0.5, -0.5]}),
        ] {
            refused(written(&|value| value["probability"] = probability.clone()), "probability");
        }
        for shares in [json!([0.5, 0.5]), json!([1.0, 0.0])] {
            let probability = json!({"scores": [0.1, 0.1], "right": shares});
            assert_eq!(written(&|value| value["probability"] = probability.clone()), None);
        }
        for scores in [json!([]), json!([0.5, 0.25]), json!([0.25, 1e39])] {
            refused(written(&|value| value["scores"] = scores.clone()), "scores");
        }
        assert_eq!(written(&|value| value["scores"] = json!([0.25, 0.25])), None);
    }
}

/// A fix is accepted if it is ready, of the kind that was calibrated, and as good as the threshold.
#[test]
fn a_threshold_accepts_ready_fixes_of_its_kind_and_score() {
    let scores = [0.25_f32; 40];
    let mut threshold =
        calibrate(&matches(&scores), &[Some(0.0); 40], &Calibrate::default()).unwrap();
    for motion in [None, Some(Motion::steady())] {
        let mut config = Config::default();
        (config.sequence_length, config.motion) = (2, motion.clone());
        let mut matcher = Matcher::new(4, config).unwrap();
        for query in 0..3 {
            let fix = matcher.push(&[0.5, 1.0, 0.25, 0.75]).unwrap();
            for tracked in [false, true] {
                threshold.tracked = tracked;
                let judged = fix.is_ready() && tracked == motion.is_some();
                for (score, good) in [
                    (None, false),
                    (Some(fix.score), true),
                    (Some(fix.score.next_down()), false),
                    (Some(f32::MAX), true),
                ] {
                    threshold.score = score;
                    // Before it is ready, a fix has no score.
                    assert_eq!(threshold.accepts(&fix), judged && good, "query {query}: {score:?}");
                }
                assert_eq!(threshold.probability_of(&fix).is_some(), judged);
            }
        }
    }
}

/// The blocks are as long as the scores are alike, and of a long drive the latest thousand count.
#[test]
fn a_thresholds_alarm_knows_the_latest_blocks_of_its_drive() {
    for (queries, lasting) in [(200, 1), (400, 7), (999, 1), (6_000, 1), (6_000, 4)] {
        let mut dice = SplitMix64(queries as u64);
        let mut level = 0.0;
        let one = |query: usize| {
            if query.is_multiple_of(lasting) {
                level = dice.share();
            }
            // The first half would be noticed: it was better.
            level + dice.share() / 4.0 + if 2 * query > queries { 1.0 } else { 0.0 }
        };
        let scores: Vec<f32> = (0..queries).map(one).collect();
        let each: Vec<f64> = scores.iter().copied().map(f64::from).collect();
        let block = block_length(&each).unwrap();
        let blocks = queries / block;
        let latest = &scores[blocks.saturating_sub(1000) * block..];
        let threshold =
            calibrate(&matches(&scores), &vec![Some(0.0); queries], &Calibrate::default()).unwrap();
        let mut own = threshold.alarm(0.01).unwrap();
        let mut other = Alarm::new(latest, block, 0.01).unwrap();
        for score in (0..20 * block).map(|frame| (frame % 5) as f32 / 2.0) {
            assert_eq!(own.push(score).unwrap(), other.push(score).unwrap());
            assert_eq!(own.evidence().to_bits(), other.evidence().to_bits(), "{queries} queries");
        }
    }
}

#[test]
fn an_option_outside_its_range_is_named() {
    let given = |change: fn(&mut Calibrate)| {
        let mut options = Calibrate::default();
        change(&mut options);
        match calibrate(&matches(&[0.5; 40]), &[Some(0.0); 40], &options) {
            Err(Error::Option { name, got, .. }) => Some((name, got)),
            other => other.map(|_| None).unwrap(),
        }
    };
    let refused = |name, got: &str| Some((name, got.to_owned()));
    assert_eq!(given(|options| options.metres = Some(-0.5)), refused("metres", "-0.5"));
    assert_eq!(given(|options| options.metres = Some(f64::INFINITY)), refused("metres", "inf"));
    assert_eq!(given(|options| options.metres = Some(f64::NAN)), refused("metres", "NaN"));
    assert_eq!(given(|options| options.metres = Some(0.5)), None);
    assert_eq!(given(|options| options.block = Some(0)), refused("block", "0"));
    assert_eq!(given(|options| options.block = Some(1)), None);
    let both = given(|options| (options.block, options.independent) = (Some(3), true));
    assert_eq!(both, refused("block", "3"));
    assert_eq!(given(|options| options.independent = true), None);
    for block in [0, 1] {
        assert_eq!(Alarm::new(&[0.5; 4], block, 0.1).is_ok(), block > 0);
    }
}

#[test]
fn what_no_match_can_be_is_refused() {
    let scores = [0.25_f32, 0.5, 0.75];
    let judged = |wrong: &[f64]| {
        let wrong: Vec<_> = wrong.iter().copied().map(Some).collect();
        calibrate(&matches(&scores), &wrong, &Calibrate::default())
    };
    assert!(judged(&[0.0, 1.0, 0.5]).is_ok());
    for outside in [-0.125, 1.125, f64::NAN] {
        let refused = judged(&[0.0, outside, 0.5]);
        let Err(Error::Shape { what: "wrong", got, .. }) = refused else { panic!("{refused:?}") };
        assert_eq!(got, outside.to_string());
    }
    for count in [2, 4] {
        let refused = judged(&vec![0.0; count]);
        let Err(Error::Length { expected: 3, got, .. }) = refused else { panic!("{refused:?}") };
        assert_eq!(got, count);
    }
}
