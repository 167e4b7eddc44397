//! Whatever the data, a push gives a fix or an error, and an error changes nothing.

use std::sync::Arc;

use crate::cases::{Kind, Told, bits, cases, columns, given, kind, route};
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

/// None, one that can be, or any bits.
fn any_advance() -> impl Strategy<Value = Option<f64>> {
    let odd = vec![f64::NAN, f64::INFINITY, -1e12, 1e12, 1.1e12, 1e-300, -0.5, 2.5];
    let odd = prop_oneof![select(odd), any::<u64>().prop_map(f64::from_bits)];
    prop_oneof![3 => Just(None), 3 => (-3.0..9.0).prop_map(Some), 1 => odd.prop_map(Some)]
}

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
    }
    let Some(track) = fix.track else {
        let sequence = fix.sequence.map(|sequence| (sequence.place, sequence.score));
        return assert_eq!(sequence.unwrap_or((fix.place, fix.score)), (fix.place, fix.score));
    };
    let (first, last) = track.interval;
    assert!(first <= track.place && track.place <= last && last < places, "{fix:?}");
    assert!((-1e-9..1.0 + 1e-9).contains(&track.confidence), "{fix:?}");
    assert!((0.0..=1.0).contains(&track.off_map) && track.speed.is_finite(), "{fix:?}");
    assert_eq!((fix.place, fix.score), (track.place, (1.0 - track.confidence) as f32));
}

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn a_refused_vector_leaves_no_trace(
        (places, config) in route(2..20),
        pushes in vec((vec(any_number(), 0..24), any::<bool>(), any_advance()), 1..8),
        kind in kind(), seed: u64,
    ) {
        let good = columns(kind, places, pushes.len(), seed);
        let mut matcher = Matcher::new(places, config.clone()).unwrap();
        let mut spared = matcher.clone();
        for ((mut bad, fits, advance), good) in pushes.into_iter().zip(good) {
            if fits {
                bad.resize(places, 0.5);
            }
            let mut given = Given::default();
            given.advance = advance;
            let moves = advance.is_none_or(|places| places.abs() <= 1e12);
            let acceptable = moves && bad.len() == places && bad.iter().all(|x| x.is_finite());
            let before = matcher.snapshot().unwrap();
            match matcher.push_with(&bad, given) {
                Ok(fix) => {
                    prop_assert!(acceptable);
                    in_range(&fix, places, &config);
                    prop_assert_eq!(bits(&fix), bits(&spared.push_with(&bad, given).unwrap()));
                }
                Err(Error::Option { name: "advance", .. }) => prop_assert!(!moves),
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
        let queries = places.min(10) + config.sequence_length;
        let told = Told::new(queries, seed, false, seed % 2 == 0);
        for query in 0..queries {
            let column: Vec<f32> = (0..places).map(|_| extremes[dice.below(7)]).collect();
            let fix = matcher.push_with(&column, given(told.drive(), query)).unwrap();
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
