//! Long calls look between the pieces of their work whether they are to stop: Ctrl-C in a binding.
//!
//! The thread that made the call asks; the threads that work for it are told.

#[cfg(any(feature = "rayon", feature = "pca"))]
mod told;

use std::cell::RefCell;
use std::time::{Duration, Instant};

use crate::error::Error;
#[cfg(feature = "pca")]
pub(crate) use told::apart;
#[cfg(feature = "rayon")]
pub(crate) use told::on_the_pool;

/// How often a thread asks.
const OFTEN: Duration = Duration::from_millis(50);

thread_local! {
    static WATCH: RefCell<Option<Watch>> = const { RefCell::new(None) };
}

/// How this thread knows that its work is to stop.
#[derive(Clone)]
enum Watch {
    Asks {
        asks: fn() -> bool,
        next: Instant,
        stopped: bool,
    },
    #[cfg(feature = "rayon")]
    Told(told::Flag),
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
        #[cfg(feature = "rayon")]
        Some(Watch::Told(told)) => Err(told.load(std::sync::atomic::Ordering::Relaxed)),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::each;
    use std::sync::atomic::{AtomicUsize, Ordering};

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
