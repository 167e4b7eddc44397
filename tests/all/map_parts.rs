//! Parts of maps, in one piece or several, and the limits of what a map says of itself.

use std::sync::Arc;

use surefix::evaluate::correlation_time;
use surefix::{
    Channels, Config, Error, Extras, Image, ImageSource, Input, Localizer, LoopCloser, LoopConfig,
    Map, Metric, Post, Sad, Segments, Step, Thumbnails, Values, View, quiet,
};

/// Rows of two bytes, each with the number of its place.
fn numbered(places: usize) -> Map {
    let rows: Vec<u8> = (0..places).flat_map(|place| [place as u8, (place / 256) as u8]).collect();
    Map::from_descriptors(rows, 2, Metric::Manhattan).unwrap()
}

fn bytes(map: &Map) -> &[u8] {
    let View::U8(rows) = map.descriptors() else { panic!("bytes") };
    rows
}

fn places(map: &Map) -> Vec<usize> {
    let place = |row: &[u8; 2]| usize::from(row[0]) + 256 * usize::from(row[1]);
    bytes(map).as_chunks::<2>().0.iter().map(place).collect()
}

#[test]
fn parts_of_one_map_are_in_one_piece_if_they_follow_each_other() {
    let map = numbered(600);
    let join = |parts: &[std::ops::Range<usize>]| {
        let parts: Vec<Map> = parts.iter().map(|part| map.slice(part.clone()).unwrap()).collect();
        Map::join(&parts.iter().collect::<Vec<_>>()).unwrap()
    };
    for parts in [
        vec![0..300, 300..600],
        vec![0..300, 400..600],
        vec![300..600, 0..300],
        vec![0..300, 0..300],
        vec![10..20, 20..500, 520..530],
    ] {
        assert_eq!(places(&join(&parts)), parts.into_iter().flatten().collect::<Vec<_>>());
    }
    // Memory is shared as long as it can be.
    assert_eq!(bytes(&join(&[5..300, 300..600])).as_ptr(), bytes(&map)[10..].as_ptr());
    // Rows of another map may begin with the number at which the first map's end.
    let (one, other) = (map.slice(0..10).unwrap(), numbered(30).slice(10..30).unwrap());
    assert_eq!(places(&Map::join(&[&one, &other]).unwrap()), (0..30).collect::<Vec<_>>());
}

/// Runs of 16 places and more on average are shared, shorter ones copied.
#[test]
fn long_runs_of_places_are_kept_without_a_copy() {
    let map = numbered(600);
    let keep = |kept: Vec<usize>| {
        let of_it = map.keep(&kept).unwrap();
        assert_eq!(places(&of_it), kept);
        of_it
    };
    // One run lies in one piece if it is shared.
    for (first, count, shared) in [(7, 16, true), (7, 400, true), (7, 15, false), (7, 2, false)] {
        let kept = keep((first..first + count).collect());
        assert_eq!(bytes(&kept).as_ptr() == bytes(&map)[2 * first..].as_ptr(), shared, "{count}");
    }
    // Of two runs, the first is one piece of its own.
    for (each, shared) in [(8, false), (9, false), (15, false), (16, true), (100, true)] {
        let kept = keep((0..each).chain(300..300 + each).collect());
        let first = kept.slice(0..each).unwrap();
        assert_eq!(bytes(&first).as_ptr() == bytes(&map).as_ptr(), shared, "{each}");
    }
}

#[test]
fn a_slice_is_a_range_of_at_least_two_places() {
    let map = numbered(6);
    for (start, end) in [(0, 6), (2, 4), (4, 6)] {
        assert_eq!(places(&map.slice(start..end).unwrap()), (start..end).collect::<Vec<_>>());
    }
    for (start, end) in [(3, 3), (3, 4), (0, 0), (6, 6)] {
        let refused = map.slice(start..end);
        assert!(matches!(refused, Err(Error::TooFewPlaces { .. })), "{start}..{end}: {refused:?}");
    }
    for (start, end) in [(5, 3), (4, 3), (0, 7), (7, 7), (5, 7)] {
        let refused = map.slice(start..end);
        let named = matches!(refused, Err(Error::Option { name: "places", .. }));
        assert!(named, "{start}..{end}: {refused:?}");
    }
}

/// A snapshot is of its map's segments and post-processing, and not of other ones.
#[test]
fn maps_that_are_cut_or_processed_otherwise_are_other_maps() {
    let rows: Vec<f32> = (0..60).map(|at| (at * at % 17) as f32).collect();
    let map = Map::from_descriptors(rows, 6, Metric::Euclidean).unwrap();
    let localizer = |map: &Map| {
        let mut localizer = Localizer::new(Arc::new(map.clone()), Config::default()).unwrap();
        localizer.push_descriptor(&[0.5_f32; 6][..]).unwrap();
        localizer.snapshot().unwrap()
    };
    // Its mark is known before it is cut.
    localizer(&map);
    let cut =
        |breaks: &[usize]| map.clone().with_segments(Segments::new(10, breaks).unwrap()).unwrap();
    let post = |scale: f32| {
        let rows: Vec<f32> = (0..60).map(|at| scale * (at * 7 % 11) as f32).collect();
        Post::fit(&[Step::Standardize], &rows, 6).unwrap().0
    };
    let with = |scale: f32| map.clone().with_post(post(scale)).unwrap();
    let maps = [map.clone(), cut(&[4]), cut(&[5]), cut(&[4, 5]), with(1.0), with(2.0)];
    for (own, one) in maps.iter().enumerate() {
        let snapshot = localizer(one);
        for (index, other) in maps.iter().enumerate() {
            match Localizer::restore(Arc::new(other.clone()), &snapshot, None) {
                Ok(_) => assert_eq!(index, own),
                Err(refused) => {
                    assert_ne!(index, own, "{refused}");
                    let refused = refused.to_string();
                    assert!(refused.contains("taken on another map"), "{refused}");
                }
            }
        }
    }
}

#[test]
fn images_have_two_sides() {
    let map = numbered(4);
    for size in [None, Some((1, 1)), Some((640, 480)), Some((usize::MAX, usize::MAX))] {
        assert_eq!(map.clone().with_image_size(size).unwrap().image_size(), size);
    }
    for size in [(0, 0), (0, 480), (640, 0)] {
        let refused = map.clone().with_image_size(Some(size));
        assert!(matches!(refused, Err(Error::Option { name: "image_size", .. })), "{size:?}");
    }
}

#[test]
fn a_recipe_has_a_mebibyte_at_most() {
    let map = numbered(4);
    let recipe = |bytes: usize| {
        let text = format!(r#"{{"name": "{}"}}"#, "x".repeat(bytes - 12));
        assert_eq!(text.len(), bytes);
        text
    };
    let longest = recipe(1 << 20);
    let known = map.clone().with_learned_recipe(&longest).unwrap();
    assert_eq!(known.learned_recipe(), Some(&longest[..]));
    assert!(map.with_learned_recipe(&recipe((1 << 20) + 1)).is_err());
}

/// The longer side has 96 pixels, the other one its share of them, rounded.
#[test]
fn thumbnails_have_the_shape_of_their_images() {
    for size in [(96, 96), (640, 480), (480, 640), (1920, 1080), (97, 1), (1, 1), (7, 5), (1000, 3)]
    {
        let (width, height) = Thumbnails::size_for(size);
        let scale = 96.0 / size.0.max(size.1) as f64;
        let side = |side: usize| ((side as f64 * scale).round() as usize).max(1);
        assert_eq!((width, height), (side(size.0), side(size.1)), "{size:?}");
        assert_eq!(width.max(height), 96);
    }
    assert_eq!(Thumbnails::size_for((0, 0)), (1, 1));
}

/// Zeros before post-processing are what it makes of them in the map.
#[test]
fn a_place_of_zeros_shows_nothing_after_post_processing() {
    const DIM: usize = 10;
    let mut raw: Vec<f32> = (0..12 * DIM).map(|at| 1.0 + (at * at % 23) as f32).collect();
    raw[3 * DIM..4 * DIM].fill(0.0);
    let (post, rows) = Post::fit(&[Step::Standardize], &raw, DIM).unwrap();
    assert!(rows[3 * DIM..4 * DIM].iter().all(|&x| x != 0.0));
    // One that is all zeros afterwards was not so before.
    let mut rows = rows;
    rows[7 * DIM..8 * DIM].fill(0.0);
    let map = Map::from_descriptors(rows.clone(), DIM, Metric::Euclidean).unwrap();
    assert_eq!(map.blank(), [7]);
    let map = Map::from_descriptors(rows, DIM, Metric::Euclidean).unwrap();
    assert_eq!(map.with_post(post).unwrap().blank(), [3]);
}

/// On a map of nothing else, the distances to places that show nothing have the mean of all.
#[test]
fn if_all_places_show_nothing_all_count() {
    const DIM: usize = 9;
    let rows: Vec<f32> = (0..10).flat_map(|place| [f32::from(place < 5_u8); DIM]).collect();
    let map = Map::from_descriptors(rows, DIM, Metric::Manhattan).unwrap();
    assert_eq!(map.blank(), (0..10).collect::<Vec<_>>());
    let query: &[f32] = &[3.0; DIM];
    assert_eq!(map.distances(query).unwrap(), [2.5; 10]);
}

/// A traverse that is kept in part is the traverse of the places that are kept.
#[test]
fn the_rows_of_a_traverse_are_kept_with_their_places() {
    let rows = |seed: usize| -> Vec<f32> {
        (0..40 * 3).map(|at| ((at * 31 + seed * 17) % 101) as f32).collect()
    };
    let map = |seed: usize| Map::from_descriptors(rows(seed), 3, Metric::Manhattan).unwrap();
    let (summer, winter) = (map(1), map(2));
    let all: Vec<_> = (0..40).map(|place| (place % 7 != 3).then_some(place)).collect();
    let both = summer.add_traverse(&winter, &all, "winter").unwrap();
    for kept in [
        (5..30).collect::<Vec<_>>(),
        (0..40).step_by(2).collect(),
        vec![0, 1, 2, 3, 4, 9, 10, 11, 30, 31],
        vec![3, 10, 12],
    ] {
        let of_it = both.keep(&kept).unwrap();
        let own: Vec<_> = (0..kept.len()).map(|at| (kept[at] % 7 != 3).then_some(at)).collect();
        let (first, second) = (summer.keep(&kept).unwrap(), winter.keep(&kept).unwrap());
        let expected = first.add_traverse(&second, &own, "winter").unwrap();
        let query: &[f32] = &[20.0, 50.0, 70.0];
        assert_eq!(of_it.distances(query).unwrap(), expected.distances(query).unwrap());
        let rows = |map: &Map| map.traverses().map(|one| one.rows()).collect::<Vec<_>>();
        assert_eq!(rows(&of_it), rows(&expected));
    }
    let labelled = |label: &str| summer.add_traverse(&winter, &all, label).is_ok();
    assert!(labelled("") && labelled(&"x".repeat(1024)));
    assert!(!labelled("\0") && !labelled("a\0b") && !labelled(&"x".repeat(1025)));
}

#[test]
fn a_map_has_65_traverses_at_most() {
    let drive = |label: &str| {
        let rows = Values::U8(vec![1, 2]);
        let map = Map::from_descriptors(rows, 1, Metric::Manhattan).unwrap();
        map.add_traverse(&map, &[Some(0), Some(1)], label).unwrap()
    };
    let (one, alone) =
        (drive("0"), Map::from_descriptors(vec![1_u8, 2], 1, Metric::Manhattan).unwrap());
    let with = |count: usize, labels: &str| {
        (1..count).fold(one.clone(), |map, index| {
            map.add_traverse(&alone, &[Some(0), None], &format!("{labels}{index}")).unwrap()
        })
    };
    let full = with(64, "");
    assert_eq!(full.traverses().len(), 65);
    let more = full.add_traverse(&alone, &[Some(0), None], "more");
    assert!(matches!(more, Err(Error::Option { name: "traverse", .. })));
    // Joined, those of one label count once.
    let (half, same, other) = (with(40, "a"), with(40, "a"), with(40, "b"));
    assert_eq!(Map::join(&[&half, &same]).unwrap().traverses().len(), 41);
    assert!(matches!(Map::join(&[&half, &other]), Err(Error::Append { .. })));
    let few = with(25, "b");
    assert_eq!(Map::join(&[&half, &few]).unwrap().traverses().len(), 65);
    assert!(matches!(Map::join(&[&half, &with(26, "b")]), Err(Error::Append { .. })));
}

/// A tunnel over the seam of a closed segment opens it, with a link across.
#[test]
fn a_tunnel_over_a_seam_opens_a_closed_segment() {
    const DIM: usize = 10;
    let dark = |dark: &[usize]| {
        let rows: Vec<f32> = (0..20 * DIM)
            .map(|at| if dark.contains(&(at / DIM)) { 0.0 } else { 1.0 + (at * at % 23) as f32 })
            .collect();
        let map = Map::from_descriptors(rows, DIM, Metric::Euclidean).unwrap();
        map.with_segments(Segments::one(20).with_closed(&[0]).unwrap()).unwrap()
    };
    for (places, opens) in [
        (&[0, 1, 2, 3, 4][..], true),
        (&[15, 16, 17, 18, 19], true),
        (&[0, 1, 17, 18, 19], true),
        (&[0, 1, 2, 3], false),
        (&[0, 1, 18, 19], false),
        (&[19], false),
    ] {
        let left = dark(places).without_blank().unwrap();
        let (segment, links) = (*left.segments().iter().next().unwrap(), left.segments().links());
        assert_eq!((left.places(), segment.len()), (20 - places.len(), 20 - places.len()));
        assert_eq!(segment.closed, !opens, "{places:?}");
        let across = [(left.places() - 1, 0)];
        assert_eq!(links, if opens { &across[..] } else { &[] });
    }
}

/// In units of a tile's deviation, of which a byte has 32.
#[test]
fn a_distance_of_sad_descriptors_is_in_units_of_their_deviation() {
    struct Drive;
    impl ImageSource for Drive {
        fn len(&self) -> usize {
            5
        }

        fn load(&self, index: usize) -> Result<Image, Error> {
            let pixels = (0..64 * 32).map(|at| ((at * at + 31 * at * index) % 251) as u8).collect();
            Image::new(64, 32, Channels::Grey, pixels)
        }
    }
    let map = Map::from_images(&Drive, Sad::default(), &mut quiet).unwrap();
    let View::U8(rows) = map.descriptors() else { panic!("bytes") };
    let rows: Vec<&[u8]> = rows.chunks_exact(map.dim()).collect();
    let of = |one: &[u8], other: &[u8]| {
        let sum: u64 = one.iter().zip(other).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        (sum as f64 / (32.0 * map.dim() as f64)) as f32
    };
    for query in &rows {
        let expected: Vec<f32> = rows.iter().map(|row| of(row, query)).collect();
        assert_eq!(map.distances(*query).unwrap(), expected);
    }
}

/// The map of a drive that is under way has the distances of a map of its first frames.
#[test]
fn a_growing_map_has_the_distances_of_a_map() {
    for (metric, dim) in [Metric::Manhattan, Metric::Euclidean, Metric::Cosine]
        .into_iter()
        .flat_map(|metric| [(metric, 3), (metric, 8), (metric, 9), (metric, 17)])
    {
        let row = |frame: usize| -> Vec<f32> {
            (0..dim).map(|at| ((frame * 31 + at * at * 7 + 3) % 19) as f32 - 4.5).collect()
        };
        let mut config = LoopConfig::default();
        config.exclude = 2;
        let mut closer = LoopCloser::of_descriptors(dim, metric, config).unwrap();
        for frame in 0..30 {
            closer.push(Input::Descriptor(View::F32(&row(frame))), None).unwrap();
            let places = closer.distances().len();
            if places < 2 {
                continue;
            }
            let rows: Vec<f32> = (0..places).flat_map(row).collect();
            let map = Map::from_descriptors(rows, dim, metric).unwrap();
            let expected = map.distances(&row(frame)[..]).unwrap();
            assert_eq!(closer.distances(), expected, "{metric}, {dim} numbers, frame {frame}");
        }
        // Up to 8 zeros have no direction, more show nothing.
        let zeros = closer.push(Input::Descriptor(View::F32(&vec![0.0; dim])), None);
        if metric == Metric::Cosine && dim <= 8 {
            assert!(matches!(zeros, Err(Error::NoDirection { .. })), "{zeros:?}");
        } else {
            assert_eq!(zeros.unwrap().blank, dim > 8);
        }
    }
}

/// A drive whose images have names, one of them of another size.
struct Named {
    mixed: bool,
}

impl ImageSource for Named {
    fn len(&self) -> usize {
        6
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        let width = if index == 3 { 96 } else { 64 };
        let pixels = (0..width * 32).map(|at| ((at * at + 31 * index) % 251) as u8).collect();
        Image::new(width, 32, Channels::Grey, pixels)
    }

    fn name(&self, index: usize) -> String {
        format!("picture {index}")
    }

    fn has_mixed_sizes(&self) -> bool {
        self.mixed
    }
}

/// With pictures of its places or without.
#[test]
fn an_image_of_another_size_is_named() {
    for extras in [Extras::default(), Extras::default().thumbnails()] {
        let made =
            |mixed| Map::from_images_with(&Named { mixed }, Sad::default(), extras, &mut quiet);
        let refused = made(false);
        let Err(Error::ImageSize { name, .. }) = refused else { panic!("{refused:?}") };
        assert_eq!(name, "picture 3");
        let map = made(true).unwrap();
        let names: Vec<String> = (0..6).map(|index| format!("picture {index}")).collect();
        assert_eq!((map.places(), map.names()), (6, Some(&names[..])));
    }
}

/// The sum of autocorrelations ends with the first pair that is 0.
#[test]
fn a_pair_of_lags_that_is_0_ends_the_correlation_time() {
    let values = [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 0.0, 1.0, 1.0, 2.0, 2.0, 2.0];
    let pair = |lag: usize| {
        let each =
            |lag: usize| values.iter().zip(&values[lag..]).map(|(a, b)| (a - 1.0) * (b - 1.0));
        (each(lag).sum::<f64>() + each(lag + 1).sum::<f64>()) / 8.0
    };
    let first = (0..6).map(|index| pair(2 * index)).position(|pair| pair == 0.0).unwrap();
    let later = (first..6).map(|index| pair(2 * index)).take_while(|&pair| pair >= 0.0);
    assert!(later.sum::<f64>() > 0.0);
    let sum = (0..first).map(|index| pair(2 * index)).sum::<f64>();
    assert_eq!(correlation_time(&values), Some(2.0 * sum - 1.0));
}

/// The image of a place that shows nothing, known to one of the traverses alone, shows nothing again.
#[test]
fn each_traverse_knows_what_shows_nothing() {
    const DIM: usize = 10;
    let drive = |seed: usize, dark: bool| {
        let rows: Vec<f32> = (0..12 * DIM)
            .map(|at| {
                let shown = 2.0 + ((at * at + seed * at) % 23) as f32;
                if dark && at < 5 * DIM { 0.5 } else { shown }
            })
            .collect();
        Map::from_descriptors(rows, DIM, Metric::Euclidean).unwrap()
    };
    let all: Vec<_> = (0..12).map(Some).collect();
    for dark in [
        &[true, false][..],
        &[false, true],
        &[true, false, false],
        &[false, true, false],
        &[false, false, true],
    ] {
        let drives: Vec<Map> =
            dark.iter().map(|&dark| drive(if dark { 3 } else { 5 }, dark)).collect();
        let mut map = drives[0].clone();
        for further in &drives[1..] {
            map = map.add_traverse(further, &all, "").unwrap();
        }
        assert!(map.blank().is_empty());
        let again = map.distances(&[0.5_f32; DIM][..]).unwrap();
        assert!(again.iter().all(|&d| d == again[0] && d > 1.0), "{dark:?}: {again:?}");
        let other = map.distances(&[4.0_f32; DIM][..]).unwrap();
        assert!(other.iter().any(|&d| d != other[0]), "{dark:?}: {other:?}");
    }
}
