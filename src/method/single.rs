//! The best single match: the smallest distance (method 1.3).

use super::argmin::{BLOCK, any, first_better};
use crate::error::Error;
use crate::numbers::first_not_finite;
use crate::simd::fetch;
use serde::{Deserialize, Serialize};

/// Distances in a line of the cache.
const LINE: usize = 16;
/// How many distances ahead memory is prefetched.
const AHEAD: usize = 1024;

/// The best match of one query alone: the smallest distance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Single {
    /// The place, from 0.
    pub place: usize,
    /// The distance there, in the units of the distances.
    pub distance: f32,
}

/// `i_d = argmin d`: the first of the smallest distances, which are finite.
#[inline(always)]
pub(crate) fn minimum(distances: &[f32]) -> Single {
    let mut single = Single { place: 0, distance: f32::INFINITY };
    for (index, block) in distances.chunks(BLOCK).enumerate() {
        if let Some((at, distance)) = first_better(block, single.distance, |a, b| a < b) {
            single = Single { place: index * BLOCK + at, distance };
        }
    }
    single
}

/// [`minimum`], and a check of every distance in the same pass.
///
/// # Errors
/// [`Error::Length`] unless there is one distance a place, [`Error::NotFinite`] for a NaN or an
/// infinity.
#[inline(always)]
pub(super) fn checked_minimum(distances: &[f32], places: usize) -> Result<Single, Error> {
    let what = "distances";
    if distances.len() != places {
        return Err(Error::Length { what, expected: places, got: distances.len() });
    }
    let mut single = Single { place: 0, distance: f32::INFINITY };
    for (index, block) in distances.chunks(BLOCK).enumerate() {
        for line in block.chunks(LINE) {
            fetch(line.as_ptr().wrapping_add(AHEAD));
        }
        // One question for both: smaller than all before, or not finite? A NaN is in no range.
        let expected = single.distance..=f32::MAX;
        if any(block, |x| !expected.contains(&x)) {
            if let Some((at, value)) = first_not_finite(block) {
                return Err(Error::NotFinite { what, row: None, index: index * BLOCK + at, value });
            }
            if let Some((at, distance)) = first_better(block, single.distance, |a, b| a < b) {
                single = Single { place: index * BLOCK + at, distance };
            }
        }
    }
    Ok(single)
}
