//! The exact sweep: every score is a threshold, and equal scores enter together.

use std::str::FromStr;

use crate::error::Error;

/// What recall is a share of. Published code differs, so a figure names the one it used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
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

/// One query's match, judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judged {
    pub(super) score: f32,
    pub(super) correct: bool,
    pub(super) place_exists: bool,
}

/// One threshold: the queries with this score or a better one are accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// The score up to which matches are accepted.
    pub threshold: f32,
    /// The share of the accepted matches that is correct.
    pub precision: f64,
    /// The share found, by the curve's recall convention.
    pub recall: f64,
    /// How many accepted matches are wrong.
    pub false_positives: usize,
}

/// A precision-recall curve: a point a distinct score, from the best score to the worst.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    points: Vec<Point>,
}

impl Curve {
    /// Accepts the matches from the best score to the worst, equal scores together.
    pub(super) fn sweep(mut judged: Vec<Judged>, recall: Recall) -> Self {
        judged.sort_by(|a, b| a.score.total_cmp(&b.score));
        let total = judged.len();
        let correct = judged.iter().filter(|match_| match_.correct).count();
        let exist = judged.iter().filter(|match_| match_.place_exists).count();
        let (mut accepted, mut true_positives) = (0, 0);
        let points = judged.chunk_by(|a, b| a.score == b.score).map(|equals| {
            accepted += equals.len();
            true_positives += equals.iter().filter(|match_| match_.correct).count();
            let relevant = match recall {
                Recall::Correct => correct,
                Recall::PlaceExists => exist,
                Recall::Rejected => true_positives + (total - accepted),
            };
            Point {
                threshold: equals[0].score,
                precision: true_positives as f64 / accepted as f64,
                // Nothing to find: nothing found.
                recall: true_positives as f64 / relevant.max(1) as f64,
                false_positives: accepted - true_positives,
            }
        });
        Self { points: points.collect() }
    }

    /// The points, from the best score to the worst; recall never falls along them.
    pub fn points(&self) -> &[Point] {
        &self.points
    }
}
