//! Long calls look between the pieces of their work whether they are to stop: Ctrl-C in a binding.
//!
//! The thread that made the call asks; the threads that work for it are told.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

use crate::error::Error;

/// How often a thread asks.
const OFTEN: Duration = Duration::from_millis(50);

thread_local! {
    static WATCH: RefCell<Option<Watch>> = const { RefCell::new(None) };
}

/// How this thread knows that its work is to stop.
#[derive(Clone)]
enum Watch {
    Asks { asks: fn() -> bool, next: Instant, stopped: bool },
    Told(Arc<AtomicBool>),
}

/// The watch before, which comes back when this is dropped.
struct Entered(Option<Watch>);

impl Entered {
    fn new(watch: Watch) -> Self {
        Self(WATCH.replace(Some(watch)))
    }
}

impl Drop for Entered {
    fn drop(&mut self) {
        WATCH.set(self.0.take());
    }
}

/// Runs `work`, whose long calls into this crate ask about every 50 ms whether to stop, always on
/// this thread: if so, they end with [`Error::Interrupted`], and what they work on is as it was.
///
/// ```
/// use std::sync::atomic::{AtomicBool, Ordering};
/// use surefix::{Map, Metric, interruptible};
/// static CTRL_C: AtomicBool = AtomicBool::new(false); // set by a handler
/// let rows = vec![0.5_f32; 2000];
/// let map = interruptible(
///     || CTRL_C.load(Ordering::Relaxed),
///     || Map::from_descriptors(rows, 2, Metric::Euclidean),
/// )?;
/// # assert_eq!(map.places(), 1000);
/// # Ok::<(), surefix::Error>(())
/// ```
pub fn interruptible<R>(asks: fn() -> bool, work: impl FnOnce() -> R) -> R {
    let _entered = Entered::new(Watch::Asks { asks, next: Instant::now() + OFTEN, stopped: false });
    work()
}

/// # Errors
/// [`Error::Interrupted`] if the work is to stop.
pub(crate) fn check() -> Result<(), Error> {
    if stopped() { Err(Error::Interrupted { done: 0, total: 0 }) } else { Ok(()) }
}

/// Whether the work is to stop; once so, always.
pub(crate) fn stopped() -> bool {
    // The answer may come from code that calls into this crate.
    let due = WATCH.with_borrow_mut(|watch| match watch {
        None => Err(false),
        Some(Watch::Told(told)) => Err(told.load(Ordering::Relaxed)),
        Some(Watch::Asks { asks, next, stopped }) => {
            let now = Instant::now();
            if *stopped || now < *next {
                return Err(*stopped);
            }
            *next = now + OFTEN;
            Ok(*asks)
        }
    });
    let stop = due.map_or_else(|known| known, |asks| asks());
    if stop {
        WATCH.with_borrow_mut(|watch| {
            if let Some(Watch::Asks { stopped, .. }) = watch {
                *stopped = true;
            }
        });
    }
    stop
}

/// What the threads are told that work for this one.
#[derive(Clone)]
pub(crate) struct Told(Option<Arc<AtomicBool>>);

impl Told {
    /// As this thread is told; of one that asks, whether it `asks` itself, and a new flag.
    fn here() -> (Self, bool) {
        WATCH.with_borrow(|watch| match watch {
            None => (Self(None), false),
            Some(Watch::Told(told)) => (Self(Some(Arc::clone(told))), false),
            Some(Watch::Asks { .. }) => (Self(Some(Arc::default())), true),
        })
    }

    /// Runs a piece of the work on a thread that is told.
    ///
    /// # Errors
    /// Those of the piece; [`Error::Interrupted`] if the work is to stop.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::each;
    use std::sync::atomic::AtomicUsize;

    /// It says so after some asking.
    fn third() -> bool {
        static ASKED: AtomicUsize = AtomicUsize::new(0);
        ASKED.fetch_add(1, Ordering::Relaxed) >= 2
    }

    #[test]
    fn endless_work_on_any_thread_stops_and_others_do_not() {
        let endless = |(): &mut (), _: usize| -> Result<(), Error> {
            loop {
                check()?;
                std::thread::yield_now();
            }
        };
        let stopped = interruptible(third, || each(0..8, || (), endless));
        assert!(matches!(stopped, Err(Error::Interrupted { .. })));
        assert!(check().is_ok(), "the watch is gone with the call");
        let within = || {
            let inner = interruptible(|| false, check);
            std::thread::sleep(2 * OFTEN);
            inner.and(check())
        };
        assert!(interruptible(|| true, within).is_err(), "the watch before is back");
    }

    #[test]
    fn work_within_work_is_told_too() {
        let inner = |(): &mut (), _: usize| each(0..3, || (), |(), index| Ok(index));
        let done = interruptible(|| false, || each(0..50, || (), inner));
        assert_eq!(done.map(|all| all.concat().len()).unwrap_or_default(), 150);
    }

    #[cfg(feature = "pca")]
    #[test]
    fn a_call_that_cannot_be_stopped_is_left_alone() {
        assert_eq!(interruptible(|| false, || apart(|| 7)).ok(), Some(7));
        let (go_on, wait) = std::sync::mpsc::channel::<()>();
        let left = interruptible(|| true, || apart(move || wait.recv()));
        assert!(left.is_err());
        drop(go_on);
    }
}
