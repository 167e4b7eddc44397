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
        let failed = First::default();
        let done: Vec<Option<R>> = on_the_pool(|told| {
            let one = |state: &mut S, index| failed.run(index, || told.run(|| work(state, index)));
            indices.into_par_iter().map_init(state, one).collect()
        })?;
        return failed.or(done);
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
        let failed = First::default();
        let done: Vec<Option<R>> = on_the_pool(|told| {
            let rows = rows.par_chunks_exact_mut(width).enumerate();
            rows.map(|(index, row)| failed.run(index, || told.run(|| work(index, row)))).collect()
        })?;
        return failed.or(done);
    }
    let rows = rows.chunks_exact_mut(width).enumerate();
    rows.map(|(index, row)| check().and_then(|()| work(index, row))).collect()
}

/// The error of the first item in order that failed.
#[cfg(feature = "rayon")]
#[derive(Default)]
struct First(std::sync::Mutex<Option<(usize, Error)>>);

#[cfg(feature = "rayon")]
impl First {
    fn run<R>(&self, index: usize, work: impl FnOnce() -> Result<R, Error>) -> Option<R> {
        match work() {
            Ok(done) => Some(done),
            Err(error) => {
                let mut first = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                if first.as_ref().is_none_or(|(before, _)| index < *before) {
                    *first = Some((index, error));
                }
                None
            }
        }
    }

    /// All results, if none failed.
    fn or<R>(self, done: Vec<Option<R>>) -> Result<Vec<R>, Error> {
        match self.0.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
            Some((_, error)) => Err(error),
            None => Ok(done.into_iter().flatten().collect()),
        }
    }
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
