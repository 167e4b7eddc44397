//! Snapshots of shards and drivers that no queries can have led to.

use std::sync::Arc;

use serde_json::{Value, json};
use surefix::shard::{Driver, Next, Shard};
use surefix::{Config, Dtype, Error, Given, Input, Map, Metric, Motion};

use crate::cases::numbers;
use crate::snapshot::{forged, with_header};

const PLACES: usize = 12;

fn parts(motion: bool) -> (Driver, Shard) {
    parts_of(PLACES, motion)
}

fn parts_of(places: usize, motion: bool) -> (Driver, Shard) {
    let rows = numbers(Dtype::F32, places * 4, 1);
    let map = Arc::new(Map::from_descriptors(rows, 4, Metric::Euclidean).unwrap());
    let motion = motion.then(Motion::any);
    let config: Config = config! { motion: motion, sequence_length: 3 };
    (Driver::new(map.clone(), &config, 1).unwrap(), Shard::new(map, &config, 0, 1).unwrap())
}

/// Those of the driver and the shard after some queries.
fn snapshots(motion: bool) -> [Vec<u8>; 2] {
    snapshots_of(PLACES, motion)
}

fn snapshots_of(places: usize, motion: bool) -> [Vec<u8>; 2] {
    let (mut driver, mut shard) = parts_of(places, motion);
    for query in 0..5 {
        let row = numbers(Dtype::F32, 4, 10 + query);
        let mut next = driver.push(Input::Descriptor(row.view()), Given::default()).unwrap();
        while let Next::Ask(questions) = next {
            next = driver.answer(&[shard.answer(&questions[0]).unwrap()]).unwrap();
        }
    }
    [driver.snapshot().unwrap(), shard.snapshot().unwrap()]
}

/// The number at the end of a tensor, changed.
fn with_number(snapshot: &[u8], tensor: &str, number: &[u8]) -> Vec<u8> {
    forged(snapshot, |header, tensors| {
        let end = header[tensor]["data_offsets"][1].as_u64().unwrap() as usize;
        tensors[end - number.len()..end].copy_from_slice(number);
    })
}

/// The snapshot without a place or a query in one of its tensors.
fn shorter(snapshot: &[u8], tensor: &str) -> Vec<u8> {
    forged(snapshot, |header, _| {
        let shape = header[tensor]["shape"].as_array().unwrap().clone();
        let numbers: u64 = shape.iter().map(|side| side.as_u64().unwrap()).product();
        header[tensor]["shape"] =
            if shape.len() == 1 { json!([1, numbers]) } else { json!([numbers]) };
    })
}

/// The columns of a shard as one.
fn one_column(snapshot: &[u8]) -> Vec<u8> {
    forged(snapshot, |header, _| {
        let shape = &mut header["columns"]["shape"];
        let columns = shape[0].as_u64().unwrap();
        assert!(columns > 1);
        *shape = json!([1, columns * PLACES as u64]);
    })
}

fn check(taken: &Result<(), Error>, name: &str) {
    assert!(matches!(taken, Err(Error::Snapshot { .. })), "{name}: {taken:?}");
}

#[test]
fn a_shard_in_an_impossible_state_is_refused() {
    let anchor = |place: usize| json!([{"place": place, "distance": 0.5}, true]);
    for motion in [false, true] {
        let [_, snapshot] = snapshots(motion);
        let (_, mut shard) = parts(motion);
        let part = |change: &dyn Fn(&mut Value)| with_header(&snapshot, |header| change(header));
        shard.restore(&part(&|_| ())).unwrap();
        // The most queries that are counted.
        shard.restore(&part(&|header| header["frames"] = (1_u64 << 60).into())).unwrap();
        let mut forgeries = vec![
            ("places", part(&|header| header["places"]["end"] = 11.into())),
            ("frames", part(&|header| header["frames"] = ((1_u64 << 60) + 1).into())),
            ("many frames", part(&|header| header["frames"] = u64::MAX.into())),
            ("few frames", part(&|header| header["frames"] = 2.into())),
            ("no anchors", part(&|header| header["part"]["anchors"] = json!([]))),
            ("an anchor beyond", part(&|header| header["part"]["anchors"][1] = anchor(PLACES))),
            (
                "an anchor more",
                part(&|header| {
                    header["part"]["anchors"].as_array_mut().unwrap().push(anchor(0));
                }),
            ),
            ("a shape", shorter(&snapshot, "columns")),
            ("one long column", one_column(&snapshot)),
            ("a distance", with_number(&snapshot, "columns", &f32::INFINITY.to_le_bytes())),
        ];
        if motion {
            for tensor in ["track.sums", "track.mass", "track.corrected"] {
                forgeries.push((tensor, shorter(&snapshot, tensor)));
                forgeries.push((tensor, with_number(&snapshot, tensor, &f64::NAN.to_le_bytes())));
                let infinite = f64::INFINITY.to_le_bytes();
                forgeries.push((tensor, with_number(&snapshot, tensor, &infinite)));
            }
            let negative = with_number(&snapshot, "track.mass", &(-0.5_f64).to_le_bytes());
            forgeries.push(("negative", negative));
            let track =
                |change: &dyn Fn(&mut Value)| part(&|header| change(&mut header["part"]["track"]));
            forgeries.push(("no track", track(&|track| *track = Value::Null)));
            forgeries.push(("one row", track(&|track| track["joint"] = true.into())));
            forgeries.push(("columns", track(&|track| track["columns"] = 0.into())));
        }
        let before = shard.snapshot().unwrap();
        for (name, forgery) in forgeries {
            check(&shard.restore(&forgery), name);
            assert_eq!(shard.snapshot().unwrap(), before, "{name}");
        }
    }
}

#[test]
fn a_driver_in_an_impossible_state_is_refused() {
    let anchor = |place: usize| json!([{"place": place, "distance": 0.5}, true]);
    for motion in [false, true] {
        let [snapshot, _] = snapshots(motion);
        let (mut driver, _) = parts(motion);
        assert_eq!(
            *driver.config(),
            config! { motion: motion.then(Motion::any), sequence_length: 3 }
        );
        let whole = |change: &dyn Fn(&mut Value)| {
            with_header(&snapshot, |header| change(&mut header["whole"]))
        };
        driver.restore(&whole(&|_| ())).unwrap();
        driver.restore(&whole(&|whole| whole["frames"] = (1_u64 << 60).into())).unwrap();
        let mut forgeries = vec![
            ("shards", with_header(&snapshot, |header| header["shards"] = 2.into())),
            ("frames", whole(&|whole| whole["frames"] = ((1_u64 << 60) + 1).into())),
            ("many frames", whole(&|whole| whole["frames"] = u64::MAX.into())),
            ("few frames", whole(&|whole| whole["frames"] = 2.into())),
            ("an anchor beyond", whole(&|whole| whole["anchors"][2] = anchor(PLACES))),
            ("no anchors", whole(&|whole| whole["anchors"] = json!([]))),
        ];
        if motion {
            let state = |key: &'static str, value: Value| {
                whole(&|whole| whole["track"]["state"][key] = value.clone())
            };
            forgeries.extend([
                ("no track", whole(&|whole| whole["track"] = Value::Null)),
                ("a view's shape", shorter(&snapshot, "track.view")),
                ("scale", state("scale", 0.into())),
                ("on", state("on", 1.5.into())),
                ("twice", state("off", 1.into())),
                ("far", state("travelled", 1e31.into())),
                ("farther", state("pending", (-1e31).into())),
            ]);
        }
        let before = driver.snapshot().unwrap();
        for (name, forgery) in forgeries {
            check(&driver.restore(&forgery), name);
            assert_eq!(driver.snapshot().unwrap(), before, "{name}");
        }
    }
}

#[test]
fn a_driver_has_seen_all_blocks_of_a_view_or_none() {
    for places in [PLACES, 5000, 9000] {
        let (mut driver, _) = parts_of(places, true);
        let none = driver.snapshot().unwrap();
        let [seen, _] = snapshots_of(places, true);
        driver.restore(&seen).unwrap();
        assert_eq!(driver.snapshot().unwrap(), seen);
        driver.restore(&none).unwrap();
        let forged = with_header(&none, |header| {
            let viewed = &mut header["whole"]["track"]["viewed"];
            assert_eq!(*viewed, json!(false));
            *viewed = true.into();
        });
        check(&driver.restore(&forged), "a view that is not there");
    }
}

/// The columns of a longer sequence, under the options of a shorter one.
#[test]
fn a_shard_takes_no_more_columns_than_it_keeps() {
    let rows = numbers(Dtype::F32, PLACES * 4, 1);
    let map = Arc::new(Map::from_descriptors(rows, 4, Metric::Euclidean).unwrap());
    let after = |sequence_length: usize| {
        let config: Config = config! { sequence_length: sequence_length };
        let mut driver = Driver::new(map.clone(), &config, 1).unwrap();
        let mut shard = Shard::new(map.clone(), &config, 0, 1).unwrap();
        for query in 0..6 {
            let row = numbers(Dtype::F32, 4, 10 + query);
            let mut next = driver.push(Input::Descriptor(row.view()), Given::default()).unwrap();
            while let Next::Ask(questions) = next {
                next = driver.answer(&[shard.answer(&questions[0]).unwrap()]).unwrap();
            }
        }
        shard
    };
    let mut own = after(3);
    let mut options = Value::Null;
    let own_snapshot = own.snapshot().unwrap();
    forged(&own_snapshot, |outer, _| {
        let entry = outer["__metadata__"]["surefix"].as_str().unwrap();
        options = serde_json::from_str::<Value>(entry).unwrap()["header"].clone();
    });
    for (length, fits) in [(3, true), (4, false)] {
        let longer = with_header(&after(length).snapshot().unwrap(), |header| {
            header["header"] = options.clone();
            header["part"]["anchors"].as_array_mut().unwrap().truncate(3);
        });
        let taken = own.restore(&longer);
        assert_eq!(taken.is_ok(), fits, "{taken:?}");
        if let Err(refused) = taken {
            assert!(refused.to_string().contains("(at most 3, 12)"), "{refused}");
        }
    }
}
