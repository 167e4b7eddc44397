//! Maps whose queries go through post-processing: the same in a file, in a stream, in a batch and
//! with a screen.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[cfg(feature = "pca")]
use crate::cases::sealed;
use crate::cases::{cases, signed};
use proptest::prelude::*;
use serde_json::{Value, json};
use surefix::{Config, Drive, Dtype, Error, Localizer, Map, Metric, Post, Step, match_descriptors};
use tempfile::tempdir;

const CHAINS: &[&[Step]] = &[
    &[Step::Normalize],
    &[Step::Standardize],
    &[Step::Standardize, Step::Normalize],
    #[cfg(feature = "pca")]
    &[Step::Pca { dim: 4, whiten: true }],
    &[Step::Projection { dim: 7, seed: 1 }, Step::Standardize],
    &[
        Step::Standardize,
        #[cfg(feature = "pca")]
        Step::Pca { dim: 5, whiten: false },
        Step::Projection { dim: 3, seed: 2 },
        Step::Normalize,
    ],
];

/// A map, and what its rows were made of.
fn route(steps: &[Step], places: usize, dim: usize, metric: Metric, seed: u64) -> (Map, Vec<f32>) {
    let raw = signed(places * dim, seed);
    let (post, rows) = Post::fit(steps, &raw, dim).unwrap();
    let output = post.output();
    (Map::from_descriptors(rows, output, metric).unwrap().with_post(post).unwrap(), raw)
}

fn saved(map: &Map) -> (tempfile::TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    map.save(&path).unwrap();
    (folder, path)
}

/// The map, mapped where the library can.
fn open_mapped(path: &Path) -> Result<Map, Error> {
    #[cfg(feature = "mmap")]
    {
        // SAFETY: each test writes its files before it opens them, and nobody else knows them.
        #[allow(unsafe_code)]
        unsafe {
            Map::open_mapped(path)
        }
    }
    #[cfg(not(feature = "mmap"))]
    Map::open(path)
}

proptest! {
    #![proptest_config(cases(200))]

    #[test]
    fn a_stream_is_a_batch_is_the_processed_map(
        chain in 0..CHAINS.len(), places in 8..30_usize, dim in 8..40_usize, seed: u64, length in 1..4_usize,
    ) {
        for metric in [Metric::Euclidean, Metric::Cosine, Metric::Manhattan] {
            let (map, _) = route(CHAINS[chain], places, dim, metric, seed);
            let queries = signed(20 * dim, !seed);
            let config = config! { sequence_length: length };
            let plain = Map::from_descriptors(map.descriptors().to_values(), map.dim(), metric).unwrap();
            let processed = map.post().unwrap().apply(&queries).unwrap();
            let mut by_hand = Localizer::new(Arc::new(plain), config.clone()).unwrap();
            let expected: Vec<_> =
                processed.chunks_exact(map.dim()).map(|row| by_hand.push_descriptor(row).unwrap()).collect();
            let (_folder, path) = saved(&map);
            let opened = Map::open(&path).unwrap();
            let mapped = open_mapped(&path).unwrap();
            for map in [map, opened, mapped] {
                let batch = match_descriptors(&map, &queries, &config, Drive::default(), &mut |_, _| ControlFlow::Continue(()));
                prop_assert_eq!(&batch.unwrap().fixes, &expected);
                let map = Arc::new(map);
                let mut localizer = Localizer::new(Arc::clone(&map), config.clone()).unwrap();
                for (index, (query, expected)) in queries.chunks_exact(dim).zip(&expected).enumerate() {
                    if index == 10 {
                        let snapshot = localizer.snapshot().unwrap();
                        localizer = Localizer::restore(Arc::clone(&map), &snapshot, Some(&config)).unwrap();
                    }
                    let mut spoilt = query.to_vec();
                    spoilt[0] = f32::INFINITY;
                    let refused = localizer.push_descriptor(spoilt.as_slice()).is_err()
                        && localizer.push_descriptor(&query[1..]).is_err();
                    prop_assert!(refused);
                    prop_assert_eq!(&localizer.push_descriptor(query).unwrap(), expected);
                    prop_assert_eq!(localizer.distances().to_vec(), map.distances(query).unwrap());
                }
            }
        }
    }
}

#[test]
fn a_screen_changes_nothing() {
    let steps = [Step::Standardize, Step::Projection { dim: 300, seed: 1 }, Step::Normalize];
    let (map, raw) = route(&steps, 60, 400, Metric::Cosine, 5);
    let config = Config::default();
    let mut plain = Localizer::new(Arc::new(map.clone()), config.clone()).unwrap();
    let mut screened =
        Localizer::new(Arc::new(map.with_screen(Dtype::I8).unwrap()), config).unwrap();
    for row in raw.chunks_exact(400) {
        assert_eq!(plain.push_descriptor(row).unwrap(), screened.push_descriptor(row).unwrap());
    }
}

#[test]
fn a_file_is_what_it_was_and_can_be_made_longer() {
    for steps in CHAINS {
        let (map, raw) = route(steps, 12, 9, Metric::Euclidean, 3);
        let map = map.with_learned_recipe(r#"{"name": "mine", "size": [2, 1]}"#).unwrap();
        let (_folder, path) = saved(&map);
        let opened = Map::open(&path).unwrap();
        assert_eq!(opened.post(), map.post());
        assert_eq!((opened.input_dim(), opened.dim()), (9, map.dim()));
        assert_eq!(opened.descriptors(), map.descriptors());
        let recipe: Value = serde_json::from_str(opened.learned_recipe().unwrap()).unwrap();
        assert_eq!(recipe, json!({"name": "mine", "size": [2, 1]}));
        let (_other, again) = saved(&opened);
        assert_eq!(fs::read(&path).unwrap(), fs::read(again).unwrap());

        let post = map.post().unwrap();
        let rows = post.apply(&raw[..4 * 9]).unwrap();
        let more = Map::from_descriptors(rows, map.dim(), Metric::Euclidean).unwrap();
        let refused = Map::append(&path, &more).unwrap_err().to_string();
        assert!(refused.contains("without post-processing"), "{refused}");
        let more = more.with_post(post.clone()).unwrap();
        let longer = map.extended(&more).unwrap();
        Map::append(&path, &more).unwrap();
        let appended = Map::open(&path).unwrap();
        assert_eq!((appended.places(), appended.post()), (16, map.post()));
        let (_folder, whole) = saved(&longer);
        assert_eq!(fs::read(&path).unwrap(), fs::read(whole).unwrap());

        let (other, _) = route(steps, 12, 9, Metric::Euclidean, 4);
        if other.post() != map.post() {
            let refused = map.extended(&other).unwrap_err().to_string();
            assert!(refused.contains("fitted on other references"), "{refused}");
        }
    }
}

#[test]
fn other_maps_have_no_post_processing() {
    let (map, raw) = route(CHAINS[0], 4, 5, Metric::Cosine, 1);
    let post = map.post().unwrap().clone();
    let say = |map: Map| map.with_post(post.clone()).unwrap_err().to_string();
    let bytes = Map::from_descriptors(vec![1_u8; 20], 5, Metric::Euclidean).unwrap();
    assert!(say(bytes).contains("float32"));
    let short = Map::from_descriptors(vec![1.0_f32; 20], 4, Metric::Euclidean).unwrap();
    assert!(say(short).contains("expected 4 values, got 5"));
    assert!(matches!(map.distances([1_u8; 5].as_slice()), Err(Error::Dtype { .. })));
    assert!(matches!(map.distances([0.0_f32; 5].as_slice()), Err(Error::NoDirection { .. })));
    let zeros = map.distances([0.0_f32; 5].as_slice()).unwrap_err().to_string();
    assert_eq!(
        zeros,
        "descriptor: expected a vector that is not all zeros, which have no direction"
    );
    let queries = [&raw[..5], &[0.0; 5]].concat();
    let batch =
        match_descriptors(&map, &queries, &Config::default(), Drive::default(), &mut |_, _| {
            ControlFlow::Continue(())
        });
    assert!(matches!(batch, Err(Error::NoDirection { row: Some(1), .. })));
    for recipe in ["", "[]", "{}", r#"{"name": 3}"#, "nonsense"] {
        assert!(map.clone().with_learned_recipe(recipe).is_err(), "{recipe}");
    }
}

#[test]
fn places_by_another_recipe_do_not_follow() {
    let (map, _) = route(CHAINS[2], 12, 9, Metric::Euclidean, 3);
    let by = |recipe: &str| map.clone().with_learned_recipe(recipe).unwrap();
    let first = by(r#"{"name": "net", "sha256": "1", "size": [2, 1]}"#);
    let (_folder, path) = saved(&first);
    let before = fs::read(&path).unwrap();
    for other in [r#"{"name": "other"}"#, r#"{"name": "net", "sha256": "2", "size": [2, 1]}"#] {
        let other = by(other);
        for refused in [first.extended(&other).map(|_| ()), Map::append(&path, &other)] {
            let refused = refused.unwrap_err();
            assert!(matches!(refused, Error::Append { .. }), "{refused}");
            assert!(refused.to_string().contains(r#"by the recipe {"name""#), "{refused}");
        }
        assert_eq!(fs::read(&path).unwrap(), before);
    }
    // The same in another order, and nothing said.
    for same in [by(r#"{"size": [2, 1], "sha256": "1", "name": "net"}"#), map.clone()] {
        assert_eq!(first.extended(&same).unwrap().learned_recipe(), first.learned_recipe());
        Map::append(&path, &same).unwrap();
    }
    assert_eq!(Map::open(&path).unwrap().places(), 36);
}

/// What is taken can be saved, and what is saved can be opened.
#[test]
fn a_recipe_that_a_file_cannot_hold_is_refused_at_once() {
    let (map, _) = route(CHAINS[0], 4, 5, Metric::Cosine, 1);
    let mut taken = 0;
    for depth in 0..200 {
        let recipe =
            format!(r#"{{"name": "deep", "x": {}1{}}}"#, "[".repeat(depth), "]".repeat(depth));
        if let Ok(map) = map.clone().with_learned_recipe(&recipe) {
            let (_folder, path) = saved(&map);
            assert!(Map::open(&path).unwrap().learned_recipe().is_some());
            taken += 1;
        }
    }
    assert!((100..150).contains(&taken), "{taken}");
    let long = |count| format!(r#"{{"name": "{}"}}"#, r"\\".repeat(count));
    let (_folder, path) = saved(&map.clone().with_learned_recipe(&long(524_000)).unwrap());
    assert_eq!(
        Map::open(&path).unwrap().learned_recipe().unwrap(),
        long(524_000).replace(": ", ":")
    );
    let refused = map.clone().with_learned_recipe(&long(525_000)).unwrap_err().to_string();
    assert!(refused.contains("1048576 are the most"), "{refused}");
    assert!(map.with_learned_recipe(r#"{"name": "a"}, {"name": "b"}"#).is_err());
}

#[test]
fn a_chain_without_steps_is_none() {
    let raw = signed(20, 1);
    let (post, rows) = Post::fit(&[], &raw, 5).unwrap();
    let map = Map::from_descriptors(rows, 5, Metric::Cosine).unwrap().with_post(post).unwrap();
    assert_eq!((map.post(), map.input_dim()), (None, 5));
    let (_folder, path) = saved(&map);
    assert_eq!(Map::open(&path).unwrap().post(), None);
}

/// Every kind of damage to the entry and to the tensors is refused, and named.
#[cfg(feature = "pca")]
#[test]
fn files_that_do_not_fit_together_are_refused() {
    let (map, _) = route(CHAINS[5], 12, 9, Metric::Euclidean, 3);
    let (folder, path) = saved(&map);
    let file = fs::read(&path).unwrap();
    let length = u64::from_le_bytes(file[..8].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&file[8..8 + length]).unwrap();
    let entry: Value =
        serde_json::from_str(header["__metadata__"]["surefix"].as_str().unwrap()).unwrap();
    assert_eq!(entry["version"], 1);
    let tried = folder.path().join("tried.safetensors");
    let open = |header: &Value, entry: &Value, payload: &[u8]| {
        let mut header = header.clone();
        header["__metadata__"]["surefix"] = entry.to_string().into();
        let text = header.to_string().into_bytes();
        let file = [&(text.len() as u64).to_le_bytes(), text.as_slice(), payload].concat();
        fs::write(&tried, sealed(file)).unwrap();
        let mapped = open_mapped(&tried).map(|_| ());
        let read = Map::open(&tried).map(|_| ());
        if let (Err(read), Err(mapped)) = (&read, &mapped) {
            assert!(read.to_string().contains("tried.safetensors"), "{read}");
            assert!(mapped.to_string().contains("tried.safetensors"), "{mapped}");
        }
        read.or(mapped)
    };
    let payload = &file[8 + length..];
    assert!(open(&header, &entry, payload).is_ok());
    let mut changed = Vec::new();
    for index in 0..4 {
        for (key, value) in [
            ("step", json!("sharpen")),
            ("step", json!("normalize")),
            ("step", json!("standardize")),
            ("dim", json!(2)),
            ("dim", json!(0)),
            ("dim", json!(1_u64 << 60)),
        ] {
            let mut entry = entry.clone();
            if entry["post"][index][key] == value || entry["post"][index].get(key).is_none() {
                continue;
            }
            entry["post"][index][key] = value;
            changed.push((header.clone(), entry));
        }
    }
    let mut fewer = entry.clone();
    fewer["post"].as_array_mut().unwrap().remove(1);
    changed.push((header.clone(), fewer));
    for name in ["post.0.offset", "post.0.scale", "post.1.offset", "post.1.matrix", "post.2.matrix"]
    {
        let mut without = header.clone();
        let tensor = without.as_object_mut().unwrap().remove(name).unwrap();
        without["other"] = tensor.clone();
        changed.push((without, entry.clone()));
        let mut flat = header.clone();
        let bytes = tensor["data_offsets"][1].as_u64().unwrap()
            - tensor["data_offsets"][0].as_u64().unwrap();
        flat[name]["dtype"] = "U8".into();
        flat[name]["shape"] = json!([bytes]);
        changed.push((flat, entry.clone()));
        if let [rows, columns] = tensor["shape"].as_array().unwrap().as_slice() {
            let mut turned = header.clone();
            turned[name]["shape"] = json!([columns, rows]);
            if rows != columns {
                changed.push((turned, entry.clone()));
            }
        }
    }
    for learned in [json!(3), json!({}), json!({"name": 3})] {
        let mut entry = entry.clone();
        entry["learned"] = learned;
        changed.push((header.clone(), entry));
    }
    // A matrix, which a length has none of.
    let mut more = header.clone();
    let end = payload.len() - 8;
    more["post.3.matrix"] =
        json!({"dtype": "F32", "shape": [3, 3], "data_offsets": [end, end + 36]});
    more["checksum"]["data_offsets"] = json!([end + 36, end + 44]);
    assert!(open(&more, &entry, &[payload, &[0; 36]].concat()).is_err());
    for (header, entry) in &changed {
        assert!(open(header, entry, payload).is_err(), "{entry} {header}");
    }
    let offset = header["post.0.offset"]["data_offsets"][0].as_u64().unwrap() as usize;
    let mut spoilt = payload.to_vec();
    spoilt[offset..offset + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    assert!(open(&header, &entry, &spoilt).is_err());
    for cut in (0..file.len()).step_by(97) {
        fs::write(&tried, &file[..cut]).unwrap();
        assert!(Map::open(&tried).is_err(), "cut at {cut}");
    }
}

#[test]
fn a_chain_has_at_most_64_steps() {
    let steps = vec![Step::Normalize; 65];
    let rows = signed(12, 1);
    let (post, rows) = Post::fit(&steps[..64], &rows, 3).unwrap();
    let map = Map::from_descriptors(rows, 3, Metric::Euclidean).unwrap().with_post(post).unwrap();
    let again = Map::from_bytes(&map.to_bytes().unwrap()).unwrap();
    assert_eq!(again.post().map(|post| post.steps().len()), Some(64));
    let refused = Post::fit(&steps, &signed(12, 1), 3).unwrap_err();
    assert!(matches!(refused, Error::Option { name: "steps", .. }), "{refused}");
}
