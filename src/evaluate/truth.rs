//! When a match counts as correct.

/// Within `tolerance` places of the truth; never where there is no true place.
pub(super) fn is_correct(place: usize, truth: Option<usize>, tolerance: usize) -> bool {
    truth.is_some_and(|truth| place.abs_diff(truth) <= tolerance)
}
