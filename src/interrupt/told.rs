//! Threads that work for one that asks are told to stop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};

#[cfg(feature = "rayon")]
use super::Entered;
use super::{OFTEN, WATCH, Watch, check};
use crate::error::Error;

/// Whether to stop.
pub(super) type Flag = Arc<AtomicBool>;

/// What the threads are told that work for this one.
#[derive(Clone)]
pub(crate) struct Told(Option<Flag>);

impl Told {
    /// As this thread is told; of one that asks, whether it `asks` itself, and a new flag.
    fn here() -> (Self, bool) {
        WATCH.with_borrow(|watch| match watch {
            None => (Self(None), false),
            #[cfg(feature = "rayon")]
            Some(Watch::Told(told)) => (Self(Some(Arc::clone(told))), false),
            Some(Watch::Asks { .. }) => (Self(Some(Arc::default())), true),
        })
    }

    /// Runs a piece of the work on a thread that is told.
    ///
    /// # Errors
    /// Those of the piece; [`Error::Interrupted`] if the work is to stop.
    #[cfg(feature = "rayon")]
    pub(crate) fn run<R>(&self, piece: impl FnOnce() -> Result<R, Error>) -> Result<R, Error> {
        let Some(told) = &self.0 else { return piece() };
        let _entered = Entered::new(Watch::Told(Arc::clone(told)));
        check()?;
        piece()
    }

    /// Waits for a result of other threads, which are told to stop if this one is to.
    fn wait<R>(&self, result: &Receiver<R>, leave: bool) -> Result<R, Error> {
        loop {
            match result.recv_timeout(OFTEN) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Timeout) => {
                    if let (Err(error), Some(told)) = (check(), &self.0) {
                        told.store(true, Ordering::Relaxed);
                        if leave {
                            return Err(error);
                        }
                    }
                }
                // It has panicked.
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(Error::Interrupted { done: 0, total: 0 });
                }
            }
        }
    }
}

/// Runs `work` on the threads of the pool, while this one asks if it is to.
///
/// # Errors
/// [`Error::Interrupted`] if the work panics, but then the panic goes on.
#[cfg(feature = "rayon")]
pub(crate) fn on_the_pool<R: Send>(work: impl FnOnce(&Told) -> R + Send) -> Result<R, Error> {
    let (told, asks) = Told::here();
    if !asks {
        return Ok(work(&told));
    }
    let (done, result) = sync_channel(1);
    rayon::in_place_scope(|scope| {
        scope.spawn(|_| {
            let done = done;
            // Somebody waits for it.
            let _ = done.send(work(&told));
        });
        told.wait(&result, false)
    })
}

/// Runs a call into a library that cannot be stopped: on a thread of its own, if this one asks.
/// If it is to stop, that thread is left to itself until the call ends.
///
/// # Errors
/// [`Error::Interrupted`] if it is to stop, and [`Error::Memory`] if there is no thread.
#[cfg(feature = "pca")]
pub(crate) fn apart<R: Send + 'static>(
    work: impl FnOnce() -> R + Send + 'static,
) -> Result<R, Error> {
    let (told, asks) = Told::here();
    if !asks {
        return Ok(work());
    }
    let (done, result) = sync_channel(1);
    let thread = std::thread::Builder::new().name("surefix-apart".to_owned());
    let started = thread.spawn(move || {
        let _ = done.send(work());
    });
    started.map_err(|_| Error::Memory { places: 0, columns: 0 })?;
    told.wait(&result, true)
}
