//! Truths, a part of the target `settings`: matches with truths of each kind. Curves are those of a
//! count at every threshold, and a threshold that is calibrated on them keeps its promise there.

use arbitrary::{Result, Unstructured};
use ndarray::Array2;
use surefix::calibration::{Calibrate, calibrate, wrong_by_truth};
use surefix::evaluate::{Bootstrap, Match, Recall, Truth, Verdict, evaluate};
use surefix::{Positions, Settings};

use crate::input::{number, rarely, route};

pub(crate) fn truth(data: &[u8]) {
    let _ = run(&mut Unstructured::new(data));
}

fn run(u: &mut Unstructured<'_>) -> Result<()> {
    let segments = route(u, 40)?;
    let places = segments.places();
    let queries = u.int_in_range(0..=60)?;
    let tolerance = if rarely(u, 8)? { usize::MAX } else { u.int_in_range(0..=3)? };
    let mut truth = match u.int_in_range(0..=2)? {
        0 => {
            let place = |u: &mut Unstructured<'_>| {
                Ok(if rarely(u, 5)? { None } else { Some(u.choose_index(places)?) })
            };
            let truth = (0..queries).map(|_| place(u)).collect::<Result<_>>()?;
            Truth::places(truth, tolerance)
        }
        1 => {
            let mut cells = Array2::zeros((places, queries));
            for cell in &mut cells {
                *cell = u.int_in_range(-1..=1_i8)?;
            }
            Truth::cells(&cells.view(), tolerance).expect("-1 to 1")
        }
        _ => {
            let mut metres = |count: usize| {
                (0..2 * count).map(|_| Ok(f64::from(number(u)?))).collect::<Result<Vec<_>>>()
            };
            let (map, drive) = (metres(places)?, metres(queries)?);
            let (Ok(map), Ok(drive)) = (Positions::new(map, 2), Positions::new(drive, 2)) else {
                return Ok(());
            };
            let Ok(truth) = Truth::positions(map, drive, f64::from(number(u)?)) else {
                return Ok(());
            };
            truth
        }
    };
    if u.arbitrary()? {
        truth = truth.along(&segments);
    }
    if queries > 0 && u.arbitrary()? {
        truth = truth.ignoring([u.choose_index(queries)?]);
    }
    let mut matches = Vec::new();
    for _ in 0..queries {
        let (place, score) = (u.choose_index(places)?, number(u)?);
        matches.push(Match { place, score, ready: !rarely(u, 6)?, accepted: !rarely(u, 6)? });
    }
    truth.check_places(places).expect("places of the route");
    for recall in [Recall::Correct, Recall::PlaceExists, Recall::Rejected] {
        count(&matches, &truth, recall);
    }
    promise(u, &matches, &truth)
}

/// Each point of the curve by counting.
fn count(matches: &[Match], truth: &Truth, recall: Recall) {
    let curve = evaluate(matches, truth, recall).expect("finite scores");
    let judged = matches.iter().enumerate().filter_map(|(query, found)| {
        let verdict = truth.judge(query, found.place);
        let counts = found.ready && verdict != Verdict::Ignored;
        counts.then_some((found, verdict == Verdict::Correct, truth.exists(query)))
    });
    let judged: Vec<_> = judged.collect();
    assert_eq!(curve.judged(), judged.len());
    let correct = judged.iter().filter(|j| j.1).count();
    assert_eq!(curve.correct(), correct);
    let mut before = f64::NEG_INFINITY;
    for point in curve.points() {
        let taken = |j: &&(&Match, bool, bool)| j.0.accepted && j.0.score <= point.threshold;
        let accepted = judged.iter().filter(taken).count();
        let right = judged.iter().filter(taken).filter(|j| j.1).count();
        assert_eq!(point.false_positives, accepted - right);
        assert_eq!(point.precision, right as f64 / accepted as f64);
        let relevant = match recall {
            Recall::Correct => correct,
            Recall::PlaceExists => judged.iter().filter(|j| j.2).count(),
            _ => right + judged.len() - accepted,
        };
        assert_eq!(point.recall, right as f64 / relevant.max(1) as f64);
        assert!(f64::from(point.threshold) > before);
        before = f64::from(point.threshold);
    }
    let taken: Vec<f32> = judged.iter().filter(|j| j.0.accepted).map(|j| j.0.score).collect();
    for score in taken {
        assert!(curve.points().iter().any(|point| point.threshold == score));
    }
    for upto in [0.0, 0.3, 1.0] {
        assert!((0.0..=1.0 + 1e-12).contains(&curve.auc(upto)), "{}", curve.auc(upto));
    }
    assert!((0.0..=1.0).contains(&curve.recall_at_precision(1.0)));
    let _ = (curve.best_f1(), curve.false_positives_at(0.5), curve.max_recall());
}

fn promise(u: &mut Unstructured<'_>, matches: &[Match], truth: &Truth) -> Result<()> {
    let Ok(wrong) = wrong_by_truth(matches, truth) else { return Ok(()) };
    let mut options = Calibrate::default();
    options.wrong = f64::from(u.int_in_range(1..=99_u8)?) / 100.0;
    options.sure = f64::from(u.int_in_range(1..=99_u8)?) / 100.0;
    let Ok(threshold) = calibrate(matches, &wrong, &options) else { return Ok(()) };
    let accepts = |found: &Match| threshold.score.is_some_and(|score| found.score <= score);
    let known = matches.iter().zip(&wrong).filter(|(found, _)| found.ready && found.accepted);
    let errors: Vec<f64> = known.filter(|(m, _)| accepts(m)).filter_map(|(_, w)| *w).collect();
    assert_eq!(threshold.accepted, errors.len(), "{threshold:?}");
    assert!((threshold.errors - errors.iter().sum::<f64>()).abs() < 1e-9);
    let share = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
    assert!(share <= options.wrong, "{share} of {options:?}");
    for found in matches {
        let right = threshold.probability().at(found.score);
        assert!((0.0..=1.0).contains(&right), "{right}");
    }
    let mut settings = Settings::default();
    settings.threshold = Some(threshold);
    let text = settings.to_toml().expect("numbers and texts");
    assert_eq!(Settings::from_toml(&text).expect("what was saved"), settings);
    if rarely(u, 8)?
        && let Ok(curve) = evaluate(matches, truth, Recall::Correct)
        && let Ok(interval) = curve.auc_interval(1.0, &Bootstrap::default())
    {
        assert!(interval.low <= interval.high, "{interval:?}");
    }
    Ok(())
}
