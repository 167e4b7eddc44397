//! Estimators turn the columns into answers; the sequence is one.

use super::trust::Anchors;
use super::window::{Exact, Window};
use crate::segments::Segments;

/// Turns the columns seen so far into an answer, one query at a time.
///
/// A new estimator is a file of its own with an `impl Estimator`, a field of `Matcher`, and a field
/// of `Fix`. Its field stands in four places of `mod.rs`: `method` asks it in its order, `memory`
/// takes the longest of all, `gap` and `reset` clear it. If it keeps a state that the columns do
/// not give back, `snapshot.rs` saves that too.
pub(super) trait Estimator {
    /// Its answer to one query.
    type Answer;

    /// How far back the answer looks. It decides how a batch may be cut into pieces.
    fn memory(&self) -> Memory;

    /// Forgets the queries so far: the next one does not follow them.
    fn clear(&mut self);

    /// Takes the newest column of `window`. If columns are bounds, `ask` has their distances: an
    /// estimator that needs all of them resolves the column.
    fn estimate<E: Exact>(
        &mut self,
        window: &mut Window,
        seen: &Seen<'_>,
        ask: &mut E,
    ) -> Self::Answer;
}

/// How many queries an answer depends on, the current one included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Memory {
    /// The newest ones: a batch can begin this many queries early and be cut into pieces.
    Queries(usize),
    /// All since the start, as in a recursion: a batch runs in order, in one piece.
    Whole,
}

/// Facts about the queries so far that all estimators share.
pub(super) struct Seen<'a> {
    /// The route's segments: where diagonals and motion end.
    pub(super) segments: &'a Segments,
    /// The single match and the trust flag of each of the newest `L` queries.
    pub(super) anchors: &'a Anchors,
    /// The floor of trusted cells (Eq. 4).
    pub(super) floor: f64,
    /// How many places the robot has moved since the query before, if that is known.
    pub(super) advance: Option<f64>,
    /// What several techniques say together for each place, if there are several.
    pub(super) evidence: Option<&'a [f64]>,
}
