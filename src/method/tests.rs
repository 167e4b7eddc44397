//! The kernels against one-line oracles, to the last bit, on grids of small numbers where
//! everything ties.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use super::argmin::first_better;
use super::estimator::{Estimator, Memory, Seen};
use super::gradient::{Enhancement, gradient, missing_gradient};
use super::sequence::SequenceSearch;
use super::single::{Single, checked_minimum, minimum};
use super::trust::{Anchor, Anchors};
use super::window::{Ring, Window};
use crate::cases::cases;
use crate::config::{Config, Gradient};
use crate::error::Error;
use crate::random::SplitMix64;
use crate::segments::Segments;
use crate::simd::{Compiled, Isa};

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

/// A window that has been pushed these columns, after `before` others that were overwritten or not.
fn window(newest_first: &[Vec<f32>], before: usize) -> Window {
    let mut window = Window::new(newest_first.len(), newest_first[0].len()).unwrap();
    for _ in 0..before {
        window.cells.lower.advance().fill(f32::NAN);
    }
    for column in newest_first.iter().rev() {
        window.cells.lower.advance().copy_from_slice(column);
    }
    window
}

/// Eq. 1 of a whole segment.
fn whole_gradient(d: &[f32], closed: bool, kind: Gradient) -> Vec<f32> {
    let mut g = vec![f32::NAN; d.len()];
    gradient(d, d, closed, kind, 0, &mut g, |out, value| *out = value);
    g
}

fn same(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Places that are cut into short and long segments by chance; some of them are closed.
pub(super) fn route(places: usize, seed: u64) -> Segments {
    let mut dice = SplitMix64(seed);
    let most = [places, 1, 5, 40, 300][dice.below(5)];
    let mut breaks = Vec::new();
    let mut at = 0;
    while at < places {
        at += 1 + dice.below(most);
        breaks.extend((at < places).then_some(at));
    }
    let segments = Segments::new(places, &breaks).unwrap();
    let closed = segments.iter().enumerate().filter(|(_, s)| s.len() > 2 && dice.below(2) == 0);
    let closed: Vec<usize> = closed.map(|(index, _)| index).collect();
    segments.with_closed(&closed).unwrap()
}

/// The place that is `steps` places back, found by its number in its segment.
fn back(segments: &Segments, place: usize, steps: usize) -> Option<usize> {
    let segment = segments.iter().find(|s| s.places().contains(&place)).unwrap();
    let number = (place - segment.start) as i64 - steps as i64;
    let number = if segment.closed { number.rem_euclid(segment.len() as i64) } else { number };
    (number >= 0).then(|| segment.start + number as usize)
}

fn naive_gradient(d: &[f32], segments: &Segments, kind: Gradient) -> Vec<f32> {
    let mut before: Vec<Option<usize>> = vec![None; d.len()];
    let mut after = before.clone();
    for (place, before) in before.iter_mut().enumerate() {
        *before = back(segments, place, 1);
        if let Some(previous) = *before {
            after[previous] = Some(place);
        }
    }
    let at = |i: usize| match (before[i], after[i], kind) {
        (None, None, _) => 0.0,
        (Some(only), None, _) | (None, Some(only), _) => d[only] - d[i],
        (Some(b), Some(a), Gradient::Halved) => (d[b] + d[a]) * 0.5 - d[i],
        (Some(b), Some(a), Gradient::Unhalved) => d[a] + d[b] - (d[i] + d[i]),
    };
    (0..d.len()).map(at).collect()
}

/// The peak of these columns, the newest first, beside that of all sums.
fn check_peak(
    d: &[Vec<f32>],
    segments: &Segments,
    before: usize,
    smoothing: usize,
    kind: Gradient,
) -> Result<(), TestCaseError> {
    let g: Vec<Vec<f32>> = d.iter().map(|d| naive_gradient(d, segments, kind)).collect();
    let mut sums = Vec::new();
    for segment in segments.iter() {
        let ends = g[0][segment.start] + g[0][segment.end - 1];
        let has_mean = kind == Gradient::Halved && segment.len() > 1 && !segment.closed;
        let missing = if has_mean { ends / (2 * segment.len()) as f32 } else { 0.0 };
        for i in segment.places() {
            let term = |k: usize| {
                let there = back(segments, i, k);
                g.get(k).zip(there).map_or(missing, |(g, there)| g[there])
            };
            sums.push((1..smoothing).fold(g[0][i], |sum, k| sum + term(k)));
        }
    }
    let highest = sums.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let place = sums.iter().position(|&x| x == highest).unwrap();
    let enhancement = Enhancement { gradient: kind, smoothing };
    let peak = enhancement.peak(&mut window(d, before), segments, &mut ());
    prop_assert_eq!((peak.place, peak.value.to_bits()), (place, sums[place].to_bits()));
    Ok(())
}

/// One estimate, compiled for an instruction set.
struct Estimate<'a>(&'a mut SequenceSearch, &'a mut Window, &'a Seen<'a>);

impl Compiled for Estimate<'_> {
    type Out = Option<super::Sequence>;

    #[inline(always)]
    fn run(self) -> Self::Out {
        self.0.estimate(self.1, self.2, &mut ())
    }
}

proptest! {
    #![proptest_config(cases(10_000))]

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
    fn gradient_is_the_second_difference(d in numbers(1..150), round: bool, kind in kinds()) {
        let closed = round && d.len() > 2;
        let segments = Segments::one(d.len()).with_closed(if closed { &[0] } else { &[] }).unwrap();
        let g = whole_gradient(&d, closed, kind);
        prop_assert!(same(&g, &naive_gradient(&d, &segments, kind)), "{:?}", g);
    }

    #[test]
    fn a_missing_gradient_is_the_mean_of_the_current_one(
        d in numbers(1..150), round: bool, kind in kinds(),
    ) {
        let closed = round && d.len() > 2;
        let g = whole_gradient(&d, closed, kind);
        let mean = g.iter().map(|&x| f64::from(x)).sum::<f64>() / g.len() as f64;
        // Unhalved, the inside counts twice, so that the sum is less the two ends: the method's 0
        // stands in for it.
        let expected = if kind == Gradient::Halved { mean } else { 0.0 };
        prop_assert!((f64::from(missing_gradient(&d, closed, kind)) - expected).abs() < 1e-6);
    }

    #[test]
    fn the_enhanced_peak_adds_along_the_diagonal_in_order(
        d in columns(2..600, 1..6), cut: u64, before in 0..4_usize, smoothing in 1..9_usize,
        kind in kinds(),
    ) {
        let segments = route(d[0].len(), cut);
        check_peak(&d, &segments, before, smoothing, kind)?;
    }

    /// Of sums that are equal but for rounding, the order of the additions decides.
    #[test]
    fn the_enhanced_peak_is_the_largest_after_rounding(
        d in vec(vec(select(vec![0.1_f32, 0.2, 0.3, 0.7, 1.1]), 1680), 3), kind in kinds(),
    ) {
        check_peak(&d, &Segments::one(1680), 0, 3, kind)?;
    }

    /// Of every length, on every instruction set; numbers of every size, so that each order of
    /// additions has other bits: from the oldest query to the newest.
    #[test]
    fn best_sequence_is_the_smallest_mean_of_all_diagonals(
        raw in prop_oneof![
            4 => columns(8..150, 1..8), 2 => columns(200..900, 1..4), 1 => columns(60..400, 8..60),
        ],
        before in 0..3_usize, trust in any::<u64>(), cut: u64,
        weight in select(vec![0.0, 0.5, 0.99, 1.0]), floor in -3.0..0.0_f64,
        speeds in vec(select(vec![0.0, 0.5, 0.75, 1.0, 7.0]), 1..4),
        wild: bool, isa: prop::sample::Index,
    ) {
        let (length, places) = (raw.len(), raw[0].len());
        let scale = |age: usize| if wild { 10_f32.powi((age * 7 % 31) as i32 - 15) } else { 1.0 };
        let raw: Vec<Vec<f32>> = raw.into_iter().enumerate()
            .map(|(age, column)| column.into_iter().map(|x| x * scale(age)).collect())
            .collect();
        let anchor = |age: usize| {
            // Any cell may be the anchor here; in the matcher it is the column's minimum.
            let place = (trust as usize % 256 * 7 + age * 3) % places;
            let single = Single { place, distance: raw[age][place] };
            Anchor { single, trusted: (trust >> age) & 1 == 1 }
        };
        let mut weighted = raw.clone();
        for age in (0..length).filter(|&age| anchor(age).trusted) {
            let cell = &mut weighted[age][anchor(age).single.place];
            *cell = (f64::from(*cell) - weight * (f64::from(*cell) - floor)) as f32;
        }
        let segments = route(places, cut);
        let on_diagonal = |place: usize, speed: f64, age: usize| {
            back(&segments, place, (speed * age as f64 + 0.5).floor() as usize)
        };
        // The smallest sum; of equals the lowest place, then the speed named first.
        let mut best: Option<(f64, usize, f64)> = None;
        for place in 0..places {
            for &speed in &speeds {
                let cell = |age: usize| Some(f64::from(weighted[age][on_diagonal(place, speed, age)?]));
                let cells: Option<Vec<f64>> = (0..length).rev().map(cell).collect();
                let Some(cells) = cells else { continue };
                let sum = cells.into_iter().fold(0.0, |sum, cell| sum + cell);
                if best.is_none_or(|(least, ..)| sum < least) {
                    best = Some((sum, place, speed));
                }
            }
        }
        let mut window = window(&raw, before);
        let mut ring = Anchors::new(length).unwrap();
        (0..length).rev().for_each(|age| ring.push(anchor(age)));
        let config = Config { sequence_length: length, weight, speeds, ..Config::default() };
        let mut search = SequenceSearch::new(&config).unwrap();
        prop_assert_eq!(search.memory(), Memory::Queries(length));
        let seen = Seen { segments: &segments, anchors: &ring, floor, advance: None, evidence: None };
        let isa = isa.get(&Isa::available().collect::<Vec<_>>()).to_owned();
        let got = isa.run(Estimate(&mut search, &mut window, &seen));
        // If no diagonal fits a segment, there is no sequence.
        prop_assert_eq!(got.is_some(), best.is_some());
        let (Some(got), Some((sum, place, speed))) = (got, best) else { return Ok(()) };
        let here = |&age: &usize| {
            anchor(age).trusted && on_diagonal(place, speed, age) == Some(anchor(age).single.place)
        };
        let anchors = (0..length).filter(here).count();
        prop_assert_eq!((got.place, got.speed, got.anchors), (place, speed, anchors));
        prop_assert_eq!(got.score.to_bits(), ((sum / length as f64) as f32).to_bits());
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

    /// A column that is given up leaves those before it, but for the one that it has overwritten.
    #[test]
    fn a_ring_goes_back_by_a_column(capacity in 1..9_usize, pushes in 0..40_u8, given_up in 0..2_usize) {
        let mut ring = Ring::new(capacity, 2).unwrap();
        for push in 0..pushes {
            ring.advance().fill(f32::from(push));
        }
        let held = ring.held();
        for _ in 0..given_up {
            ring.advance().fill(-1.0);
        }
        let left = (capacity - 1).min(usize::from(pushes));
        let expected: Vec<Vec<f32>> = (0..left).map(|age| vec![f32::from(pushes) - 1.0 - age as f32; 2]).collect();
        prop_assert_eq!(ring.columns(held).map(<[f32]>::to_vec).collect::<Vec<_>>(), expected.clone());
        ring.hold(held);
        prop_assert_eq!((0..ring.len()).map(|age| ring.column(age).to_vec()).collect::<Vec<_>>(), expected);
    }
}

/// A bowl: the sums of all blocks are larger than those of the first places.
#[test]
fn a_block_of_larger_sums_is_searched() {
    let bowl: Vec<f32> = (0..1680_u16).map(|i| (f32::from(i) - 840.0).powi(2)).collect();
    for kind in [Gradient::Halved, Gradient::Unhalved] {
        check_peak(&vec![bowl.clone(); 3], &Segments::one(1680), 0, 3, kind).unwrap();
    }
}

/// A slope: each block has smaller sums than the one before.
#[test]
fn a_block_of_smaller_sums_is_searched() {
    let slope: Vec<f32> = (0..1680_u16).map(|i| 2000.0 - f32::from(i)).collect();
    let segments = Segments::one(1680);
    for length in 1..=3 {
        let mut window = window(&vec![slope.clone(); length], 0);
        let anchors = Anchors::new(length).unwrap();
        let config = Config { sequence_length: length, ..Config::default() };
        let mut search = SequenceSearch::new(&config).unwrap();
        let (segments, anchors) = (&segments, &anchors);
        let seen = Seen { segments, anchors, floor: 0.0, advance: None, evidence: None };
        let found = Isa::Scalar.run(Estimate(&mut search, &mut window, &seen)).unwrap();
        // The last place: 321, and one more for each query before.
        assert_eq!((found.place, found.score), (1679, 321.0 + (length - 1) as f32 / 2.0));
    }
}

/// A part of a map is told the cells of as many places before its own.
#[test]
fn the_fastest_diagonal_reaches_farthest_back() {
    for (sequence_length, speeds, back) in [
        (1, vec![1.0], 0),
        (5, vec![0.0], 0),
        (2, vec![1.0], 1),
        (10, vec![0.5, 1.0, 0.0], 9),
        (4, vec![1.0, 2.5, 2.0], 8),
    ] {
        let config = Config { sequence_length, speeds, ..Config::default() };
        assert_eq!(SequenceSearch::new(&config).unwrap().reach(), back);
    }
}
