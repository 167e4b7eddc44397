//! A mapped map gives the answers of one that is read into memory, and a file that cannot be mapped
//! soundly is refused.
#![allow(unsafe_code, reason = "the door is unsafe: nobody but these tests touches their files")]

use std::fs;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use crate::cases::{DTYPES, cases, numbers, sealed};
use proptest::prelude::*;
use serde_json::{Value, json};
use surefix::{Config, Dtype, Error, Localizer, Map, Metric, Positions};
use tempfile::tempdir;

const METRICS: [Metric; 3] = [Metric::Manhattan, Metric::Euclidean, Metric::Cosine];

fn mapped(path: &Path) -> Result<Map, Error> {
    // SAFETY: the files of these tests are replaced, never changed in place or shortened while they
    // are mapped.
    unsafe { Map::open_mapped(path) }
}

fn saved(map: &Map) -> Vec<u8> {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    map.save(&path).unwrap();
    fs::read(path).unwrap()
}

fn split(file: &[u8]) -> (Value, &[u8]) {
    let length = u64::from_le_bytes(file[..8].try_into().unwrap()) as usize;
    (serde_json::from_slice(&file[8..8 + length]).unwrap(), &file[8 + length..])
}

/// The file of a header, padded to a multiple of `to` bytes, and its payload.
fn join(header: &Value, payload: &[u8], to: usize) -> Vec<u8> {
    let mut text = header.to_string().into_bytes();
    text.resize((8 + text.len()).next_multiple_of(to) - 8, b' ');
    let file = [&(text.len() as u64).to_le_bytes(), text.as_slice(), payload].concat();
    if header.get("checksum").is_some() { sealed(file) } else { file }
}

/// The same word from both doors, as what `open` finds only in the numbers is not looked for here.
fn both_refuse(bytes: &[u8]) -> String {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    fs::write(&path, bytes).unwrap();
    let refused = |result: Result<Map, Error>| match result {
        Err(error @ Error::MapFile { .. }) => error.to_string(),
        other => panic!("expected Error::MapFile, got {other:?}"),
    };
    let (read, mapped) = (refused(Map::open(&path)), refused(mapped(&path)));
    assert_eq!(read, mapped);
    assert!(read.starts_with(&path.display().to_string()), "the file is named: {read}");
    read
}

fn cosine_map() -> Map {
    Map::from_descriptors(numbers(Dtype::F32, 35, 1), 7, Metric::Cosine).unwrap()
}

fn bits(map: &Map, query: &surefix::Values) -> Vec<u32> {
    map.distances(query).unwrap().into_iter().map(f32::to_bits).collect()
}

#[test]
fn a_mapped_map_answers_as_one_in_memory_bit_for_bit() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    for dtype in DTYPES {
        for metric in METRICS {
            for dim in [1, 7, 64, 257] {
                let map = Map::from_descriptors(numbers(dtype, 5 * dim, 3), dim, metric).unwrap();
                let map = map.with_names((0..5).map(|i| format!("é{i}")).collect()).unwrap();
                let metres = (0..10).map(f64::from).collect();
                let map = map.with_positions(Positions::new(metres, 2).unwrap()).unwrap();
                map.save(&path).unwrap();
                let (read, lazy) = (Map::open(&path).unwrap(), mapped(&path).unwrap());
                assert_eq!(lazy.descriptors(), map.descriptors());
                assert_eq!((lazy.names(), lazy.positions()), (map.names(), map.positions()));
                assert_eq!(
                    (lazy.dtype(), lazy.metric(), lazy.recipe()),
                    (dtype, metric, map.recipe())
                );
                for query in [numbers(dtype, dim, 9), numbers(Dtype::F32, dim, 9)] {
                    assert_eq!(bits(&lazy, &query), bits(&map, &query));
                    assert_eq!(bits(&read, &query), bits(&map, &query));
                    assert_eq!(bits(&lazy.clone(), &query), bits(&map, &query));
                }
                assert_eq!(saved(&lazy), saved(&map));
                assert_eq!(
                    saved(&lazy.extended(&read).unwrap()),
                    saved(&map.extended(&map).unwrap())
                );
            }
        }
    }
}

#[test]
fn every_flipped_byte_of_a_mapped_map_is_found_on_request() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    let bytes = saved(&cosine_map());
    fs::write(&path, &bytes).unwrap();
    let map = mapped(&path).unwrap();
    map.verify().unwrap();
    map.extended(&map).unwrap().slice(3..8).unwrap().verify().unwrap();
    cosine_map().verify().unwrap();
    for at in 0..bytes.len() {
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << (at % 8);
        let path = folder.path().join("flipped");
        fs::write(&path, flipped).unwrap();
        assert!(mapped(&path).and_then(|map| map.verify()).is_err(), "byte {at}");
        fs::remove_file(path).unwrap();
    }
}

#[test]
fn a_snapshot_goes_from_a_mapped_map_to_one_in_memory_and_back() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    cosine_map().save(&path).unwrap();
    let maps = [Arc::new(Map::open(&path).unwrap()), Arc::new(mapped(&path).unwrap())];
    for (from, to) in [(0, 1), (1, 0)] {
        let mut first = Localizer::new(Arc::clone(&maps[from]), Config::default()).unwrap();
        first.push_descriptor(&numbers(Dtype::F32, 7, 1)).unwrap();
        let mut second =
            Localizer::restore(Arc::clone(&maps[to]), &first.snapshot().unwrap(), None).unwrap();
        let next = numbers(Dtype::F32, 7, 2);
        assert_eq!(first.push_descriptor(&next).unwrap(), second.push_descriptor(&next).unwrap());
    }
}

#[test]
fn rows_of_a_saved_map_begin_on_a_cache_line_of_the_file() {
    for places in 2..40 {
        let map =
            Map::from_descriptors(numbers(Dtype::U8, places * 3, 1), 3, Metric::Cosine).unwrap();
        let metres = (0..places * 2).map(|i| i as f64).collect();
        let map = map.with_positions(Positions::new(metres, 2).unwrap()).unwrap();
        let bytes = saved(&map);
        let (header, payload) = split(&bytes);
        let start = header["descriptors"]["data_offsets"][0].as_u64().unwrap() as usize;
        assert_eq!((bytes.len() - payload.len() + start) % 64, 0);
    }
}

#[test]
fn saving_onto_the_file_that_is_mapped_leaves_the_mapped_map_as_it_was() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    let (map, other) = (cosine_map(), cosine_map().extended(&cosine_map()).unwrap());
    map.save(&path).unwrap();
    let lazy = mapped(&path).unwrap();
    lazy.save(&path).unwrap();
    assert_eq!(fs::read(&path).unwrap(), saved(&map));
    other.save(&path).unwrap();
    Map::append(&path, &map).unwrap();
    assert_eq!(lazy.descriptors(), map.descriptors());
    assert_eq!(Map::open(&path).unwrap().places(), 15);
}

#[test]
fn a_file_without_norms_opens_as_it_did_and_is_appended_to_with_them() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    for dtype in DTYPES {
        let map = Map::from_descriptors(numbers(dtype, 35, 1), 7, Metric::Cosine).unwrap();
        let whole = saved(&map);
        let (mut header, payload) = split(&whole);
        header.as_object_mut().unwrap().remove("norms");
        let end = payload.len() - 40;
        header["descriptors"]["data_offsets"] = json!([0, end - 13]);
        header["blank"]["data_offsets"] = json!([end - 13, end - 8]);
        header["checksum"]["data_offsets"] = json!([end - 8, end]);
        let old = join(&header, &payload[40..], 8);
        fs::write(&path, &old).unwrap();
        assert_eq!(saved(&Map::open(&path).unwrap()), whole);
        assert_eq!(saved(&mapped(&path).unwrap()), whole);
        Map::append(&path, &map).unwrap();
        assert_eq!(fs::read(&path).unwrap(), saved(&map.extended(&map).unwrap()));
        // A row without a length is refused.
        for spoilt in [f32::NAN, 0.0] {
            if dtype != Dtype::F32 {
                continue;
            }
            let mut bytes = old.clone();
            let end = bytes.len() - 13;
            bytes[end - 28..end].as_chunks_mut().0.fill(spoilt.to_le_bytes());
            fs::write(&path, sealed(bytes)).unwrap();
            for refused in [mapped(&path).map(drop), Map::append(&path, &map)] {
                let error = refused.unwrap_err().to_string();
                assert!(error.contains("row 4"), "{error}");
            }
        }
    }
}

#[test]
fn norms_that_cannot_be_those_of_the_rows_are_refused() {
    let bytes = saved(&cosine_map());
    let (header, payload) = split(&bytes);
    assert_eq!(header["norms"], json!({"dtype": "F64", "shape": [5], "data_offsets": [0, 40]}));
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, -1.0] {
        let mut payload = payload.to_vec();
        payload[16..24].copy_from_slice(&bad.to_le_bytes());
        let message = both_refuse(&join(&header, &payload, 64));
        assert!(message.contains("norms") && message.contains("row 2"), "{message}");
    }
    for norms in [
        json!({"dtype": "F64", "shape": [5, 1], "data_offsets": [0, 40]}),
        json!({"dtype": "F64", "shape": [1, 5], "data_offsets": [0, 40]}),
        json!({"dtype": "I64", "shape": [5], "data_offsets": [0, 40]}),
        json!({"dtype": "F32", "shape": [10], "data_offsets": [0, 40]}),
        json!({"dtype": "U8", "shape": [40], "data_offsets": [0, 40]}),
        // Of another length than it says, over its neighbour, or with a gap after it.
        json!({"dtype": "F64", "shape": [4], "data_offsets": [0, 40]}),
        json!({"dtype": "F64", "shape": [6], "data_offsets": [0, 48]}),
        json!({"dtype": "F64", "shape": [4], "data_offsets": [0, 32]}),
        json!({"dtype": "F64", "shape": [5], "data_offsets": [40, 80]}),
        json!({"dtype": "F64", "shape": [u64::MAX], "data_offsets": [0, 40]}),
    ] {
        let mut header = header.clone();
        header["norms"] = norms;
        both_refuse(&join(&header, payload, 64));
    }
    // Norms of other rows: found where the rows are read.
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    let mut payload = payload.to_vec();
    payload[16..24].copy_from_slice(&7.5_f64.to_le_bytes());
    fs::write(&path, join(&header, &payload, 64)).unwrap();
    let error = Map::open(&path).unwrap_err().to_string();
    assert!(error.contains("norms") && error.contains("row 2") && error.contains("7.5"), "{error}");
    // And of a mapped file on request, by the row of the whole map.
    let damaged = mapped(&path).unwrap();
    let good = folder.path().join("good.safetensors");
    cosine_map().save(&good).unwrap();
    let good = mapped(&good).unwrap();
    for (map, row) in [
        (damaged.clone(), 2),
        (good.extended(&damaged).unwrap(), 5 + 2),
        (good.extended(&good).unwrap().extended(&damaged).unwrap(), 10 + 2),
    ] {
        let error = map.verify().unwrap_err().to_string();
        assert!(error.contains(&format!("row {row}, got 7.5")), "{error}");
    }
}

#[test]
fn norms_are_for_the_cosine_and_nothing_else_has_them() {
    for metric in [Metric::Euclidean, Metric::Manhattan] {
        let map = Map::from_descriptors(numbers(Dtype::F32, 35, 1), 7, metric).unwrap();
        assert_eq!(split(&saved(&map)).0.get("norms"), None);
    }
}

#[test]
fn rows_that_are_not_aligned_can_be_read_but_not_mapped() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    for dtype in DTYPES {
        let map = Map::from_descriptors(numbers(dtype, 35, 1), 7, Metric::Euclidean).unwrap();
        let bytes = saved(&map);
        let (header, payload) = split(&bytes);
        for shift in 1..8 {
            // One header byte fewer or more moves all that follows.
            let mut text = header.to_string().into_bytes();
            text.resize(text.len().next_multiple_of(8) + shift, b' ');
            let moved = [&(text.len() as u64).to_le_bytes(), text.as_slice(), payload].concat();
            fs::write(&path, sealed(moved)).unwrap();
            assert_eq!(Map::open(&path).unwrap().descriptors(), map.descriptors());
            match mapped(&path) {
                Ok(lazy) => {
                    assert_eq!(shift % dtype.size(), 0);
                    assert_eq!(lazy.descriptors(), map.descriptors());
                }
                Err(error) => {
                    assert_ne!(shift % dtype.size(), 0);
                    assert!(matches!(error, Error::MapFile { .. }));
                    assert!(error.to_string().contains("open it into memory"), "{error}");
                }
            }
        }
    }
}

#[test]
fn a_number_that_is_none_is_refused_when_its_distance_is_pushed_and_the_place_is_named() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    for metric in METRICS {
        let bytes = saved(&Map::from_descriptors(numbers(Dtype::F32, 35, 1), 7, metric).unwrap());
        let mut spoilt = bytes.clone();
        // The third number of the fourth place.
        let at = bytes.len() - 8 - 5 - 35 * 4 + (3 * 7 + 2) * 4;
        spoilt[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
        fs::write(&path, sealed(spoilt)).unwrap();
        assert!(Map::open(&path).unwrap_err().to_string().contains("row 3, index 2"));
        let mut localizer =
            Localizer::new(Arc::new(mapped(&path).unwrap()), Config::default()).unwrap();
        let error = localizer.push_descriptor(&numbers(Dtype::F32, 7, 9)).unwrap_err();
        assert!(matches!(error, Error::NotFinite { index: 3, .. }), "{metric}: {error}");
        assert_eq!(localizer.frames(), 0, "the localizer is as it was");
    }
}

#[test]
fn what_is_no_map_is_refused_as_when_it_is_read() {
    let bytes = saved(&cosine_map());
    for end in [0, 7, 8, 50, bytes.len() - 1] {
        both_refuse(&bytes[..end]);
    }
    both_refuse(&[&bytes[..], &[0]].concat());
    both_refuse(b"hello");
    let folder = tempdir().unwrap();
    for path in [folder.path().join("gone"), folder.path().to_owned()] {
        let error = mapped(&path).unwrap_err();
        assert!(matches!(&error, Error::Io { path: named, .. } if *named == path), "{error}");
    }
}

proptest! {
    #![proptest_config(cases(1_000))]

    #[test]
    fn damaged_bytes_never_panic(
        flips in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        static WHOLE: OnceLock<Vec<u8>> = OnceLock::new();
        let mut bytes = WHOLE.get_or_init(|| saved(&cosine_map())).clone();
        let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize + 40;
        for (at, to) in flips {
            bytes[at.index(header)] = to;
        }
        let folder = tempdir().unwrap();
        let path = folder.path().join("route.safetensors");
        fs::write(&path, bytes).unwrap();
        match mapped(&path) {
            Ok(map) => {
                prop_assert!(map.places() * map.dim() <= 140);
                let _ = map.distances(&numbers(Dtype::F32, map.dim(), 1));
            }
            Err(Error::MapFile { .. } | Error::MapVersion { .. }) => {}
            Err(other) => prop_assert!(false, "{}", other),
        }
    }
}
