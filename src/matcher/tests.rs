//! The kernels against one-line oracles, to the last bit, on grids of small numbers where
//! everything ties.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use super::consensus::{Single, checked_minimum};
use super::extreme::first_better;
use super::gradient::{Enhanced, gradient, missing_gradient};
use super::minimum;
use super::ring::Ring;
use super::sequence::{Anchor, Anchors, Search, Window};
use crate::config::Gradient;
use crate::error::Error;

fn cases() -> ProptestConfig {
    ProptestConfig { cases: 10_000, failure_persistence: None, ..ProptestConfig::default() }
}

/// Whole numbers and halves that tie, both zeros, and now and then any number of like size.
fn number() -> impl Strategy<Value = f32> {
    prop_oneof![6 => (-2..4_i8).prop_map(f32::from), 1 => select(vec![-0.0, 0.5, 1.5]), 2 => -4.0..4.0_f32]
}

fn numbers(length: impl Into<proptest::collection::SizeRange>) -> impl Strategy<Value = Vec<f32>> {
    vec(number(), length)
}

/// Columns of one height, the newest first.
fn columns(
    height: std::ops::Range<usize>,
    count: std::ops::Range<usize>,
) -> impl Strategy<Value = Vec<Vec<f32>>> {
    (height, count).prop_flat_map(|(height, count)| vec(numbers(height), count))
}

fn kinds() -> impl Strategy<Value = Gradient> {
    select(vec![Gradient::Halved, Gradient::Unhalved])
}

/// A ring that has been pushed these columns, after `before` others that were overwritten or not.
fn ring(newest_first: &[Vec<f32>], before: usize) -> Ring {
    let mut ring = Ring::new(newest_first.len(), newest_first[0].len()).unwrap();
    for _ in 0..before {
        ring.advance().fill(f32::NAN);
    }
    for column in newest_first.iter().rev() {
        ring.advance().copy_from_slice(column);
    }
    ring
}

fn same(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

fn naive_gradient(d: &[f32], kind: Gradient) -> Vec<f32> {
    let end = d.len() - 1;
    let inside = |i: usize| match kind {
        Gradient::Halved => (d[i - 1] + d[i + 1]) * 0.5 - d[i],
        Gradient::Unhalved => d[i + 1] + d[i - 1] - (d[i] + d[i]),
    };
    let at = |i| {
        if i == 0 {
            d[1] - d[0]
        } else if i == end {
            d[end - 1] - d[end]
        } else {
            inside(i)
        }
    };
    (0..=end).map(at).collect()
}

/// The peak of these columns, the newest first, beside that of all sums.
fn check_peak(
    d: &[Vec<f32>],
    before: usize,
    kept: usize,
    smoothing: usize,
    kind: Gradient,
) -> Result<(), TestCaseError> {
    let g: Vec<Vec<f32>> = d.iter().map(|d| naive_gradient(d, kind)).collect();
    let missing = missing_gradient(&d[0], kind);
    let enhanced = |i: usize| {
        let term = |k: usize| if k <= i { g.get(k).map_or(missing, |g| g[i - k]) } else { missing };
        (1..smoothing).fold(g[0][i], |sum, k| sum + term(k))
    };
    let sums: Vec<f32> = (0..g[0].len()).map(enhanced).collect();
    let highest = sums.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let place = sums.iter().position(|&x| x == highest).unwrap();
    let (columns, kept) = d.split_at(d.len() - kept.min(d.len() - 1));
    let earlier = if kept.is_empty() {
        Ring::new(0, d[0].len()).unwrap()
    } else {
        ring(&g[columns.len()..], 0)
    };
    let peak = {
        let columns = ring(columns, before);
        Enhanced { columns: &columns, upper: None, earlier: &earlier, kind, smoothing }.peak()
    };
    prop_assert_eq!((peak.place, peak.value.to_bits()), (place, sums[place].to_bits()));
    Ok(())
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn first_better_is_argmin_and_argmax_where_they_beat_the_best(numbers in numbers(1..200), best in number()) {
        let smallest = numbers.iter().copied().fold(f32::INFINITY, f32::min);
        let largest = numbers.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let first = |wanted: f32| numbers.iter().position(|&x| x == wanted).map(|at| (at, numbers[at]));
        let bits = |found: Option<(usize, f32)>| found.map(|(at, x)| (at, x.to_bits()));
        for best in [f32::INFINITY, best, smallest] {
            let expected = if smallest < best { first(smallest) } else { None };
            prop_assert_eq!(bits(first_better(&numbers, best, |a, b| a < b)), bits(expected));
        }
        for best in [f32::NEG_INFINITY, best, largest] {
            let expected = if largest > best { first(largest) } else { None };
            prop_assert_eq!(bits(first_better(&numbers, best, |a, b| a > b)), bits(expected));
        }
    }

    #[test]
    fn of_two_zeros_the_first_is_found(numbers in vec(select(vec![0.0_f32, -0.0, 1.0]), 1..200)) {
        let bits = |found: Option<(usize, f32)>| found.map(|(at, x)| (at, x.to_bits()));
        let expected = numbers.iter().position(|&x| x == 0.0).map(|at| (at, numbers[at]));
        prop_assert_eq!(bits(first_better(&numbers, 1.0, |a, b| a < b)), bits(expected));
        let negated: Vec<f32> = numbers.iter().map(|x| -x).collect();
        let expected = expected.map(|(at, x)| (at, -x));
        prop_assert_eq!(bits(first_better(&negated, -1.0, |a, b| a > b)), bits(expected));
    }

    #[test]
    fn a_vector_that_may_not_be_taken_is_refused_at_its_first_number(
        good in numbers(2..1200), spoilt in vec((any::<prop::sample::Index>(), 0..3_usize), 0..3),
    ) {
        let mut d = good.clone();
        for (at, kind) in spoilt {
            let at = at.index(d.len());
            d[at] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][kind];
        }
        match (checked_minimum(&d, d.len()), d.iter().position(|x| !x.is_finite())) {
            (Ok(single), None) => prop_assert_eq!(single, minimum(&good)),
            (Err(Error::NotFinite { index, value, row: None, .. }), Some(first)) => {
                prop_assert_eq!((index, value.to_bits()), (first, d[first].to_bits()));
            }
            other => prop_assert!(false, "{:?}", other),
        }
    }

    #[test]
    fn minimum_is_the_first_of_the_smallest(numbers in numbers(1..1200)) {
        let single = minimum(&numbers);
        prop_assert!(numbers.iter().all(|&x| x >= single.distance));
        prop_assert!(numbers[..single.place].iter().all(|&x| x > single.distance));
        prop_assert_eq!(single.distance.to_bits(), numbers[single.place].to_bits());
    }

    #[test]
    fn gradient_is_the_second_difference(d in numbers(2..150), kind in kinds()) {
        let mut g = vec![f32::NAN; d.len()];
        gradient(&d, kind, &mut g);
        prop_assert!(same(&g, &naive_gradient(&d, kind)), "{:?}", g);
    }

    #[test]
    fn a_missing_gradient_is_the_mean_of_the_current_one(d in numbers(2..150), kind in kinds()) {
        let mut g = vec![0.0; d.len()];
        gradient(&d, kind, &mut g);
        let mean = g.iter().map(|&x| f64::from(x)).sum::<f64>() / g.len() as f64;
        // Unhalved, the inside counts twice, so that the sum is less the two ends: the method's 0
        // stands in for it.
        let expected = if kind == Gradient::Halved { mean } else { 0.0 };
        prop_assert!((f64::from(missing_gradient(&d, kind)) - expected).abs() < 1e-6);
    }

    /// Whether the older gradients are made of columns or were kept.
    #[test]
    fn the_enhanced_peak_adds_along_the_diagonal_in_order(
        d in columns(2..600, 1..6), before in 0..4_usize, kept in 0..5_usize, smoothing in 1..9_usize, kind in kinds(),
    ) {
        check_peak(&d, before, kept, smoothing, kind)?;
    }

    /// Of sums that are equal but for rounding, the order of the additions decides.
    #[test]
    fn the_enhanced_peak_is_the_largest_after_rounding(
        d in vec(vec(select(vec![0.1_f32, 0.2, 0.3, 0.7, 1.1]), 1680), 3), kind in kinds(),
    ) {
        check_peak(&d, 0, 0, 3, kind)?;
    }

    #[test]
    fn best_sequence_is_the_smallest_mean_of_all_diagonals(
        raw in prop_oneof![columns(8..150, 1..8), columns(200..900, 1..4)], before in 0..3_usize, trust in any::<u8>(),
        weight in select(vec![0.0, 0.5, 0.99, 1.0]), floor in -3.0..0.0_f64,
        speeds in vec(select(vec![0.0, 0.5, 0.75, 1.0]), 1..4),
    ) {
        let length = raw.len();
        let anchor = |age: usize| {
            // Any cell may be the anchor here; in the matcher it is the column's minimum.
            let place = (usize::from(trust) * 7 + age * 3) % raw[age].len();
            let single = Single { place, distance: raw[age][place] };
            Anchor { single, trusted: (trust >> age) & 1 == 1 }
        };
        let mut weighted = raw.clone();
        for age in (0..length).filter(|&age| anchor(age).trusted) {
            let cell = &mut weighted[age][anchor(age).single.place];
            *cell = (f64::from(*cell) - weight * (f64::from(*cell) - floor)) as f32;
        }
        let back = |speed: f64, age: usize| (speed * age as f64 + 0.5).floor() as usize;
        // The smallest sum; of equals the lowest place, then the speed named first.
        let mut best: Option<(f64, usize, f64)> = None;
        for place in 0..raw[0].len() {
            for &speed in speeds.iter().filter(|&&speed| back(speed, length - 1) <= place) {
                let sum = (0..length).map(|age| f64::from(weighted[age][place - back(speed, age)])).sum::<f64>();
                if best.is_none_or(|(least, ..)| sum < least) {
                    best = Some((sum, place, speed));
                }
            }
        }
        let (sum, place, speed) = best.unwrap();
        let cells = (0..length).map(|age| (anchor(age), back(speed, age)));
        let anchors = cells.filter(|(a, back)| a.trusted && a.single.place + back == place).count();

        let (columns, frame) = (ring(&raw, before), length as u64 + 6);
        let mut ring = Anchors::new(length).unwrap();
        (0..length).rev().for_each(|age| ring.push(anchor(age)));
        let mut search = Search::new(&speeds, length, raw[0].len()).unwrap();
        let window = Window { frame, columns: &columns, anchors: &ring, weight, floor };
        let got = search.best(window).unwrap();
        prop_assert_eq!((got.place, got.speed, got.anchors), (place, speed, anchors));
        prop_assert_eq!(got.score, (sum / length as f64) as f32);
    }

    #[test]
    fn a_ring_holds_the_newest_columns(capacity in 1..9_usize, pushes in 0..40_u8) {
        let mut ring = Ring::new(capacity, 2).unwrap();
        for push in 0..pushes {
            ring.advance().fill(f32::from(push));
        }
        prop_assert_eq!(ring.len(), capacity.min(usize::from(pushes)));
        for age in 0..ring.len() {
            prop_assert_eq!(ring.column(age), &[f32::from(pushes) - 1.0 - age as f32; 2][..]);
        }
        ring.clear();
        prop_assert_eq!(ring.len(), 0);
    }
}
