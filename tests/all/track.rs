//! The tracker at the ends of its options, and its belief.

use surefix::{Config, Drive, Error, Matcher, Motion, Segments, match_fused_distances};

use crate::cases::{Kind, columns};

fn matcher(places: usize, motion: Motion) -> Matcher {
    Matcher::new(places, config! { motion: Some(motion) }).unwrap()
}

#[test]
fn a_restored_tracker_has_the_belief_that_it_had() {
    for motion in [Motion::steady(), Motion::free(), Motion::any()] {
        let mut matcher = matcher(30, motion);
        for column in columns(Kind::Smooth, 30, 5, 1) {
            let fix = matcher.push(&column).unwrap();
            let restored = Matcher::restore(&matcher.snapshot().unwrap(), None).unwrap();
            let [whole, again] =
                [&matcher, &restored].map(|m| m.belief().unwrap().collect::<Vec<f64>>());
            assert_eq!(whole, again);
            let total = whole.iter().sum::<f64>() + fix.off_map().unwrap();
            assert!((total - 1.0).abs() < 1e-12, "{total}");
        }
    }
}

#[test]
fn a_tolerance_of_any_size_is_the_whole_route() {
    let distances = &columns(Kind::Smooth, 12, 1, 1)[0];
    let of = |tolerance| {
        let config = config! { motion: Some(Motion::free()), tolerance };
        Matcher::new(12, config).unwrap().push(distances).unwrap().track.unwrap()
    };
    for tolerance in [usize::MAX, usize::MAX - 1] {
        assert_eq!(of(tolerance), of(12));
    }
}

/// The interval of a column that says little: its ends lie far from the most probable place.
/// They are places on up to 65,536 places, and on longer routes the ends of chunks.
#[test]
fn an_interval_is_exact_up_to_65_536_places() {
    for (places, chunk) in [(65_536, 1), (65_537, 256)] {
        for closed in [&[][..], &[0]] {
            let route = Segments::one(places).with_closed(closed).unwrap();
            let config = config! { motion: Some(Motion::steady()) };
            let mut matcher = Matcher::along(route, config).unwrap();
            let mut column = columns(Kind::Smooth, places, 1, 5).remove(0);
            column[30_300] = -0.5;
            let track = matcher.push(&column).unwrap().track.unwrap();
            let belief: Vec<f64> = matcher.belief().unwrap().collect();
            let seam = if closed.is_empty() { 0 } else { track.place + places.div_ceil(2) };
            let seam = (seam % places) / chunk * chunk;
            let mut order: Vec<usize> = (0..places).map(|at| (seam + at) % places).collect();
            let tail = 0.025 * belief.iter().sum::<f64>();
            let mut end = || {
                let mut sum = 0.0;
                let beyond = order.iter().find(|&&place| {
                    sum += belief[place];
                    sum > tail
                });
                let place = *beyond.unwrap();
                order.reverse();
                place / chunk * chunk
            };
            let (first, last) = (end(), (end() + chunk - 1).min(places - 1));
            assert_eq!(
                (track.place, track.interval),
                (30_300, (first, last)),
                "{places} {closed:?}"
            );
        }
    }
}

/// Without any way back, no belief is left in any place.
#[test]
fn a_robot_that_left_for_good_has_no_speed() {
    let mut motion = Motion::free();
    (motion.leave, motion.rejoin, motion.restart) = (1.0, 0.0, 0.0);
    let mut matcher = matcher(12, motion);
    for column in columns(Kind::Smooth, 12, 3, 1) {
        let track = matcher.push(&column).unwrap().track.unwrap();
        assert_eq!((track.confidence, track.off_map, track.speed), (0.0, 1.0, 0.0));
    }
}

/// The cost of a query grows with the fastest speed.
#[test]
fn a_speed_in_places_has_a_limit_whatever_the_pace() {
    let mut motion = Motion::free();
    for (speed, pace, fits) in [(1000.0, 1.0, true), (2.0, 500.0, true), (2.0, 501.0, false)] {
        motion.speeds = vec![0.0, speed];
        motion.pace = pace;
        assert_eq!(motion.validate().is_ok(), fits);
    }
    let refused = motion.validate().unwrap_err().to_string();
    assert!(refused.contains("motion.speeds x motion.pace"), "{refused}");
}

/// More techniques than maps of a localizer: their evidence would leave the range of `exp`.
#[test]
fn as_many_matrices_are_fused_as_maps() {
    let matrix = ndarray::Array2::from_shape_fn((9, 4), |(i, j)| (i * j * 7 % 5) as f32);
    let mut motion = Motion::free();
    (motion.evidence, motion.clip) = (100.0, 1.0);
    let config: Config = config! { motion: Some(motion) };
    let run = |count: usize| {
        match_fused_distances(&vec![matrix.view(); count], &config, Drive::default())
    };
    for fix in run(32).unwrap().fixes {
        assert!((0.0..=1.0).contains(&fix.confidence().unwrap()), "{fix:?}");
    }
    assert!(matches!(run(33), Err(Error::Option { name: "distances", .. })));
}
