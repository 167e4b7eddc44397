//! The best single match, and whether to trust it (method 1.3, Eqs. 2 and 3).

use super::extreme::{extreme, first_equal};
use super::gradient::Peak;
use crate::distance::first_not_finite;
use crate::error::Error;

/// The best match of one query alone: the smallest distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Single {
    /// The place, from 0.
    pub place: usize,
    /// The distance there, in the units of the distances.
    pub distance: f32,
}

/// How many numbers are looked at between two looks at what they gave.
const BLOCK: usize = 256;

/// Eq. 2: the place of the smallest distance, the first of equals, of a vector that may be taken: one pass finds both.
///
/// # Errors
/// [`Error::Length`] unless there is one distance a place, [`Error::NotFinite`] for a NaN or an infinity.
#[inline(always)]
pub(super) fn checked_minimum(distances: &[f32], places: usize) -> Result<Single, Error> {
    let what = "distances";
    if distances.len() != places {
        return Err(Error::Length { what, expected: places, got: distances.len() });
    }
    let (single, largest) = smallest_and_largest(distances);
    if largest < f32::INFINITY.to_bits() {
        return Ok(single);
    }
    match first_not_finite(distances) {
        Some((index, value)) => Err(Error::NotFinite { what, row: None, index, value }),
        None => Ok(single),
    }
}

/// Eq. 2: the place of the smallest distance, the first of equals.
pub(crate) fn minimum(distances: &[f32]) -> Single {
    smallest_and_largest(distances).0
}

/// The smallest distance, and the bits of the largest magnitude: those of an infinity or a NaN come after all others.
#[inline(always)]
fn smallest_and_largest(distances: &[f32]) -> (Single, u32) {
    let mut single = Single { place: 0, distance: f32::INFINITY };
    let mut largest = 0;
    for (index, block) in distances.chunks(BLOCK).enumerate() {
        let smallest = extreme(block, f32::INFINITY, |a, b| if b < a { b } else { a });
        if smallest < single.distance {
            single = Single { place: index * BLOCK + first_equal(block, smallest), distance: smallest };
        }
        largest = block.iter().map(|x| x.abs().to_bits()).fold(largest, u32::max);
    }
    // Of the two zeros, the first.
    single.distance = distances[single.place];
    (single, largest)
}

/// Eq. 3: the minimum and the peak of the gradient fall on the same place, within `tolerance`.
pub(super) fn consensus(single: Single, peak: Peak, tolerance: usize) -> bool {
    single.place.abs_diff(peak.place) <= tolerance
}
