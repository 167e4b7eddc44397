//! Every kind of bad input, its typed error, and a message that names the expected value, the one
//! that it got and the place.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot be set up has failed"
)]

use std::ops::ControlFlow;
use std::sync::Arc;

use ndarray::Array2;
use surefix::{
    Channels, Config, Drive, Dtype, Error, Floor, Given, Image, ImageView, Localizer, Map, Matcher,
    Metric, Positions, Sad, Values, match_descriptors, match_distances,
};

/// The message holds all of these.
#[track_caller]
fn says(error: &Error, parts: &[&str]) {
    let message = error.to_string();
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
}

#[track_caller]
fn refused<T>(result: Result<T, Error>) -> Error {
    result.map(|_| ()).expect_err("this must be refused")
}

fn go_on(_: usize, _: usize) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn image(width: usize, height: usize, channels: Channels) -> Image {
    let bytes = width * height * channels.count();
    Image::new(width, height, channels, (0..bytes).map(|i| (i * 7) as u8).collect()).unwrap()
}

#[test]
fn a_route_has_two_places_at_least() {
    for places in [0, 1] {
        let error = refused(Matcher::new(places, Config::default()));
        assert!(matches!(error, Error::TooFewPlaces { got, .. } if got == places));
        says(&error, &["expected at least 2 places", &format!("got {places}")]);

        let error = refused(Map::from_descriptors(vec![1_u8; 3 * places], 3, Metric::Manhattan));
        assert!(matches!(error, Error::TooFewPlaces { what: "map", got } if got == places));
        let images = vec![image(16, 16, Channels::Grey); places];
        let error = refused(Map::from_images(&images, Sad::default(), &mut go_on));
        assert!(matches!(error, Error::TooFewPlaces { what: "map", got } if got == places));
        let matrix = Array2::<f32>::zeros((places, 5));
        let error = refused(match_distances(matrix.view(), &Config::default(), Drive::default()));
        assert!(matches!(error, Error::TooFewPlaces { got, .. } if got == places));
    }
}

#[test]
fn every_option_has_its_range() {
    let base = Config::default;
    let cases: Vec<(&str, Config, [&str; 2])> = vec![
        ("sequence_length", config! { base() => sequence_length: 0 }, ["from 1 to 10", "got 0"]),
        (
            "sequence_length",
            config! { base() => sequence_length: 11 },
            ["the number of places", "got 11"],
        ),
        ("smoothing", config! { base() => smoothing: 0 }, ["from 1", "got 0"]),
        (
            "smoothing",
            config! { base() => smoothing: usize::MAX },
            ["from 1 to 65536", "got 18446744073709551615"],
        ),
        ("weight", config! { base() => weight: -0.01 }, ["from 0 to 1", "got -0.01"]),
        ("weight", config! { base() => weight: 1.01 }, ["from 0 to 1", "got 1.01"]),
        ("weight", config! { base() => weight: f64::NAN }, ["from 0 to 1", "got NaN"]),
        ("floor", config! { base() => floor: Floor::Fixed(f64::NAN) }, ["finite", "got NaN"]),
        ("floor", config! { base() => floor: Floor::Fixed(f64::INFINITY) }, ["finite", "got inf"]),
        // Nearer to the end of float32 than to what lies beyond it, but beyond it.
        (
            "floor",
            config! { base() => floor: Floor::Fixed(-340_282_356_779_733_600_000_000_000_000_000_000_000.0) },
            ["finite in float32", "got -34028235677973"],
        ),
        ("floor", config! { base() => floor: Floor::Global }, ["stream", "global"]),
        ("speeds", config! { base() => speeds: vec![] }, ["at least one", "got none"]),
        ("speeds", config! { base() => speeds: vec![1.0, -0.5] }, ["0 or more", "got -0.5"]),
        ("speeds", config! { base() => speeds: vec![f64::NAN] }, ["finite", "got NaN"]),
        ("speeds", config! { base() => speeds: vec![f64::INFINITY] }, ["finite", "got inf"]),
        ("speeds", config! { base() => speeds: vec![9.5] }, ["at most 9 places back", "got 9.5"]),
        ("speeds", config! { base() => speeds: vec![1e300] }, ["at most 9 places back", "got 1"]),
    ];
    for (option, config, parts) in cases {
        let error = refused(Matcher::new(10, config.clone()));
        assert!(
            matches!(error, Error::Option { name, .. } if name == option),
            "{config:?}: {error}"
        );
        says(&error, &[&format!("option `{option}`"), "expected", parts[0], parts[1]]);
        // The same word from all doors; only a batch knows the whole matrix.
        let map = Arc::new(Map::from_descriptors(vec![1_u8; 20], 2, Metric::Manhattan).unwrap());
        assert_eq!(
            refused(Localizer::new(Arc::clone(&map), config.clone())).to_string(),
            error.to_string()
        );
        if config.floor != Floor::Global {
            let batch =
                refused(match_distances(Array2::zeros((10, 3)).view(), &config, Drive::default()));
            assert_eq!(batch.to_string(), error.to_string());
            let batch = refused(match_descriptors(
                &map,
                &Values::U8(vec![]),
                &config,
                Drive::default(),
                &mut |_, _| ControlFlow::Continue(()),
            ));
            assert_eq!(batch.to_string(), error.to_string());
        }
    }
}

#[test]
fn every_option_takes_the_ends_of_its_range() {
    let base = Config::default;
    let cases = [
        config! { base() => sequence_length: 1 },
        config! { base() => sequence_length: 10 },
        config! { base() => weight: 0.0 },
        config! { base() => weight: 1.0 },
        config! { base() => tolerance: usize::MAX },
        config! { base() => floor: Floor::Fixed(f32::MIN.into()) },
        config! { base() => floor: Floor::Fixed(f32::MAX.into()) },
        config! { base() => smoothing: 65_536 },
        config! { base() => speeds: vec![0.0, 9.49] },
        config! { base() => speeds: vec![1e300], sequence_length: 1 },
    ];
    for config in cases {
        let mut matcher = Matcher::new(10, config.clone()).unwrap();
        for _ in 0..12 {
            matcher.push(&[0.5; 10]).unwrap();
        }
    }
}

#[test]
fn distances_are_as_many_as_places_and_finite() {
    let mut matcher = Matcher::new(4, Config::default()).unwrap();
    let error = refused(matcher.push(&[0.5; 3]));
    assert_eq!(error.to_string(), "distances: expected 4 values, got 3");
    for (bad, name) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (f32::NEG_INFINITY, "-inf")] {
        let error =
            refused(matcher.push_with(&[0.5, 0.5, bad, 0.5], Given::default().trusted(true)));
        assert!(matches!(error, Error::NotFinite { row: None, index: 2, .. }));
        assert_eq!(
            error.to_string(),
            format!("distances: expected finite numbers, got {name} at index 2")
        );
    }
    assert_eq!(matcher.frames(), 0);
}

#[test]
fn a_maps_rows_are_whole_finite_and_have_a_direction() {
    let error = refused(Map::from_descriptors(vec![1_u8; 7], 3, Metric::Manhattan));
    assert!(matches!(error, Error::Shape { what: "map", .. }));
    says(&error, &["7 numbers in rows of 3"]);
    refused(Map::from_descriptors(vec![1_u8; 7], 0, Metric::Manhattan));

    let mut rows = vec![1.0_f32; 12];
    rows[7] = f32::NAN;
    let error = refused(Map::from_descriptors(rows.clone(), 3, Metric::Euclidean));
    assert!(matches!(error, Error::NotFinite { row: Some(2), index: 1, .. }));
    says(&error, &["descriptors", "NaN", "row 2, index 1"]);
    let halves: Vec<half::f16> = rows.iter().map(|&x| half::f16::from_f32(x)).collect();
    says(&refused(Map::from_descriptors(halves, 3, Metric::Euclidean)), &["NaN", "row 2, index 1"]);

    rows[6..9].fill(0.0);
    let error = refused(Map::from_descriptors(rows, 3, Metric::Cosine));
    assert!(matches!(error, Error::NoDirection { row: Some(2), .. }));
    says(&error, &["row 2", "not all zeros"]);
}

#[test]
fn names_and_positions_are_one_a_place() {
    let map = || Map::from_descriptors(vec![1_u8; 6], 2, Metric::Manhattan).unwrap();
    let error = refused(map().with_names(vec![String::new(); 2]));
    assert_eq!(error.to_string(), "names: expected 3 values, got 2");
    let nul = vec!["a".to_owned(), "b\0c".to_owned(), "d".to_owned()];
    says(&refused(map().with_names(nul)), &["names", "NUL", "b\\0c"]);

    let positions = |metres: Vec<f64>, axes| Positions::new(metres, axes);
    let error = refused(map().with_positions(positions(vec![0.0; 8], 2).unwrap()));
    assert_eq!(error.to_string(), "positions: expected 3 values, got 4");
    for (count, axes, got) in [
        (7, 2, "got 7 numbers, which 2 does not divide"),
        (4, 1, "got 1"),
        (4, 4, "got 4"),
        (4, 0, "got 0"),
    ] {
        let error = refused(positions(vec![0.0; count], axes));
        assert!(matches!(error, Error::Shape { what: "positions", .. }));
        says(&error, &["2 or 3", got]);
    }
    let error = refused(positions(vec![0.0, 1.0, 2.0, f64::INFINITY], 2));
    assert!(matches!(error, Error::NotFinite { row: Some(1), index: 1, .. }));
    says(&error, &["positions", "inf", "row 1, index 1"]);
}

#[test]
fn a_descriptor_has_the_maps_dimension_and_type() {
    let map = Map::from_descriptors(vec![1_u8; 6], 2, Metric::Cosine).unwrap();
    let error = refused(map.distances([1_u8; 3].as_slice()));
    assert_eq!(error.to_string(), "descriptor: expected 2 values, got 3");
    let error = refused(map.distances([1_i8; 2].as_slice()));
    assert!(matches!(error, Error::Dtype { map: Dtype::U8, got: Dtype::I8, .. }));
    assert_eq!(error.to_string(), "descriptor: expected float32 or the map's own uint8, got int8");
    says(&refused(map.distances([0.0_f32; 2].as_slice())), &["descriptor", "not all zeros"]);
    says(&refused(map.distances([0.0, f32::NAN].as_slice())), &["descriptor", "NaN at index 1"]);
    let mut out = [7.0; 2];
    let error = refused(map.distances_into((&[1.0_f32, 2.0][..]).into(), &mut out));
    assert_eq!(
        (error.to_string().as_str(), out),
        ("distances: expected 3 values, got 2", [7.0; 2])
    );

    let floats = Map::from_descriptors(vec![1.0_f32; 6], 2, Metric::Cosine).unwrap();
    let error = refused(floats.distances([1_u8; 2].as_slice()));
    assert_eq!(error.to_string(), "descriptor: expected float32, got uint8");
    let error = refused(match_descriptors(
        &map,
        &Values::U8(vec![1; 5]),
        &Config::default(),
        Drive::default(),
        &mut |_, _| ControlFlow::Continue(()),
    ));
    says(&error, &["queries", "rows of 2 numbers", "5 numbers"]);
}

#[test]
fn an_image_for_a_map_of_ready_descriptors_says_what_to_do() {
    let map = Map::from_descriptors(vec![1_u8; 6], 2, Metric::Manhattan).unwrap();
    let mut localizer = Localizer::new(Arc::new(map), Config::default()).unwrap();
    let error = refused(localizer.push_image(&image(4, 4, Channels::Rgb)));
    assert!(matches!(error, Error::NoDescriptor));
    says(&error, &["push the image's descriptor instead"]);
    assert_eq!(localizer.frames(), 0);
}

#[test]
fn an_image_has_as_many_bytes_as_its_size_says() {
    for (width, height, channels, bytes) in [
        (4, 3, Channels::Grey, 11),
        (4, 3, Channels::Rgb, 12),
        (0, 3, Channels::Grey, 0),
        (4, 0, Channels::Rgb, 0),
        (usize::MAX, 2, Channels::Rgb, 12),
    ] {
        let pixels = vec![0; bytes];
        let error = refused(ImageView::new(width, height, channels, &pixels));
        assert!(matches!(error, Error::Shape { what: "image", .. }));
        says(&error, &[&format!("{width} x {height} ({channels})"), &format!("{bytes} bytes")]);
        refused(Image::new(width, height, channels, pixels));
    }
}

#[test]
fn a_sad_recipe_is_checked_when_it_is_made() {
    for (size, patch, dtype, option) in [
        ((64, 32), 0, Dtype::U8, "patch"),
        ((64, 32), 7, Dtype::U8, "size"),
        ((0, 32), 8, Dtype::U8, "size"),
        ((4104, 8), 8, Dtype::U8, "size"),
        ((64, 32), 8, Dtype::I8, "dtype"),
        ((64, 32), 8, Dtype::F16, "dtype"),
    ] {
        let error = refused(Sad::new(size, patch, dtype));
        assert!(matches!(error, Error::Option { name, .. } if name == option), "{error}");
    }
    says(
        &refused(Sad::new((64, 30), 8, Dtype::U8)),
        &["`size`", "the patch (8) divides", "got 64 x 30"],
    );
}

#[test]
fn images_of_a_map_have_one_size() {
    let mut images = vec![image(20, 10, Channels::Grey); 200];
    images[130] = image(10, 20, Channels::Grey);
    images[190] = image(5, 5, Channels::Grey);
    let error = refused(Map::from_images(&images, Sad::default(), &mut go_on));
    assert!(matches!(&error, Error::ImageSize { expected: (20, 10), got: (10, 20), .. }));
    says(&error, &["image 130", "expected 20 x 10", "got 10 x 20"]);
}

#[test]
fn progress_is_told_and_can_stop_the_work() {
    let images = vec![image(20, 10, Channels::Rgb); 200];
    let mut told = Vec::new();
    let mut listen = |done, total| {
        told.push((done, total));
        ControlFlow::Continue(())
    };
    Map::from_images(&images, Sad::default(), &mut listen).unwrap();
    assert_eq!((told.first(), told.last()), (Some(&(0, 200)), Some(&(200, 200))));
    assert!(told.len() > 2 && told.is_sorted());

    for stop_at in [0, 1, 200] {
        let mut stop = |done, _| {
            if done >= stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let error = refused(Map::from_images(&images, Sad::default(), &mut stop));
        let Error::Interrupted { done, total: 200 } = error else { panic!("{error}") };
        assert!(done >= stop_at && done <= 200);
        says(&error, &[&format!("stopped after {done} of 200")]);
    }
}

#[test]
fn an_unknown_metric_names_the_known_ones() {
    let error = refused("hamming".parse::<Metric>());
    says(&error, &["`metric`", "\"manhattan\"", "\"euclidean\"", "\"cosine\"", "got \"hamming\""]);
    for metric in [Metric::Manhattan, Metric::Euclidean, Metric::Cosine] {
        assert_eq!(metric.to_string().parse::<Metric>().unwrap(), metric);
    }
}
