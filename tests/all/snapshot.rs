//! A robot that restarts goes on as if it had not, and a snapshot that does not fit is refused.

use std::hash::Hasher as _;
use std::sync::Arc;

use crate::cases::{Kind, Told, bits, cases, columns, given, kind, numbers, route};
use proptest::prelude::*;
use serde_json::{Value, json};
use surefix::{
    Config, Dtype, Error, Floor, Given, Gradient, Localizer, Map, Matcher, Metric, Motion, Segments,
};

const DIM: usize = 6;

fn map(seed: u64, metric: Metric) -> Arc<Map> {
    Arc::new(Map::from_descriptors(numbers(Dtype::F32, 12 * DIM, seed), DIM, metric).unwrap())
}

/// A localizer that has seen `frames` frames, and its snapshot.
fn taken(frames: u64) -> (Arc<Map>, Config, Vec<u8>) {
    let (map, config) = (map(1, Metric::Euclidean), config! { sequence_length: 4 });
    let mut localizer = Localizer::new(Arc::clone(&map), config.clone()).unwrap();
    for frame in 0..frames {
        localizer.push_descriptor(&numbers(Dtype::F32, DIM, 100 + frame)).unwrap();
    }
    (map, config, localizer.snapshot().unwrap())
}

fn reason(result: Result<impl Sized, Error>) -> String {
    match result {
        Err(error @ Error::Snapshot { .. }) => error.to_string(),
        Err(other) => panic!("expected Error::Snapshot, got {other}"),
        Ok(_) => panic!("expected Error::Snapshot, but it was taken"),
    }
}

/// The JSON of the one metadata entry, changed by `change`: a forgery on purpose.
pub(crate) fn with_header(snapshot: &[u8], change: impl Fn(&mut Value)) -> Vec<u8> {
    forged(snapshot, |outer, _| {
        let entry = &mut outer["__metadata__"]["surefix"];
        let mut inner: Value = serde_json::from_str(entry.as_str().unwrap()).unwrap();
        change(&mut inner);
        *entry = inner.to_string().into();
    })
}

/// A snapshot whose header or tensors `change` has changed, and whose checksum fits.
pub(crate) fn forged(snapshot: &[u8], change: impl FnOnce(&mut Value, &mut [u8])) -> Vec<u8> {
    let length = u64::from_le_bytes(snapshot[..8].try_into().unwrap()) as usize;
    let mut outer: Value = serde_json::from_slice(&snapshot[8..8 + length]).unwrap();
    // The tensors, without the checksum at the end.
    let mut tensors = snapshot[8 + length..snapshot.len() - 8].to_vec();
    change(&mut outer, &mut tensors);
    let mut text = outer.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    let mut out = (text.len() as u64).to_le_bytes().to_vec();
    out.extend(text);
    out.extend(tensors);
    let mut hash = twox_hash::XxHash3_64::with_seed(0);
    hash.write(&out);
    out.extend(hash.finish().to_le_bytes());
    out
}

proptest! {
    #![proptest_config(cases(3_000))]

    /// Cuts before, inside and after the warm-up.
    #[test]
    fn a_restored_matcher_goes_on_to_the_last_bit(
        (n, config) in route(2..40), cut in 0..50_usize, more in 1..50_usize, kind in kind(), seed: u64,
        odometry: bool,
    ) {
        let d = columns(kind, n, cut + more, seed);
        let told = Told::new(cut + more, seed, false, odometry);
        let mut whole = Matcher::new(n, config.clone())?;
        for (query, column) in d[..cut].iter().enumerate() {
            whole.push_with(column, given(told.drive(), query))?;
        }
        let blob = whole.snapshot()?;
        let mut restored = Matcher::restore(&blob, Some(&config))?;
        prop_assert_eq!(&restored.snapshot()?, &blob);
        prop_assert_eq!((restored.frames(), restored.places()), (cut as u64, n));
        for (query, column) in d.iter().enumerate().skip(cut) {
            let given = given(told.drive(), query);
            prop_assert_eq!(bits(&restored.push_with(column, given)?), bits(&whole.push_with(column, given)?));
        }
    }

    /// The running minimum goes through text: every f32 must come back.
    #[test]
    fn any_running_minimum_survives(number in any::<u32>().prop_map(f32::from_bits)) {
        prop_assume!(number.is_finite());
        let config = config! { weight: 1.0 };
        let mut whole = Matcher::new(2, config)?;
        whole.push(&[number, f32::MAX])?;
        let mut restored = Matcher::restore(&whole.snapshot()?, None)?;
        for matcher in [&mut whole, &mut restored] {
            // Scrolls the minimum out of the window: only the header still knows it.
            for _ in 0..3 {
                matcher.push_with(&[f32::MAX; 2], Given::default().trusted(true))?;
            }
        }
        let [a, b] = [&mut whole, &mut restored].map(|m| m.push_with(&[f32::MAX; 2], Given::default().trusted(true)));
        prop_assert_eq!(bits(&a?), bits(&b?));
    }

    #[test]
    fn damaged_bytes_never_panic(at: prop::sample::Index, to: u8, also: prop::sample::Index, with: u8) {
        let (map, config, mut blob) = taken(6);
        for (at, to) in [(at, to), (also, with)] {
            let at = at.index(blob.len());
            blob[at] = to;
        }
        for expected in [None, Some(&config)] {
            match Localizer::restore(Arc::clone(&map), &blob, expected) {
                // A flip in a blank, or in a number of the header.
                Ok(mut localizer) => drop(localizer.push_descriptor(&numbers(Dtype::F32, DIM, 1))?),
                Err(Error::Snapshot { .. }) => {}
                Err(other) => prop_assert!(false, "{}", other),
            }
        }
    }
}

#[test]
fn a_restored_localizer_goes_on_to_the_last_bit() {
    for frames in [0, 1, 3, 4, 50] {
        let (map, config, blob) = taken(frames);
        let mut whole = Localizer::new(Arc::clone(&map), config.clone()).unwrap();
        for frame in 0..frames {
            whole.push_descriptor(&numbers(Dtype::F32, DIM, 100 + frame)).unwrap();
        }
        let mut restored = Localizer::restore(map, &blob, Some(&config)).unwrap();
        for frame in 0..10 {
            let query = numbers(Dtype::F32, DIM, 900 + frame);
            let (a, b) =
                (whole.push_descriptor(&query).unwrap(), restored.push_descriptor(&query).unwrap());
            assert_eq!(bits(&a), bits(&b), "cut at {frames}");
        }
    }
}

#[test]
fn another_map_is_refused() {
    let (own, config, blob) = taken(5);
    let longer =
        Map::from_descriptors(numbers(Dtype::F32, 13 * DIM, 1), DIM, Metric::Euclidean).unwrap();
    for other in [map(2, Metric::Euclidean), map(1, Metric::Manhattan), Arc::new(longer)] {
        let message = reason(Localizer::restore(other, &blob, Some(&config)));
        assert!(message.contains("another map"), "{message}");
    }
    let roads = Segments::new(12, &[7]).unwrap();
    let of_roads = Matcher::along(roads, config.clone()).unwrap().snapshot().unwrap();
    let mut segments = Value::Null;
    forged(&of_roads, |outer, _| {
        let entry = outer["__metadata__"]["surefix"].as_str().unwrap();
        segments = serde_json::from_str::<Value>(entry).unwrap()["segments"].clone();
    });
    let cut = with_header(&blob, |header| header["segments"] = segments.clone());
    let message = reason(Localizer::restore(own.clone(), &cut, None));
    assert!(message.contains("taken on other segments of this map"), "{message}");
    // The same descriptors are the same map, wherever they came from.
    assert!(Localizer::restore(map(1, Metric::Euclidean), &blob, Some(&config)).is_ok());

    let alone = Matcher::new(12, config.clone()).unwrap().snapshot().unwrap();
    assert!(reason(Localizer::restore(own, &alone, None)).contains("Matcher"));
}

#[test]
fn other_options_are_refused_where_options_are_expected() {
    let (map, config, blob) = taken(5);
    let others = [
        config! { config.clone() => sequence_length: 3 },
        config! { config.clone() => weight: 0.5 },
        config! { config.clone() => tolerance: 2 },
        config! { config.clone() => smoothing: 1 },
        config! { config.clone() => gradient: Gradient::Unhalved },
        config! { config.clone() => floor: Floor::Fixed(0.0) },
        config! { config.clone() => speeds: vec![1.0, 0.9] },
        config! { config.clone() => motion: Some(Motion::free()) },
    ];
    for other in others {
        let message = reason(Localizer::restore(Arc::clone(&map), &blob, Some(&other)));
        // Just the options that differ, each by its name.
        assert!(message.contains("other options: "), "{message}");
        assert_eq!(message.matches(": expected ").count(), 1, "{message}");
    }
    let restored = Localizer::restore(map, &blob, None).unwrap();
    assert_eq!(restored.config(), &config, "without expectations, the snapshot's own options hold");
}

#[test]
fn every_truncation_is_refused() {
    let (map, config, blob) = taken(5);
    for length in 0..blob.len() {
        reason(Localizer::restore(Arc::clone(&map), &blob[..length], Some(&config)));
        reason(Matcher::restore(&blob[..length], None));
    }
    let mut longer = blob;
    longer.push(0);
    reason(Localizer::restore(map, &longer, Some(&config)));
}

#[test]
fn every_flipped_bit_of_the_numbers_is_refused() {
    let (map, config, blob) = taken(5);
    let payload = 8 + u64::from_le_bytes(blob[..8].try_into().unwrap()) as usize;
    assert!(blob.len() - payload >= 4 * 12 * 4, "four columns of twelve places");
    for at in payload..blob.len() {
        for bit in 0..8 {
            let mut blob = blob.clone();
            blob[at] ^= 1 << bit;
            let message = reason(Localizer::restore(Arc::clone(&map), &blob, Some(&config)));
            assert!(message.contains("damaged"), "{message}");
        }
    }
}

#[test]
fn a_changed_digit_of_the_header_is_refused() {
    let (map, config, blob) = taken(5);
    let digits: Vec<usize> = (8..blob.len()).filter(|&at| blob[at].is_ascii_digit()).collect();
    assert!(digits.len() > 20);
    for at in digits {
        let mut blob = blob.clone();
        blob[at] = if blob[at] == b'3' { b'4' } else { b'3' };
        reason(Localizer::restore(Arc::clone(&map), &blob, Some(&config)));
    }
}

#[test]
fn a_newer_version_says_to_upgrade() {
    let (map, config, blob) = taken(5);
    // A newer one may lack what this version needs, so the version is looked at first.
    for lacks in ["", "anchors", "config"] {
        let newer = with_header(&blob, |header| {
            header["version"] = 2.into();
            header.as_object_mut().unwrap().remove(lacks);
        });
        let message = reason(Localizer::restore(Arc::clone(&map), &newer, Some(&config)));
        assert!(message.contains("format 2") && message.contains("upgrade"), "{message}");
    }
    let foreign = with_header(&blob, |header| header["format"] = "surefix-map".into());
    reason(Matcher::restore(&foreign, None));
    let unchanged = with_header(&blob, |_| {});
    assert!(
        Localizer::restore(map, &unchanged, Some(&config)).is_ok(),
        "the craft itself does no harm"
    );
}

/// Headers that no matcher wrote, over an honest payload.
#[test]
fn impossible_headers_are_refused() {
    let (_, _, blob) = taken(5);
    let forgeries: [(&str, Value); 12] = [
        ("places", 0.into()),
        ("places", 11.into()),
        ("places", u64::MAX.into()),
        ("frames", 2.into()),
        ("frames", u64::MAX.into()),
        ("lowest", "x".into()),
        ("lowest", 1e9.into()),
        ("anchors", json!([[0, true], [0, true], [0, true], [0, true]])),
        ("anchors", json!([])),
        ("anchors", json!([[12, true], [0, true], [0, true], [0, true]])),
        ("config", json!({})),
        ("map", (-1).into()),
    ];
    let mut taken_or_panicked = Vec::new();
    for (key, value) in forgeries {
        let forged = with_header(&blob, |header| header[key] = value.clone());
        // What is taken must at least go on without a panic.
        let outcome = std::panic::catch_unwind(|| match Matcher::restore(&forged, None) {
            Err(error) => {
                matches!(error, Error::Snapshot { .. }).then_some(()).ok_or(error.to_string())
            }
            Ok(mut matcher) => Err(format!("taken; its next fix: {:?}", matcher.push(&[0.5; 12]))),
        });
        if !matches!(outcome, Ok(Ok(()))) {
            taken_or_panicked.push((key, value, outcome));
        }
    }
    assert!(taken_or_panicked.is_empty(), "{taken_or_panicked:#?}");
}

/// A tracker with a motion of several speeds that has seen some queries, and its snapshot.
fn tracked() -> Vec<u8> {
    let mut matcher = Matcher::new(6, config! { motion: Some(Motion::free()) }).unwrap();
    for column in columns(Kind::Smooth, 6, 4, 1) {
        matcher.push(&column).unwrap();
    }
    matcher.snapshot().unwrap()
}

#[test]
fn beliefs_that_cannot_be_are_refused() {
    let blob = tracked();
    assert!(Matcher::restore(&forged(&blob, |_, _| {}), None).is_ok(), "the craft does no harm");
    for name in ["track.sums", "track.mass"] {
        let count = if name == "track.sums" { 6_usize } else { 6 * 5 };
        for shape in [json!([1, count]), json!([2, count / 2]), json!([])] {
            reason(Matcher::restore(
                &forged(&blob, |header, _| header[name]["shape"] = shape),
                None,
            ));
        }
        for dtype in ["I64", "U64", "F32"] {
            reason(Matcher::restore(
                &forged(&blob, |header, _| header[name]["dtype"] = dtype.into()),
                None,
            ));
        }
        let renamed = forged(&blob, |header, _| {
            let tensor = header.as_object_mut().unwrap().remove(name).unwrap();
            header["track.other"] = tensor;
        });
        reason(Matcher::restore(&renamed, None));
        for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let spoilt = forged(&blob, |header, tensors| {
                let at = header[name]["data_offsets"][1].as_u64().unwrap() as usize;
                tensors[at - 8..at].copy_from_slice(&number.to_le_bytes());
            });
            let message = reason(Matcher::restore(&spoilt, None));
            assert!(message.contains("belief") || message.contains("finite"), "{message}");
        }
    }
    let forgeries: [(&str, Value); 9] = [
        ("joint", true.into()),
        ("scale", 0.0.into()),
        ("scale", 1e-320.into()),
        ("on", 1.5.into()),
        ("on", (-0.1).into()),
        ("off", 2.into()),
        ("off", Value::Null),
        ("travelled", "far".into()),
        ("pending", json!([1.0])),
    ];
    for (key, value) in forgeries {
        let forged = with_header(&blob, |header| {
            assert!(header["track"]["state"][key] != value, "{key} exists and differs");
            header["track"]["state"][key] = value.clone();
        });
        reason(Matcher::restore(&forged, None));
    }
    let forged = with_header(&blob, |header| header["track"]["columns"] = u64::MAX.into());
    reason(Matcher::restore(&forged, None));
    for track in [Value::Null, json!({}), json!(1)] {
        reason(Matcher::restore(
            &with_header(&blob, |header| header["track"] = track.clone()),
            None,
        ));
    }
}

/// Numbers that are finite, and that no tracker has: they would become NaN, or no probability.
#[test]
fn beliefs_of_no_tracker_are_refused() {
    let mut matcher = Matcher::new(6, config! { motion: Some(Motion::any()) }).unwrap();
    for column in columns(Kind::Smooth, 6, 4, 1) {
        matcher.push(&column).unwrap();
    }
    let blob = matcher.snapshot().unwrap();
    let tensor = |name: &'static str, of: fn(f64) -> f64| {
        forged(&blob, |header, tensors| {
            let [from, to] =
                [0, 1].map(|i| header[name]["data_offsets"][i].as_u64().unwrap() as usize);
            for number in tensors[from..to].chunks_exact_mut(8) {
                let changed = of(f64::from_le_bytes(number.try_into().unwrap()));
                number.copy_from_slice(&changed.to_le_bytes());
            }
        })
    };
    let state = |of: fn(&mut Value)| with_header(&blob, |header| of(&mut header["track"]["state"]));
    let forgeries = [
        ("no belief", tensor("track.mass", |_| 0.0)),
        ("negative", tensor("track.mass", |mass| -mass)),
        ("beyond 1", tensor("track.mass", |mass| 1e300 * mass)),
        ("large sums", tensor("track.sums", |_| 1e300)),
        ("a large view", tensor("track.corrected", |x| 1e300 * x)),
        // It was `z`.
        (
            "a view of before",
            forged(&blob, |header, _| {
                let view = header.as_object_mut().unwrap().remove("track.corrected").unwrap();
                header["track.view"] = view;
            }),
        ),
        ("a large scale", state(|state| state["scale"] = 1e300.into())),
        ("nowhere", state(|state| (state["on"], state["off"]) = (0.into(), 0.into()))),
        ("twice", state(|state| (state["on"], state["off"]) = (1.into(), 1.into()))),
        ("far", state(|state| state["travelled"] = 1e300.into())),
        ("farther", state(|state| state["pending"] = (-1e300).into())),
        ("sums of no column", with_header(&blob, |header| header["track"]["columns"] = 0.into())),
    ];
    let mut taken = Vec::new();
    for (name, forged) in forgeries {
        if let Ok(mut matcher) = Matcher::restore(&forged, None) {
            taken.push((
                name,
                std::panic::catch_unwind(move || matcher.push(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6])),
            ));
        }
    }
    assert!(taken.is_empty(), "{taken:#?}");
}

/// Those of version 0.1 know neither motion nor a track.
#[test]
fn an_older_snapshot_is_taken_if_there_is_no_motion() {
    let (map, config, blob) = taken(5);
    let older = with_header(&blob, |header| {
        assert!(header.as_object_mut().unwrap().remove("track").is_some());
        assert!(header["config"].as_object_mut().unwrap().remove("motion").is_some());
    });
    let mut restored = Localizer::restore(Arc::clone(&map), &older, Some(&config)).unwrap();
    let mut whole = Localizer::restore(map, &blob, Some(&config)).unwrap();
    let query = numbers(Dtype::F32, DIM, 7);
    let (a, b) =
        (restored.push_descriptor(&query).unwrap(), whole.push_descriptor(&query).unwrap());
    assert_eq!(bits(&a), bits(&b));

    let lacking = with_header(&tracked(), |header| {
        header.as_object_mut().unwrap().remove("track");
    });
    let message = reason(Matcher::restore(&lacking, None));
    assert!(message.contains("tracker"), "{message}");
}

/// Memory is asked for only once the payload is known to fill it: an allocation that fails ends the
/// whole program.
#[test]
fn a_forged_size_is_refused_before_memory_is_taken() {
    let (_, _, blob) = taken(5);
    for places in [1_u64 << 40, 1 << 58] {
        let forged = with_header(&blob, |header| header["places"] = places.into());
        reason(Matcher::restore(&forged, None));
    }
    let length = with_header(&blob, |header| {
        header["places"] = (1_u64 << 40).into();
        header["config"]["sequence_length"] = (1_u64 << 39).into();
    });
    reason(Matcher::restore(&length, None));
}

#[test]
fn a_snapshot_is_small_and_the_same_each_time() {
    let config = config! { sequence_length: 5 };
    let mut matcher = Matcher::new(100, config).unwrap();
    for column in columns(Kind::Smooth, 100, 20, 1) {
        matcher.push(&column).unwrap();
    }
    let blob = matcher.snapshot().unwrap();
    assert_eq!(blob, matcher.snapshot().unwrap());
    assert!(blob.len() < (5 + 3) * 100 * 4 + 1500, "{} bytes", blob.len());
}

#[test]
fn a_large_matcher_without_columns_comes_back_and_a_claim_of_one_is_refused() {
    let config = config! { sequence_length: 100 };
    let mut matcher = Matcher::new(200_000, config.clone()).unwrap();
    let column: Vec<f32> = (0..200_000_u32).map(|i| (i * 7919 % 1000) as f32).collect();
    matcher.push(&column).unwrap();
    matcher.gap();
    let snapshot = matcher.snapshot().unwrap();
    assert!(snapshot.len() < 1 << 20, "{} bytes", snapshot.len());
    let mut restored = Matcher::restore(&snapshot, None).unwrap();
    let (one, other) = (matcher.push(&column).unwrap(), restored.push(&column).unwrap());
    assert_eq!(one, other);

    // The window of 4 TB of a matcher of a million places, in a few hundred bytes.
    let small = Matcher::new(5, Config::default()).unwrap().snapshot().unwrap();
    assert!(small.len() < 1000, "no room is made for what any snapshot may ask for");
    assert!(!String::from_utf8_lossy(&small).contains("\"room\""));
    let claim = forged(&small, |outer, _| {
        let entry = outer["__metadata__"]["surefix"].as_str().unwrap();
        let mut inner: Value = serde_json::from_str(entry).unwrap();
        inner["places"] = 1_000_000.into();
        inner["config"]["sequence_length"] = 1_000_000.into();
        outer["__metadata__"]["surefix"] = inner.to_string().into();
        outer["columns"]["shape"] = json!([0, 1_000_000]);
    });
    assert!(reason(Matcher::restore(&claim, None)).contains("bytes that ask for"));
}

/// A snapshot whose header says that it is of so many places, without a column.
fn of_places(snapshot: &[u8], places: usize) -> Vec<u8> {
    forged(snapshot, |outer, _| {
        let entry = outer["__metadata__"]["surefix"].as_str().unwrap();
        let mut inner: Value = serde_json::from_str(entry).unwrap();
        inner["places"] = places.into();
        outer["__metadata__"]["surefix"] = inner.to_string().into();
        outer["columns"]["shape"] = json!([0, places]);
    })
}

/// 64 MiB, and 64 bytes more for each of its own: of each place 4 bytes a column, 32 a speed and 32.
#[test]
fn a_snapshot_may_ask_for_so_much_memory_and_no_more() {
    for (motion, columns, of_a_place) in [
        (None, 8, 4 * 8 + 32),
        (None, 24, 4 * 24 + 32),
        (Some(Motion::free()), 8, 4 * 8 + 32 * 5 + 32),
    ] {
        let config = config! { motion: motion.clone(), sequence_length: columns };
        let small = Matcher::new(columns, config).unwrap().snapshot().unwrap();
        let given = of_places(&small, 1_000_000).len();
        let message = reason(Matcher::restore(&of_places(&small, 9_999_999), None));
        let asked = 9_999_999_u64 * of_a_place;
        let expected = format!("{given} bytes that ask for {asked} bytes of memory");
        assert!(message.contains(&expected), "{message}: {expected}");
    }
    // As many places as may be, and one more: none of 64 bytes.
    let small = Matcher::new(8, config! { sequence_length: 8 }).unwrap().snapshot().unwrap();
    let most = (1 << 20) + of_places(&small, 1_000_000).len();
    let restored = Matcher::restore(&of_places(&small, most), None).unwrap();
    assert_eq!(restored.places(), most);
    reason(Matcher::restore(&of_places(&small, most + 1), None));
}

#[test]
fn a_snapshot_counts_two_to_the_sixtieth_frames_and_no_more() {
    let (_, _, blob) = taken(5);
    let counted = |frames: u64| with_header(&blob, |header| header["frames"] = frames.into());
    let mut last = Matcher::restore(&counted(1 << 60), None).unwrap();
    assert_eq!(last.frames(), 1 << 60);
    assert!(last.push(&[0.5; 12]).is_ok());
    assert!(reason(Matcher::restore(&counted((1 << 60) + 1), None)).contains("frames"));
}

/// Two columns of six places are not one of twelve.
#[test]
fn columns_of_another_length_are_refused() {
    let mut matcher = Matcher::new(6, config! { sequence_length: 1, smoothing: 2 }).unwrap();
    for column in columns(Kind::Smooth, 6, 2, 1) {
        matcher.push(&column).unwrap();
    }
    let snapshot = matcher.snapshot().unwrap();
    for shape in [json!([1, 12]), json!([3, 4]), json!([12]), json!([2, 6, 1]), json!([2, 2, 3])] {
        let forgery = forged(&snapshot, |outer, _| outer["columns"]["shape"] = shape.clone());
        reason(Matcher::restore(&forgery, None));
    }
}
