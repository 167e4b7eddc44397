//! Maps of several segments: joined, cut, thinned and made longer, in memory and in files.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use crate::cases::{cases, numbers, sealed};
use proptest::prelude::*;
use serde_json::Value;
use surefix::{
    Config, Dtype, Error, Localizer, Map, Metric, Origin, Positions, Segments, Thumbnails,
};
use tempfile::{TempDir, tempdir};

const DIM: usize = 9;

/// A map of the rows `first..first + places` of one long list, with all that a place can have.
fn part(first: usize, places: usize, metric: Metric) -> Map {
    let of = |count: usize| first * count..(first + places) * count;
    let rows = numbers(Dtype::F32, 200 * DIM, 3).view().row(0, 200 * DIM).map(|all| match all {
        surefix::View::F32(all) => all[of(DIM)].to_vec(),
        _ => Vec::new(),
    });
    let map = Map::from_descriptors(rows.unwrap(), DIM, metric).unwrap();
    let names = (first..first + places).map(|place| format!("{place}.png")).collect();
    let metres = of(2).map(|at| at as f64 * 1.5).collect();
    let origin = Origin::new(48.1, 11.6).unwrap();
    let positions = Positions::new(metres, 2).unwrap().with_origin(origin).unwrap();
    let pixels = of(6).map(|at| (at % 251) as u8).collect();
    let map = map.with_names(names).unwrap().with_positions(positions).unwrap();
    map.with_thumbnails(Thumbnails::new(3, 2, pixels).unwrap()).unwrap()
}

fn file(map: &Map) -> (TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    map.save(&path).unwrap();
    (folder, path)
}

fn bytes(map: &Map) -> Vec<u8> {
    map.to_bytes().unwrap()
}

/// The file with a tensor's numbers changed.
fn changed(file: &[u8], tensor: &str, numbers: &[u64]) -> Vec<u8> {
    let length = u64::from_le_bytes(file[..8].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&file[8..8 + length]).unwrap();
    let at = header[tensor]["data_offsets"][0].as_u64().unwrap() as usize + 8 + length;
    let mut file = file.to_vec();
    for (index, number) in numbers.iter().enumerate() {
        file[at + 8 * index..][..8].copy_from_slice(&number.to_le_bytes());
    }
    sealed(file)
}

/// Lengths of pieces, and whether each is closed.
fn pieces() -> impl Strategy<Value = Vec<(usize, bool)>> {
    prop::collection::vec((2_usize..25, any::<bool>()), 1..6)
}

fn closed(map: Map, closed: bool) -> Map {
    if !closed || map.places() < 3 {
        return map;
    }
    let ring = map.segments().clone().with_closed(&[0]).unwrap();
    map.with_segments(ring).unwrap()
}

proptest! {
    #![proptest_config(cases(60))]

    #[test]
    fn joined_and_appended_maps_are_the_map_made_at_once(
        pieces in pieces(),
        cosine in any::<bool>(),
    ) {
        let metric = if cosine { Metric::Cosine } else { Metric::Manhattan };
        let (mut maps, mut breaks, mut rings) = (Vec::new(), Vec::new(), Vec::new());
        let mut places = 0;
        for (index, &(length, ring)) in pieces.iter().enumerate() {
            breaks.extend((places > 0).then_some(places));
            rings.extend((ring && length > 2).then_some(index));
            maps.push(closed(part(places, length, metric), ring));
            places += length;
        }
        let segments = Segments::new(places, &breaks).unwrap().with_closed(&rings).unwrap();
        let whole = part(0, places, metric).with_segments(segments).unwrap();
        let joined = Map::join(&maps.iter().collect::<Vec<_>>()).unwrap();
        prop_assert_eq!(bytes(&joined), bytes(&whole));
        let (_folder, path) = file(&maps[0]);
        for more in &maps[1..] {
            Map::append_segment(&path, more).unwrap();
        }
        prop_assert_eq!(fs::read(&path).unwrap(), bytes(&whole));
        // Opened again, and each piece cut out again.
        let opened = Map::open(&path).unwrap();
        prop_assert_eq!(opened.segments(), whole.segments());
        prop_assert_eq!(bytes(&opened), bytes(&whole));
        let mut start = 0;
        for map in &maps {
            let end = start + map.places();
            prop_assert_eq!(bytes(&opened.slice(start..end).unwrap()), bytes(map));
            start = end;
        }
    }

    #[test]
    fn kept_places_are_those_of_a_map_made_of_them(
        keep in prop::collection::vec(any::<bool>(), 60),
        at in 1_usize..59,
        ring in any::<bool>(),
        run in 1_usize..40,
    ) {
        // Some cases have long runs, which share rows.
        let mut places: Vec<usize> =
            (0..60).filter(|&place| keep[place] || place < run).collect();
        if places.len() < 2 {
            places = vec![3, 50];
        }
        let rings: &[usize] = if ring && at > 2 { &[0] } else { &[] };
        let segments = Segments::new(60, &[at]).unwrap().with_closed(rings).unwrap();
        let segments = segments.with_links(&[(59, 0)]).unwrap();
        let whole = part(0, 60, Metric::Cosine).with_segments(segments.clone()).unwrap();
        let kept = whole.keep(&places).unwrap();
        let one = |&place: &usize| {
            // Of two places, as no map has one.
            let first = place.min(58);
            part(first, 2, Metric::Cosine)
        };
        let pairs: Vec<Map> = places.iter().map(one).collect();
        for (index, (pair, &place)) in pairs.iter().zip(&places).enumerate() {
            let row = place - place.min(58);
            prop_assert_eq!(kept.descriptors().row(index, DIM), pair.descriptors().row(row, DIM));
            prop_assert_eq!(&kept.names().unwrap()[index], &pair.names().unwrap()[row]);
            prop_assert_eq!(kept.positions().unwrap().at(index), pair.positions().unwrap().at(row));
            let (picture, expected) = (kept.thumbnails().unwrap(), pair.thumbnails().unwrap());
            prop_assert_eq!(picture.get(index), expected.get(row));
        }
        prop_assert_eq!(kept.segments(), &segments.keep(&places).unwrap());
        let query = numbers(Dtype::F32, DIM, 8);
        let all = whole.distances(&query).unwrap();
        let some = kept.distances(&query).unwrap();
        let bits = |x: f32| x.to_bits();
        prop_assert!(places.iter().zip(some).all(|(&at, d)| bits(all[at]) == bits(d)));
        prop_assert_eq!(bytes(&Map::from_bytes(&bytes(&kept)).unwrap()), bytes(&kept));
    }
}

fn bits_of(map: &Map) -> Vec<u32> {
    map.distances(&numbers(Dtype::F32, DIM, 8)).unwrap().into_iter().map(f32::to_bits).collect()
}

#[test]
fn places_that_go_on_make_one_segment_and_a_closed_one_cannot() {
    let [one, other] = [part(0, 10, Metric::Manhattan), part(10, 8, Metric::Manhattan)];
    let (whole, ring) = (part(0, 18, Metric::Manhattan), closed(one.clone(), true));
    assert_eq!(bytes(&one.extended(&other).unwrap()), bytes(&whole));
    let (_folder, path) = file(&one);
    Map::append(&path, &other).unwrap();
    assert_eq!(fs::read(&path).unwrap(), bytes(&whole));
    // The added places have segments of their own: the first goes on.
    let two = other.clone().with_segments(Segments::new(8, &[3]).unwrap()).unwrap();
    assert_eq!(*one.extended(&two).unwrap().segments(), Segments::new(18, &[13]).unwrap());
    let (_folder, path) = file(&ring);
    let before = fs::read(&path).unwrap();
    for refused in [Map::append(&path, &other), ring.extended(&other).map(|_| ())] {
        let error = refused.unwrap_err();
        assert!(matches!(error, Error::Append { .. }), "{error}");
        assert!(error.to_string().contains("a new segment, as its last segment is closed"));
    }
    let error = other.extended(&ring).unwrap_err().to_string();
    assert!(error.contains("a new segment, as their first segment is closed"), "{error}");
    assert_eq!(fs::read(&path).unwrap(), before);
    assert!(Map::join(&[&ring, &other]).is_ok());
}

#[test]
fn maps_of_different_kinds_are_not_joined() {
    let first = part(0, 5, Metric::Manhattan);
    let bare = |rows| Map::from_descriptors(rows, DIM, Metric::Manhattan).unwrap();
    let plain = bare(numbers(Dtype::F32, 5 * DIM, 1));
    let named = plain.clone().with_names((0..5).map(|i| i.to_string()).collect()).unwrap();
    let placed = |axes: usize| Positions::new(vec![1.0; 5 * axes], axes).unwrap();
    let utm = placed(2).with_plane("UTM 55S").unwrap();
    let other = utm.clone().with_plane("UTM 54S").unwrap();
    let with = |positions: Positions| named.clone().with_positions(positions).unwrap();
    let local = "positions of 2 coordinates around an origin";
    for (one, other, expected, got) in [
        (&first, part(0, 5, Metric::Cosine), "9 x float32, manhattan", "9 x float32, cosine"),
        (&first, bare(numbers(Dtype::U8, 5 * DIM, 1)), "9 x float32", "9 x uint8"),
        (&first, plain, "a name for each place", "no names"),
        (&first, named.clone(), local, "no positions"),
        (&first, with(placed(2)), local, "positions of 2 coordinates"),
        (&first, with(placed(3)), local, "positions of 3 coordinates"),
        (&with(utm), with(other), "on the plane UTM 55S", "on the plane UTM 54S"),
    ] {
        let error = Map::join(&[one, one, &other]).unwrap_err();
        assert!(matches!(error, Error::Append { .. }), "{error}");
        let text = error.to_string();
        assert!(text.starts_with("map 2: cannot append"), "{text}");
        assert!(text.contains(expected) && text.contains(got), "{text}");
    }
    assert!(matches!(Map::join(&[]), Err(Error::Option { name: "maps", .. })));
}

#[test]
fn wrong_places_to_keep_are_refused() {
    let map = part(0, 10, Metric::Manhattan);
    for (places, got) in [(&[3, 2][..], "2 after 3"), (&[4, 4], "4 after 4"), (&[1, 10], "10")] {
        let error = map.keep(places).unwrap_err();
        assert!(matches!(error, Error::Option { name: "places", .. }));
        assert!(error.to_string().ends_with(&format!("got {got}")), "{error}");
    }
    for places in [&[][..], &[3]] {
        assert!(matches!(map.keep(places), Err(Error::TooFewPlaces { .. })));
    }
    for metres in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(map.thin(metres), Err(Error::Option { name: "metres", .. })));
    }
    assert!(matches!(map.thin(1e9), Err(Error::TooFewPlaces { got: 1, .. })));
    let bare = Map::from_descriptors(vec![0_u8, 1, 2], 1, Metric::Manhattan).unwrap();
    assert!(bare.thin(1.0).unwrap_err().to_string().contains("a map with positions, got one with"));
}

#[test]
fn every_segment_is_thinned_from_its_first_place() {
    // Steps of sqrt(18) metres, about 4.24.
    let map = part(0, 20, Metric::Manhattan);
    let segments = Segments::new(20, &[7]).unwrap().with_closed(&[1]).unwrap();
    let map = map.with_segments(segments).unwrap();
    let thin = map.thin(9.0).unwrap();
    let expected = map.keep(&[0, 3, 6, 7, 10, 13, 16, 19]).unwrap();
    assert_eq!(bytes(&thin), bytes(&expected));
    assert_eq!(*thin.segments(), Segments::new(8, &[3]).unwrap().with_closed(&[1]).unwrap());
    assert_eq!(bytes(&map.thin(0.0).unwrap()), bytes(&map));
    // Places that are just so far apart are kept.
    let metres = (0..4).flat_map(|place| [f64::from(place), 0.0]).collect();
    let line = Map::from_descriptors(vec![0_u8, 1, 2, 3], 1, Metric::Manhattan).unwrap();
    let line = line.with_positions(Positions::new(metres, 2).unwrap()).unwrap();
    assert_eq!(line.thin(1.0).unwrap().places(), 4);
}

#[test]
fn a_tunnel_becomes_a_break_with_a_link() {
    let mut rows: Vec<f32> = (0..30 * 9).map(|at| (at * at % 97) as f32).collect();
    rows[4 * 9..6 * 9].fill(0.0);
    rows[10 * 9..15 * 9].fill(0.0);
    let map = Map::from_descriptors(rows, 9, Metric::Euclidean).unwrap().without_blank().unwrap();
    let expected = Segments::new(23, &[8]).unwrap().with_links(&[(7, 8)]).unwrap();
    assert_eq!(*map.segments(), expected);
}

#[test]
fn a_map_of_one_open_segment_has_the_file_of_before() {
    let map = Map::from_descriptors(numbers(Dtype::F32, 45, 3), DIM, Metric::Cosine).unwrap();
    let same = map.clone().with_segments(Segments::one(5)).unwrap();
    assert_eq!(bytes(&map), bytes(&same));
    let file = bytes(&map);
    let text = String::from_utf8_lossy(&file[..1000.min(file.len())]);
    for part in ["breaks", "closed", "links", "origin", "plane", "thumbnails"] {
        assert!(!text.contains(part), "{part}");
    }
}

#[test]
fn segments_decide_what_a_snapshot_is_of() {
    let map = part(0, 12, Metric::Manhattan);
    let blob = |map: &Map| {
        let mut localizer = Localizer::new(Arc::new(map.clone()), Config::default()).unwrap();
        localizer.push_descriptor(&numbers(Dtype::F32, DIM, 2)).unwrap();
        localizer.snapshot().unwrap()
    };
    let restore = |map: &Map, blob: &[u8]| Localizer::restore(Arc::new(map.clone()), blob, None);
    let two = map.clone().with_segments(Segments::new(12, &[5]).unwrap()).unwrap();
    let one = map.clone().with_segments(Segments::one(12)).unwrap();
    assert!(restore(&one, &blob(&map)).is_ok() && restore(&two, &blob(&two)).is_ok());
    assert!(restore(&two, &blob(&map)).is_err() && restore(&map, &blob(&two)).is_err());
}

#[test]
fn files_with_impossible_segments_are_refused() {
    let segments = Segments::new(20, &[5, 12]).unwrap().with_closed(&[0, 2]).unwrap();
    let segments = segments.with_links(&[(3, 15), (19, 6)]).unwrap();
    let whole = bytes(&part(0, 20, Metric::Manhattan).with_segments(segments).unwrap());
    let refused = |bytes: &[u8]| match Map::from_bytes(bytes) {
        Err(error @ Error::MapFile { .. }) => error.to_string(),
        other => panic!("expected Error::MapFile, got {other:?}"),
    };
    assert!(Map::from_bytes(&changed(&whole, "breaks", &[5, 13])).is_ok());
    for (tensor, numbers, reason) in [
        ("breaks", [12, 5], "expected places in ascending order, from 1 to 19, got 5 after 12"),
        ("breaks", [0, 5], "from 1 to 19, got 0"),
        ("breaks", [5, 20], "from 1 to 19, got 20 after 5"),
        ("breaks", [5, u64::MAX], "from 1 to 19"),
        ("breaks", [1, 18], "a segment of at least 3 places, got segment 0 of 1"),
        ("closed", [0, 3], "segments from 0 to 2, got 3"),
        ("closed", [u64::MAX, 0], "segments from 0 to 2"),
        ("links", [3, 20], "places from 0 to 19, got 3 to 20"),
        ("links", [3, 4], "one that does not follow it anyway, got 3 to 4"),
        ("links", [19, 6], "each link once"),
    ] {
        let text = refused(&changed(&whole, tensor, &numbers));
        assert!(text.contains(reason), "{tensor} {numbers:?}: {text}");
    }
    let length = u64::from_le_bytes(whole[..8].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&whole[8..8 + length]).unwrap();
    let with = |change: &dyn Fn(&mut Value)| {
        let mut header = header.clone();
        change(&mut header);
        let text = header.to_string().into_bytes();
        let length = (text.len() as u64).to_le_bytes();
        sealed([&length[..], &text, &whole[8 + length_of(&whole)..]].concat())
    };
    for (tensor, shape, dtype, reason) in [
        ("breaks", "[2, 1]", "U64", "breaks: expected a tensor of U64 (k)"),
        ("breaks", "[2]", "F64", "breaks: expected a tensor of U64 (k)"),
        ("links", "[4]", "U64", "links: expected a tensor of U64 (k, 2)"),
        ("thumbnails", "[20, 6, 1, 1]", "U8", "thumbnails: expected a tensor of U8 (20, "),
        ("thumbnails", "[10, 6, 2]", "U8", "thumbnails: expected a tensor of U8 (20, "),
        ("thumbnails", "[20, 2, 3]", "I8", "thumbnails: expected a tensor of U8 (20, "),
    ] {
        let text = refused(&with(&|header| {
            header[tensor]["shape"] = serde_json::from_str(shape).unwrap();
            header[tensor]["dtype"] = dtype.into();
        }));
        assert!(text.contains(reason), "{text}");
    }
    for (origin, reason) in [
        ("[91.0, 0.0]", "a latitude between -90 and 90"),
        ("[48.0, 541.0]", "a latitude between -90 and 90 and a longitude"),
        ("[89.99999, 0.0]", "positions on the globe around it"),
        ("[1.0]", "its entry cannot be read"),
    ] {
        let text = refused(&with(&|header| {
            let entry = &mut header["__metadata__"]["surefix"];
            let mut inner: Value = serde_json::from_str(entry.as_str().unwrap()).unwrap();
            inner["origin"] = serde_json::from_str(origin).unwrap();
            *entry = inner.to_string().into();
        }));
        assert!(text.contains(reason), "{origin}: {text}");
    }
}

fn length_of(file: &[u8]) -> usize {
    u64::from_le_bytes(file[..8].try_into().unwrap()) as usize
}

#[cfg(all(feature = "mmap", target_endian = "little"))]
#[allow(unsafe_code, reason = "only these tests touch their files")]
fn mapped(path: &std::path::Path) -> Map {
    // SAFETY: the file is replaced, never changed in place.
    unsafe { Map::open_mapped(path) }.unwrap()
}

#[cfg(all(feature = "mmap", target_endian = "little"))]
#[test]
fn a_mapped_map_has_segments_origin_and_thumbnails() {
    let segments = Segments::new(20, &[5, 12]).unwrap().with_closed(&[1]).unwrap();
    let map = part(0, 20, Metric::Cosine).with_segments(segments).unwrap();
    let (_folder, path) = file(&map);
    let opened = mapped(&path);
    assert_eq!(opened.segments(), map.segments());
    assert_eq!(opened.positions(), map.positions());
    let pictures = [&map, &opened].map(|map| map.thumbnails().and_then(|all| all.get(17)).unwrap());
    assert_eq!(pictures[0], pictures[1]);
    assert_eq!(bytes(&opened), bytes(&map));
    opened.verify().unwrap();
    let kept = [1, 2, 3, 17].as_slice();
    assert_eq!(bytes(&opened.keep(kept).unwrap()), bytes(&map.keep(kept).unwrap()));
}

#[test]
fn a_thousand_routes_are_one_map() {
    let rows = numbers(Dtype::U8, 500_000 * 2, 4);
    let breaks: Vec<usize> = (1..1000).map(|index| index * 500).collect();
    let whole = Map::from_descriptors(rows.clone(), 2, Metric::Manhattan).unwrap();
    let town = whole.clone().with_segments(Segments::new(500_000, &breaks).unwrap()).unwrap();
    let routes: Vec<Map> =
        (0..1000).map(|index| whole.slice(index * 500..(index + 1) * 500).unwrap()).collect();
    let joined = Map::join(&routes.iter().collect::<Vec<_>>()).unwrap();
    assert_eq!(joined.segments(), town.segments());
    let file = joined.to_bytes().unwrap();
    assert!(file == town.to_bytes().unwrap());
    // 8 bytes a break, and a header as long as ever.
    assert!(file.len() - whole.to_bytes().unwrap().len() < 8 * 999 + 256);
    let opened = Map::from_bytes(&file).unwrap();
    let query = numbers(Dtype::U8, 2, 5);
    let bits = |map: &Map| -> Vec<u32> {
        map.distances(&query).unwrap().into_iter().map(f32::to_bits).collect()
    };
    assert!(bits(&joined) == bits(&whole) && bits(&opened) == bits(&whole));
}

#[test]
fn a_hundred_thousand_segments_fit_into_a_file() {
    let places = 400_000;
    let breaks: Vec<usize> = (1..100_000).map(|index| index * 4).collect();
    let closed: Vec<usize> = (0..100_000).collect();
    let links: Vec<(usize, usize)> =
        (0..100_000).map(|at| (at * 4, (at * 4 + 8) % 400_000)).collect();
    let segments = Segments::new(places, &breaks).unwrap().with_closed(&closed).unwrap();
    let segments = segments.with_links(&links).unwrap();
    let map = Map::from_descriptors(numbers(Dtype::U8, places, 1), 1, Metric::Manhattan).unwrap();
    let map = map.with_segments(segments).unwrap();
    let file = bytes(&map);
    assert!(length_of(&file) < 2048);
    assert_eq!(Map::from_bytes(&file).unwrap().segments(), map.segments());
}

#[test]
fn thumbnails_stay_if_all_have_them() {
    let [one, other] = [part(0, 4, Metric::Manhattan), part(4, 5, Metric::Manhattan)];
    let small = other.clone().with_thumbnails(Thumbnails::new(1, 1, vec![0; 5]).unwrap()).unwrap();
    let whole = Map::join(&[&one, &other]).unwrap();
    assert_eq!(whole.thumbnails().map(|all| (all.len(), all.size())), Some((9, (3, 2))));
    assert!(Map::join(&[&one, &small]).unwrap().thumbnails().is_none());
    let (_folder, path) = file(&one);
    let before = fs::read(&path).unwrap();
    let error = Map::append(&path, &small).unwrap_err().to_string();
    assert!(error.contains("expected thumbnails of 3 x 2, got thumbnails of 1 x 1"), "{error}");
    assert_eq!(fs::read(&path).unwrap(), before);
    Map::append(&path, &other).unwrap();
    let grown = one.extended(&other).unwrap();
    assert_eq!(fs::read(&path).unwrap(), bytes(&grown));
    assert_eq!(bits_of(&grown), bits_of(&whole));
    for (width, height, pixels) in [(0, 2, 4), (2, 0, 4), (3, 2, 7), (usize::MAX, 2, 4)] {
        assert!(matches!(
            Thumbnails::new(width, height, vec![0; pixels]),
            Err(Error::Shape { what: "thumbnails", .. })
        ));
    }
    assert!(one.with_thumbnails(Thumbnails::new(3, 2, vec![0; 6]).unwrap()).is_err());
}
