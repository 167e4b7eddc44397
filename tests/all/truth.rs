//! When a match is correct, and the figures that count it so, beside their definitions.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use surefix::evaluate::{TrustTable, Truth, Verdict, evaluate_trust, recall_at};
use surefix::{Error, Positions, Run, Segments};

use crate::cases::{any_fix, cases};
use crate::filter::along;

/// Whole numbers, so that distances are known exactly, on two or three axes.
fn points(axes: usize) -> impl Strategy<Value = Vec<i32>> {
    (1..9_usize).prop_flat_map(move |count| vec(-3..4_i32, count * axes))
}

fn positions(points: &[i32], axes: usize) -> Positions {
    Positions::new(points.iter().map(|&x| f64::from(x)).collect(), axes).unwrap()
}

/// The verdict on every match, one query and one place past the end among them.
fn check(
    truth: &Truth,
    (places, queries): (usize, usize),
    verdict: impl Fn(usize, usize) -> Verdict,
    exists: impl Fn(usize) -> bool,
) -> Result<(), TestCaseError> {
    prop_assert_eq!((truth.len(), truth.is_empty()), (queries, queries == 0));
    prop_assert!(truth.check_places(places).is_ok());
    for query in 0..=queries {
        prop_assert_eq!(truth.exists(query), query < queries && exists(query), "{}", query);
        for place in 0..=places {
            let known = query < queries && place < places;
            let expected = if known { verdict(query, place) } else { Verdict::Wrong };
            prop_assert_eq!(truth.judge(query, place), expected, "{} at {}", query, place);
        }
    }
    Ok(())
}

fn verdict(correct: bool) -> Verdict {
    if correct { Verdict::Correct } else { Verdict::Wrong }
}

/// A route of 10 places: with and without a break, and with closed segments.
fn routes() -> impl Strategy<Value = Segments> {
    let route = |breaks: &[usize], closed: &[usize]| {
        Segments::new(10, breaks).unwrap().with_closed(closed).unwrap()
    };
    select(vec![route(&[], &[]), route(&[], &[0]), route(&[6], &[0]), route(&[3, 4], &[2])])
}

/// Whether a place is reached from another by a few places on or back.
fn near(route: &Segments, one: usize, other: usize, tolerance: usize) -> bool {
    let reach = -(tolerance as i64)..=tolerance as i64;
    reach.into_iter().any(|by| along(route, one, by) == Some(other))
}

proptest! {
    #![proptest_config(cases(2_000))]

    #[test]
    fn a_true_place_is_right_within_the_tolerance(
        route in routes(), truth in vec(proptest::option::weighted(0.8, 0..10_usize), 0..6),
        tolerance in 0..7_usize,
    ) {
        let right = |query: usize, place: usize| {
            verdict(truth[query].is_some_and(|there| near(&route, there, place, tolerance)))
        };
        let exists = |query: usize| truth[query].is_some();
        let known = Truth::places(truth.clone(), tolerance).along(&route);
        check(&known, (10, truth.len()), right, exists)?;
        prop_assert_eq!(known.extent(), None);
    }

    #[test]
    fn a_cell_is_right_within_the_tolerance_or_ignored(
        route in routes(), columns in vec(vec(-1..2_i8, 10), 1..5), tolerance in 0..4_usize,
    ) {
        let cells = ndarray::Array2::from_shape_fn((10, columns.len()), |(i, j)| columns[j][i]);
        let right = |query: usize, place: usize| {
            let same = |there| columns[query][there] == 1 && near(&route, there, place, tolerance);
            match columns[query][place] {
                _ if (0..10).any(same) => Verdict::Correct,
                -1 => Verdict::Ignored,
                _ => Verdict::Wrong,
            }
        };
        let exists = |query: usize| columns[query].contains(&1);
        let truth = Truth::cells(&cells.view(), tolerance).unwrap().along(&route);
        check(&truth, (10, columns.len()), right, exists)?;
    }

    #[test]
    fn a_position_is_right_within_metres(
        (axes, places, queries) in (2..4_usize).prop_flat_map(|n| (Just(n), points(n), points(n))),
        halves in 0..12_i32,
    ) {
        let (here, there) = (places.len() / axes, queries.len() / axes);
        let apart = |place: usize, query: usize| -> i32 {
            let (a, b) = (&places[place * axes..][..axes], &queries[query * axes..][..axes]);
            a.iter().zip(b).map(|(a, b)| (a - b).pow(2)).sum()
        };
        let near = |place: usize, query: usize| 4 * apart(place, query) <= halves * halves;
        let right = |query: usize, place: usize| verdict(near(place, query));
        let exists = |query: usize| (0..here).any(|place| near(place, query));
        let metres = f64::from(halves) / 2.0;
        let truth = Truth::positions(positions(&places, axes), positions(&queries, axes), metres);
        let truth = truth.unwrap();
        check(&truth, (here, there), right, exists)?;
        let side = |axis: usize| {
            let along: Vec<i32> = places.iter().copied().skip(axis).step_by(axes).collect();
            along.iter().max().unwrap() - along.iter().min().unwrap()
        };
        let squares: i32 = (0..axes).map(|axis| side(axis).pow(2)).sum();
        prop_assert_eq!(truth.extent(), Some(f64::from(squares).sqrt()));
    }

    /// Ties go to the lowest place; queries without a true place do not count.
    #[test]
    fn recall_at_k_is_the_share_of_the_first_k_places(
        columns in vec(vec((0..5_u8).prop_map(f32::from), 10), 1..7),
        truth in vec(proptest::option::weighted(0.7, 0..10_usize), 7), unknown in 0..9_usize,
        tolerance in 0..3_usize,
    ) {
        let queries = columns.len();
        let matrix = ndarray::Array2::from_shape_fn((10, queries), |(i, j)| columns[j][i]);
        let truth = Truth::places(truth[..queries].to_vec(), tolerance).ignoring([unknown]);
        let rank = |query: usize| {
            let mut places: Vec<usize> = (0..10).collect();
            places.sort_by(|&a, &b| columns[query][a].total_cmp(&columns[query][b]));
            places.iter().position(|&place| truth.judge(query, place) == Verdict::Correct)
        };
        let ranks: Vec<usize> = (0..queries).filter_map(rank).collect();
        let ks: Vec<usize> = (1..12).collect();
        let share = |k: &usize| {
            let within = ranks.iter().filter(|rank| *rank < k).count();
            within as f64 / ranks.len().max(1) as f64
        };
        let expected: Vec<f64> = ks.iter().map(share).collect();
        prop_assert_eq!(recall_at(&matrix.view(), &truth, &ks).unwrap(), expected);
    }

    #[test]
    fn trust_is_counted_by_its_name(
        fixes in vec((0..8_usize, any::<bool>(), proptest::option::weighted(0.8, 0..8_usize)), 0..30),
        unknown in 0..40_usize,
    ) {
        let mut run = Run::default();
        run.segments = Segments::one(8);
        run.fixes = fixes.iter().map(|&(place, trusted, _)| {
            let mut fix = any_fix();
            (fix.single.place, fix.trusted) = (place, trusted);
            fix
        }).collect();
        let truth = Truth::places(fixes.iter().map(|fix| fix.2).collect(), 1).ignoring([unknown]);
        let count = |trusted: bool, right: bool| {
            let known = fixes.iter().enumerate().filter(|&(query, _)| query != unknown);
            known.filter(|&(_, &(place, flag, there))| {
                flag == trusted && there.is_some_and(|there| there.abs_diff(place) <= 1) == right
            }).count()
        };
        let table = evaluate_trust(&run, &truth).unwrap();
        prop_assert_eq!(table, TrustTable {
            true_positives: count(true, true),
            false_positives: count(true, false),
            false_negatives: count(false, true),
            true_negatives: count(false, false),
        });
        let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
        let (trusted, right) = (count(true, true) + count(true, false), count(true, true) + count(false, true));
        let wrong = count(true, false) + count(false, false);
        prop_assert_eq!(table.precision(), share(count(true, true), trusted));
        prop_assert_eq!(table.recall(), share(count(true, true), right));
        prop_assert_eq!(table.false_positive_rate(), share(count(true, false), wrong));
        prop_assert_eq!(table.share_trusted(), share(trusted, right + wrong));
    }
}

#[test]
fn a_truth_of_another_route_is_refused() {
    let cells = ndarray::Array2::from_elem((10, 2), 1_i8);
    let line = |count: usize| Positions::new(vec![0.5; 2 * count], 2).unwrap();
    let truths = [
        Truth::places(vec![Some(9), None], 0),
        Truth::cells(&cells.view(), 0).unwrap(),
        Truth::positions(line(10), line(2), 1.0).unwrap(),
    ];
    for truth in truths {
        assert!(truth.check_places(10).is_ok());
        assert!(truth.check_places(9).is_err());
        let (mut run, matrix) = (Run::default(), ndarray::Array2::zeros((9, 2)));
        (run.fixes, run.segments) = (vec![any_fix(); 2], Segments::one(9));
        assert!(evaluate_trust(&run, &truth).is_err());
        assert!(recall_at(&matrix.view(), &truth, &[1]).is_err());
    }
    let deep = Positions::new(vec![0.5; 3], 3).unwrap();
    assert!(matches!(Truth::positions(line(1), deep, 1.0), Err(Error::Shape { .. })));
    for metres in [-1.0, f64::NAN, f64::INFINITY] {
        let refused = Truth::positions(line(1), line(1), metres);
        assert!(matches!(refused, Err(Error::Option { name: "tolerance", .. })));
    }
    assert!(matches!(
        Truth::cells(&ndarray::array![[1, 2_i8]].view(), 0),
        Err(Error::Shape { what: "truth", .. })
    ));
}

#[test]
fn what_cannot_be_ranked_is_refused() {
    let truth = Truth::places(vec![Some(0), Some(1)], 0);
    let good = ndarray::array![[0.5_f32, 0.5], [0.5, 0.5]];
    let nan = ndarray::array![[0.5_f32, 0.5], [0.5, f32::NAN]];
    assert_eq!(recall_at(&good.view(), &truth, &[1, 2]).unwrap(), [0.5, 1.0]);
    let refused = recall_at(&nan.view(), &truth, &[1]).unwrap_err();
    assert!(matches!(refused, Error::NotFinite { row: Some(1), index: 1, .. }), "{refused}");
    assert!(matches!(recall_at(&good.view(), &truth, &[1, 0]), Err(Error::Option { .. })));
    let short = Truth::places(vec![Some(0)], 0);
    assert!(matches!(recall_at(&good.view(), &short, &[1]), Err(Error::Length { .. })));
    let mut run = Run::default();
    (run.fixes, run.segments) = (vec![any_fix(); 3], Segments::one(2));
    assert!(matches!(evaluate_trust(&run, &truth), Err(Error::Length { .. })));
}
