//! A saved map opens as it was, and nothing else opens at all.

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::OnceLock;

use crate::cases::{DTYPES, cases, numbers, sealed};
use proptest::prelude::*;
use serde_json::{Value, json};
use surefix::{
    Channels, Dtype, Error, Image, Map, Metric, Positions, Post, Recipe, Sad, Step, Thumbnails,
    Values, View,
};
use tempfile::{TempDir, tempdir};

const METRICS: [Metric; 3] = [Metric::Manhattan, Metric::Euclidean, Metric::Cosine];

fn small_map() -> Map {
    let map = Map::from_descriptors(numbers(Dtype::U8, 12, 3), 4, Metric::Euclidean).unwrap();
    let map = map.with_names(vec!["a".into(), "b".into(), "c".into()]).unwrap();
    map.with_positions(Positions::new(vec![0.0, 0.5, 1.0, 1.5, 2.0, 2.5], 2).unwrap()).unwrap()
}

fn saved(map: &Map) -> Vec<u8> {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    map.save(&path).unwrap();
    fs::read(path).unwrap()
}

fn open(bytes: &[u8]) -> Result<Map, Error> {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    fs::write(&path, bytes).unwrap();
    let result = Map::open(&path);
    if let Err(error) = &result {
        assert!(
            error.to_string().starts_with(&path.display().to_string()),
            "the file is named: {error}"
        );
    }
    result
}

fn split(file: &[u8]) -> (Value, &[u8]) {
    let length = u64::from_le_bytes(file[..8].try_into().unwrap()) as usize;
    (serde_json::from_slice(&file[8..8 + length]).unwrap(), &file[8 + length..])
}

fn join(header: &Value, payload: &[u8]) -> Vec<u8> {
    let mut text = header.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    let file = [&(text.len() as u64).to_le_bytes(), text.as_slice(), payload].concat();
    if header.get("checksum").is_some() { sealed(file) } else { file }
}

/// The file with surefix's own entry changed.
fn with_entry(file: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (mut header, payload) = split(file);
    let entry = &mut header["__metadata__"]["surefix"];
    let mut inner: Value = serde_json::from_str(entry.as_str().unwrap()).unwrap();
    change(&mut inner);
    *entry = inner.to_string().into();
    join(&header, payload)
}

fn with_header(file: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (mut header, payload) = split(file);
    change(&mut header);
    join(&header, payload)
}

fn refused(bytes: &[u8]) -> String {
    match open(bytes) {
        Err(error @ Error::MapFile { .. }) => error.to_string(),
        other => panic!("expected Error::MapFile, got {other:?}"),
    }
}

fn sad_map() -> Map {
    let image = |seed| {
        Image::new(16, 8, Channels::Grey, (0..128).map(|i| (i * seed) as u8).collect()).unwrap()
    };
    let images: Vec<Image> = (1..4).map(image).collect();
    let sad = Sad::new((8, 4), 4, Dtype::U8).unwrap();
    Map::from_images(&images, sad, &mut |_, _| ControlFlow::Continue(())).unwrap()
}

#[test]
fn every_map_comes_back_as_it_was() {
    let names: Vec<String> = ["é日本.png", "", "same", "same", " \n\t"].map(str::to_owned).to_vec();
    for dtype in DTYPES {
        for metric in METRICS {
            for named in [None, Some(names.clone()), Some(vec![String::new(); 5])] {
                for axes in [0, 2, 3] {
                    let mut map = Map::from_descriptors(numbers(dtype, 35, 1), 7, metric).unwrap();
                    if let Some(names) = &named {
                        map = map.with_names(names.clone()).unwrap();
                    }
                    if axes > 0 {
                        let metres = (0..5 * axes).map(|i| i as f64 / 3.0 - 1e6).collect();
                        map = map.with_positions(Positions::new(metres, axes).unwrap()).unwrap();
                    }
                    let bytes = saved(&map);
                    assert_eq!(bytes, saved(&map), "the same map, the same bytes");
                    let opened = open(&bytes).unwrap();
                    assert_eq!(opened.descriptors(), map.descriptors());
                    assert_eq!((opened.places(), opened.dim()), (5, 7));
                    assert_eq!(
                        (opened.dtype(), opened.metric(), opened.recipe()),
                        (dtype, metric, Recipe::Ready)
                    );
                    assert_eq!(
                        (opened.names(), opened.positions()),
                        (named.as_deref(), map.positions())
                    );
                    for query in [numbers(dtype, 7, 9), numbers(Dtype::F32, 7, 9)] {
                        let bits = |map: &Map| -> Vec<u32> {
                            map.distances(&query).unwrap().into_iter().map(f32::to_bits).collect()
                        };
                        assert_eq!(bits(&opened), bits(&map));
                    }
                    assert_eq!(saved(&opened), bytes, "opened and saved again, the same bytes");
                }
            }
        }
    }
}

#[test]
fn a_map_of_images_remembers_its_recipe_and_unit() {
    let map = sad_map();
    let opened = open(&saved(&map)).unwrap();
    assert_eq!(opened.recipe(), map.recipe());
    assert_eq!(opened.names().unwrap(), ["0", "1", "2"]);
    let query = map.descriptors().row(1, map.dim()).unwrap();
    assert_eq!(opened.distances(query).unwrap(), map.distances(query).unwrap());
}

#[test]
fn any_safetensors_reader_can_open_it() {
    let map = small_map();
    let bytes = saved(&map);
    let file = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let rows = file.tensor("descriptors").unwrap();
    assert_eq!((rows.dtype(), rows.shape()), (safetensors::Dtype::U8, &[3, 4][..]));
    assert_eq!(Values::U8(rows.data().to_vec()).view(), map.descriptors());
    let positions = file.tensor("positions").unwrap();
    assert_eq!((positions.dtype(), positions.shape()), (safetensors::Dtype::F64, &[3, 2][..]));
    assert_eq!(file.tensor("names").unwrap().data(), b"a\0b\0c\0");
}

#[test]
fn every_truncation_is_refused() {
    let bytes = saved(&small_map());
    for length in 0..bytes.len() {
        refused(&bytes[..length]);
    }
    refused(&[&bytes[..], &[0]].concat());
}

#[test]
fn every_flipped_byte_is_refused() {
    let maps = [small_map(), sad_map()];
    for bytes in maps.map(|map| saved(&map)) {
        for at in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[at] ^= 0xff;
            assert!(Map::from_bytes(&flipped).is_err(), "byte {at}");
            flipped[at] = bytes[at] ^ (1 << (at % 8));
            assert!(Map::from_bytes(&flipped).is_err(), "a bit of byte {at}");
        }
    }
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn a_flipped_byte_of_a_larger_map_is_refused(at: prop::sample::Index, flip in 1..=255_u8) {
        static WHOLE: OnceLock<Vec<u8>> = OnceLock::new();
        let whole = WHOLE.get_or_init(|| {
            let rows = numbers(Dtype::F16, 300 * 1000, 5);
            saved(&Map::from_descriptors(rows, 1000, Metric::Cosine).unwrap())
        });
        let mut bytes = whole.clone();
        bytes[at.index(whole.len())] ^= flip;
        prop_assert!(Map::from_bytes(&bytes).is_err());
    }
}

#[test]
fn a_file_without_a_checksum_is_another_program_s_and_opens() {
    let bytes = saved(&small_map());
    let without = |both: bool| {
        let (mut header, payload) = split(&bytes);
        if both {
            let entry = &mut header["__metadata__"]["surefix"];
            let mut inner: Value = serde_json::from_str(entry.as_str().unwrap()).unwrap();
            assert!(inner.as_object_mut().unwrap().remove("checksum").is_some());
            *entry = inner.to_string().into();
        }
        header.as_object_mut().unwrap().remove("checksum");
        let text = header.to_string().into_bytes();
        let payload = &payload[..payload.len() - 8];
        [&(text.len() as u64).to_le_bytes(), text.as_slice(), payload].concat()
    };
    assert_eq!(open(&without(true)).unwrap().descriptors(), small_map().descriptors());
    assert!(refused(&without(false)).contains("checksum"));
}

#[test]
fn bytes_are_a_map_as_a_file_is() {
    for map in [small_map(), sad_map()] {
        let bytes = map.to_bytes().unwrap();
        assert_eq!(bytes, saved(&map));
        let opened = Map::from_bytes(&bytes).unwrap();
        assert_eq!(opened.descriptors(), map.descriptors());
        assert_eq!((opened.names(), opened.positions()), (map.names(), map.positions()));
    }
    let error = Map::from_bytes(b"hello").unwrap_err();
    assert!(matches!(error, Error::MapFile { .. }), "{error}");
}

#[test]
fn a_slice_is_the_map_of_its_places() {
    let names = |places: std::ops::Range<usize>| places.map(|i| format!("é{i}")).collect();
    let metres = |places: std::ops::Range<usize>| {
        Positions::new(places.flat_map(|i| [i as f64, 0.5]).collect(), 2).unwrap()
    };
    for metric in METRICS {
        // Several blocks.
        let (places, dim) = (90, 40_000);
        let all = numbers(Dtype::U8, places * dim, 3);
        let part = |range: std::ops::Range<usize>| {
            let Values::U8(all) = &all else { panic!("bytes were drawn") };
            let rows = all[range.start * dim..range.end * dim].to_vec();
            let map = Map::from_descriptors(rows, dim, metric).unwrap();
            map.with_names(names(range.clone())).unwrap().with_positions(metres(range)).unwrap()
        };
        let map = part(0..places);
        for range in [0..90, 0..2, 30..34, 17..80, 88..90] {
            let slice = map.slice(range.clone()).unwrap();
            assert_eq!(saved(&slice), saved(&part(range.clone())), "{metric} {range:?}");
            let query = numbers(Dtype::U8, dim, 7);
            assert_eq!(
                slice.distances(&query).unwrap(),
                map.distances(&query).unwrap()[range.clone()]
            );
            let row = map.descriptors().row(range.start, dim).unwrap();
            let (View::U8(row), View::U8(own)) = (row, slice.descriptors()) else { panic!() };
            assert_eq!(row.as_ptr(), own.as_ptr(), "its rows are the map's");
        }
        let joined = map.slice(0..40).unwrap().extended(&map.slice(40..90).unwrap()).unwrap();
        assert_eq!(saved(&joined), saved(&map));
        assert_eq!(saved(&joined.slice(35..60).unwrap()), saved(&part(35..60)));
    }
    let map = small_map();
    #[expect(clippy::reversed_empty_ranges, reason = "it is refused")]
    for range in [0..4, 3..5, 2..1, 0..1, 1..1] {
        let error = map.slice(range.clone()).unwrap_err();
        let expected = matches!(error, Error::Option { .. } | Error::TooFewPlaces { .. });
        assert!(expected, "{range:?}: {error}");
    }
}

#[test]
fn a_foreign_file_is_refused() {
    for bytes in
        [&b""[..], b"hello", b"\x89PNG\r\n\x1a\n and so on and so forth", &[0xff; 100], &[0; 100]]
    {
        refused(bytes);
    }
    let foreign =
        join(&json!({"weight": {"dtype": "U8", "shape": [4], "data_offsets": [0, 4]}}), &[0; 4]);
    assert!(refused(&foreign).contains("some other program"));
    let bytes = saved(&small_map());
    let snapshot = with_entry(&bytes, |entry| entry["format"] = "surefix-snapshot".into());
    assert!(refused(&snapshot).contains("surefix-snapshot"));
    refused(&with_header(&bytes, |header| header["__metadata__"]["surefix"] = "not json".into()));
}

#[test]
fn a_newer_version_says_to_upgrade() {
    let bytes = saved(&small_map());
    assert!(open(&with_entry(&bytes, |_| {})).is_ok(), "the craft itself does no harm");
    // A newer version may have done away with anything but its own number.
    let newer = [
        with_entry(&bytes, |entry| entry["version"] = 7.into()),
        with_entry(&bytes, |entry| *entry = json!({"format": "surefix-map", "version": 7})),
        with_header(&with_entry(&bytes, |entry| entry["version"] = 7.into()), |header| {
            header["places"] = header["descriptors"].take();
            header.as_object_mut().unwrap().remove("descriptors");
        }),
    ];
    for bytes in newer {
        let error = open(&bytes).unwrap_err();
        assert!(matches!(error, Error::MapVersion { found: 7, supported: 1, .. }), "{error}");
        assert!(error.to_string().contains("upgrade surefix"), "{error}");
    }
}

#[test]
fn tensors_that_do_not_fit_are_refused() {
    let bytes = saved(&small_map());
    for (tensor, shape) in [
        ("descriptors", json!([12])),
        ("descriptors", json!([3, 2, 2])),
        ("descriptors", json!([1, 12])),
        ("descriptors", json!([2, 6])),
        ("descriptors", json!([12, 1])),
        ("positions", json!([6])),
        ("positions", json!([6, 1])),
        ("positions", json!([2, 3])),
    ] {
        let message =
            refused(&with_header(&bytes, |header| header[tensor]["shape"] = shape.clone()));
        let named =
            ["descriptors", "positions", "names", "map"].iter().any(|what| message.contains(what));
        assert!(named, "{tensor} {shape}: {message}");
    }
    let renamed = with_header(&bytes, |header| {
        header["rows"] = header["descriptors"].clone();
        header.as_object_mut().unwrap().remove("descriptors");
    });
    assert!(refused(&renamed).contains("descriptors"));
    // Twelve bytes are three float32 in rows of one, or six int16, which no descriptor is.
    refused(&with_header(&bytes, |header| {
        header["descriptors"] = json!({"dtype": "I16", "shape": [3, 2], "data_offsets": header["descriptors"]["data_offsets"]});
    }));
    // One name too many, and a name that is no text.
    let (header, payload) = split(&bytes);
    for (from, to) in [(b'b', 0), (b'b', 0xff)] {
        let mut payload = payload.to_vec();
        let names = payload.len() - 8;
        let at = payload[..names].iter().rposition(|&byte| byte == from).unwrap();
        payload[at] = to;
        assert!(refused(&join(&header, &payload)).contains("names"));
    }
}

/// A file of holes claims names of eight terabytes: no memory is taken that is not there.
#[cfg(target_os = "linux")]
/// Sides of nothing are no size of images, and no pictures.
#[test]
fn a_size_of_nothing_is_none() {
    let pictures = Thumbnails::new(2, 3, vec![7; 18]).unwrap();
    assert!(!pictures.is_empty() && Thumbnails::new(2, 3, vec![]).unwrap().is_empty());
    let map = small_map().with_image_size(Some((4, 3))).unwrap().with_thumbnails(pictures).unwrap();
    let file = saved(&map);
    assert_eq!(open(&file).unwrap().image_size(), Some((4, 3)));
    for size in [[0, 3], [4, 0], [0, 0]] {
        let forged = with_entry(&file, |entry| entry["image_size"] = json!(size));
        assert_eq!(open(&forged).unwrap().image_size(), None);
    }
    let (mut header, payload) = split(&file);
    let offset = |tensor: &Value, end: usize| tensor["data_offsets"][end].as_u64().unwrap();
    let (start, end) = (offset(&header["thumbnails"], 0), offset(&header["thumbnails"], 1));
    header["thumbnails"]["shape"] = json!([3, 0, 2]);
    for tensor in header.as_object_mut().unwrap().values_mut() {
        for side in 0..2 {
            if tensor.get("data_offsets").is_some() && offset(tensor, side) >= end {
                tensor["data_offsets"][side] = (offset(tensor, side) - (end - start)).into();
            }
        }
    }
    let payload = [&payload[..start as usize], &payload[end as usize..]].concat();
    let reason = refused(&join(&header, &payload));
    assert!(reason.contains("thumbnails: expected a tensor of U8"), "{reason}");
}

#[test]
fn a_claim_beyond_the_memory_is_an_error() {
    const CLAIMED: u64 = 8_000_000_000_000;
    let bytes = saved(&small_map());
    let bytes = with_entry(&bytes, |entry| {
        entry.as_object_mut().unwrap().remove("checksum");
    });
    let (mut header, payload) = split(&bytes);
    header.as_object_mut().unwrap().remove("checksum");
    let start = header["names"]["data_offsets"][0].as_u64().unwrap();
    header["names"]["shape"] = json!([CLAIMED]);
    header["names"]["data_offsets"] = json!([start, start + CLAIMED]);
    let file = join(&header, &payload[..start as usize]);
    let folder = tempdir().unwrap();
    let path = folder.path().join("holes.safetensors");
    fs::write(&path, &file).unwrap();
    let length = file.len() as u64 + CLAIMED;
    if fs::File::options().write(true).open(&path).unwrap().set_len(length).is_err() {
        eprintln!("skipped: this file system has no files of {length} bytes");
        return;
    }
    let error = Map::open(&path).unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
}

/// Rows that nothing vouches for are looked at before a checksum is written over them.
#[test]
fn damage_is_never_signed_by_appending() {
    let map = Map::from_descriptors(vec![1.0_f32, 2.0, 3.0, 4.0], 2, Metric::Euclidean).unwrap();
    let bytes = with_entry(&saved(&map), |entry| {
        entry.as_object_mut().unwrap().remove("checksum");
    });
    let (mut header, payload) = split(&bytes);
    header.as_object_mut().unwrap().remove("checksum");
    let mut payload = payload[..payload.len() - 8].to_vec();
    let folder = tempdir().unwrap();
    let path = folder.path().join("foreign.safetensors");
    fs::write(&path, join(&header, &payload)).unwrap();
    Map::append(&path, &map).unwrap();
    assert_eq!(Map::open(&path).unwrap().places(), 4);
    payload[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    fs::write(&path, join(&header, &payload)).unwrap();
    assert!(Map::append(&path, &map).is_err());
}

#[test]
fn a_recipe_that_disagrees_with_the_tensor_is_refused() {
    let bytes = saved(&sad_map());
    assert!(open(&with_entry(&bytes, |_| {})).is_ok());
    for (key, value) in [
        ("size", json!([8, 8])),
        ("size", json!([7, 4])),
        ("patch", 0.into()),
        ("patch", 3.into()),
        ("dtype", "f32".into()),
        ("dtype", "i8".into()),
        ("kind", "netvlad".into()),
    ] {
        refused(&with_entry(&bytes, |entry| entry["descriptor"][key] = value));
    }
    refused(&with_entry(&bytes, |entry| entry["metric"] = "cosine".into()));
    refused(&with_entry(&bytes, |entry| entry["metric"] = "hamming".into()));
}

#[test]
fn numbers_that_cannot_be_compared_are_refused() {
    let rows = vec![0.25_f32; 6];
    for (metric, bad, expected) in [
        (Metric::Euclidean, f32::NAN.to_le_bytes(), "row 1, index 2"),
        (Metric::Manhattan, f32::INFINITY.to_le_bytes(), "row 1, index 2"),
    ] {
        let mut bytes = saved(&Map::from_descriptors(rows.clone(), 3, metric).unwrap());
        let end = bytes.len() - 8 - 2; // before the flags of 2 places
        bytes[end - 4..end].copy_from_slice(&bad);
        assert!(refused(&sealed(bytes)).contains(expected));
    }
    let mut bytes = saved(&Map::from_descriptors(rows, 3, Metric::Cosine).unwrap());
    let end = bytes.len() - 8 - 2; // before the flags of 2 places
    bytes[end - 12..end].fill(0);
    assert!(refused(&sealed(bytes)).contains("row 1"));
}

proptest! {
    #![proptest_config(cases(3_000))]

    #[test]
    fn damaged_bytes_never_panic(flips in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4)) {
        let mut bytes = saved(&small_map());
        let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        for (at, to) in flips {
            bytes[at.index(header)] = to;
        }
        match open(&sealed(bytes)) {
            Ok(map) => prop_assert!(map.places() * map.dim() <= 12),
            Err(Error::MapFile { .. } | Error::MapVersion { .. }) => {}
            Err(other) => prop_assert!(false, "{}", other),
        }
    }
}

fn listing(folder: &Path) -> Vec<String> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn saving_leaves_the_map_and_nothing_else() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    fs::write(&path, "an old file, to be replaced").unwrap();
    small_map().save(&path).unwrap();
    assert_eq!(listing(folder.path()), ["map.safetensors"]);
    assert_eq!(Map::open(&path).unwrap().places(), 3);
}

#[test]
fn a_place_that_cannot_be_written_is_named_and_stays_as_it_was() {
    let folder = tempdir().unwrap();
    let taken = folder.path().join("folder");
    fs::create_dir(&taken).unwrap();
    fs::write(taken.join("inside"), "kept").unwrap();
    for path in [folder.path().join("missing/map.safetensors"), taken.clone(), "/".into()] {
        let error = small_map().save(&path).unwrap_err();
        assert!(matches!(&error, Error::Io { path: named, .. } if *named == path), "{error}");
        assert!(error.to_string().contains("cannot write the map"), "{error}");
    }
    assert_eq!(listing(folder.path()), ["folder"]);
    assert_eq!(listing(&taken), ["inside"]);
}

#[test]
fn a_missing_file_is_named() {
    let folder: TempDir = tempdir().unwrap();
    let path = folder.path().join("gone.safetensors");
    let error = Map::open(&path).unwrap_err();
    assert!(matches!(&error, Error::Io { path: named, .. } if *named == path), "{error}");
}

/// Numbers of another type than post-processing is for, as many bytes of them.
#[test]
fn post_processing_of_other_numbers_than_floats_is_refused() {
    let rows: Vec<f32> = (0..60).map(|at| (at * at % 17) as f32).collect();
    let (post, rows) = Post::fit(&[Step::Standardize], &rows, 6).unwrap();
    let map = Map::from_descriptors(rows, 6, Metric::Euclidean).unwrap().with_post(post).unwrap();
    let file = saved(&map);
    assert!(open(&file).is_ok());
    let reason = refused(&with_header(&file, |header| {
        header["descriptors"]["dtype"] = "U8".into();
        header["descriptors"]["shape"] = json!([10, 24]);
    }));
    assert!(reason.contains("post-processing: expected ready descriptors of F32"), "{reason}");
}
