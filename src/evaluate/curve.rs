//! The exact sweep: every score is a threshold, and equal scores enter together. Figures of the
//! curve are numbers even if it is empty.

use serde::{Deserialize, Serialize};
use std::str::FromStr;

use super::truth::{Truth, Verdict};
use crate::batch::Run;
use crate::error::Error;

/// The whole that recall is a share of. Published code differs, so a figure names its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Recall {
    /// True positives of all queries whose match is correct: the paper's wording.
    #[default]
    Correct,
    /// True positives of all queries that have a true place.
    PlaceExists,
    /// True positives of true positives and all rejected queries: the authors' earlier code.
    Rejected,
}

impl FromStr for Recall {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        match name {
            "correct" => Ok(Self::Correct),
            "place_exists" => Ok(Self::PlaceExists),
            "rejected" => Ok(Self::Rejected),
            other => Err(Error::Option {
                name: "recall",
                expected: "\"correct\", \"place_exists\" or \"rejected\"".to_owned(),
                got: format!("{other:?}"),
            }),
        }
    }
}

/// One query's match, of any method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// The place, from 0.
    pub place: usize,
    /// How good the match is; less is better. Not a NaN.
    pub score: f32,
    /// False if the method had no answer, as in a sequence's warm-up. The query is left out then.
    pub ready: bool,
    /// False if a mask rejects the match at any score. It still counts towards recall.
    pub accepted: bool,
}

impl Run {
    /// The run's matches: the sequences' places and scores, all of which may be accepted.
    pub fn matches(&self) -> Vec<Match> {
        let of = |fix: &crate::Fix| Match {
            place: fix.place,
            score: fix.score,
            ready: fix.is_ready(),
            accepted: true,
        };
        self.fixes.iter().map(of).collect()
    }
}

/// One threshold: the queries with this score or a better one are accepted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The score up to which matches are accepted.
    pub threshold: f32,
    /// The share of the accepted matches that is correct.
    pub precision: f64,
    /// The share found, by the curve's recall convention.
    pub recall: f64,
    /// Accepted matches that are wrong.
    pub false_positives: usize,
}

/// A query's match with the truth's verdict.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Judged {
    pub(super) query: usize,
    score: f32,
    accepted: bool,
    correct: bool,
    place_exists: bool,
}

/// A precision-recall curve: a point a distinct score, from the best score to the worst.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    points: Vec<Point>,
    /// From the best score to the worst.
    judged: Vec<Judged>,
    pub(super) queries: usize,
    recall: Recall,
}

/// The precision-recall curve of any method's matches against the truth.
///
/// Queries that are not ready, and those that the truth ignores, are left out.
///
/// ```
/// use surefix::evaluate::{Match, Recall, Truth, evaluate};
///
/// let found = |place, score| Match { place, score, ready: true, accepted: true };
/// let matches = [found(0, 0.1), found(1, 0.2), found(7, 0.3), found(3, 0.4)];
/// let truth = Truth::places(vec![Some(0), Some(1), Some(2), Some(3)], 0);
/// let curve = evaluate(&matches, &truth, Recall::Correct)?;
/// assert_eq!(curve.correct(), 3);
/// assert_eq!(curve.points()[1].precision, 1.0); // the two surest are right
/// assert_eq!(curve.points()[2].false_positives, 1);
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// [`Error::Length`] if the truth has another number of queries, [`Error::NotFinite`] for
/// a score that is a NaN.
pub fn evaluate(matches: &[Match], truth: &Truth, recall: Recall) -> Result<Curve, Error> {
    if truth.len() != matches.len() {
        return Err(Error::Length { what: "truth", expected: matches.len(), got: truth.len() });
    }
    if let Some(index) = matches.iter().position(|found| found.ready && found.score.is_nan()) {
        return Err(Error::NotFinite { what: "scores", row: None, index, value: f32::NAN });
    }
    let judge = |(query, found): (usize, &Match)| {
        let verdict = truth.judge(query, found.place);
        (found.ready && verdict != Verdict::Ignored).then(|| Judged {
            query,
            score: found.score,
            accepted: found.accepted,
            correct: verdict == Verdict::Correct,
            place_exists: truth.exists(query),
        })
    };
    let mut judged: Vec<Judged> = matches.iter().enumerate().filter_map(judge).collect();
    judged.sort_by(|a, b| a.score.total_cmp(&b.score));
    let points = sweep(&judged, recall, |_| 1);
    Ok(Curve { points, judged, queries: matches.len(), recall })
}

/// Accepts the matches from the best score to the worst, equal scores together. Each query counts
/// `times` times.
fn sweep(judged: &[Judged], recall: Recall, times: impl Fn(&Judged) -> usize) -> Vec<Point> {
    let count =
        |which: fn(&Judged) -> bool| judged.iter().filter(|j| which(j)).map(&times).sum::<usize>();
    let (total, correct, exist) =
        (count(|_| true), count(|j| j.correct), count(|j| j.place_exists));
    let (mut accepted, mut true_positives) = (0, 0);
    let mut points = Vec::new();
    // -0 and 0 sort apart, but are one score.
    for equals in judged.chunk_by(|a, b| a.score == b.score) {
        let before = accepted;
        for found in equals.iter().filter(|j| j.accepted) {
            accepted += times(found);
            true_positives += if found.correct { times(found) } else { 0 };
        }
        if accepted == before {
            continue;
        }
        let relevant = match recall {
            Recall::Correct => correct,
            Recall::PlaceExists => exist,
            Recall::Rejected => true_positives + (total - accepted),
        };
        points.push(Point {
            threshold: equals[0].score,
            precision: true_positives as f64 / accepted as f64,
            // If there is nothing to find, the recall is 0.
            recall: true_positives as f64 / relevant.max(1) as f64,
            false_positives: accepted - true_positives,
        });
    }
    points
}

impl Curve {
    /// The points, from the best score to the worst; recall never falls along them.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The number of judged queries: ready, and not ignored.
    pub fn judged(&self) -> usize {
        self.judged.len()
    }

    /// The number of judged matches that are correct, accepted or not.
    pub fn correct(&self) -> usize {
        self.judged.iter().filter(|j| j.correct).count()
    }

    /// Whether each judged match is wrong, 0 or 1, in the order of the queries.
    pub(super) fn errors(&self) -> Vec<f64> {
        let mut judged: Vec<&Judged> = self.judged.iter().collect();
        judged.sort_by_key(|j| j.query);
        judged.into_iter().map(|j| f64::from(!j.correct)).collect()
    }

    /// The queries a block of a [`Bootstrap`](super::Bootstrap) by default.
    pub fn block(&self) -> Option<usize> {
        super::block_length(&self.errors())
    }

    /// The points of the curve if each query counts `times` times: a sample of the bootstrap.
    pub(super) fn redrawn(&self, times: &[usize]) -> Vec<Point> {
        sweep(&self.judged, self.recall, |j| times[j.query])
    }
}

/// The threshold with the best balance of precision and recall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BestF1 {
    /// The harmonic mean of precision and recall there.
    pub f1: f64,
    /// The score up to which matches are accepted there.
    pub threshold: f32,
    /// The precision there.
    pub precision: f64,
    /// The recall there.
    pub recall: f64,
}

impl Curve {
    /// The area under the curve up to the recall `upto`, divided by `upto`: 1 if every match
    /// accepted by then is correct. Trapezoids between the lowest precisions at each recall; in the
    /// segment that `upto` cuts, the sweep's own line, which leads to the highest precision at the
    /// next recall. The first precision is held back to recall 0. A curve that ends before `upto`
    /// adds nothing beyond its end, so read it beside [`max_recall`](Self::max_recall).
    pub fn auc(&self, upto: f64) -> f64 {
        area(self.points(), upto)
    }

    /// The largest recall that the curve reaches.
    pub fn max_recall(&self) -> f64 {
        self.points().last().map_or(0.0, |point| point.recall)
    }

    /// The largest recall at a precision of at least `precision`; 0 if there is none.
    pub fn recall_at_precision(&self, precision: f64) -> f64 {
        let enough = self.points().iter().filter(|point| point.precision >= precision);
        enough.map(|point| point.recall).fold(0.0, f64::max)
    }

    /// The wrong matches accepted by the time that the recall is reached; `None` if it never is.
    pub fn false_positives_at(&self, recall: f64) -> Option<usize> {
        self.points().iter().find(|point| point.recall >= recall).map(|point| point.false_positives)
    }

    /// The threshold with the largest harmonic mean of precision and recall, the strictest of
    /// equals; zeros if nothing is correct.
    pub fn best_f1(&self) -> BestF1 {
        let mut best = BestF1::default();
        for &Point { threshold, precision, recall, .. } in self.points() {
            let f1 = 2.0 * precision * recall / (precision + recall).max(f64::MIN_POSITIVE);
            if f1 > best.f1 {
                best = BestF1 { f1, threshold, precision, recall };
            }
        }
        best
    }
}

/// The area under a curve's points up to a recall, divided by that recall.
pub(super) fn area(points: &[Point], upto: f64) -> f64 {
    let Some(first) = points.first() else { return 0.0 };
    let (mut area, mut last) = (0.0, (0.0, first.precision));
    for equals in points.chunk_by(|a, b| a.recall == b.recall) {
        let (Some(highest), Some(lowest)) = (equals.first(), equals.last()) else { continue };
        let (from, to) = (last.0, lowest.recall);
        if to > upto {
            let end = last.1 + (upto - from) / (to - from) * (highest.precision - last.1);
            area += (upto - from) * (last.1 + end) / 2.0;
            break;
        }
        area += (to - from) * (last.1 + lowest.precision) / 2.0;
        last = (to, lowest.precision);
    }
    if upto > 0.0 { area / upto } else { first.precision }
}
