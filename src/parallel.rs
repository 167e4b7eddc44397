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
    if is_forked() {
        return one_by_one(indices, state, work);
    }
    indices.into_par_iter().map_init(state, work).collect()
}

/// Whether this process was forked off one that had worked in parallel: the threads did not come
/// along, and work that is given to them would wait for ever.
#[cfg(feature = "rayon")]
fn is_forked() -> bool {
    static FIRST: std::sync::OnceLock<u32> = std::sync::OnceLock::new();
    let here = std::process::id();
    *FIRST.get_or_init(|| here) != here
}

/// `work` on every index, one after the other.
#[cfg(not(feature = "rayon"))]
pub(crate) fn each<S, R>(
    indices: Range<usize>,
    state: impl Fn() -> S,
    work: impl Fn(&mut S, usize) -> R,
) -> Vec<R> {
    one_by_one(indices, state, work)
}

fn one_by_one<S, R>(
    indices: Range<usize>,
    state: impl Fn() -> S,
    work: impl Fn(&mut S, usize) -> R,
) -> Vec<R> {
    let mut state = state();
    indices.map(|index| work(&mut state, index)).collect()
}

/// `work` on every row of `width` bytes, with its index, on all cores; the results in order.
#[cfg(feature = "rayon")]
pub(crate) fn each_row<R: Send>(
    rows: &mut [u8],
    width: usize,
    work: impl Fn(usize, &mut [u8]) -> R + Sync + Send,
) -> Vec<R> {
    use rayon::prelude::*;
    if is_forked() {
        return row_by_row(rows, width, work);
    }
    rows.par_chunks_exact_mut(width).enumerate().map(|(index, row)| work(index, row)).collect()
}

/// `work` on every row of `width` bytes, with its index, one after the other.
#[cfg(not(feature = "rayon"))]
pub(crate) fn each_row<R>(
    rows: &mut [u8],
    width: usize,
    work: impl Fn(usize, &mut [u8]) -> R,
) -> Vec<R> {
    row_by_row(rows, width, work)
}

fn row_by_row<R>(rows: &mut [u8], width: usize, work: impl Fn(usize, &mut [u8]) -> R) -> Vec<R> {
    rows.chunks_exact_mut(width).enumerate().map(|(index, row)| work(index, row)).collect()
}

/// How many threads share the work.
#[cfg(feature = "rayon")]
pub(crate) fn threads() -> usize {
    if is_forked() { 1 } else { rayon::current_num_threads() }
}

/// One thread does the work.
#[cfg(not(feature = "rayon"))]
pub(crate) fn threads() -> usize {
    1
}
