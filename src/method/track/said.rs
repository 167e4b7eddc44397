//! What a driver asks a shard about its part of the belief, and what the shard says.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::hubness::{BlockMoments, Standard};
use super::predict::{Prediction, Step};
use crate::error::Error;

/// Before the column counts.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::method) struct TrackFirst {
    /// `1 / (k + hubness)` with this column.
    pub(super) share: f64,
    /// Whether the belief is the same in all places: at the start, and after a gap.
    pub(super) anywhere: bool,
    /// Whether there is a view to compare with.
    pub(super) compare: bool,
    /// How the belief moves, but for what the views say.
    pub(super) step: Step,
    /// The own places whose belief others need.
    pub(super) asked: Vec<Range<usize>>,
}

/// The sums of each of the shard's blocks.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::method) struct TrackFirstSaid {
    /// Three numbers for each, as in [`BlockMoments`].
    #[serde(with = "crate::bytes")]
    pub(super) moments: Vec<f64>,
    /// What the views have together; empty if there is none to compare with.
    #[serde(with = "crate::bytes")]
    pub(super) together: Vec<f64>,
    /// What is lost beyond the ends of segments.
    #[serde(with = "crate::bytes")]
    pub(super) lost: Vec<f64>,
    /// Of each range that others need.
    pub(super) belief: Vec<Numbers>,
}

/// What all shards together said.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::method) struct TrackSecond {
    /// `None` if the column says nothing.
    pub(super) says: Option<Standard>,
    pub(super) weight: f64,
    pub(super) step: Step,
    pub(super) prediction: Prediction,
    /// How far the moves reach: before each place and after it.
    pub(super) reach: [usize; 2],
    /// The belief in other shards' places: with the first of them.
    pub(super) foreign: Vec<(usize, Numbers)>,
}

/// The belief afterwards.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::method) struct TrackSecondSaid {
    /// The sum of each block's evidence.
    #[serde(with = "crate::bytes")]
    pub(super) evidence: Vec<f64>,
    /// The sum of each chunk.
    #[serde(with = "crate::bytes")]
    pub(super) sums: Vec<f64>,
    /// The most probable place, its mass and the speed there.
    pub(super) best: (usize, f64),
    pub(super) speed: f64,
    /// The masses of some chunks, which the answer may need.
    pub(super) masses: Vec<(usize, Numbers)>,
}

/// The belief in some places, row by row.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Numbers(#[serde(with = "crate::bytes")] pub(super) Vec<f64>);

impl TrackFirstSaid {
    /// The moments of the blocks, whose places these are.
    ///
    /// # Errors
    /// [`Error::Shard`] unless it has the sums of these blocks.
    pub(super) fn moments(
        &self,
        blocks: &[usize],
        compare: bool,
    ) -> Result<impl Iterator<Item = BlockMoments>, Error> {
        let count = blocks.len();
        counted("moments", 3 * count, self.moments.len())?;
        counted("sums of views", if compare { count } else { 0 }, self.together.len())?;
        counted("sums of what is lost", count, self.lost.len())?;
        let each = self.moments.as_chunks::<3>().0.iter().zip(blocks.to_vec());
        Ok(each.map(|(&[distance, x, squares], places)| BlockMoments {
            places,
            distance,
            x,
            squares,
        }))
    }
}

/// # Errors
/// [`Error::Shard`] for another count.
pub(in crate::method) fn counted(what: &str, expected: usize, got: usize) -> Result<(), Error> {
    if got == expected {
        return Ok(());
    }
    Err(Error::Shard { reason: format!("expected {expected} {what}, got {got}") })
}
