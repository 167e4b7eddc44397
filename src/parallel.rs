//! Work on many items, on all cores with the feature `rayon`, else on one.

use std::ops::Range;

/// `work` on every index, each thread with a state of its own; the results in order.
pub(crate) fn each<S: Send, R: Send>(
    indices: Range<usize>,
    state: impl Fn() -> S + Sync + Send,
    work: impl Fn(&mut S, usize) -> R + Sync + Send,
) -> Vec<R> {
    #[cfg(feature = "rayon")]
    if !is_forked() {
        use rayon::prelude::*;
        return indices.into_par_iter().map_init(state, work).collect();
    }
    let mut state = state();
    indices.map(|index| work(&mut state, index)).collect()
}

/// `work` on every row of `width` bytes, with its index; the results in order.
pub(crate) fn each_row<R: Send>(
    rows: &mut [u8],
    width: usize,
    work: impl Fn(usize, &mut [u8]) -> R + Sync + Send,
) -> Vec<R> {
    #[cfg(feature = "rayon")]
    if !is_forked() {
        use rayon::prelude::*;
        let rows = rows.par_chunks_exact_mut(width).enumerate();
        return rows.map(|(index, row)| work(index, row)).collect();
    }
    rows.chunks_exact_mut(width).enumerate().map(|(index, row)| work(index, row)).collect()
}

/// How many threads share the work.
pub(crate) fn threads() -> usize {
    #[cfg(feature = "rayon")]
    if !is_forked() {
        return rayon::current_num_threads();
    }
    1
}

/// Whether this process was forked off one that had worked in parallel. The threads did not come
/// along, and work that is given to them would wait for ever.
#[cfg(feature = "rayon")]
fn is_forked() -> bool {
    static FIRST: std::sync::OnceLock<u32> = std::sync::OnceLock::new();
    let here = std::process::id();
    *FIRST.get_or_init(|| here) != here
}
