//! Settings in files: read as they were written, bit for bit, and refused with the line.

use std::fs;
use std::sync::Arc;

use proptest::prelude::*;
use surefix::calibration::{Calibrate, Threshold, calibrate};
use surefix::evaluate::Match;
use surefix::{Config, Error, Floor, Map, MapMark, Metric, Motion, Settings};
use tempfile::tempdir;

fn refused(text: &str) -> String {
    match Settings::from_toml(text) {
        Err(Error::Settings { reason }) => reason,
        other => panic!("expected Error::Settings, got {other:?}"),
    }
}

/// A threshold on scores that say little, so that no number of it is round.
fn threshold(scores: &[f32], tracked: bool) -> Threshold {
    let found = |&score| Match { place: 0, score, ready: true, accepted: true };
    let matches: Vec<Match> = scores.iter().map(found).collect();
    let wrong: Vec<_> = (0..scores.len()).map(|query| Some(f64::from(query % 7 == 0))).collect();
    let mut options = Calibrate::default();
    (options.wrong, options.tracked, options.metres) = (0.3, tracked, Some(1234.5));
    calibrate(&matches, &wrong, &options).unwrap()
}

fn map() -> Map {
    Map::from_descriptors(vec![1.0_f32, 0.0, 0.0, 1.0], 2, Metric::Euclidean).unwrap()
}

#[test]
fn what_is_not_in_the_file_is_the_default() {
    assert_eq!(Settings::from_toml("").unwrap(), Settings::default());
    let named = Settings::from_toml("[config]\nmotion = \"any\"").unwrap();
    assert_eq!(named.config, config!(motion: Some(Motion::any())));
    assert_eq!((named.threshold, named.maps.len(), named.measured.len()), (None, 0, 0));
    let part = Settings::from_toml("[config]\nfloor = \"global\"\nweight = 1\n").unwrap();
    assert_eq!(part.config, config!(floor: Floor::Global, weight: 1.0));
    let own = "[config.motion]\nspeeds = [1.0]\npace = 2.0";
    let mut motion = Motion::free();
    (motion.speeds, motion.pace) = (vec![1.0], 2.0);
    assert_eq!(Settings::from_toml(own).unwrap().config.motion, Some(motion));
}

#[test]
fn a_refusal_says_the_line_and_the_name() {
    for (text, line, words) in [
        ("[config]\nweight = 0.9\nwait = 0.5", "line 3", "`wait`"),
        ("[config]\nmotion = \"fast\"", "line 2", "\"steady\", \"free\", \"any\""),
        ("[config]\nweight = \"much\"", "line 2", "expected f64"),
        ("[config.motion]\npaces = 2", "line 2", "`paces`"),
        ("\n[threshold]\nscore = 0.5", "line 2", "missing field"),
        ("[[maps]]\nplaces = 4", "line 1", "missing field `hash`"),
        ("[config]\nweight = ", "line 2", ""),
        ("options = 3", "line 1", "`options`"),
    ] {
        let said = refused(text);
        assert!(said.contains(line) && said.contains(words), "{text}: {said}");
    }
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.toml");
    fs::write(&path, "[config]\nwait = 0.5").unwrap();
    let said = Settings::open(&path).unwrap_err().to_string();
    assert!(said.contains(&path.display().to_string()) && said.contains("line 2"), "{said}");
    fs::write(&path, [0xff, 0xfe]).unwrap();
    assert!(Settings::open(&path).is_err());
    let none = folder.path().join("none.toml");
    assert!(matches!(Settings::open(none), Err(Error::Io { action: "read the settings", .. })));
}

#[test]
fn a_file_that_cannot_be_written_stays_as_it_was() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.toml");
    Settings::default().save(&path).unwrap();
    let settings = Settings::from_toml("[config]\nmotion = \"steady\"").unwrap();
    settings.save(&path).unwrap();
    assert_eq!(Settings::open(&path).unwrap(), settings);
    // A folder is in the way, and there is no folder to write in.
    let (taken, nowhere) = (folder.path().join("taken"), folder.path().join("none/route.toml"));
    fs::create_dir(&taken).unwrap();
    for out in [&taken, &nowhere] {
        let refused = settings.save(out);
        assert!(matches!(refused, Err(Error::Io { action: "write the settings", .. })));
    }
    let mut names: Vec<_> =
        fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["route.toml", "taken"], "no half file is left");
}

#[test]
fn settings_are_for_the_maps_that_they_were_measured_on() {
    let (known, other) = (map(), Map::from_descriptors(vec![0.5_f32; 4], 2, Metric::Euclidean));
    let longer = Map::from_descriptors(vec![0.5_f32; 6], 2, Metric::Euclidean).unwrap();
    let mut settings = Settings::default();
    settings.maps = vec![MapMark::of(&known)];
    let text = settings.to_toml().unwrap();
    let settings = Settings::from_toml(&text).unwrap();
    settings.check_maps([&known]).unwrap();
    for maps in [&[&other.unwrap()][..], &[&longer], &[&known, &known], &[]] {
        let refused = settings.check_maps(maps.iter().copied());
        assert!(matches!(refused, Err(Error::Settings { .. })), "{refused:?}");
    }
    assert!(settings.localizer(vec![Arc::new(longer)]).is_err());
    let localizer = settings.localizer(vec![Arc::new(known)]).unwrap();
    assert_eq!(localizer.config(), &Config::default());
}

proptest! {
    #[test]
    fn a_saved_file_opens_bit_for_bit(
        scores in prop::collection::vec(0.0_f32..1.0, 20..300),
        weight in 0.0..1.0,
        floor in prop::option::of(0.0..1e30),
        numbers in prop::array::uniform3(0.0_f64..0.25),
        speeds in prop::collection::vec(0.0..5.0, 1..4),
        weights in prop::collection::vec(0.0..3.0, 0..3),
        tracked in any::<bool>(),
        words in ".*",
    ) {
        let mut settings = Settings::default();
        let mut motion = Motion::any();
        [motion.jitter, motion.restart, motion.evidence] = numbers;
        settings.config = config!(
            weight,
            speeds,
            technique_weights: weights,
            floor: floor.map_or(Floor::Running, Floor::Fixed),
            motion: tracked.then_some(motion),
        );
        settings.threshold = Some(threshold(&scores, tracked));
        settings.maps = vec![MapMark::of(&map())];
        settings.measured.insert("words".to_owned(), words);
        let folder = tempdir().unwrap();
        let path = folder.path().join("route.toml");
        settings.save(&path).unwrap();
        // Equal numbers have equal bits, as there is no NaN here and no zero with a sign.
        prop_assert_eq!(Settings::open(&path).unwrap(), settings);
    }
}

#[test]
fn long_settings_are_refused_and_a_long_line_is_shown_in_short() {
    let refused = |text: &str| Settings::from_toml(text).unwrap_err().to_string();
    let long = refused(&"#".repeat((1 << 20) + 1));
    assert!(long.contains("at most 1048576 bytes of text, got 1048577"), "{long}");
    assert_eq!(Settings::from_toml(&"#".repeat(1 << 20)).unwrap(), Settings::default());
    let digits = refused(&format!("[config]\nsequence_length = {}", "9".repeat(100_000)));
    assert!(digits.contains("line 2") && digits.len() < 1000, "{} bytes", digits.len());
}
