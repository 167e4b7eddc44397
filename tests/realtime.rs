//! What a control loop needs: no allocation, no lock, values that can be copied and sent.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

#[macro_use]
#[path = "all/options.rs"]
mod options;

#[path = "all/cases.rs"]
mod cases;
#[path = "all/counting.rs"]
mod counting;
#[path = "../src/random.rs"]
mod random;

use std::sync::Arc;
use std::thread;

use cases::{DTYPES, Kind, all_bits, columns, numbers};
use counting::allocations;
use random::SplitMix64;
use surefix::calibration::{Alarm, Calibrate, calibrate};
use surefix::evaluate::Match;
use surefix::{
    Channels, Config, Dtype, Error, Fix, Floor, Given, Gradient, Image, Input, Localizer,
    LoopCloser, LoopConfig, Map, Matcher, Metric, Motion, Post, Run, Sad, Segments, Step, Values,
    View,
};

#[test]
fn a_loop_closer_allocates_for_blocks_of_places_and_nothing_within_what_is_reserved() {
    let mut random = SplitMix64(1);
    let rows: Vec<Vec<f32>> =
        (0..300).map(|_| (0..1024).map(|_| (random.next() >> 40) as f32).collect()).collect();
    let mut config = LoopConfig::default();
    (config.exclude, config.lasting) = (20, 1);
    let push = |closer: &mut LoopCloser, frame: usize, advance: Option<f64>| {
        let query = Input::Descriptor(View::F32(&rows[frame % 300]));
        closer.push(query, advance).unwrap()
    };
    // 256 places fill a block, and there is room for 256 beliefs at first.
    let mut closer = LoopCloser::of_descriptors(1024, Metric::Euclidean, config.clone()).unwrap();
    let calls = allocations(|| {
        for frame in 0..1200 {
            push(&mut closer, frame, None);
        }
    });
    assert!(closer.edges().len() > 600 && calls < 200, "{calls} for 1,200 frames");

    let mut reserved = LoopCloser::of_descriptors(1024, Metric::Euclidean, config).unwrap();
    reserved.reserve(1200).unwrap();
    let bytes = reserved.bytes();
    let calls = allocations(|| {
        for frame in 0..1200 {
            push(&mut reserved, frame, (frame % 3 == 0).then_some(1.0));
        }
    });
    assert_eq!((calls, reserved.bytes()), (0, bytes));
}

fn configs() -> Vec<Config> {
    let mut all = Vec::new();
    for sequence_length in [1, 2, 100] {
        for smoothing in [1, 3, 200] {
            for gradient in [Gradient::Halved, Gradient::Unhalved] {
                for floor in [Floor::Running, Floor::Fixed(0.1)] {
                    for speeds in [vec![1.0], vec![0.8, 0.9, 1.0, 1.1, 1.2]] {
                        all.push(config! { sequence_length,
                        smoothing,
                        gradient,
                        floor,
                        speeds });
                    }
                }
            }
        }
    }
    all
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![1_u8; 100]))), 2);
}

#[test]
fn a_matcher_allocates_nothing_after_construction() {
    const PLACES: usize = 150;
    let queries = columns(Kind::Smooth, PLACES, 250, 1);
    let mut spoilt = queries[0].clone();
    spoilt[PLACES - 1] = f32::NAN;
    for config in configs() {
        let mut matcher = Matcher::new(PLACES, config.clone()).unwrap();
        let mut ready = 0;
        let calls = allocations(|| {
            for (index, query) in queries.iter().enumerate() {
                let fix = match index % 3 {
                    0 => matcher.push_with(query, Given::default().trusted(index % 2 == 0)),
                    _ => matcher.push(query),
                };
                ready += usize::from(fix.unwrap().sequence.is_some());
                assert!(matches!(matcher.push(&spoilt), Err(Error::NotFinite { .. })));
                assert!(matches!(matcher.push(&query[1..]), Err(Error::Length { .. })));
                assert!(matches!(matcher.push(&[]), Err(Error::Length { .. })));
            }
            assert_eq!(ready, 251 - config.sequence_length, "the full windows were measured too");
            for (index, query) in queries.iter().enumerate() {
                if index % 120 == 0 {
                    matcher.gap();
                }
                ready += usize::from(matcher.push(query).unwrap().sequence.is_some());
            }
            matcher.reset();
            matcher.push(&queries[0]).unwrap();
        });
        assert_eq!(calls, 0, "{config:?}");
        let length = config.sequence_length;
        assert_eq!(
            ready,
            251 - length + 2 * (121 - length) + 11_usize.saturating_sub(length),
            "those after gaps too"
        );
    }
}

#[test]
fn a_tracker_allocates_nothing_after_construction() {
    const PLACES: usize = 5000;
    let queries = columns(Kind::Smooth, PLACES, 12, 1);
    let mut custom = Motion::free();
    (custom.pace, custom.by_distance, custom.repeat) = (7.0, true, 0.5);
    let links = [(99, 800), (1500, 20), (4999, 3), (700, 2000)];
    let town = Segments::new(PLACES, &[100, 900]).and_then(|town| town.with_closed(&[1]));
    let town = town.and_then(|town| town.with_links(&links)).unwrap();
    let motions = [Motion::steady(), Motion::free(), Motion::any(), custom];
    let each = motions.iter().flat_map(|motion| [(motion, None), (motion, Some(&town))]);
    for (motion, town) in each {
        let config = config! { motion: Some(motion.clone()) };
        let segments = town.cloned().unwrap_or_else(|| Segments::one(PLACES));
        let mut matcher = Matcher::along(segments, config).unwrap();
        let calls = allocations(|| {
            for (index, query) in queries.iter().cycle().take(60).enumerate() {
                let given = match index % 5 {
                    0 => Given::default().advance(1e12),
                    1 => Given::default().advance(-0.7),
                    _ => Given::default(),
                };
                assert!(matcher.push_with(query, given).unwrap().track.is_some());
                match index % 15 {
                    7 => matcher.gap(),
                    11 => matcher.gap_with_advance(3.3).unwrap(),
                    13 => assert!(matcher.belief().unwrap().sum::<f64>() <= 1.0 + 1e-9),
                    _ => {}
                }
            }
            matcher.reset();
            matcher.push(&queries[0]).unwrap();
        });
        assert_eq!(calls, 0, "{motion:?}, {town:?}");
    }
}

#[test]
fn judged_fixes_allocate_nothing_either() {
    const DIM: usize = 20;
    let map = Map::from_descriptors(numbers(Dtype::F32, 40 * DIM, 7), DIM, Metric::Euclidean);
    let mut localizer = Localizer::new(Arc::new(map.unwrap()), Config::default()).unwrap();
    let found =
        |query: usize| Match { place: 0, score: query as f32 / 200.0, ready: true, accepted: true };
    let matches: Vec<Match> = (0..200).map(found).collect();
    let wrong: Vec<_> = (0..200).map(|query| Some(f64::from(query > 150))).collect();
    let threshold = calibrate(&matches, &wrong, &Calibrate::default()).unwrap();
    localizer = localizer.with_threshold(threshold).unwrap();
    localizer.on_alarm(|_| ());
    let query = numbers(Dtype::F32, DIM, 8);
    let calls = allocations(|| {
        for _ in 0..300 {
            assert!(localizer.push_descriptor(&query).unwrap().accepted.is_some());
        }
    });
    assert_eq!(calls, 0);
}

#[test]
fn a_localizer_allocates_nothing_for_a_descriptor() {
    const DIM: usize = 300;
    for metric in [Metric::Manhattan, Metric::Euclidean, Metric::Cosine] {
        for dtype in DTYPES {
            let map = Map::from_descriptors(numbers(dtype, 40 * DIM, 7), DIM, metric).unwrap();
            // Two places show nothing.
            let dark = Map::from_descriptors(Values::zeros(dtype, 2 * DIM), DIM, metric).unwrap();
            let map = Arc::new(map.extended(&dark).unwrap());
            let mut localizer = Localizer::new(Arc::clone(&map), Config::default()).unwrap();
            let (own, float) = (numbers(dtype, DIM, 8), numbers(Dtype::F32, DIM, 9));
            let spoilt = vec![f32::NAN; DIM];
            let foreign = numbers(if dtype == Dtype::I8 { Dtype::U8 } else { Dtype::I8 }, DIM, 10);
            let zeros = vec![0.0_f32; DIM];
            let calls = allocations(|| {
                for _ in 0..5 {
                    localizer.push_descriptor(&own).unwrap();
                    localizer.push_descriptor(&float).unwrap();
                    assert!(matches!(
                        localizer.push_descriptor(&spoilt),
                        Err(Error::NotFinite { .. })
                    ));
                    assert!(matches!(
                        localizer.push_descriptor(&foreign),
                        Err(Error::Dtype { .. })
                    ));
                    let short = localizer.push_descriptor(&spoilt[1..]);
                    assert!(matches!(short, Err(Error::Length { .. })));
                    assert!(localizer.push_descriptor(&zeros).unwrap().blank);
                    localizer.gap();
                }
                localizer.reset();
            });
            assert_eq!((calls, map.blank()), (0, &[40, 41][..]), "{metric} {dtype}");
        }
    }
}

#[test]
fn post_processing_allocates_nothing_either() {
    const DIM: usize = 120;
    let Values::F32(raw) = numbers(Dtype::F32, 40 * DIM, 3) else { unreachable!() };
    let steps = [
        Step::StandardizeRunning,
        Step::Projection { dim: 200, seed: 1 },
        Step::Standardize,
        #[cfg(feature = "pca")]
        Step::Pca { dim: 30, whiten: true },
        #[cfg(not(feature = "pca"))]
        Step::Projection { dim: 30, seed: 2 },
        Step::Normalize,
    ];
    let (post, rows) = Post::fit(&steps, &raw, DIM).unwrap();
    let map = Map::from_descriptors(rows, 30, Metric::Cosine).unwrap().with_post(post).unwrap();
    let mut localizer = Localizer::new(Arc::new(map), Config::default()).unwrap();
    let mut copy = localizer.clone();
    let calls = allocations(|| {
        for row in raw.chunks_exact(DIM) {
            assert_eq!(localizer.push_descriptor(row).unwrap(), copy.push_descriptor(row).unwrap());
            assert!(matches!(localizer.push_descriptor(&row[1..]), Err(Error::Length { .. })));
        }
        localizer.reset();
    });
    assert_eq!(calls, 0);
}

#[test]
fn a_fused_localizer_allocates_nothing_either() {
    const DIM: usize = 30;
    let Values::F32(raw) = numbers(Dtype::F32, 40 * DIM, 3) else { unreachable!() };
    let (post, rows) = Post::fit(&[Step::StandardizeRunning], &raw, DIM).unwrap();
    let maps = [
        Map::from_descriptors(raw.clone(), DIM, Metric::Manhattan).unwrap(),
        Map::from_descriptors(rows, DIM, Metric::Cosine).unwrap().with_post(post).unwrap(),
    ];
    let config = config! { motion: Some(Motion::any()) };
    let mut localizer = Localizer::fused(maps.map(Arc::new).to_vec(), config).unwrap();
    let mut copy = localizer.clone();
    let input = |row| Input::Descriptor(View::F32(row));
    let calls = allocations(|| {
        for (at, row) in raw.chunks_exact(DIM).enumerate() {
            let mut given = Given::default();
            given.advance = (at % 3 == 0).then_some(0.7);
            let [a, b] =
                [&mut localizer, &mut copy].map(|l| l.push_inputs(&[input(row); 2], given));
            assert_eq!(a.unwrap(), b.unwrap());
            assert!(localizer.push_inputs(&[input(row), input(&row[1..])], given).is_err());
            if at % 7 == 0 {
                localizer.gap_with_advance(2.0).unwrap();
                copy.gap_with_advance(2.0).unwrap();
            }
        }
        localizer.reset();
    });
    assert_eq!(calls, 0);
}

#[test]
fn a_localizer_on_several_traverses_allocates_nothing_either() {
    for dtype in DTYPES {
        let rows = |seed| numbers(dtype, 40 * 24, seed);
        let map = |seed| Map::from_descriptors(rows(seed), 24, Metric::Euclidean).unwrap();
        let places: Vec<_> = (0..40).map(|place| (place % 3 > 0).then_some(place)).collect();
        let both = map(1).add_traverse(&map(2), &places, "second").unwrap();
        for threads in [1, 2] {
            let mut config = Config::default();
            config.motion = Some(Motion::any());
            let localizer = Localizer::new(Arc::new(both.clone()), config).unwrap();
            let mut localizer = localizer.with_threads(Some(threads)).unwrap();
            let queries = rows(3);
            let counted = allocations(|| {
                for query in 0..40 {
                    let query = queries.view().row(query, 24).unwrap();
                    localizer.push_descriptor(query).unwrap();
                }
            });
            assert_eq!(counted, 0, "{dtype} on {threads} threads");
        }
    }
}

/// Where the screen leaves few rows in doubt, and where it gives up.
#[test]
fn a_screened_localizer_allocates_nothing_either() {
    const DIM: usize = 256;
    for metric in [Metric::Euclidean, Metric::Cosine] {
        for same in [0.0, 1.0] {
            let mut dice = SplitMix64(3);
            let rows: Vec<f32> = (0..400 * DIM)
                .map(|at| same * ((at % 13) as f32 - 6.0) + 1e-3 * (dice.share() - 0.5))
                .collect();
            let alike: Vec<f32> =
                (0..400 * DIM).map(|at| rows[at % (2 * DIM)] + 1e-6 * rows[at]).collect();
            let map =
                Map::from_descriptors(if same > 0.0 { alike } else { rows.clone() }, DIM, metric)
                    .unwrap();
            let map = map.with_screen(Dtype::I8).unwrap();
            let config = config! { sequence_length: 12, speeds: vec![1.0, 0.8] };
            let mut localizer = Localizer::new(Arc::new(map), config).unwrap();
            let mut copy = localizer.clone();
            let spoilt = vec![f32::NAN; DIM];
            let mut looked_at = 0;
            let calls = allocations(|| {
                for query in 0..60 {
                    let row = &rows[query * DIM..(query + 1) * DIM];
                    assert_eq!(
                        localizer.push_descriptor(row).unwrap(),
                        copy.push_descriptor(row).unwrap()
                    );
                    looked_at += localizer.looked_at();
                    assert!(matches!(
                        localizer.push_descriptor(&spoilt),
                        Err(Error::NotFinite { .. })
                    ));
                    localizer.distances();
                    if query % 25 == 20 {
                        localizer.gap();
                        copy.gap();
                    }
                }
                localizer.reset();
            });
            assert_eq!(calls, 0, "{metric} {same}");
            assert_eq!(looked_at < 60 * 100, same == 0.0, "both ways were taken: {looked_at}");
        }
    }
}

fn image(width: usize, height: usize, channels: Channels, seed: u64) -> Image {
    let mut dice = SplitMix64(seed);
    let pixels = (0..width * height * channels.count()).map(|_| dice.below(256) as u8).collect();
    Image::new(width, height, channels, pixels).unwrap()
}

fn sad_localizer(dtype: Dtype) -> Localizer {
    let images: Vec<Image> = (0..8).map(|seed| image(80, 60, Channels::Grey, seed)).collect();
    let sad = Sad::new((64, 32), 8, dtype).unwrap();
    let map =
        Map::from_images(&images, sad, &mut |_, _| std::ops::ControlFlow::Continue(())).unwrap();
    Localizer::new(Arc::new(map), Config::default()).unwrap()
}

#[test]
fn a_localizer_allocates_nothing_for_an_image_after_the_first_of_its_size() {
    for dtype in [Dtype::U8, Dtype::F32] {
        for channels in [Channels::Grey, Channels::Rgb] {
            for (width, height) in [(320, 240), (64, 32), (20, 10), (64, 100)] {
                let mut localizer = sad_localizer(dtype);
                let frames: Vec<Image> =
                    (0..4).map(|seed| image(width, height, channels, seed)).collect();
                localizer.push_image(&frames[0]).unwrap();
                let calls = allocations(|| {
                    for frame in &frames {
                        localizer.push_image(frame).unwrap();
                    }
                });
                assert_eq!(calls, 0, "{dtype} {channels} {width} x {height}");
                let other = [Channels::Grey, Channels::Rgb]
                    .map(|channels| image(width, height, channels, 9));
                let calls = allocations(|| {
                    for frame in &other {
                        localizer.push_image(frame).unwrap();
                    }
                });
                assert_eq!(calls, 0, "grey and colour, {dtype} {width} x {height}");
            }
        }
    }
}

#[test]
fn memory_grows_to_the_largest_size_seen_and_no_further() {
    let mut localizer = sad_localizer(Dtype::U8);
    let (small, large) = (image(100, 80, Channels::Rgb, 1), image(640, 480, Channels::Rgb, 2));
    localizer.push_image(&small).unwrap();
    let calls = allocations(|| assert!(localizer.push_image(&large).is_ok()));
    assert!(calls > 0, "a larger size needs memory once");
    let calls = allocations(|| {
        for frame in [&small, &large, &small, &large] {
            localizer.push_image(frame).unwrap();
        }
    });
    assert_eq!(calls, 0, "two cameras in turn cost nothing more");
}

#[test]
fn an_alarm_allocates_nothing_before_or_after_it_is_raised() {
    let scores: Vec<f32> = (0..300).map(|frame| (frame * 7 % 11) as f32).collect();
    let mut alarm = Alarm::new(&scores, 10, 0.01).unwrap();
    let calls = allocations(|| {
        for &score in &scores {
            assert!(!alarm.push(score).unwrap());
        }
        alarm.push(f32::NAN).unwrap_err();
        for _ in 0..300 {
            alarm.push(20.0).unwrap();
        }
        assert!(alarm.raised());
        alarm.reset();
    });
    assert_eq!(calls, 0);
}

#[test]
fn fixes_are_copied_and_everything_can_be_sent() {
    fn copied<T: Copy>() {}
    fn sent<T: Send>() {}
    fn shared<T: Sync>() {}
    copied::<Fix>();
    sent::<Matcher>();
    sent::<Localizer>();
    sent::<Map>();
    sent::<Run>();
    sent::<Error>();
    shared::<Map>();
    shared::<Error>();
    assert!(size_of::<Fix>() <= 192, "a fix fits three cache lines: {} bytes", size_of::<Fix>());
}

#[test]
fn localizers_that_share_a_map_do_not_notice_each_other() {
    const DIM: usize = 64;
    let map = Arc::new(
        Map::from_descriptors(numbers(Dtype::U8, 200 * DIM, 1), DIM, Metric::Manhattan).unwrap(),
    );
    let run = |map: Arc<Map>, robot: u64| -> Vec<Fix> {
        let mut localizer = Localizer::new(map, config! { sequence_length: 5 }).unwrap();
        let queries = (0..100).map(|query| numbers(Dtype::U8, DIM, robot * 1000 + query));
        queries.map(|query| localizer.push_descriptor(&query).unwrap()).collect()
    };
    let robots: Vec<_> = (0..6)
        .map(|robot| {
            let map = Arc::clone(&map);
            thread::spawn(move || run(map, robot))
        })
        .collect();
    for (robot, handle) in robots.into_iter().enumerate() {
        let together = handle.join().unwrap();
        assert_eq!(
            all_bits(&together),
            all_bits(&run(Arc::clone(&map), robot as u64)),
            "robot {robot}"
        );
    }
}
