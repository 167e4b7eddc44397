//! Work on many items, on all cores with the feature `rayon`, else on one.

use std::ops::Range;

use crate::error::Error;
use crate::interrupt::check;
#[cfg(feature = "rayon")]
use crate::interrupt::on_the_pool;

/// `work` on every index, each thread with a state of its own; the results in order.
///
/// # Errors
/// The first of the work's, in order; [`Error::Interrupted`] if it is to stop.
pub(crate) fn each<S: Send, R: Send>(
    indices: Range<usize>,
    state: impl Fn() -> S + Sync + Send,
    work: impl Fn(&mut S, usize) -> Result<R, Error> + Sync + Send,
) -> Result<Vec<R>, Error> {
    #[cfg(feature = "rayon")]
    if !is_forked() {
        use rayon::prelude::*;
        let done: Vec<Result<R, Error>> = on_the_pool(|told| {
            let indices = indices.into_par_iter();
            indices.map_init(state, |state, index| told.run(|| work(state, index))).collect()
        })?;
        return done.into_iter().collect();
    }
    let mut state = state();
    indices.map(|index| check().and_then(|()| work(&mut state, index))).collect()
}

/// `work` on every row of `width` bytes, with its index; the results in order.
///
/// # Errors
/// As for [`each`].
pub(crate) fn each_row<R: Send>(
    rows: &mut [u8],
    width: usize,
    work: impl Fn(usize, &mut [u8]) -> Result<R, Error> + Sync + Send,
) -> Result<Vec<R>, Error> {
    #[cfg(feature = "rayon")]
    if !is_forked() {
        use rayon::prelude::*;
        let done: Vec<Result<R, Error>> = on_the_pool(|told| {
            let rows = rows.par_chunks_exact_mut(width).enumerate();
            rows.map(|(index, row)| told.run(|| work(index, row))).collect()
        })?;
        return done.into_iter().collect();
    }
    let rows = rows.chunks_exact_mut(width).enumerate();
    rows.map(|(index, row)| check().and_then(|()| work(index, row))).collect()
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
    use std::sync::atomic::{AtomicU32, Ordering};
    // No process has the number 0. A lock could be held for ever in a fork.
    static FIRST: AtomicU32 = AtomicU32::new(0);
    let here = std::process::id();
    let first = FIRST.compare_exchange(0, here, Ordering::Relaxed, Ordering::Relaxed);
    first.is_err_and(|first| first != here)
}
