//! Long calls without the GIL, which look at Python's signals as they work.

use std::cell::RefCell;

use pyo3::prelude::*;
use surefix::{Error, interruptible};

use crate::error::OrRaise as _;

thread_local! {
    static RAISED: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// Whether a signal's handler raises: `KeyboardInterrupt` on Ctrl-C. Python runs handlers on the
/// main thread alone; on others it is always no.
#[expect(clippy::redundant_closure_for_method_calls, reason = "the method is of one lifetime")]
fn raises() -> bool {
    let raised = Python::attach(|py| py.check_signals()).err();
    let any = raised.is_some();
    if any {
        RAISED.set(raised);
    }
    any
}

/// Runs `work` without the GIL. If a signal's handler raises meanwhile, the work is stopped.
pub(crate) fn detached<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, Error> + Send,
) -> PyResult<T> {
    watched(|| py.detach(work)).and_then(|result| result.or_raise(py))
}

/// Runs `work`; if a signal's handler raises meanwhile, all that is long in it is stopped.
pub(crate) fn watched<T>(work: impl FnOnce() -> T) -> PyResult<T> {
    let before = RAISED.take();
    let result = interruptible(raises, work);
    match RAISED.replace(before) {
        Some(error) => Err(error),
        None => Ok(result),
    }
}
