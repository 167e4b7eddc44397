//! How good the trust flag is, by itself.

use super::truth::{Truth, Verdict};
use crate::batch::Run;
use crate::error::Error;
use serde::{Deserialize, Serialize};

/// The confusion table of a trust flag: positive is trusted, true is a correct single match.
///
/// ```
/// use surefix::evaluate::TrustTable;
///
/// let table = TrustTable { true_positives: 9, false_positives: 1, false_negatives: 6, true_negatives: 4 };
/// assert_eq!((table.precision(), table.recall(), table.share_trusted()), (0.9, 0.6, 0.5));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrustTable {
    /// Trusted, and correct.
    pub true_positives: usize,
    /// Trusted, but wrong.
    pub false_positives: usize,
    /// Correct, but not trusted.
    pub false_negatives: usize,
    /// Not trusted, and wrong.
    pub true_negatives: usize,
}

impl TrustTable {
    /// The share of the trusted matches that is correct; 0 if none is trusted.
    pub fn precision(&self) -> f64 {
        share(self.true_positives, self.true_positives + self.false_positives)
    }

    /// The share of the correct matches that is trusted (the true positive rate); 0 if none is
    /// correct.
    pub fn recall(&self) -> f64 {
        share(self.true_positives, self.true_positives + self.false_negatives)
    }

    /// The share of the wrong matches that is trusted; 0 if none is wrong.
    pub fn false_positive_rate(&self) -> f64 {
        share(self.false_positives, self.false_positives + self.true_negatives)
    }

    /// The share of all matches that is trusted; 0 if there are none.
    pub fn share_trusted(&self) -> f64 {
        let trusted = self.true_positives + self.false_positives;
        share(trusted, trusted + self.false_negatives + self.true_negatives)
    }
}

fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole.max(1) as f64
}

/// The confusion table of a run's trust flags, which speak of the single matches. Queries that the
/// truth ignores are left out.
///
/// # Errors
/// [`Error::Length`] if the truth has another number of queries or, like
/// [`Error::Option`], of another route.
pub fn evaluate_trust(run: &Run, truth: &Truth) -> Result<TrustTable, Error> {
    if truth.len() != run.fixes.len() {
        return Err(Error::Length { what: "truth", expected: run.fixes.len(), got: truth.len() });
    }
    truth.check_places(run.places())?;
    let mut table = TrustTable::default();
    for (query, fix) in run.fixes.iter().enumerate() {
        let cell = match (truth.judge(query, fix.single.place), fix.trusted) {
            (Verdict::Correct, true) => &mut table.true_positives,
            (Verdict::Wrong, true) => &mut table.false_positives,
            (Verdict::Correct, false) => &mut table.false_negatives,
            (Verdict::Wrong, false) => &mut table.true_negatives,
            (Verdict::Ignored, _) => continue,
        };
        *cell += 1;
    }
    Ok(table)
}
