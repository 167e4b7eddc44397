//! How good the answers are: exact precision-recall curves (DESIGN 1.8).

mod curve;
mod metrics;
mod truth;

pub use curve::{Curve, Point, Recall};

use crate::batch::Run;
use crate::error::Error;

/// The precision-recall curve of a run against the truth: `truth[j]` is the place where query `j` really was, or nothing
/// where it was off the map (accepting any match for it is then a mistake). A match within `tolerance` places is correct.
///
/// The queries of the warm-up, which have no sequence yet, are left out.
///
/// # Errors
/// [`Error::Length`] where `truth` has not one entry a query.
pub fn evaluate(
    run: &Run,
    truth: &[Option<usize>],
    tolerance: usize,
    recall: Recall,
) -> Result<Curve, Error> {
    if truth.len() != run.fixes.len() {
        return Err(Error::Length { what: "truth", expected: run.fixes.len(), got: truth.len() });
    }
    let ready = run.fixes.iter().zip(truth).filter(|(fix, _)| fix.sequence.is_some());
    let judged = ready.map(|(fix, &truth)| curve::Judged {
        score: fix.score,
        correct: truth::is_correct(fix.place, truth, tolerance),
        place_exists: truth.is_some(),
    });
    Ok(Curve::sweep(judged.collect(), recall))
}
