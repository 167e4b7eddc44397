//! Target `settings`: texts as settings, options and what else is read from JSON, and truths. A text
//! that opens means the same when it is saved and opened again, and can be used.

use std::fmt::Debug;
use std::sync::Arc;

use serde_json::{from_str, to_string};
use surefix::calibration::Threshold;
use surefix::{Alignment, Config, Fix, Localizer, Motion, Run, Segments, Settings, Step};

use crate::snapshot::{PLACES, maps, numbers};

pub(crate) fn settings(data: &[u8]) {
    let Some((&kind, text)) = data.split_first() else { return };
    if kind % 9 == 8 {
        return crate::truth::truth(text);
    }
    let Ok(text) = std::str::from_utf8(text) else { return };
    match kind % 9 {
        0 => json::<Segments>(text),
        1 => json::<Config>(text),
        2 => json::<Motion>(text),
        3 => json::<Step>(text),
        4 => json::<Run>(text),
        5 => json::<Alignment>(text),
        6 => json::<Fix>(text),
        _ => toml(text),
    }
}

fn json<T: serde::Serialize + serde::de::DeserializeOwned + Debug>(text: &str) {
    match from_str::<T>(text) {
        Ok(value) => {
            let saved = to_string(&value).expect("what was read");
            // JSON has no infinity: it is null, which not all read.
            if let Ok(again) = from_str::<T>(&saved) {
                assert_eq!(to_string(&again).expect("what was read"), saved);
            } else {
                assert!(saved.contains("null"), "{saved}");
            }
        }
        Err(error) => drop(error.to_string()),
    }
}

fn toml(text: &str) {
    let settings = match Settings::from_toml(text) {
        Ok(settings) => settings,
        Err(error) => return drop(error.to_string()),
    };
    let saved = settings.to_toml().expect("what was read");
    let again = Settings::from_toml(&saved).expect("what was saved");
    assert_eq!(again.to_toml().expect("what was read"), saved);
    // A NaN is none of its equals.
    assert!(again == settings || saved.contains("nan"), "{settings:?}, {again:?}");
    let valid = settings.config.validate(PLACES);
    if let Some(threshold) = &settings.threshold {
        judge(threshold);
    }
    let small = settings.config.sequence_length <= 64 && settings.config.smoothing <= 64;
    let localizer = settings.localizer(vec![Arc::clone(&maps()[0])]);
    if let (Ok(localizer), true) = (localizer, small) {
        assert!(valid.is_ok());
        drive(localizer);
    }
}

fn drive(mut localizer: Localizer) {
    for query in 0..6 {
        let fix = localizer.push_descriptor(numbers(query).as_slice()).expect("finite numbers");
        assert!(fix.probability.is_none_or(|p| (0.0..=1.0).contains(&p)), "{fix:?}");
    }
}

fn judge(threshold: &Threshold) {
    for score in [0.0, 0.5, 1.0, f32::MAX, f32::MIN, f32::INFINITY] {
        let right = threshold.probability().at(score);
        assert!((0.0..=1.0).contains(&right), "{score}: {right}");
    }
    if let Ok(carried) = threshold.carried_to(&[0.25, 0.5, 0.125, 0.5]) {
        assert!(carried.carried);
    }
    if let Ok(mut alarm) = threshold.alarm(0.01) {
        for score in [0.1, 0.9, 0.9] {
            alarm.push(score).expect("a number");
        }
    }
    let _ = threshold.more_metres();
}
