//! A localizer's fixes, judged by a threshold.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use surefix::calibration::{Calibrate, Threshold, calibrate};
use surefix::{
    Config, Dtype, Error, Fix, Localizer, Map, MapMark, Metric, Motion, Settings, Values,
};

use crate::cases::numbers;
use crate::random::SplitMix64;

const DIM: usize = 8;

fn map(places: usize) -> Arc<Map> {
    let rows = numbers(Dtype::F32, places * DIM, 5);
    Arc::new(Map::from_descriptors(rows, DIM, Metric::Euclidean).unwrap())
}

/// A drive along the map: its rows, with noise of this size.
fn drive(map: &Map, noise: f32, seed: u64) -> Vec<Vec<f32>> {
    let Values::F32(rows) = numbers(Dtype::F32, map.places() * DIM, 5) else { panic!("float32") };
    let mut random = SplitMix64(seed);
    let noisy =
        |row: &[f32]| row.iter().map(|x| x + noise * (2.0 * random.share() - 1.0)).collect();
    rows.chunks_exact(DIM).map(noisy).collect()
}

fn fixes(localizer: &mut Localizer, drive: &[Vec<f32>]) -> Vec<Fix> {
    drive.iter().map(|row| localizer.push_descriptor(&row[..]).unwrap()).collect()
}

fn calibrated(map: &Arc<Map>, config: &Config) -> Threshold {
    let mut localizer = Localizer::new(map.clone(), config.clone()).unwrap();
    let run = fixes(&mut localizer, &drive(map, 0.4, 1));
    let mut options = Calibrate::default();
    (options.wrong, options.block) = (0.1, Some(1));
    options.tracked = config.motion.is_some();
    let matches: Vec<_> = run
        .iter()
        .map(|fix| surefix::evaluate::Match {
            place: fix.place,
            score: fix.score,
            ready: fix.is_ready(),
            accepted: true,
        })
        .collect();
    let wrong: Vec<_> =
        run.iter().enumerate().map(|(j, fix)| Some(f64::from(fix.place.abs_diff(j) > 1))).collect();
    calibrate(&matches, &wrong, &options).unwrap()
}

#[test]
fn each_fix_says_what_the_threshold_says_of_it() {
    let map = map(400);
    for motion in [None, Some(Motion::steady())] {
        let config = config! { motion: motion, sequence_length: 3 };
        let threshold = calibrated(&map, &config);
        assert!(threshold.score.is_some(), "{threshold}");
        let plain = Localizer::new(map.clone(), config.clone()).unwrap();
        let mut judged = plain.clone().with_threshold(threshold.clone()).unwrap();
        let mut plain = plain;
        let drive = drive(&map, 0.4, 2);
        let (with, without) = (fixes(&mut judged, &drive), fixes(&mut plain, &drive));
        let mut accepted = 0;
        for (one, other) in with.iter().zip(&without) {
            assert_eq!(one.accepted, Some(threshold.accepts(other)));
            assert_eq!(one.probability, threshold.probability_of(other));
            assert_eq!(one.probability.is_some(), one.is_ready());
            let unjudged = {
                let mut fix = *one;
                (fix.accepted, fix.probability) = (None, None);
                fix
            };
            assert_eq!(unjudged, *other);
            accepted += usize::from(one.accepted == Some(true));
        }
        assert!(accepted > 100, "{accepted}");
        assert_eq!(judged.threshold(), Some(&threshold));
        // A snapshot is that of a localizer without.
        assert_eq!(judged.snapshot().unwrap(), plain.snapshot().unwrap());
        let restored = Localizer::restore(map.clone(), &plain.snapshot().unwrap(), None).unwrap();
        assert!(restored.threshold().is_none());
    }
}

#[test]
fn the_alarm_is_told_once_and_only_of_worse_scores() {
    let map = map(400);
    let config = config! { sequence_length: 3 };
    let told = Arc::new(AtomicUsize::new(0));
    let mut localizer = Localizer::new(map.clone(), config.clone()).unwrap();
    localizer = localizer.with_threshold(calibrated(&map, &config)).unwrap();
    let count = told.clone();
    localizer.on_alarm(move |fix| {
        assert!(fix.accepted.is_some());
        count.fetch_add(1, Ordering::Relaxed);
    });
    fixes(&mut localizer, &drive(&map, 0.4, 3));
    assert_eq!(told.load(Ordering::Relaxed), 0);
    assert!(!localizer.alarm().unwrap().raised());
    fixes(&mut localizer, &drive(&map, 1.0, 4));
    assert_eq!(told.load(Ordering::Relaxed), 1);
    assert!(localizer.alarm().unwrap().raised());
    localizer.reset();
    assert!(!localizer.alarm().unwrap().raised());
    fixes(&mut localizer, &drive(&map, 1.0, 4));
    assert_eq!(told.load(Ordering::Relaxed), 2);
}

#[test]
fn a_threshold_of_another_kind_or_map_is_refused() {
    let map = map(40);
    let tracked = config! { motion: Some(Motion::steady()) };
    let threshold = calibrated(&map, &tracked);
    let localizer = Localizer::new(map.clone(), Config::default()).unwrap();
    let error = localizer.with_threshold(threshold.clone()).unwrap_err();
    assert!(matches!(error, Error::Option { name: "threshold", .. }), "{error}");

    let mut settings = Settings::default();
    settings.config = tracked;
    settings.threshold = Some(threshold);
    settings.maps = vec![MapMark::of(&map)];
    assert!(settings.localizer(vec![map.clone()]).is_ok());
    let mut other = drive(&map, 0.0, 0).concat();
    other[7] += 0.5;
    let other = Arc::new(Map::from_descriptors(other, DIM, Metric::Euclidean).unwrap());
    for maps in [vec![other.clone()], vec![self::map(41)], vec![map.clone(), map]] {
        let error = settings.localizer(maps).unwrap_err();
        assert!(
            error.to_string().contains("expected the map that they were measured on"),
            "{error}"
        );
    }
    settings.maps.clear();
    assert!(settings.localizer(vec![other]).is_ok());
}
