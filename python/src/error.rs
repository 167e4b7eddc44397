//! Rust errors as Python exceptions, whose classes are written in Python (`surefix/errors.py`).

use pyo3::exceptions::{PyException, PyMemoryError};
use pyo3::prelude::*;
use pyo3::types::PyType;
use surefix::Error;

/// A Rust error as its Python exception.
pub(crate) fn to_py(py: Python<'_>, error: &Error) -> PyErr {
    match error {
        Error::Io { .. } => new(py, "SurefixFileError", error.to_string()),
        Error::Interrupted { .. } | Error::Shard { .. } => {
            new(py, "SurefixError", error.to_string())
        }
        _ => value(py, error.to_string()),
    }
}

/// The exception for a bad value that is found before the crate sees it.
pub(crate) fn value(py: Python<'_>, message: String) -> PyErr {
    new(py, "SurefixValueError", message)
}

/// The exception for a value whose own code failed, with that error as its cause: `message` gets
/// its words. Ctrl-C, an exit and the like (no `Exception`), and the end of memory stay what they are.
pub(crate) fn refused(
    py: Python<'_>,
    error: PyErr,
    message: impl FnOnce(&Bound<'_, PyAny>) -> String,
) -> PyErr {
    if is_none_of_ours(py, &error) {
        return error;
    }
    let refusal = value(py, message(error.value(py)));
    refusal.set_cause(py, Some(error));
    refusal
}

/// The value, or `None` if the object's own code failed. Errors that are no refusal stay what they
/// are, as by [`refused`].
pub(crate) fn if_it_can<T>(py: Python<'_>, result: PyResult<T>) -> PyResult<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if is_none_of_ours(py, &error) => Err(error),
        Err(_) => Ok(None),
    }
}

/// Ctrl-C, an exit and the like (no `Exception`), and the end of memory.
pub(crate) fn is_none_of_ours(py: Python<'_>, error: &PyErr) -> bool {
    !error.is_instance_of::<PyException>(py) || error.is_instance_of::<PyMemoryError>(py)
}

/// The exception for an object that another thread is using.
pub(crate) fn busy(py: Python<'_>, what: &str) -> PyErr {
    let message =
        format!("{what}: in use by another thread: give each thread its own, on one shared map");
    new(py, "SurefixError", message)
}

fn new(py: Python<'_>, class: &'static str, message: String) -> PyErr {
    // Looked up each time: a fork could leave a cache half-made.
    let class = py.import("surefix.errors").and_then(|module| module.getattr(class));
    match class.and_then(|class| Ok(class.cast_into::<PyType>()?)) {
        Ok(class) => PyErr::from_type(class, message),
        Err(error) => error,
    }
}

/// Turns the crate's results into Python's.
pub(crate) trait OrRaise<T> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T>;
}

impl<T> OrRaise<T> for Result<T, Error> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|error| to_py(py, &error))
    }
}
