//! Work on many items, on all cores where the feature `rayon` is on.

use std::ops::Range;

/// `work` on every index, each core with a state of its own; the results in order.
#[cfg(feature = "rayon")]
pub(crate) fn each<S: Send, R: Send>(
    indices: Range<usize>,
    state: impl Fn() -> S + Sync + Send,
    work: impl Fn(&mut S, usize) -> R + Sync + Send,
) -> Vec<R> {
    use rayon::prelude::*;
    indices.into_par_iter().map_init(state, work).collect()
}

/// `work` on every index, one after the other.
#[cfg(not(feature = "rayon"))]
pub(crate) fn each<S, R>(
    indices: Range<usize>,
    state: impl Fn() -> S,
    work: impl Fn(&mut S, usize) -> R,
) -> Vec<R> {
    let mut state = state();
    indices.map(|index| work(&mut state, index)).collect()
}
