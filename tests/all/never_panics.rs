//! Whatever the data, a push gives a fix or an error, and an error changes nothing.

use std::sync::Arc;

use crate::cases::{Kind, bits, cases, columns, kind, route};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use surefix::{Config, Error, Fix, Floor, Given, Localizer, Map, Matcher, Metric};

const ODD: [f32; 12] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    1e-45,
    -1e-45,
    0.0,
    -0.0,
    1.0,
    -1.0,
];

/// Any bits at all, the odd ones often.
fn any_number() -> impl Strategy<Value = f32> {
    prop_oneof![any::<u32>().prop_map(f32::from_bits), select(ODD.to_vec()), 0.0..1.0_f32]
}

fn in_range(fix: &Fix, places: usize, config: &Config) {
    assert!(
        fix.place < places && fix.single.place < places && fix.gradient.place < places,
        "{fix:?}"
    );
    if let Some(sequence) = fix.sequence {
        assert!(sequence.place < places && sequence.anchors <= config.sequence_length, "{fix:?}");
        assert!(config.speeds.contains(&sequence.speed), "{fix:?}");
        assert_eq!((sequence.place, sequence.score), (fix.place, fix.score));
    }
}

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn a_refused_vector_leaves_no_trace(
        (places, config) in route(2..20),
        pushes in vec((vec(any_number(), 0..24), any::<bool>()), 1..8),
        kind in kind(), seed: u64,
    ) {
        let good = columns(kind, places, pushes.len(), seed);
        let mut matcher = Matcher::new(places, config.clone()).unwrap();
        let mut spared = matcher.clone();
        for ((mut bad, fits), good) in pushes.into_iter().zip(good) {
            if fits {
                bad.resize(places, 0.5);
            }
            let acceptable = bad.len() == places && bad.iter().all(|x| x.is_finite());
            let before = matcher.snapshot().unwrap();
            match matcher.push(&bad) {
                Ok(fix) => {
                    prop_assert!(acceptable);
                    in_range(&fix, places, &config);
                    prop_assert_eq!(bits(&fix), bits(&spared.push(&bad).unwrap()));
                }
                Err(Error::Length { expected, got, .. }) => {
                    prop_assert_eq!((expected, got), (places, bad.len()));
                    prop_assert_ne!(places, bad.len());
                }
                Err(Error::NotFinite { index, value, row: None, .. }) => {
                    let first = bad.iter().position(|x| !x.is_finite()).unwrap();
                    prop_assert_eq!((index, value.to_bits()), (first, bad[first].to_bits()));
                }
                Err(other) => prop_assert!(false, "{}", other),
            }
            if !acceptable {
                prop_assert_eq!(before, matcher.snapshot().unwrap());
            }
            // One that never saw the refused vectors goes the same way.
            prop_assert_eq!(bits(&matcher.push(&good).unwrap()), bits(&spared.push(&good).unwrap()));
        }
    }

    #[test]
    fn the_largest_numbers_give_places_on_the_route(
        (places, config) in route(2..40),
        seed: u64,
        floor in prop_oneof![Just(Floor::Running), select(vec![-1e38, 0.0, 1e38]).prop_map(Floor::Fixed)],
    ) {
        let config = config! { config => floor };
        let mut dice = crate::random::SplitMix64(seed);
        let mut matcher = Matcher::new(places, config.clone()).unwrap();
        let extremes = [f32::MAX, f32::MIN, f32::MAX / 2.0, 1e-45, -0.0, 0.0, 1.0];
        for _ in 0..places.min(10) + config.sequence_length {
            let column: Vec<f32> = (0..places).map(|_| extremes[dice.below(7)]).collect();
            let fix = matcher.push(&column).unwrap();
            in_range(&fix, places, &config);
            prop_assert!(fix.score.is_finite(), "{:?}", fix);
        }
    }
}

#[test]
fn a_score_is_finite_whatever_floor_is_accepted() {
    for floor in [-1e30, -1e39, -1e300, f64::MIN, 1e300, f64::MAX] {
        let config = config! { floor: Floor::Fixed(floor) };
        let Ok(mut matcher) = Matcher::new(3, config) else { continue };
        for _ in 0..3 {
            let fix = matcher.push_with(&[0.5, 0.2, 0.4], Given::default().trusted(true)).unwrap();
            assert!(fix.score.is_finite(), "floor {floor}: {fix:?}");
        }
    }
}

#[test]
fn an_overflowing_gradient_does_not_hide_the_others() {
    // The first places' sums overflow to -inf or NaN; place 3 has the only clear dip.
    let big = f32::MAX;
    let mut matcher = Matcher::new(6, Config::default()).unwrap();
    matcher.push(&[0.0; 6]).unwrap();
    matcher.push(&[0.0; 6]).unwrap();
    let fix = matcher.push(&[big, -big, 1.0, -1.0, 1.0, 1.0]).unwrap();
    in_range(&fix, 6, &Config::default());
    assert_eq!((fix.gradient.place, fix.gradient.value), (3, 2.0), "{fix:?}");
}

#[test]
fn a_localizer_that_refuses_is_as_it_was() {
    let rows: Vec<f32> = columns(Kind::Smooth, 8, 6, 1).concat();
    let map = Arc::new(Map::from_descriptors(rows.clone(), 8, Metric::Euclidean).unwrap());
    let mut localizer = Localizer::new(map, Config::default()).unwrap();
    localizer.push_descriptor(&rows[..8]).unwrap();
    let mut spared = localizer.clone();
    // Finite numbers whose distance is not: refused after the distances were computed.
    let refusals: [&[f32]; 4] = [&[f32::NAN; 8], &[f32::INFINITY; 8], &[0.5; 7], &[f32::MAX; 8]];
    for refused in refusals {
        assert!(localizer.push_descriptor(refused).is_err(), "{refused:?}");
        assert_eq!(localizer.distances(), spared.distances(), "after {refused:?}");
        assert_eq!(localizer.snapshot().unwrap(), spared.snapshot().unwrap(), "after {refused:?}");
    }
    let next = &rows[8..16];
    let (got, expected) =
        (localizer.push_descriptor(next).unwrap(), spared.push_descriptor(next).unwrap());
    assert_eq!(bits(&got), bits(&expected));
}
