//! Rust errors as Python exceptions, whose classes are written in Python (`surefix/errors.py`).

use pyo3::exceptions::{PyException, PyMemoryError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use surefix::Error;

/// A Rust error as its Python exception.
pub(crate) fn to_py(py: Python<'_>, error: &Error) -> PyErr {
    match error {
        Error::Io { .. } => new(py, "SurefixFileError", error.to_string()),
        Error::Interrupted { .. } => new(py, "SurefixError", error.to_string()),
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
    if !error.is_instance_of::<PyException>(py) || error.is_instance_of::<PyMemoryError>(py) {
        return error;
    }
    let refusal = value(py, message(error.value(py)));
    refusal.set_cause(py, Some(error));
    refusal
}

/// The exception for an object that another thread is using.
pub(crate) fn busy(py: Python<'_>, what: &str) -> PyErr {
    let message =
        format!("{what}: in use by another thread: give each thread its own, on one shared map");
    new(py, "SurefixError", message)
}

fn new(py: Python<'_>, class: &'static str, message: String) -> PyErr {
    static CLASSES: [PyOnceLock<Py<PyType>>; 3] = [const { PyOnceLock::new() }; 3];
    let slot = match class {
        "SurefixValueError" => &CLASSES[0],
        "SurefixFileError" => &CLASSES[1],
        _ => &CLASSES[2],
    };
    match slot.import(py, "surefix.errors", class) {
        Ok(class) => PyErr::from_type(class.clone(), message),
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
