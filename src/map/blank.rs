//! Places and queries that show nothing (method 1.7): a lens cap, a tunnel, a camera that failed.
//!
//! They are near everything, so that they would draw queries to themselves. Their distances say
//! nothing, and are made to: a place that shows nothing is as far from a query as the mean of the
//! others, and a query that shows nothing is equally far from all places.

use std::ops::Range;
use std::sync::Arc;

use twox_hash::XxHash3_64;

use super::block::SMALL;
use super::edit::TUNNEL;
use super::recipe::Kind;
use super::{Map, Recipe};
use crate::error::Error;
use crate::numbers::{View, each_type};
use crate::sums::BLOCK;

/// This many equal rows, and no camera saw their places.
const EQUAL: usize = 5;

/// A query nearer to a place that shows nothing than this share of the mean distance is that
/// place's image again.
pub(super) const SAME: f64 = 1e-3;

/// Finds the places that show nothing among rows that come in pieces.
pub(super) struct Census {
    recipe: Recipe,
    dim: usize,
    /// What post-processing makes of zeros.
    zeros: Option<Vec<f32>>,
    rows: Vec<Seen>,
}

/// A row's hash, and whether it shows nothing by itself.
struct Seen {
    hash: u64,
    nothing: bool,
}

impl Census {
    pub(super) fn new(kind: &Kind) -> Self {
        let post = kind.post.as_deref().filter(|post| post.input() > SMALL);
        let zeros = post.and_then(|post| post.apply(&vec![0.0; post.input()]).ok());
        Self { recipe: kind.recipe, dim: kind.dim, zeros, rows: Vec::new() }
    }

    /// Takes the next rows.
    pub(super) fn add(&mut self, rows: View<'_>) {
        let Self { recipe, dim, zeros, rows: seen } = self;
        let rows = (0..rows.len() / *dim).filter_map(|row| rows.row(row, *dim));
        seen.extend(rows.map(|row| Seen {
            hash: XxHash3_64::oneshot(row.bytes()),
            nothing: match (row, &*zeros) {
                (View::F32(row), Some(zeros)) => row == zeros,
                _ => shows_nothing(*recipe, row),
            },
        }));
    }

    /// The places that show nothing, in order.
    pub(super) fn places(&self) -> Vec<usize> {
        let mut equal = Vec::new();
        if self.dim > SMALL {
            let mut hashes: Vec<u64> = self.rows.iter().map(|row| row.hash).collect();
            hashes.sort_unstable();
            let many = hashes.chunk_by(|a, b| a == b).filter(|same| same.len() >= EQUAL);
            equal.extend(many.map(|same| same[0]));
        }
        let blank = |row: &Seen| row.nothing || equal.binary_search(&row.hash).is_ok();
        let places = self.rows.iter().enumerate().filter(|(_, row)| blank(row));
        places.map(|(place, _)| place).collect()
    }
}

/// A byte for each place: 1 if it shows nothing.
pub(super) fn flags(blank: &[usize], places: usize) -> Vec<u8> {
    let mut flags = vec![0; places];
    for &place in blank {
        flags[place] = 1;
    }
    flags
}

/// The places of such bytes; `None` if there are other bytes.
pub(super) fn flagged(flags: &[u8]) -> Option<Arc<[usize]>> {
    let blank = (0..flags.len()).filter(|&place| flags[place] != 0).collect();
    flags.iter().all(|&flag| flag <= 1).then_some(blank)
}

impl Map {
    /// The places that show nothing, in order: SAD descriptors of images with hardly any content
    /// (method 1.7), ready descriptors of zeros, and any that at least 5 places share. Of ready
    /// descriptors, only those of more than 8 numbers can be. The distance to such a place is the
    /// mean of the others, and so it is never a query's best match.
    ///
    /// On a map of several traverses, a place shows nothing if all its rows do.
    ///
    /// The list is in the map's file. If it is not known, the first call reads all rows.
    ///
    /// ```
    /// use surefix::{Map, Metric};
    /// let mut rows: Vec<f32> = (0..40).map(|at| (at * at % 17) as f32).collect();
    /// rows[20..30].fill(0.0);
    /// let map = Map::from_descriptors(rows, 10, Metric::Euclidean)?;
    /// assert_eq!(map.blank(), [2]);
    /// assert_eq!(map.without_blank()?.places(), 3);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    pub fn blank(&self) -> &[usize] {
        self.blank_places()
    }

    /// The rows of the first traverse that show nothing.
    pub(super) fn blank_rows(&self) -> &[usize] {
        self.blank.get_or_init(|| {
            let mut census = Census::new(&self.kind);
            self.blocks.iter().for_each(|block| census.add(block.rows()));
            Box::new(census.places().into())
        })
    }

    /// The same map without the places that [show nothing](Self::blank). The places after them move
    /// up, within the same segments, as for [`keep`](Self::keep). If 5 places or more that follow
    /// each other show nothing, as in a tunnel, a new segment begins after them, with a link to it
    /// from the place before: the road goes on, and the track may follow.
    ///
    /// # Errors
    /// [`Error::TooFewPlaces`] if fewer than two are left, and those of
    /// [`with_screen`](Self::with_screen) if this map has a screen.
    pub fn without_blank(&self) -> Result<Self, Error> {
        let blank = self.blank();
        if blank.is_empty() {
            return Ok(self.clone());
        }
        let mut next = blank.iter().peekable();
        let kept = (0..self.places()).filter(|place| next.next_if_eq(&place).is_none());
        self.keep_with(&kept.collect::<Vec<_>>(), TUNNEL)
    }

    /// Whether a query shows nothing, as it is before post-processing.
    pub(crate) fn shows_nothing(&self, query: View<'_>) -> bool {
        shows_nothing(self.recipe(), query)
    }

    /// Takes out of a query's distances what says nothing: those to places that show nothing become
    /// the mean of the others. If the query shows `nothing`, or is the image of such a place again,
    /// all of them do.
    pub(crate) fn quieten(&self, nothing: bool, distances: &mut [f32]) {
        quieten(self.blank(), nothing, distances);
    }
}

/// [`Map::quieten`] of a map on which the places `blank` show nothing.
pub(super) fn quieten(blank: &[usize], nothing: bool, distances: &mut [f32]) {
    if blank.is_empty() && !nothing {
        return;
    }
    let skipped = if blank.len() < distances.len() { blank } else { &[] };
    let Some(mean) = mean_without(distances, skipped) else { return };
    let near = |&place: &usize| f64::from(distances[place]) <= SAME * mean;
    if nothing || blank.iter().any(near) {
        distances.fill(mean as f32);
    } else {
        for &place in blank {
            distances[place] = mean as f32;
        }
    }
}

/// The mean of the distances to all places but those `skipped`, which are in order; `None` if it is
/// no number: then a distance is none, and is refused where it stands.
fn mean_without(distances: &[f32], skipped: &[usize]) -> Option<f64> {
    let blocks = blocks(distances.len());
    let sum: f64 =
        blocks.map(|block| sum_without(block, skipped, |at| f64::from(distances[at]))).sum();
    let mean = sum / (distances.len() - skipped.len()) as f64;
    mean.is_finite().then_some(mean)
}

/// The blocks of a route of `places` places.
pub(super) fn blocks(places: usize) -> impl Iterator<Item = Range<usize>> {
    (0..places).step_by(BLOCK).map(move |start| start..places.min(start + BLOCK))
}

/// The sum of a number for each index of a range but those `skipped`, which are in order.
pub(super) fn sum_without(
    range: Range<usize>,
    skipped: &[usize],
    of: impl Fn(usize) -> f64,
) -> f64 {
    between(range, skipped).map(|part| part.map(&of).sum::<f64>()).sum()
}

/// What is left of a range without some indices, which are in order.
pub(super) fn between(
    range: Range<usize>,
    skipped: &[usize],
) -> impl Iterator<Item = Range<usize>> {
    let ends = within(&range, skipped).iter().copied().chain([range.end]);
    ends.scan(range.start, |start, end| Some(std::mem::replace(start, end + 1)..end))
}

/// Those of some indices, which are in order, that lie in a range.
pub(super) fn within<'a>(range: &Range<usize>, indices: &'a [usize]) -> &'a [usize] {
    let first = |from: usize| indices.partition_point(|&index| index < from);
    &indices[first(range.start)..first(range.end)]
}

/// Whether a descriptor shows nothing by itself.
pub(super) fn shows_nothing(recipe: Recipe, row: View<'_>) -> bool {
    match (recipe, row) {
        (Recipe::Sad(sad), row) => sad.is_bare(row),
        (Recipe::Ready, row) => row.len() > SMALL && each_type!(View, row, v => are_zero(v)),
    }
}

fn are_zero<T: Default + PartialEq>(numbers: &[T]) -> bool {
    let zero = T::default();
    numbers.iter().all(|number| *number == zero)
}
