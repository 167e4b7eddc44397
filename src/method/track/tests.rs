//! The tracker's parts against one-line oracles, and the whole on every instruction set.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use super::Track;
use super::evidence::Says;
use super::exp::exp;
use super::hubness::Hubness;
use super::novelty::View;
use super::steps::Steps;
use crate::cases::cases;
use crate::config::Config;
use crate::method::{Given, Matcher};
use crate::motion::Motion;
use crate::segments::Segments;
use crate::simd::Isa;
use crate::sums::sum;

fn matcher(places: usize, motion: Motion) -> Matcher {
    Matcher::new(places, Config { motion: Some(motion), ..Config::default() }).unwrap()
}

fn kinds() -> impl Strategy<Value = Motion> {
    let gentle = Motion { restart: 0.0, leave: 0.0, ..Motion::free() };
    let fast = Motion { pace: 3.0, ..Motion::free() };
    select(vec![Motion::steady(), Motion::free(), Motion::any(), gentle, fast])
}

fn advances() -> impl Strategy<Value = Option<f64>> {
    prop_oneof![2 => Just(None), 2 => (-2.0..3.0_f64).prop_map(Some), 1 => select(vec![Some(0.0), Some(1e9), Some(-7.5)])]
}

/// One open segment; a closed one; and several, one of them closed, with and without links.
fn town(places: usize, kind: usize) -> Segments {
    if kind == 0 || places < 12 {
        return Segments::one(places);
    }
    if kind == 1 {
        return Segments::one(places).with_closed(&[0]).unwrap();
    }
    let last = places - 1;
    let town = Segments::new(places, &[4, places / 2 + 1]).unwrap().with_closed(&[0]).unwrap();
    let links = [(0, 6), (3, last - 1), (last, 2), (last, 5), (last - 3, last - 4)];
    town.with_links(if kind == 2 { &links } else { &[] }).unwrap()
}

fn pearson(a: &[f64], b: &[f64]) -> f64 {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let product = |a: &[f64], mean_a: f64, b: &[f64], mean_b: f64| {
        a.iter().zip(b).map(|(a, b)| (a - mean_a) * (b - mean_b)).sum::<f64>()
    };
    let spread = product(a, mean_a, a, mean_a) * product(b, mean_b, b, mean_b);
    product(a, mean_a, b, mean_b) / spread.sqrt()
}

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn exp_is_within_its_error(x in -700.0..700.0_f64) {
        prop_assert!((exp(x) / x.exp() - 1.0).abs() < 3e-13, "{x}");
    }

    #[test]
    fn a_move_keeps_all_mass_and_covers_the_way_to_the_next_speed(motion in kinds(), pace in 0.1..9.0_f64) {
        let motion = Motion { pace, ..motion };
        let steps = Steps::new(&motion).unwrap();
        prop_assert!((steps.shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let mut reached = None;
        for (speed, &of_pace) in motion.speeds.iter().enumerate() {
            let taps = steps.of(speed);
            let weight: f64 = taps.iter().map(|tap| tap.weight).sum();
            let mean: f64 = taps.iter().map(|tap| tap.weight * tap.shift as f64).sum();
            prop_assert!((weight - 1.0).abs() < 1e-12 && (mean - of_pace * pace).abs() < 1e-9);
            // Every advance between two speeds is one of the shifts.
            let (first, last) = (taps[0].shift, taps[taps.len() - 1].shift);
            prop_assert!(reached.is_none_or(|reached: isize| reached + 1 >= first));
            reached = Some(last);
        }
    }

    #[test]
    fn views_are_compared_by_their_correlation(
        views in (2..700_usize).prop_flat_map(|places| vec(vec(-3.0..3.0_f64, places), 2..4)),
    ) {
        let places = views[0].len();
        let mut view = View::new(places, &Motion::any()).unwrap();
        let hubness = Hubness::new(places).unwrap();
        let mut before: Option<&Vec<f64>> = None;
        for z in &views {
            let got = view.correlation(Says::Fused(z), &[], &hubness);
            let expected = before.map(|before| pearson(z, before));
            prop_assert_eq!(got.is_some(), expected.is_some());
            prop_assert!((got.unwrap_or(0.0) - expected.unwrap_or(0.0)).abs() < 1e-9, "{got:?} {expected:?}");
            before = Some(z);
        }
    }

    #[test]
    fn a_sum_is_that_of_its_lanes(numbers in vec(0.0..1.0_f64, 0..300)) {
        prop_assert!((sum(&numbers) - numbers.iter().sum::<f64>()).abs() < 1e-12);
    }
}

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn every_instruction_set_gives_the_same_bits(
        motion in kinds(),
        places in prop_oneof![58 => 2..40_usize, 1 => 250..270_usize, 1 => 4090..4110_usize],
        kind in 0..4_usize,
        queries in vec((any::<u64>(), advances()), 1..8),
    ) {
        let route = town(places, kind);
        let of = |isa: Isa| -> Vec<Track> {
            let config = Config { motion: Some(motion.clone()), ..Config::default() };
            let matcher = Matcher::along(route.clone(), config).unwrap();
            let mut matcher = matcher.with_isa(isa).unwrap();
            let mut push = |&(seed, advance): &(u64, Option<f64>)| {
                let mut random = crate::random::SplitMix64(seed);
                let column: Vec<f32> = (0..places).map(|_| random.share()).collect();
                let given = Given { advance, ..Given::default() };
                matcher.push_with(&column, given).unwrap().track.unwrap()
            };
            queries.iter().map(&mut push).collect()
        };
        let scalar = of(Isa::Scalar);
        for track in &scalar {
            let Track { place, confidence, off_map, interval: (low, high), .. } = *track;
            let round_it = kind == 1 && low > high;
            let within = low <= place && place <= high;
            let within = within || round_it && (low <= place || place <= high);
            prop_assert!(within && low.max(high) < places, "{track:?}");
            prop_assert!((0.0..=1.0 + 1e-12).contains(&confidence), "{track:?}");
            prop_assert!((0.0..=1.0).contains(&off_map), "{track:?}");
        }
        for isa in Isa::available() {
            prop_assert_eq!(&of(isa), &scalar, "{}", isa);
        }
    }
}

/// Techniques that contradict each other leave only rounding, which correlates with anything.
#[test]
fn rounding_is_no_view() {
    let mut view = View::new(2, &Motion::any()).unwrap();
    let hubness = Hubness::new(2).unwrap();
    let mut correlation = |z: [f64; 2]| view.correlation(Says::Fused(&z), &[], &hubness);
    assert_eq!(correlation([1.0, -1.0]), None);
    assert_eq!(correlation([1e-16, -1e-16]), None);
    assert_eq!(correlation([1e-16, -1e-16]), None);
    assert_eq!(correlation([2.0, -2.0]), None);
    assert!(correlation([1.0, -1.0]).is_some());
}

/// After a million queries of two kinds of columns, the tracker is as a fresh one that was told the
/// same means at once.
#[test]
fn a_million_queries_do_not_drift() {
    let places = 16;
    let columns: [Vec<f32>; 2] =
        [0.1, 0.7].map(|phase: f32| (0..places).map(|i| (i as f32 * 0.9 + phase).sin()).collect());
    let mut old = matcher(places, Motion::free());
    for query in 0..1_000_000 {
        old.push(&columns[query % 2]).unwrap();
    }
    let mut fresh = matcher(places, Motion::free());
    for query in 0..1_000 {
        fresh.push(&columns[query % 2]).unwrap();
    }
    let tracker = fresh.tracker.as_mut().unwrap();
    tracker.hubness.columns *= 1_000;
    tracker.hubness.sums.iter_mut().for_each(|sum| *sum *= 1_000.0);
    for query in 0..400 {
        let column = &columns[query % 2];
        let [a, b] = [&mut old, &mut fresh].map(|m| m.push(column).unwrap().track.unwrap());
        assert_eq!(a.place, b.place);
        if query > 300 {
            let differ = |a: f64, b: f64| (a - b).abs() > 1e-6;
            assert!(
                !differ(a.confidence, b.confidence) && !differ(a.off_map, b.off_map),
                "{a:?} {b:?}"
            );
        }
    }
}

#[test]
fn a_constant_column_moves_the_belief_and_teaches_nothing() {
    let mut matcher = matcher(30, Motion::steady());
    for query in 0..8 {
        let column: Vec<f32> = (0..30).map(|i| f32::from(i != 5 + query)).collect();
        matcher.push(&column).unwrap();
    }
    let sums = matcher.tracker.as_ref().unwrap().hubness.sums.clone();
    let before = matcher.push(&[0.5; 30]).unwrap().track.unwrap();
    let after = matcher.push(&[0.5; 30]).unwrap().track.unwrap();
    assert_eq!((before.place, after.place), (13, 14));
    assert!(after.confidence < before.confidence);
    assert_eq!(matcher.tracker.as_ref().unwrap().hubness.sums, sums);
}

/// Without odometry, a camera that sees the same again is one that stands: the belief stays where
/// it is, and does not grow sure of it.
#[test]
fn a_view_that_repeats_is_a_robot_that_stands() {
    let places = 60;
    let column = |at: usize| -> Vec<f32> {
        let away = |place: usize| (place as f32 - at as f32).abs().min(6.0);
        (0..places).map(|place| away(place) + 0.3 * (place * place % 7) as f32).collect()
    };
    let mut matcher = matcher(places, Motion::any());
    for at in 10..25 {
        matcher.push(&column(at)).unwrap();
    }
    let before = matcher.push(&column(24)).unwrap().track.unwrap();
    let mut after = before;
    for _ in 0..40 {
        after = matcher.push(&column(24)).unwrap().track.unwrap();
    }
    assert_eq!((before.place, after.place), (24, 24));
    assert!(after.speed < 0.2, "{after:?}");
    assert!((after.confidence - before.confidence).abs() < 0.25, "{before:?} {after:?}");
}
