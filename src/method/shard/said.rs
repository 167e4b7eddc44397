//! What shards are asked by the method, and what they answer.

use serde::{Deserialize, Serialize};

use super::super::sequence::Best;
use super::super::track::{TrackFirst, TrackFirstSaid, TrackSecond, TrackSecondSaid};
use super::super::{Peak, Single};

/// What a shard needs of a query beside its column.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct First {
    /// Whether no query came before it, so that the shard begins anew.
    pub(super) fresh: bool,
    /// Whether the query follows the one before: there is no gap between them.
    pub(super) follows: bool,
    pub(super) track: Option<TrackFirst>,
}

/// What a shard says of a column in its own places. They do not change its state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct FirstSaid {
    /// The first distance that is not finite, and its place. The rest says nothing then.
    pub(super) refused: Option<(usize, f32)>,
    pub(super) single: Single,
    /// The first distance, if all are equal.
    pub(super) constant: Option<f32>,
    /// Place 0 at minus infinity if there is none.
    pub(super) peak: Peak,
    pub(super) track: Option<TrackFirstSaid>,
}

/// What all shards together said of the column: the shard keeps it now.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Second {
    pub(super) single: Single,
    pub(super) trusted: bool,
    pub(super) floor: f64,
    pub(super) track: Option<TrackSecond>,
}

/// What a shard knows of its own places then.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SecondSaid {
    /// The first of the least sums, which ends in an own place; `None` if no diagonal does.
    pub(super) best: Option<Best>,
    pub(super) track: Option<TrackSecondSaid>,
}
