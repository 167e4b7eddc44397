//! Places with several rows: the distance is the least of theirs, each traverse's on one mean.

use std::sync::Arc;

use crate::cases::{DTYPES, bits, by_blocks, cases, numbers, sealed};
use crate::random::SplitMix64;
use proptest::prelude::*;
use proptest::sample::select;
use serde_json::{Value, json};
use surefix::{
    Config, Drive, Dtype, Error, Isa, Localizer, Map, Metric, Post, Step, Values, View,
    match_descriptors, quiet,
};
use tempfile::tempdir;

/// What a fold must give, from the columns of two maps.
fn folded(first: &[f32], own: &[f32], places: &[Option<usize>]) -> Vec<f32> {
    let mut pairs: Vec<(usize, f32)> =
        places.iter().zip(own).filter_map(|(place, &d)| Some(((*place)?, d))).collect();
    pairs.sort_by_key(|pair| pair.0);
    let apart = pairs.iter().map(|&(at, d)| (at, f64::from(first[at]) - f64::from(d)));
    let shift = by_blocks(&apart.collect::<Vec<_>>()) / pairs.len() as f64;
    let mut column = first.to_vec();
    for (place, distance) in pairs {
        column[place] = column[place].min((f64::from(distance) + shift) as f32);
    }
    column
}

fn raw(distances: &[f32]) -> Vec<u32> {
    distances.iter().map(|d| d.to_bits()).collect()
}

/// Places for some of `rows` rows, in no order.
fn some_places(places: usize, rows: usize, seed: u64) -> Vec<Option<usize>> {
    let mut dice = SplitMix64(seed);
    let mut all: Vec<usize> = (0..places).collect();
    for at in (1..places).rev() {
        all.swap(at, dice.below(at + 1));
    }
    let mut some: Vec<_> =
        (0..rows).map(|row| all.get(row).copied().filter(|_| dice.below(4) > 0)).collect();
    some[0] = Some(all[0]);
    some
}

fn map(dtype: Dtype, metric: Metric, places: usize, dim: usize, seed: u64) -> Map {
    Map::from_descriptors(numbers(dtype, places * dim, seed), dim, metric).unwrap()
}

proptest! {
    #![proptest_config(cases(40))]

    /// On every instruction set, with threads, streamed and in batch.
    #[test]
    fn the_distance_of_a_place_is_the_least_of_its_rows(
        dtype in select(DTYPES.to_vec()),
        metric in select(vec![Metric::Manhattan, Metric::Euclidean, Metric::Cosine]),
        places in 2..60_usize,
        seed in 0..1_000_000_u64,
    ) {
        let (dim, queries) = (24, 6);
        let first = map(dtype, metric, places, dim, seed);
        let second = map(dtype, metric, places, dim, seed + 1);
        let third = map(dtype, metric, places.div_ceil(2).max(2), dim, seed + 2);
        let at = some_places(places, places, seed);
        let also = some_places(places, third.places(), seed + 3);
        let both = first.add_traverse(&second, &at, "second").unwrap();
        let all = both.add_traverse(&third, &also, "third").unwrap();
        let asked = numbers(dtype, queries * dim, seed + 4);
        let mut columns = Vec::new();
        for query in 0..queries {
            let query = asked.view().row(query, dim).unwrap();
            let [one, two, three] = [&first, &second, &third].map(|map| map.distances(query).unwrap());
            let expected = folded(&one, &two, &at);
            prop_assert_eq!(raw(&both.distances(query).unwrap()), raw(&expected));
            // The third is compared with the first, not with the least of both.
            let other = folded(&one, &three, &also);
            let expected: Vec<f32> = expected.iter().zip(&other).map(|(a, b)| a.min(*b)).collect();
            for isa in Isa::available() {
                let on = all.clone().with_isa(isa).unwrap();
                prop_assert_eq!(raw(&on.distances(query).unwrap()), raw(&expected));
            }
            columns.push(expected);
        }
        let mut config = Config::default();
        config.sequence_length = 2;
        let all = Arc::new(all);
        let run = match_descriptors(&all, asked.view(), &config, Drive::default(), &mut quiet).unwrap();
        for threads in [1, 3] {
            let mut localizer =
                Localizer::new(all.clone(), config.clone()).unwrap().with_threads(Some(threads)).unwrap();
            for (query, column) in columns.iter().enumerate() {
                let fix = localizer.push_descriptor(asked.view().row(query, dim).unwrap()).unwrap();
                prop_assert_eq!(bits(&fix), bits(&run.fixes[query]));
                prop_assert_eq!(raw(localizer.distances()), raw(column));
            }
            prop_assert_eq!(localizer.looked_at(), places + all.traverses().skip(1).map(|t| t.rows()).sum::<usize>());
        }
    }

    #[test]
    fn a_file_gives_the_same_traverses_back(
        dtype in select(DTYPES.to_vec()),
        metric in select(vec![Metric::Manhattan, Metric::Cosine]),
        seed in 0..1_000_000_u64,
    ) {
        let (places, dim) = (30, 12);
        let first = map(dtype, metric, places, dim, seed).with_label("summer").unwrap();
        let mut all = first.clone();
        for more in 1..4 {
            let rows = map(dtype, metric, 10 * more, dim, seed + more as u64);
            let at = some_places(places, rows.places(), seed + more as u64);
            all = all.add_traverse(&rows, &at, &format!("drive {more}")).unwrap();
        }
        let bytes = all.to_bytes().unwrap();
        let again = Map::from_bytes(&bytes).unwrap();
        let folder = tempdir().unwrap();
        let path = folder.path().join("map");
        all.save(&path).unwrap();
        let read = Map::open(&path).unwrap();
        let query = numbers(dtype, dim, seed + 9);
        let told = |map: &Map| map
            .traverses()
            .map(|one| (one.label().to_owned(), one.places().collect::<Vec<_>>()))
            .collect::<Vec<_>>();
        let expected = raw(&all.distances(query.view()).unwrap());
        for map in [&again, &read] {
            prop_assert_eq!(told(map), told(&all));
            prop_assert_eq!(raw(&map.distances(query.view()).unwrap()), expected.clone());
            prop_assert_eq!(map.to_bytes().unwrap(), bytes.clone());
        }
        let refused = Map::append(&path, &first).unwrap_err();
        prop_assert!(refused.to_string().contains("expected a map of one traverse"), "{refused}");
        prop_assert!(Map::append(&path, &all).is_err());
        first.save(&path).unwrap();
        prop_assert!(Map::append(&path, &all).is_err());
    }

    /// A part of a map is the map of those rows.
    #[test]
    fn parts_and_joins_take_their_rows_along(from in 0..20_usize, count in 2..10_usize, seed in 0..1000_u64) {
        let (places, dim) = (30, 9);
        let first = map(Dtype::F32, Metric::Euclidean, places, dim, seed);
        let second = map(Dtype::F32, Metric::Euclidean, places, dim, seed + 1);
        let at = some_places(places, places, seed);
        let all = first.add_traverse(&second, &at, "b").unwrap();
        let cut = all.slice(from..from + count).unwrap();
        let inside: Vec<_> = at
            .iter()
            .map(|place| place.filter(|at| (from..from + count).contains(at)).map(|at| at - from))
            .collect();
        let query = numbers(Dtype::F32, dim, seed + 2);
        let alone = first.slice(from..from + count).unwrap();
        let expected = if inside.iter().all(Option::is_none) {
            alone
        } else {
            alone.add_traverse(&second, &inside, "b").unwrap()
        };
        let of = |map: &Map| raw(&map.distances(query.view()).unwrap());
        prop_assert_eq!(of(&cut), of(&expected));
        let halves = all.slice(0..15).unwrap().extended(&all.slice(15..30).unwrap()).unwrap();
        prop_assert_eq!(of(&halves), of(&all));
        prop_assert_eq!(halves.traverses().len(), 2);
        prop_assert_eq!(of(&all.without_traverse(1).unwrap()), of(&first));
    }
}

#[test]
fn traverses_of_several_blocks_are_on_one_mean() {
    for places in [4097, 8192, 9001] {
        let [first, second] =
            [1, 2].map(|seed| map(Dtype::F32, Metric::Euclidean, places, 9, seed));
        let at = some_places(places, places, 3);
        let both = first.add_traverse(&second, &at, "").unwrap();
        let query = numbers(Dtype::F32, 9, 5);
        let [one, two] = [&first, &second].map(|map| map.distances(query.view()).unwrap());
        assert_eq!(raw(&both.distances(query.view()).unwrap()), raw(&folded(&one, &two, &at)));
    }
}

#[test]
fn the_first_is_taken_out_if_another_covers_all_places() {
    let first = map(Dtype::U8, Metric::Manhattan, 8, 12, 1).with_label("first").unwrap();
    let (whole, part) =
        (map(Dtype::U8, Metric::Manhattan, 8, 12, 2), map(Dtype::U8, Metric::Manhattan, 3, 12, 3));
    let some = first.add_traverse(&part, &[Some(5), None, Some(1)], "part").unwrap();
    let expected =
        "option `traverse`: expected a traverse without which all places have a row, got 0";
    assert_eq!(some.without_traverse(0).unwrap_err().to_string(), expected);
    assert!(some.without_traverse(2).is_err() && first.without_traverse(0).is_err());
    let at: Vec<_> = (0..8).rev().map(Some).collect();
    let all = some.add_traverse(&whole, &at, "whole").unwrap().without_traverse(0).unwrap();
    let labels: Vec<_> = all.traverses().map(|one| one.label().to_owned()).collect();
    assert_eq!(labels, ["whole", "part"]);
    let query = numbers(Dtype::U8, 12, 4);
    let own = all.without_traverse(1).unwrap().distances(query.view()).unwrap();
    let reversed: Vec<f32> = whole.distances(query.view()).unwrap().into_iter().rev().collect();
    assert_eq!(own, reversed);
}

#[test]
fn rows_that_show_nothing_are_never_the_least() {
    let row =
        |seed: f32| (0..10).map(|at| (seed * 7.0 + at as f32 * seed).sin()).collect::<Vec<_>>();
    let zeros = vec![0.0; 10];
    let first: Vec<f32> = [row(1.0), zeros.clone(), row(3.0), zeros.clone(), row(5.0)].concat();
    let second: Vec<f32> = [zeros.clone(), row(2.5), row(3.5), zeros.clone()].concat();
    let first = Map::from_descriptors(first, 10, Metric::Euclidean).unwrap();
    let second = Map::from_descriptors(second, 10, Metric::Euclidean).unwrap();
    let at = [Some(0), Some(1), Some(2), Some(3)];
    let all = first.add_traverse(&second, &at, "").unwrap();
    assert_eq!(first.blank(), [1, 3]);
    assert_eq!(all.blank(), [3], "the second saw place 1");
    assert_eq!(all.without_blank().unwrap().places(), 4);
    let query: Vec<f32> = row(2.4).iter().map(|x| x * 0.5).collect();
    let distance = |map: &Map, row: usize| {
        let rows = map.descriptors();
        let View::F32(rows) = rows else { panic!("float32") };
        let square = rows[row * 10..][..10].iter().zip(&query).map(|(a, b)| (a - b) * (a - b));
        square.map(f64::from).sum::<f64>().sqrt()
    };
    // The only pair that shows something twice is that of place 2.
    let shift = distance(&first, 2) - distance(&second, 2);
    let got = all.distances(query.as_slice()).unwrap();
    let expected = [
        distance(&first, 0),
        distance(&second, 1) + shift,
        distance(&first, 2).min(distance(&second, 2) + shift),
        0.0,
        distance(&first, 4),
    ];
    // That of all rows that show something.
    let rows = [0, 2, 4].map(|row| distance(&first, row));
    let more = [1, 2].map(|row| distance(&second, row) + shift);
    let mean = rows.iter().chain(&more).sum::<f64>() / 5.0;
    for (place, &distance) in got.iter().enumerate() {
        let expected = if place == 3 { mean } else { expected[place] };
        assert!((f64::from(distance) - expected).abs() < 1e-5, "place {place}");
    }
    let nothing = all.distances(zeros.as_slice()).unwrap();
    assert!(nothing.iter().all(|&d| d == nothing[0]), "a query of zeros says nothing");
    let file = Map::from_bytes(&all.to_bytes().unwrap()).unwrap();
    assert_eq!((file.blank(), file.distances(query.as_slice()).unwrap()), (&[3][..], got));
    // All rows of all places show nothing.
    let bare = Map::from_descriptors(vec![0.0_f32; 20], 10, Metric::Euclidean).unwrap();
    let bare = bare.add_traverse(&bare, &[Some(0), Some(1)], "").unwrap();
    let got = bare.distances(query.as_slice()).unwrap();
    assert!(got[0].is_finite() && got[0] == got[1]);
}

#[test]
fn traverses_that_do_not_fit_are_refused() {
    let first = map(Dtype::F32, Metric::Euclidean, 4, 12, 1);
    let two = |dtype, metric, dim| map(dtype, metric, 2, dim, 2);
    for other in [
        two(Dtype::F16, Metric::Euclidean, 12),
        two(Dtype::F32, Metric::Cosine, 12),
        two(Dtype::F32, Metric::Euclidean, 11),
        two(Dtype::F32, Metric::Euclidean, 12)
            .with_post(Post::fit(&[Step::Normalize], &[1.0; 24], 12).unwrap().0)
            .unwrap(),
    ] {
        let refused = first.add_traverse(&other, &[Some(0), Some(1)], "");
        assert!(matches!(refused, Err(Error::Append { .. })), "{refused:?}");
    }
    let rows = two(Dtype::F32, Metric::Euclidean, 12);
    let text =
        |places: &[Option<usize>]| first.add_traverse(&rows, places, "").unwrap_err().to_string();
    assert!(text(&[Some(0)]).contains("expected 2 values, got 1"));
    assert!(text(&[Some(0), Some(4)]).contains("expected places from 0 to 3, got 4 at row 1"));
    assert!(text(&[Some(3), Some(3)]).contains("expected each place at most once, got 3 twice"));
    assert!(text(&[None, None]).contains("expected a place for at least one row"));
    assert!(first.add_traverse(&rows, &[Some(0), None], &"x".repeat(1025)).is_err());
    let both = first.add_traverse(&rows, &[Some(0), None], "").unwrap();
    assert!(first.add_traverse(&both, &[Some(0), None, None, None], "").is_err());
    assert!(
        both.clone().with_post(Post::fit(&[Step::Normalize], &[1.0; 24], 12).unwrap().0).is_err()
    );
    let mut many = first.clone();
    for _ in 0..64 {
        many = many.add_traverse(&rows, &[Some(0), None], "").unwrap();
    }
    assert!(many.add_traverse(&rows, &[Some(0), None], "").is_err());
}

/// Those of one label become one if maps are joined, of which none has two of a place.
#[test]
fn traverses_of_joined_maps_go_on_by_their_labels() {
    let (whole, rows) = (
        map(Dtype::F32, Metric::Euclidean, 8, 12, 1),
        map(Dtype::F32, Metric::Euclidean, 2, 12, 2),
    );
    let [first, second] = [0..4, 4..8].map(|places| whole.slice(places).unwrap());
    let add = |map: &Map, places: [usize; 2], label: &str| {
        map.add_traverse(&rows, &places.map(Some), label).unwrap()
    };
    let (first, second) = (add(&first, [1, 3], "a"), add(&add(&second, [0, 2], "b"), [3, 1], ""));
    let joined = first.extended(&second).unwrap();
    let expected = add(&add(&add(&whole, [1, 3], "a"), [4, 6], "b"), [7, 5], "");
    assert!(joined.to_bytes().unwrap() == expected.to_bytes().unwrap());
    let second = whole.slice(4..8).unwrap();
    let one = second.add_traverse(&rows, &[Some(0), None], "a").unwrap();
    let two = one.add_traverse(&rows, &[Some(0), None], "a").unwrap();
    let count = |map: &Map| Map::join(&[&first, map]).unwrap().traverses().len();
    assert_eq!((count(&one), count(&two)), (2, 3));
}

#[test]
fn a_label_has_at_most_1024_bytes() {
    let label = "x".repeat(1024);
    let first = map(Dtype::F32, Metric::Euclidean, 4, 12, 1);
    let all = first.add_traverse(&first, &[Some(2), None, None, None], &label).unwrap();
    let again = Map::from_bytes(&all.to_bytes().unwrap()).unwrap();
    assert_eq!(again.traverses().nth(1).unwrap().label(), label);
    assert!(first.with_label(&format!("{label}x")).is_err());
}

#[test]
fn a_snapshot_is_of_these_traverses() {
    let first = Arc::new(map(Dtype::F32, Metric::Euclidean, 6, 12, 1));
    let rows = map(Dtype::F32, Metric::Euclidean, 6, 12, 2);
    let at = |shift: usize| (0..6).map(|row| Some((row + shift) % 6)).collect::<Vec<_>>();
    let both = Arc::new(first.add_traverse(&rows, &at(0), "").unwrap());
    let turned = Arc::new(first.add_traverse(&rows, &at(1), "").unwrap());
    let mut localizer = Localizer::new(both.clone(), Config::default()).unwrap();
    localizer.push_descriptor(numbers(Dtype::F32, 12, 3).view()).unwrap();
    let bytes = localizer.snapshot().unwrap();
    assert!(Localizer::restore(both, &bytes, None).is_ok());
    for other in [first, turned] {
        assert!(matches!(Localizer::restore(other, &bytes, None), Err(Error::Snapshot { .. })));
    }
}

fn changed(file: &[u8], change: impl FnOnce(&mut Value, &mut Vec<u8>)) -> Vec<u8> {
    let length = u64::from_le_bytes(file[..8].try_into().unwrap()) as usize;
    let mut header: Value = serde_json::from_slice(&file[8..8 + length]).unwrap();
    let mut payload = file[8 + length..].to_vec();
    change(&mut header, &mut payload);
    let mut text = header.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    sealed([&(text.len() as u64).to_le_bytes()[..], &text, &payload].concat())
}

#[test]
fn hostile_files_are_refused() {
    let first = map(Dtype::F32, Metric::Cosine, 6, 12, 1);
    let rows = map(Dtype::F32, Metric::Cosine, 4, 12, 2);
    let all = first.add_traverse(&rows, &[Some(1), Some(2), None, Some(5)], "a").unwrap();
    let all = all.add_traverse(&rows, &[None, Some(3), None, None], "b").unwrap();
    let file = all.to_bytes().unwrap();
    assert!(Map::from_bytes(&changed(&file, |_, _| ())).is_ok());
    let refused = |file: &[u8]| match Map::from_bytes(file) {
        Err(Error::MapFile { reason, .. }) => reason,
        other => panic!("expected a refusal, got {other:?}"),
    };
    let put = |name: &str, index: usize, number: u64| {
        changed(&file, |header, payload| {
            let start = header[name]["data_offsets"][0].as_u64().unwrap() as usize;
            payload[start + 8 * index..][..8].copy_from_slice(&number.to_le_bytes());
        })
    };
    for (file, named) in [
        (put("traverse.places", 2, 6), "expected places from 0 to 5, ascending"),
        (put("traverse.places", 1, 1), "ascending"),
        (put("traverse.places", 3, u64::MAX), "expected places from 0 to 5"),
        (put("traverse.counts", 0, 4), "traverse.places"),
        (put("traverse.counts", 0, 0), "traverse.counts"),
        (put("traverse.counts", 1, u64::MAX), "traverse.counts"),
        (put("traverse.norms", 0, 2.0_f64.to_bits()), "norms"),
        (put("traverse.norms", 0, f64::NAN.to_bits()), "norms"),
    ] {
        let reason = refused(&file);
        assert!(reason.contains(named), "{reason}");
    }
    for name in ["traverse.counts", "traverse.places", "traverse.rows", "traverse.labels"] {
        refused(&changed(&file, |header, _| {
            let tensor = header.as_object_mut().unwrap().remove(name).unwrap();
            header["other"] = tensor;
        }));
    }
    for (name, shape) in [
        ("traverse.rows", json!([4 * 12])),
        ("traverse.rows", json!([8, 6])),
        ("traverse.places", json!([2, 2])),
        ("traverse.blank", json!([2, 2])),
    ] {
        refused(&changed(&file, |header, _| header[name]["shape"] = shape));
    }
    refused(&changed(&file, |header, payload| {
        let start = header["traverse.rows"]["data_offsets"][0].as_u64().unwrap() as usize;
        payload[start..start + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    }));
    // Numbers of another type, as long.
    refused(&changed(&file, |header, _| header["traverse.rows"]["dtype"] = "I32".into()));
    // A traverse without rows, and all of them in the other.
    let none = changed(&file, |header, payload| {
        let start = header["traverse.counts"]["data_offsets"][0].as_u64().unwrap() as usize;
        payload[start..start + 16].copy_from_slice(bytemuck::cast_slice(&[0_u64, 4]));
        let start = header["traverse.places"]["data_offsets"][0].as_u64().unwrap() as usize;
        payload[start..start + 32].copy_from_slice(bytemuck::cast_slice(&[1_u64, 2, 3, 5]));
    });
    assert!(refused(&none).contains("traverse.counts"));
    // Without lengths to check them by.
    let plain = map(Dtype::F32, Metric::Manhattan, 6, 12, 1);
    let plain = plain.add_traverse(&plain, &[Some(1), Some(2), None, None, None, Some(5)], "a");
    let number = |number: f32| {
        changed(&plain.as_ref().unwrap().to_bytes().unwrap(), |header, payload| {
            let start = header["traverse.rows"]["data_offsets"][0].as_u64().unwrap() as usize;
            payload[start + 4..start + 8].copy_from_slice(&number.to_le_bytes());
        })
    };
    assert!(Map::from_bytes(&number(0.5)).is_ok());
    assert!(refused(&number(f32::NAN)).contains("traverse.rows"));
    assert!(refused(&number(f32::INFINITY)).contains("traverse.rows"));
    // 65 labels are those of the first and the most that there may be.
    let labelled = first.clone().with_label(&"x".repeat(65)).unwrap().to_bytes().unwrap();
    let labels = |count: usize| {
        changed(&labelled, |header, payload| {
            let start = header["traverse.labels"]["data_offsets"][0].as_u64().unwrap() as usize;
            payload[start..start + count].fill(0);
        })
    };
    assert!(refused(&labels(66)).contains("expected 1 to 65 texts"));
    assert!(refused(&labels(64)).contains("traverse.rows"));
    // A map of one traverse has no such tensor.
    let text = String::from_utf8_lossy(&first.to_bytes().unwrap()).into_owned();
    assert!(!text.contains("traverse."));
}

/// The most traverses, rows that show nothing in each of them, and the label of the first.
#[test]
fn a_file_keeps_what_is_known_of_each_traverse() {
    let rows = |seed: u64, dark: usize| {
        let Values::F32(mut rows) = numbers(Dtype::F32, 8 * 12, seed) else { unreachable!() };
        rows[dark * 12..][..12].fill(0.0);
        Map::from_descriptors(rows, 12, Metric::Euclidean).unwrap()
    };
    let all: Vec<_> = (0..8).map(Some).collect();
    let first = rows(1, 2).with_label("summer").unwrap();
    let several = first.add_traverse(&rows(2, 2), &all, "autumn").unwrap();
    let several = several.add_traverse(&rows(3, 5), &all, "winter").unwrap();
    let full = (0..62).fold(several.clone(), |map, _| map.add_traverse(&first, &all, "").unwrap());
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    let query = numbers(Dtype::F32, 12, 9);
    for map in [&first, &several, &full] {
        map.save(&path).unwrap();
        let read = Map::open(&path).unwrap();
        assert_eq!(read.traverses().len(), map.traverses().len());
        assert_eq!(read.traverses().next().unwrap().label(), "summer");
        assert_eq!(read.blank(), map.blank());
        let distances = |map: &Map| raw(&map.distances(query.view()).unwrap());
        assert_eq!(distances(&read), distances(map));
    }
    assert_eq!(full.traverses().len(), 65);
    first.save(&path).unwrap();
    Map::append(&path, &rows(4, 3)).unwrap();
    let longer = Map::open(&path).unwrap();
    assert_eq!((longer.places(), longer.traverses().next().unwrap().label()), (16, "summer"));
}

/// The claim of docs/howto/traverses.md, on a generated road: a third drive is localized at least as
/// well as on the better of the two maps, and clearly better than on either at dusk.
#[cfg(feature = "rayon")]
#[test]
fn two_drives_know_a_third_better_than_one() {
    use surefix::{Motion, align_descriptors};
    use surefix_simulate::{Conditions, Route, RouteConfig};
    let (mut alone, mut other, mut both) = (0.0, 0.0, 0.0);
    for seed in [1, 2, 3] {
        let config =
            RouteConfig { places: 150, width: 96, height: 48, seed, ..RouteConfig::default() };
        let road = Route::new(config).unwrap();
        let sad = surefix::Sad::default();
        let reference = road.traverse(Conditions::reference()).unwrap();
        let winter = road.traverse(Conditions::revisit()).unwrap();
        let dusk = Conditions { light: 0.9, season: 0.35, seed: 3, ..Conditions::revisit() };
        let dusk = road.traverse(dusk).unwrap();
        let summer = Map::from_images(&reference, sad, &mut quiet).unwrap();
        let snow = Map::from_images(&winter, sad, &mut quiet).unwrap();
        let queries = Map::from_images(&dusk, sad, &mut quiet).unwrap();
        let mut config = Config::default();
        config.motion = Some(Motion::any());
        config.sequence_length = 1;
        let maps = [Arc::new(summer.clone())];
        let aligned = align_descriptors(
            &maps,
            &[snow.descriptors()],
            &config,
            Drive::default(),
            &[],
            &mut quiet,
        );
        let all = summer.add_traverse(&snow, &aligned.unwrap().sure_places(0.9), "winter").unwrap();
        let right = |map: &Map, truth: Vec<Option<usize>>| {
            let run = match_descriptors(
                map,
                queries.descriptors(),
                &Config::default(),
                Drive::default(),
                &mut quiet,
            );
            let fixes = run.unwrap().fixes;
            let right = fixes.iter().zip(truth).filter(|(fix, truth)| {
                truth.is_some_and(|truth| fix.single.place.abs_diff(truth) <= 1)
            });
            right.count() as f64 / fixes.len() as f64
        };
        alone += right(&summer, dusk.truth(&reference)) / 3.0;
        other += right(&snow, dusk.truth(&winter)) / 3.0;
        both += right(&all, dusk.truth(&reference)) / 3.0;
    }
    println!("summer {alone:.3}, winter {other:.3}, both {both:.3}");
    assert!(both >= alone + 0.02 && both >= other + 0.02, "{alone} {other} {both}");
}

#[test]
fn descriptors_of_the_same_kind_go_through_the_map_s_post_processing() {
    let rows = match numbers(Dtype::F32, 8 * 12, 1) {
        Values::F32(rows) => rows,
        other => panic!("{other:?}"),
    };
    let (post, passed) = Post::fit(&[Step::Standardize, Step::Normalize], &rows, 12).unwrap();
    let first = Map::from_descriptors(passed, 12, Metric::Cosine).unwrap().with_post(post).unwrap();
    let again = first.of_same_kind(View::F32(&rows)).unwrap();
    assert_eq!(again.descriptors(), first.descriptors());
    assert!(first.of_same_kind(numbers(Dtype::U8, 24, 1).view()).is_err());
    let at: Vec<_> = (0..8).map(Some).collect();
    let both = first.add_traverse(&again, &at, "again").unwrap();
    let query = &rows[12..24];
    assert_eq!(both.distances(query).unwrap(), first.distances(query).unwrap());
}
