//! A matcher that is told bounds against one that is told the distances, to the last bit.

use std::ops::Range;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use super::argmin::{Candidate, Search, first_least};
use super::tests::route;
use super::window::Window;
use super::{Column, Exact, Fix, Given, Matcher};
use crate::cases::cases;
use crate::config::{Config, Floor, Gradient};
use crate::motion::Motion;
use crate::random::SplitMix64;

/// All distances, and where the newest query's are; and how many were asked for.
struct Known<'a> {
    columns: &'a [Vec<f32>],
    newest: usize,
    asked: usize,
}

impl Exact for Known<'_> {
    const BOUNDS: bool = true;

    fn distances(&mut self, age: usize, places: Range<usize>, out: &mut [f32]) {
        self.asked += places.len();
        out.copy_from_slice(&self.columns[self.newest - age][places]);
    }
}

/// Drives and bounds by chance.
struct Drive(SplitMix64);

impl Drive {
    /// A drive along the route, from `start`, whose distances dip where it is, by more or less; or
    /// whole numbers, which tie. Now and then, all distances are equal.
    fn column(&mut self, places: usize, at: usize, ties: bool) -> Vec<f32> {
        if self.0.below(12) == 0 {
            return vec![self.0.below(4) as f32; places];
        }
        let mut column: Vec<f32> = (0..places)
            .map(|_| if ties { self.0.below(4) as f32 } else { 0.5 + 0.5 * self.0.share() })
            .collect();
        if !ties && self.0.below(5) > 0 {
            column[at % places] -= 0.7 * self.0.share();
        }
        column
    }

    /// Bounds as wide as `width` on either side; some are the distances themselves, some lie on one
    /// side only.
    fn bounds(&mut self, column: &[f32], width: f32) -> (Vec<f32>, Vec<f32>) {
        let mut side = |x: f32, sign: f32| match self.0.below(8) {
            0 => x,
            1 => x + sign * 1e-7,
            _ => x + sign * width * self.0.share(),
        };
        let low = column.iter().map(|&x| side(x, -1.0)).collect();
        (low, column.iter().map(|&x| side(x, 1.0)).collect())
    }
}

/// A matcher that accepts bounds, and goes on from `matcher`.
fn bounded(mut matcher: Matcher) -> Matcher {
    matcher.accept_bounds().unwrap();
    matcher
}

fn bits(fix: &Fix) -> String {
    // Shortest digits that read back the same: with the sign of a zero, all bits.
    format!("{fix:?}")
}

fn config(places: usize) -> impl Strategy<Value = Config> {
    let length = prop_oneof![3 => 1..=places.min(4), 1 => 1..=places];
    let smoothing = prop_oneof![4 => 1..=4_usize, 1 => 1..=2 * places];
    let speeds = prop_oneof![2 => Just(vec![1.0]), 1 => Just(vec![0.5, 1.0, 0.0, 0.75])];
    let floor = prop_oneof![Just(Floor::Running), Just(Floor::Fixed(0.05))];
    let gradient = select(vec![Gradient::Halved, Gradient::Unhalved]);
    let weight = select(vec![0.0, 0.5, 0.99, 1.0]);
    let kinds = [Motion::steady(), Motion::free(), Motion::any()].map(Some);
    let motion = prop_oneof![Just(None), select(kinds.to_vec())];
    (length, weight, 0..3_usize, smoothing, gradient, floor, speeds, motion).prop_map(
        |(sequence_length, weight, tolerance, smoothing, gradient, floor, speeds, motion)| Config {
            sequence_length,
            weight,
            tolerance,
            smoothing,
            gradient,
            floor,
            speeds,
            motion,
            technique_weights: Vec::new(),
        },
    )
}

/// Within a block of sums, and in several.
fn places() -> impl Strategy<Value = usize> {
    prop_oneof![30 => 2..90_usize, 1 => 250..600_usize]
}

proptest! {
    #![proptest_config(cases(20_000))]

    #[test]
    fn bounds_change_no_answer(
        (places, config) in places().prop_flat_map(|places| (Just(places), config(places))),
        width in select(vec![0.0, 1e-6, 0.01, 0.1, 0.5, 3.0]), ties: bool, restored: bool, seed: u64,
        cut: u64,
    ) {
        let (segments, mut config) = (route(places, cut), config);
        if config.validate_along(&segments).is_err() {
            // No segment is long enough.
            config.sequence_length = 1;
        }
        let mut drive = Drive(SplitMix64(seed));
        let start = drive.0.below(places);
        let columns: Vec<Vec<f32>> =
            (0..2 * config.sequence_length + 12).map(|j| drive.column(places, start + j, ties)).collect();
        let mut plain = Matcher::along(segments, config.clone()).unwrap();
        let mut told = bounded(plain.clone());
        for (newest, column) in columns.iter().enumerate() {
            let given = Given {
                trusted: [None, None, None, Some(true), Some(false)][drive.0.below(5)],
                advance: [None, None, Some(-0.75), Some(0.0), Some(1.25)][drive.0.below(5)],
            };
            let exact = Column::exact(column);
            let expected = plain.push_column(exact, given, &mut ()).unwrap();
            let mut known = Known { columns: &columns, newest, asked: 0 };
            let got = if drive.0.below(6) == 0 {
                told.push_column(exact, given, &mut known)
            } else {
                let (low, high) = drive.bounds(column, width);
                let bounds = Column::bounds(&low, &high);
                told.push_column(bounds, given, &mut known)
            }.unwrap();
            prop_assert_eq!(bits(&got), bits(&expected), "query {}", newest);
            prop_assert!(known.asked >= told.window().asked(), "counts the distances asked for");
            if restored && newest == columns.len() / 2 {
                // A snapshot is that of the plain one, and either goes on from it.
                told.window().resolve(&mut known);
                let (own, other) = (told.snapshot().unwrap(), plain.snapshot().unwrap());
                prop_assert_eq!(&own, &other);
                told = bounded(Matcher::restore(&own, None).unwrap());
            }
            if drive.0.below(10 + 2 * config.sequence_length) == 0 {
                plain.gap();
                told.gap();
                prop_assert!(told.window().newest(&mut known).is_none());
            } else if drive.0.below(20) == 0 {
                let newest = told.window().newest(&mut known).unwrap();
                prop_assert_eq!(newest, column.as_slice());
            }
        }
    }
}

proptest! {
    #![proptest_config(cases(5_000))]

    /// Of the numbers and the best so far, the first of the least, by as few of them as bounds allow.
    #[test]
    fn the_first_of_the_least_numbers_is_found_by_their_bounds(
        cells in vec((-9..9_i8, 0..4_u8), 1..400), first in 0..5_usize,
        best in proptest::option::of((-9..9_i8, 0..400_usize)), most in 0..60_usize,
    ) {
        let number = |place: usize| f64::from(cells[place - first].0);
        let bounds: Vec<f32> = cells.iter().map(|&(x, below)| f32::from(x) - f32::from(below)).collect();
        let best = best.map(|(least, place)| (f64::from(least), place));
        let before = |one: Candidate, best: Option<Candidate>| best.is_none_or(|best| one < best);
        let lower = |a: Option<Candidate>, b: Candidate| if before(b, a) { Some(b) } else { a };
        // Places by their bounds: the first of them is computed first.
        let mut order: Vec<Candidate> =
            bounds.iter().enumerate().map(|(at, &bound)| (f64::from(bound), first + at)).collect();
        order.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let after_one = if before(order[0], best) { lower(best, (number(order[0].1), order[0].1)) } else { best };
        let open = order[1..].iter().filter(|&&bound| before(bound, after_one)).count();
        let least = (first..first + cells.len()).fold(best, |best, at| lower(best, (number(at), at)));
        let mut asked = Vec::new();
        let ask = |place, _: Option<Candidate>| { asked.push(place); Some(number(place)) };
        let found = first_least(&bounds, first, best, most, &mut vec![(0.0, 0); 3], ask);
        match found {
            Search::TooMany => prop_assert!(open > most, "{open} of {most}"),
            Search::Best(found) => {
                prop_assert!(open <= most, "{open} of {most}");
                prop_assert_eq!(found, least);
                let needed = order.iter().filter(|&&bound| !before(least.unwrap(), Some(bound)));
                let needed: Vec<usize> = needed.map(|&(_, place)| place).collect();
                prop_assert!(asked.iter().zip(&order).all(|(&place, &(_, next))| place == next), "{asked:?}");
                prop_assert!(asked.len() <= needed.len() + 1, "{asked:?} of {needed:?}");
            }
        }
    }
}

/// Of a column of which more than one in four is asked for, all is computed, and each distance is
/// counted once.
#[test]
fn a_quarter_of_a_column_is_asked_for_one_by_one() {
    const PLACES: usize = 40;
    let columns: Vec<Vec<f32>> = (0..2).map(|j| vec![j as f32; PLACES]).collect();
    let mut window = Window::new(2, PLACES).unwrap();
    window.accept_bounds().unwrap();
    for newest in 0..2 {
        let (low, high) = (vec![-1.0; PLACES], vec![2.0; PLACES]);
        window.cells.push(&low, &high, 0);
        let mut known = Known { columns: &columns, newest, asked: 0 };
        for asked in 1..=PLACES / 4 {
            let place = 3 * asked;
            assert!(window.cells.resolve(0, place..place + 1, &mut known));
            assert!(!window.cells.resolve(0, place..place + 1, &mut known));
            assert_eq!(
                (known.asked, window.asked(), window.cells.is_resolved(0)),
                (asked, asked, false)
            );
        }
        assert!(window.cells.resolve(0, 1..3, &mut known));
        assert_eq!((known.asked, window.asked()), (PLACES / 4 + PLACES, PLACES));
        assert!(window.cells.is_resolved(0) && !window.cells.resolve(0, 0..PLACES, &mut known));
        assert_eq!(window.newest(&mut known), Some(&columns[newest][..]));
    }
}

/// If one distance is clearly the least, few others are computed.
#[test]
fn few_places_are_looked_at_where_few_are_in_doubt() {
    const PLACES: usize = 1000;
    let mut drive = Drive(SplitMix64(1));
    let columns: Vec<Vec<f32>> = (0..40)
        .map(|j| {
            let mut column: Vec<f32> = (0..PLACES).map(|_| 0.5 + 0.5 * drive.0.share()).collect();
            column[600 + j] = 0.1;
            column
        })
        .collect();
    let config = Config { sequence_length: 3, ..Config::default() };
    let mut plain = Matcher::new(PLACES, config).unwrap();
    let mut told = bounded(plain.clone());
    for (newest, column) in columns.iter().enumerate() {
        let expected = plain.push(column).unwrap();
        let (low, high) = drive.bounds(column, 0.02);
        let mut known = Known { columns: &columns, newest, asked: 0 };
        let bounds = Column::bounds(&low, &high);
        let fix = told.push_column(bounds, Given::default(), &mut known).unwrap();
        let looked_at = told.window().asked();
        assert_eq!(fix.single.place, 600 + newest);
        assert_eq!(bits(&fix), bits(&expected), "query {newest}");
        assert_eq!(looked_at, known.asked);
        assert!(looked_at < 20, "query {newest}: {looked_at} places");
    }
}

/// Columns whose single match is clear and whose sums are not: then all of an older column is
/// computed, and its trusted cell keeps its weight.
#[test]
fn a_trusted_cell_keeps_its_weight_if_its_column_is_computed() {
    const PLACES: usize = 60;
    for seed in 0..400 {
        let mut drive = Drive(SplitMix64(seed));
        let columns: Vec<Vec<f32>> = (0..12)
            .map(|j| {
                let mut column: Vec<f32> =
                    (0..PLACES).map(|_| 0.5 + 0.5 * drive.0.share()).collect();
                column[drive.0.below(PLACES)] =
                    if j == 0 { 0.0 } else { 0.2 + 0.1 * drive.0.share() };
                column
            })
            .collect();
        let speeds = vec![1.0, 0.5, 0.0, 0.75];
        let config = Config { sequence_length: 4, speeds, ..Config::default() };
        let mut plain = Matcher::new(PLACES, config).unwrap();
        let mut told = bounded(plain.clone());
        for (newest, column) in columns.iter().enumerate() {
            let given = Given { trusted: Some(newest % 3 > 0), ..Given::default() };
            let expected = plain.push_column(Column::exact(column), given, &mut ()).unwrap();
            // The least distance is known, the others more or less.
            let (mut low, mut high) = drive.bounds(column, 0.45);
            high[expected.single.place] = expected.single.distance;
            for (place, bound) in low.iter_mut().enumerate() {
                *bound =
                    if place == expected.single.place { column[place] } else { bound.max(0.31) };
            }
            let mut known = Known { columns: &columns, newest, asked: 0 };
            let got = told.push_column(Column::bounds(&low, &high), given, &mut known).unwrap();
            assert_eq!(bits(&got), bits(&expected), "drive {seed}, query {newest}");
        }
    }
}
