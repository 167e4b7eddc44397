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

/// Checks a distance vector before anything is stored of it.
pub(super) fn check(distances: &[f32], places: usize) -> Result<(), Error> {
    let what = "distances";
    if distances.len() != places {
        return Err(Error::Length { what, expected: places, got: distances.len() });
    }
    match first_not_finite(distances) {
        Some((index, value)) => Err(Error::NotFinite { what, row: None, index, value }),
        None => Ok(()),
    }
}

/// Eq. 2: the place of the smallest distance, the first of equals.
pub(crate) fn minimum(distances: &[f32]) -> Single {
    let place = first_equal(distances, extreme(distances, f32::INFINITY, |a, b| if b < a { b } else { a }));
    Single { place, distance: distances[place] }
}

/// Eq. 3: the minimum and the peak of the gradient fall on the same place, within `tolerance`.
pub(super) fn consensus(single: Single, peak: Peak, tolerance: usize) -> bool {
    single.place.abs_diff(peak.place) <= tolerance
}
