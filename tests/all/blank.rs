//! What shows nothing is never trusted, and draws nothing to itself.

use std::fs;
use std::ops::ControlFlow;
use std::sync::Arc;

use crate::cases::{
    all_bits, bits, by_blocks, cases, columns, kind, numbers, route, sealed, tells,
};
use crate::random::SplitMix64;
use proptest::prelude::*;
use proptest::sample::select;
use surefix::{
    Channels, Config, Drive, Dtype, Error, Fix, Given, Image, ImageView, Input, Localizer,
    LoopCloser, LoopConfig, Map, Matcher, Metric, Motion, Sad, Values, View, match_descriptors,
    match_fused,
};
use tempfile::tempdir;

/// A camera's image: noise, or, of the kinds 1 to 4, nothing.
fn image(kind: usize, seed: u64) -> Image {
    let mut dice = SplitMix64(seed);
    let pixel = |at: usize| match kind {
        1 => 0,
        2 => 255,
        // A lens cap: grey, and a sensor's noise.
        3 => 90 + dice.below(5) as u8,
        // A clock in the corner.
        4 if at % 128 < 16 && at < 128 * 8 => dice.below(256) as u8,
        4 => 7,
        _ => dice.below(256) as u8,
    };
    Image::new(128, 64, Channels::Grey, (0..128 * 64).map(pixel).collect()).unwrap()
}

fn quietly(_done: usize, _total: usize) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn drive(kinds: &[usize], seed: u64) -> Vec<Image> {
    kinds.iter().enumerate().map(|(at, &kind)| image(kind, seed + at as u64)).collect()
}

fn ready(rows: &[[f32; 10]]) -> Map {
    Map::from_descriptors(rows.concat(), 10, Metric::Euclidean).unwrap()
}

#[test]
fn images_without_content_are_named_whatever_they_show() {
    for dtype in [Dtype::U8, Dtype::F32] {
        let sad = Sad::new((64, 32), 8, dtype).unwrap();
        let images = drive(&[0, 1, 2, 0, 3, 4, 0], 1);
        let map = Map::from_images(&images, sad, &mut quietly).unwrap();
        assert_eq!(map.blank(), [1, 2, 4, 5]);
        let left = map.without_blank().unwrap();
        assert_eq!((left.places(), left.blank()), (3, &[][..]));
        assert_eq!(left.names().unwrap(), ["0", "3", "6"]);
        let rows = [0, 3, 6].map(|place| map.descriptors().row(place, map.dim()).unwrap());
        for (place, row) in rows.into_iter().enumerate() {
            assert_eq!(left.descriptors().row(place, left.dim()), Some(row));
        }
    }
    let sad = Sad::default();
    let dark = Map::from_images(&drive(&[1, 0, 2], 1), sad, &mut quietly).unwrap();
    assert!(matches!(dark.without_blank(), Err(Error::TooFewPlaces { got: 1, .. })));
    let bright = Map::from_images(&drive(&[0; 3], 1), sad, &mut quietly).unwrap();
    assert_eq!(bright.without_blank().unwrap().descriptors(), bright.descriptors());
}

#[test]
fn ready_descriptors_show_nothing_if_they_are_zeros_or_shared_by_five() {
    let row = |seed| -> [f32; 10] { std::array::from_fn(|at| (at as f32 + seed) % 7.0) };
    let mut rows: Vec<[f32; 10]> = (0..12).map(|seed| row(seed as f32 / 2.0)).collect();
    (rows[3], rows[7]) = ([0.0; 10], [-0.0; 10]);
    for place in [0, 2, 5, 11] {
        rows[place] = row(100.5);
    }
    assert_eq!(ready(&rows).blank(), [3, 7], "four places may look alike");
    rows[8] = row(100.5);
    assert_eq!(ready(&rows).blank(), [0, 2, 3, 5, 7, 8, 11]);
    assert_eq!(ready(&rows).without_blank().unwrap().places(), 5);
    // Points of a small space coincide, and one of them is the origin.
    let small = Map::from_descriptors(vec![0.0_f32; 80], 8, Metric::Euclidean).unwrap();
    assert_eq!(small.blank(), [0; 0]);
}

/// Eight zeros are a point without a direction, nine show nothing.
#[test]
fn zeros_have_no_direction_in_a_small_space() {
    for (dim, taken) in [(8, false), (9, true)] {
        let mut rows = vec![0.5_f32; 3 * dim];
        rows[dim..2 * dim].fill(0.0);
        let map = Map::from_descriptors(rows, dim, Metric::Cosine);
        assert_eq!(map.is_ok(), taken, "a map of rows of {dim}");
        let mut closer = LoopCloser::of_descriptors(dim, Metric::Cosine, LoopConfig::default());
        let place = closer.as_mut().unwrap().push_descriptor(&vec![0.0_f32; dim][..]);
        assert_eq!(place.is_ok(), taken, "a place of {dim} numbers");
    }
}

#[test]
fn the_file_knows_the_list_however_it_was_made() {
    let folder = tempdir().unwrap();
    let [whole, parts, built] = ["whole", "parts", "built"].map(|name| folder.path().join(name));
    let (sad, kinds) = (Sad::default(), [0, 1, 0, 3, 0, 0, 2, 0]);
    // Places 4 and 5 and those after them: one image, five times.
    let mut images = drive(&[&kinds[..], &[0, 4, 0, 0, 0]].concat(), 1);
    for place in [4, 5, 8, 10, 12] {
        images[place] = image(0, 77);
    }
    let expected = [1, 3, 4, 5, 6, 8, 9, 10, 12];
    let map = |images: &[Image]| Map::from_images(images, sad, &mut quietly).unwrap();
    let (all, first, more) = (map(&images), map(&images[..8]), map(&images[8..]));
    assert_eq!((first.blank(), more.blank()), (&[1, 3, 6][..], &[1][..]));
    assert_eq!((all.blank(), all.slice(0..8).unwrap().blank()), (&expected[..], first.blank()));
    assert_eq!(first.extended(&more).unwrap().blank(), expected);
    all.save(&whole).unwrap();
    first.save(&parts).unwrap();
    Map::append(&parts, &more).unwrap();
    Map::build(&built, &images[..8], sad, None, &mut quietly).unwrap();
    assert_eq!(Map::open(&built).unwrap().blank(), first.blank());
    Map::append_images(&built, &images[8..], None, &mut quietly).unwrap();
    for path in [&parts, &built] {
        assert_eq!(Map::open(path).unwrap().blank(), expected);
        #[cfg(all(feature = "mmap", target_endian = "little"))]
        #[allow(unsafe_code)]
        // SAFETY: the file is not changed.
        let mapped = unsafe { Map::open_mapped(path) };
        #[cfg(all(feature = "mmap", target_endian = "little"))]
        assert_eq!(mapped.unwrap().blank(), expected);
    }
    assert!(fs::read(&whole).unwrap() == fs::read(&built).unwrap(), "to the byte");
    // A file of another program does not say, and one that says nonsense is refused.
    let bytes = all.to_bytes().unwrap();
    let renamed = |from: &str, to: &str| {
        let at = bytes.windows(from.len()).position(|here| here == from.as_bytes()).unwrap();
        let mut bytes = bytes.clone();
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        bytes
    };
    let silent = sealed(renamed("\"blank\"", "\"other\""));
    assert_eq!(Map::from_bytes(&silent).unwrap().blank(), expected);
    let flags = [0_u8, 1, 0, 1, 1, 1, 1, 0, 1, 1, 1, 0, 1];
    let at = bytes.windows(flags.len()).position(|here| here == flags).unwrap();
    let mut wrong = bytes.clone();
    wrong[at] = 2;
    let refused = Map::from_bytes(&sealed(wrong)).unwrap_err().to_string();
    assert!(refused.contains("blank: expected (13), 0 or 1 for each place"), "{refused}");
}

/// The distances as they should be, place by place.
fn quiet(raw: &[f32], blank: &[usize], nothing: bool) -> Vec<f32> {
    let others = (0..raw.len()).filter(|place| !blank.contains(place));
    let others: Vec<(usize, f64)> = others.map(|place| (place, f64::from(raw[place]))).collect();
    let mean = (by_blocks(&others) / others.len() as f64) as f32;
    let said = |place: usize| if nothing || blank.contains(&place) { mean } else { raw[place] };
    (0..raw.len()).map(said).collect()
}

/// The mean of many places is that of the sums of their blocks.
#[test]
fn blank_places_of_several_blocks_have_the_mean_distance() {
    for n in [4095, 4096, 4097, 9000] {
        let Values::F32(mut rows) = numbers(Dtype::F32, n * 9, n as u64) else { unreachable!() };
        let blank: Vec<usize> =
            [0, 7, 4094, 4095, 4096, 8191].into_iter().filter(|&at| at < n).collect();
        for &place in &blank {
            rows[place * 9..][..9].fill(0.0);
        }
        let map = Map::from_descriptors(rows.clone(), 9, Metric::Euclidean).unwrap();
        let query = &rows[9..18];
        let raw: Vec<f32> = rows
            .chunks(9)
            .map(|row| {
                let squares = row.iter().zip(query).map(|(a, b)| f64::from(a - b).powi(2));
                squares.sum::<f64>().sqrt() as f32
            })
            .collect();
        let got = map.distances(query).unwrap();
        assert_eq!(map.blank(), blank);
        assert_eq!(got, quiet(&raw, &blank, false));
        // A drive more changes no distance if it shows the same.
        let same = map.add_traverse(&map, &(0..n).map(Some).collect::<Vec<_>>(), "").unwrap();
        for (place, (one, both)) in got.iter().zip(&same.distances(query).unwrap()).enumerate() {
            assert!((one - both).abs() <= if blank.contains(&place) { 1e-6 } else { 0.0 });
        }
        assert!(map.distances(&[0.0; 9][..]).unwrap().windows(2).all(|pair| pair[0] == pair[1]));
    }
}

proptest! {
    #![proptest_config(cases(200))]

    /// Streams and batches, alone and fused, with a track and without; queries of zeros among them.
    #[test]
    fn places_and_queries_of_nothing_have_the_mean_distance(
        (n, config) in route(3..40), m in 1..30_usize, dim in 9..20_usize, seed: u64,
        metric in select(vec![Metric::Manhattan, Metric::Euclidean, Metric::Cosine]),
    ) {
        let mut dice = SplitMix64(seed);
        let Values::F32(mut rows) = numbers(Dtype::F32, n * dim, seed) else { unreachable!() };
        let Values::F32(mut queries) = numbers(Dtype::F32, m * dim, !seed) else { unreachable!() };
        let blank: Vec<usize> = (0..n - 2).filter(|_| dice.below(4) == 0).collect();
        let dark: Vec<usize> = (0..m).filter(|_| dice.below(4) == 0).collect();
        // Two whole places are left: the least that a mean is made of.
        for place in &blank {
            rows[place * dim..][..dim].fill(0.0);
        }
        for query in &dark {
            queries[query * dim..][..dim].fill(0.0);
        }
        let map = Arc::new(Map::from_descriptors(rows.clone(), dim, metric)?);
        prop_assert_eq!(map.blank(), &blank[..]);
        let mut localizer = Localizer::new(Arc::clone(&map), config.clone())?;
        let mut matcher = Matcher::new(n, config.clone())?;
        let mut stream = Vec::new();
        for (query, row) in queries.chunks(dim).enumerate() {
            let given = Given::default().trusted(true);
            let fix = localizer.push_descriptor_with(row, given)?;
            let column = localizer.distances().to_vec();
            prop_assert_eq!(&column, &map.distances(row)?);
            let nothing = dark.contains(&query);
            prop_assert_eq!((fix.blank, fix.trusted), (nothing, !nothing));
            prop_assert!(nothing || !blank.contains(&fix.single.place));
            if !nothing {
                // Without zeros among the rows, the distances are those as they come.
                let raw = rows.chunks(dim).map(|row| if row.iter().all(|&x| x == 0.0) { vec![0.5; dim] } else { row.to_vec() });
                let raw = Map::from_descriptors(raw.collect::<Vec<_>>().concat(), dim, metric)?;
                let raw = if raw.blank().is_empty() { raw.distances(row)? } else { column.clone() };
                prop_assert_eq!(&column, &quiet(&raw, &blank, false));
            }
            prop_assert_eq!(bits(&fix), bits(&matcher.push_with(&column, given)?), "query {}", query);
            stream.push(fix);
        }
        let words = vec![true; m];
        let drive = || Drive::default().trusted(&words);
        let run = match_descriptors(&map, &queries, &config, drive(), &mut quietly)?;
        prop_assert_eq!(all_bits(&run.fixes), all_bits(&stream));
        let twins = [Arc::clone(&map), Arc::clone(&map)];
        let views = [View::F32(&queries), View::F32(&queries)];
        let fused = match_fused(&twins, &views, &config, drive(), &mut quietly)?;
        prop_assert!(dark.iter().all(|&query| fused.fixes[query].blank && !fused.fixes[query].trusted));
    }

    /// A query that says nothing says the same whatever its distances are.
    #[test]
    fn the_number_in_a_constant_column_counts_for_nothing(
        (n, config) in route(2..40), m in 1..40_usize, kind in kind(), seed: u64,
    ) {
        let d = columns(kind, n, m, seed);
        let run = |number: f32| -> Vec<Fix> {
            let mut matcher = Matcher::new(n, config.clone()).unwrap();
            let push = |column: &Vec<f32>| {
                let silent = vec![number; n];
                matcher.push(if tells(column) { column } else { &silent }).unwrap()
            };
            d.iter().map(push).collect()
        };
        let (low, high) = (run(0.0), run(64.0));
        for (query, (low, high)) in low.iter().zip(&high).enumerate() {
            prop_assert_eq!(low.blank, !tells(&d[query]));
            prop_assert!(!low.blank || !low.trusted);
            prop_assert_eq!((low.trusted, low.gradient.place), (high.trusted, high.gradient.place));
            prop_assert_eq!(low.track, high.track);
            let window = query.saturating_sub(config.sequence_length - 1)..=query;
            if d[window].iter().all(|column| tells(column)) {
                prop_assert_eq!(bits(low), bits(high), "beyond the window nothing is left of it");
            }
        }
    }

    #[test]
    fn a_screen_changes_nothing(places in 20..200_usize, blank: bool, seed: u64) {
        let dim = 256;
        let Values::F32(mut rows) = numbers(Dtype::F32, places * dim, seed) else { unreachable!() };
        let near = |place: usize| rows[place * dim..][..dim].iter().map(|x| x + 0.01).collect();
        let mut queries: Vec<Vec<f32>> = (0..12).map(near).collect();
        for query in [0, 3, 4, 9] {
            queries[query].fill(0.0);
        }
        if blank {
            rows[7 * dim..8 * dim].fill(0.0);
        }
        for metric in [Metric::Euclidean, Metric::Cosine] {
            let map = Map::from_descriptors(rows.clone(), dim, metric)?;
            let mut plain = Localizer::new(Arc::new(map.clone()), Config::default())?;
            let mut screened = Localizer::new(Arc::new(map.with_screen(Dtype::I8)?), Config::default())?;
            for (query, row) in queries.iter().enumerate() {
                let (fix, other) = (plain.push_descriptor(row)?, screened.push_descriptor(row)?);
                prop_assert_eq!(bits(&fix), bits(&other));
                prop_assert_eq!(fix.blank, [0, 3, 4, 9].contains(&query));
                prop_assert!(plain.snapshot()? == screened.snapshot()?);
                prop_assert_eq!(plain.distances(), screened.distances());
            }
        }
    }
}

#[test]
fn an_image_without_content_is_never_trusted_nor_evidence() {
    let places = 60;
    let map = Map::from_images(&drive(&vec![0; places], 1), Sad::default(), &mut quietly).unwrap();
    let map = Arc::new(map);
    let kinds: Vec<usize> =
        (0..places).map(|at| if (20..35).contains(&at) { 1 + at % 4 } else { 0 }).collect();
    let images = drive(&kinds, 1);
    for motion in [None, Some(Motion::steady()), Some(Motion::any())] {
        let config = config! { motion };
        let mut localizer = Localizer::new(Arc::clone(&map), config).unwrap();
        let mut before: Option<Fix> = None;
        for (frame, image) in images.iter().enumerate() {
            let fix = localizer.push_image(image.view()).unwrap();
            let dark = kinds[frame] > 0;
            assert_eq!((fix.blank, fix.trusted), (dark, !dark), "frame {frame}");
            if let (true, Some(track), Some(before)) =
                (dark, fix.track, before.and_then(|fix| fix.track))
            {
                assert!(track.confidence <= before.confidence + 1e-9, "nothing new is learnt");
            }
            assert!(dark || fix.single.place == frame);
            // A track begins somewhere, and the gradient's peak needs a few frames.
            assert!(dark || frame < 5 || fix.place == frame, "{} in frame {frame}", fix.place);
            before = Some(fix);
        }
    }
}

#[test]
fn the_image_of_a_blank_place_again_is_blank_itself() {
    // A network that gives some vector for black.
    let Values::F32(mut rows) = numbers(Dtype::F32, 20 * 16, 5) else { unreachable!() };
    for place in 10..15 {
        let (black, later) = rows.split_at_mut(place * 16);
        later[..16].copy_from_slice(&black[..16]);
    }
    for metric in [Metric::Euclidean, Metric::Cosine, Metric::Manhattan] {
        let map = Map::from_descriptors(rows.clone(), 16, metric).unwrap();
        assert_eq!(map.blank(), [0, 10, 11, 12, 13, 14]);
        let mut localizer = Localizer::new(Arc::new(map), Config::default()).unwrap();
        assert!(localizer.push_descriptor(&rows[..16]).unwrap().blank, "{metric}");
        let fix = localizer.push_descriptor(&rows[16..32]).unwrap();
        assert_eq!((fix.blank, fix.single.place), (false, 1));
    }
}

#[test]
fn a_stream_of_nothing_has_no_floor_and_no_anchor() {
    let config = config! { sequence_length: 3 };
    let mut matcher = Matcher::new(5, config).unwrap();
    for frame in 0..6 {
        let fix = matcher.push(&[0.25; 5]).unwrap();
        assert_eq!((fix.blank, fix.trusted, fix.single.place), (true, false, 0));
        assert_eq!(
            fix.sequence.map(|found| (found.score, found.anchors)),
            (frame > 1).then_some((0.25, 0))
        );
        let blob = matcher.snapshot().unwrap();
        matcher = Matcher::restore(&blob, None).unwrap();
    }
    // What comes after is weighted by its own least distance, not by 0.25.
    let fix = matcher.push(&[0.9, 0.8, 0.7, 0.3, 0.8]).unwrap();
    assert!(!fix.blank);
    matcher.snapshot().map(|blob| Matcher::restore(&blob, None).unwrap()).unwrap();
}

#[test]
fn images_and_descriptors_say_the_same() {
    let map = Map::from_images(&drive(&[0, 1, 0, 0], 1), Sad::default(), &mut quietly).unwrap();
    let mut localizer = Localizer::new(Arc::new(map), Config::default()).unwrap();
    let mut other = localizer.clone();
    for kind in [0, 1, 2, 3, 4, 0] {
        let image = image(kind, 9);
        let view: ImageView<'_> = image.view();
        let descriptor = Sad::default().describe(view).unwrap();
        let fix = localizer.push_image(view).unwrap();
        let ready = [Input::Descriptor(descriptor.view())];
        assert_eq!(bits(&fix), bits(&other.push_inputs(&ready, Given::default()).unwrap()));
        assert_eq!(fix.blank, kind > 0);
    }
}
