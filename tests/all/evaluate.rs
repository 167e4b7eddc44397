//! The precision-recall curve against a sweep that counts anew at every threshold.

use crate::cases::{any_fix, cases};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use surefix::evaluate::{Bootstrap, Curve, Recall, Truth, Verdict, evaluate};
use surefix::{Error, Fix, Peak, Run, Segments, Sequence, Single};

const RECALLS: [Recall; 3] = [Recall::Correct, Recall::PlaceExists, Recall::Rejected];

/// A match: its place, its score, the true place.
type Query = (usize, f32, Option<usize>);

fn fix(place: usize, score: f32, ready: bool) -> Fix {
    let sequence = ready.then_some(Sequence { place, score, anchors: 0, speed: 1.0 });
    let (single, gradient) = (Single { place, distance: score }, Peak { place, value: 0.0 });
    let mut fix = any_fix();
    (fix.frame, fix.trusted, fix.place, fix.score) = (0, false, place, score);
    (fix.single, fix.gradient, fix.sequence) = (single, gradient, sequence);
    fix
}

fn run(fixes: Vec<Fix>) -> Run {
    let mut run = Run::default();
    (run.fixes, run.segments) = (fixes, Segments::one(10));
    run
}

fn curve(queries: &[Query], tolerance: usize, recall: Recall) -> Curve {
    let fixes = queries.iter().map(|&(place, score, _)| fix(place, score, true));
    let run = run(fixes.collect());
    let truth: Vec<Option<usize>> = queries.iter().map(|query| query.2).collect();
    evaluate(&run.matches(), &Truth::places(truth, tolerance), recall).unwrap()
}

/// Few scores, so that many are equal.
fn queries() -> impl Strategy<Value = Vec<Query>> {
    let score = prop_oneof![(0..6_u8).prop_map(f32::from), select(vec![-0.0, 0.0]), 0.0..6.0_f32];
    vec((0..8_usize, score, proptest::option::weighted(0.8, 0..8_usize)), 0..60)
}

fn correct(query: &Query, tolerance: usize) -> bool {
    query.2.is_some_and(|truth| query.0 <= truth + tolerance && truth <= query.0 + tolerance)
}

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn every_point_is_counted_afresh(queries in queries(), tolerance in 0..3_usize, recall in select(RECALLS.to_vec())) {
        let curve = curve(&queries, tolerance, recall);
        let mut thresholds: Vec<f32> = queries.iter().map(|query| query.1).collect();
        thresholds.sort_by(|a, b| a.partial_cmp(b).unwrap());
        thresholds.dedup();
        prop_assert_eq!(curve.points().len(), thresholds.len());
        let count = |what: &dyn Fn(&Query) -> bool| queries.iter().filter(|query| what(query)).count();
        for (point, threshold) in curve.points().iter().zip(thresholds) {
            let accepted = |query: &Query| query.1 <= threshold;
            let found = count(&|query| accepted(query) && correct(query, tolerance));
            let relevant = match recall {
                Recall::Correct => count(&|query| correct(query, tolerance)),
                Recall::PlaceExists => count(&|query| query.2.is_some()),
                _ => found + count(&|query| !accepted(query)),
            };
            prop_assert_eq!(point.threshold, threshold);
            prop_assert_eq!(point.precision, found as f64 / count(&accepted) as f64);
            prop_assert_eq!(point.recall, if found == 0 { 0.0 } else { found as f64 / relevant as f64 });
            prop_assert_eq!(point.false_positives, count(&accepted) - found);
        }
        prop_assert!(curve.points().is_sorted_by(|a, b| a.recall <= b.recall && a.threshold < b.threshold));
    }

    #[test]
    fn the_figures_are_what_their_names_say(
        queries in queries(), upto in 0.0..=1.0_f64, at_a_point: bool, recall in select(RECALLS.to_vec()),
    ) {
        let curve = curve(&queries, 1, recall);
        let points = curve.points();
        let upto = points.get(points.len() / 2).filter(|_| at_a_point).map_or(upto, |point| point.recall);

        // The last precision at each recall, joined by lines; the first one held back to recall 0.
        // The line that is cut leads to the first precision at its recall.
        let mut knots: Vec<(f64, f64)> = points.first().map(|point| (0.0, point.precision)).into_iter().collect();
        for point in points {
            knots.retain(|&(at, _)| at == 0.0 || at != point.recall);
            if point.recall > 0.0 {
                knots.push((point.recall, point.precision));
            } else {
                knots[0].1 = point.precision;
            }
        }
        let area: f64 = knots.windows(2).map(|ends| {
            let ((a, p), (b, q)) = (ends[0], ends[1]);
            let end = b.min(upto).max(a);
            let cut = end < b;
            let first = points.iter().find(|point| point.recall == b).map_or(q, |point| point.precision);
            let at_end = p + (if cut { first } else { q } - p) * (end - a) / (b - a);
            (end - a) * f64::midpoint(p, at_end)
        }).sum();
        if upto > 1e-9 {
            prop_assert!((curve.auc(upto) - area / upto).abs() < 1e-9, "{} for {}", curve.auc(upto), area / upto);
        }

        let best = |wanted: f64| points.iter().filter(|p| p.precision >= wanted).map(|p| p.recall).fold(0.0, f64::max);
        for precision in [0.0, 0.5, upto, 1.0] {
            prop_assert_eq!(curve.recall_at_precision(precision), best(precision));
        }
        prop_assert_eq!(curve.max_recall(), points.iter().map(|p| p.recall).fold(0.0, f64::max));
        let reached = points.iter().filter(|p| p.recall >= upto).map(|p| p.false_positives).min();
        prop_assert_eq!(curve.false_positives_at(upto), reached);
    }

    #[test]
    fn the_order_of_the_queries_does_not_matter(queries in queries(), recall in select(RECALLS.to_vec())) {
        let mut turned = queries.clone();
        turned.reverse();
        let (a, b) = (curve(&queries, 1, recall), curve(&turned, 1, recall));
        prop_assert_eq!(a.points(), b.points());
    }
}

#[test]
fn equal_scores_enter_together() {
    // Whichever of the two came first would decide, if they could be told apart.
    let queries = [(0, 1.0, Some(0)), (0, 1.0, Some(7)), (0, 2.0, Some(0))];
    let curve = curve(&queries, 0, Recall::Correct);
    let points: Vec<_> = curve
        .points()
        .iter()
        .map(|p| (p.threshold, p.precision, p.recall, p.false_positives))
        .collect();
    assert_eq!(points, [(1.0, 0.5, 0.5, 1), (2.0, 2.0 / 3.0, 1.0, 1)]);
}

#[test]
fn a_perfect_run_scores_one_everywhere() {
    let queries: Vec<Query> = (0..20).map(|j| (j, j as f32, Some(j))).collect();
    for recall in RECALLS {
        let curve = curve(&queries, 0, recall);
        for upto in [0.01, 0.2, 0.5, 1.0] {
            assert!(
                (curve.auc(upto) - 1.0).abs() < 1e-12,
                "{recall:?}, up to {upto}: {}",
                curve.auc(upto)
            );
        }
        assert_eq!((curve.max_recall(), curve.recall_at_precision(1.0)), (1.0, 1.0));
        assert_eq!(curve.false_positives_at(1.0), Some(0));
    }
}

#[test]
fn a_match_off_the_map_is_a_false_positive() {
    let queries = [(0, 1.0, None), (1, 2.0, Some(1))];
    let correct = curve(&queries, 1, Recall::Correct);
    assert_eq!(correct.points()[0].false_positives, 1);
    assert_eq!(correct.max_recall(), 1.0, "a query without a place cannot be missed");
    assert_eq!(curve(&queries, 1, Recall::PlaceExists).max_recall(), 1.0);
}

#[test]
fn the_three_recalls_differ_as_they_are_defined() {
    // Accepted and right; accepted and wrong, though it has a place; rejected and right.
    let queries = [(1, 1.0, Some(1)), (1, 2.0, Some(5)), (3, 3.0, Some(3))];
    let recall_of_second = |recall| curve(&queries, 0, recall).points()[1].recall;
    assert_eq!(RECALLS.map(recall_of_second), [1.0 / 2.0, 1.0 / 3.0, 1.0 / 2.0]);
    let recall_of_first = |recall| curve(&queries, 0, recall).points()[0].recall;
    assert_eq!(RECALLS.map(recall_of_first), [1.0 / 2.0, 1.0 / 3.0, 1.0 / 3.0]);
}

#[test]
fn every_corner_gives_numbers() {
    let corners: [&[Query]; 5] = [
        &[],
        &[(0, 1.0, None)],
        &[(0, 1.0, None), (0, 1.0, None)],
        &[(0, 0.0, Some(9)), (1, 0.0, Some(9))],
        &[(0, f32::MAX, Some(0))],
    ];
    for (queries, recall) in
        corners.into_iter().flat_map(|queries| RECALLS.map(|recall| (queries, recall)))
    {
        let curve = curve(queries, 1, recall);
        for upto in [0.0, 1e-300, 0.2, 1.0, 2.0] {
            assert!(
                (0.0..=1.0).contains(&curve.auc(upto)),
                "{queries:?} up to {upto}: {}",
                curve.auc(upto)
            );
        }
        assert!((0.0..=1.0).contains(&curve.max_recall()));
        assert!((0.0..=1.0).contains(&curve.recall_at_precision(1.0)));
        for point in curve.points() {
            assert!((0.0..=1.0).contains(&point.precision) && (0.0..=1.0).contains(&point.recall));
        }
    }
    assert_eq!(curve(&[], 1, Recall::Correct).false_positives_at(0.5), None);
}

#[test]
fn the_warm_up_is_left_out() {
    let driven = run(vec![fix(0, 0.0, false), fix(3, 1.0, true)]);
    let curve =
        evaluate(&driven.matches(), &Truth::places(vec![Some(9), Some(3)], 0), Recall::Correct)
            .unwrap();
    assert_eq!(curve.points().len(), 1);
    assert_eq!(curve.points()[0].precision, 1.0);
    let warming = run(vec![fix(0, 0.0, false)]);
    assert!(
        evaluate(&warming.matches(), &Truth::places(vec![Some(0)], 0), Recall::Correct)
            .unwrap()
            .points()
            .is_empty()
    );
}

#[test]
fn a_truth_of_another_length_and_an_unknown_recall_are_refused() {
    let run = run(vec![fix(0, 0.0, true); 3]);
    let refused =
        evaluate(&run.matches(), &Truth::places(vec![None], 0), Recall::Correct).unwrap_err();
    assert!(matches!(refused, Error::Length { expected: 3, got: 1, .. }));
    assert_eq!(refused.to_string(), "truth: expected 3 values, got 1");
    for (name, recall) in ["correct", "place_exists", "rejected"].into_iter().zip(RECALLS) {
        assert_eq!(name.parse::<Recall>().unwrap(), recall);
    }
    let message = "Correct".parse::<Recall>().unwrap_err().to_string();
    assert!(
        message.contains("`recall`")
            && message.contains("\"place_exists\"")
            && message.contains("\"Correct\"")
    );
}

#[test]
fn a_tolerance_of_any_size_is_one() {
    let cells = ndarray::array![[0_i8, 1], [0, -1], [1, 0]];
    for tolerance in [2, 3, usize::MAX - 1, usize::MAX] {
        let truth = Truth::cells(&cells.view(), tolerance).unwrap();
        for (query, place) in [(0, 0), (0, 2), (1, 0), (1, 1)] {
            assert_eq!(
                truth.judge(query, place),
                Verdict::Correct,
                "place {place} within {tolerance}"
            );
        }
    }
}

#[test]
fn a_number_of_samples_that_no_memory_holds_is_refused() {
    let curve = curve(&[(1, 0.5, Some(1)), (2, 0.7, Some(3))], 0, Recall::Correct);
    for samples in [0, 100_000_001, 1 << 61, usize::MAX] {
        let refused =
            curve.auc_interval(1.0, &Bootstrap { samples, ..Bootstrap::default() }).unwrap_err();
        assert_eq!(
            refused.to_string(),
            format!("option `samples`: expected from 1 to 100000000, got {samples}")
        );
    }
}

proptest! {
    /// Queries whose place is not known change nothing: the curve is that of the others.
    #[test]
    fn unknown_queries_are_as_if_they_were_not_there(
        queries in queries(),
        every in 2..5_usize,
        recall in select(RECALLS.to_vec()),
    ) {
        let unknown = |query: &usize| query.is_multiple_of(every);
        let kept: Vec<Query> =
            queries.iter().enumerate().filter(|(query, _)| !unknown(query)).map(|(_, q)| *q).collect();
        let run = run(queries.iter().map(|&(place, score, _)| fix(place, score, true)).collect());
        let truth = Truth::places(queries.iter().map(|query| query.2).collect(), 1);
        let truth = truth.ignoring((0..queries.len()).filter(unknown));
        let found = evaluate(&run.matches(), &truth, recall).unwrap();
        let without = curve(&kept, 1, recall);
        prop_assert_eq!(found.points(), without.points());
        for query in (0..queries.len()).filter(unknown) {
            prop_assert_eq!(truth.judge(query, 0), Verdict::Ignored);
            prop_assert!(!truth.exists(query));
        }
    }
}
