//! Files and folders that replace older ones whole: for `surefix/_saving.py`.

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::path::PathBuf;

use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use surefix::saving;

/// A file that is written beside its name.
#[pyclass(module = "surefix._core")]
pub(crate) struct _AtomicFile(Option<saving::AtomicFile>);

#[pymethods]
impl _AtomicFile {
    #[new]
    fn new(py: Python<'_>, path: PathBuf, rows: bool) -> PyResult<Self> {
        py.detach(|| {
            if rows { saving::AtomicFile::of_rows(&path) } else { saving::AtomicFile::new(&path) }
        })
        .map(|file| Self(Some(file)))
        .map_err(|error| raised(py, error))
    }

    /// The part, for another library to write to (not on Windows, which locks it against all).
    #[getter]
    fn path(&self) -> PyResult<PathBuf> {
        Ok(self.0.as_ref().ok_or_else(ended)?.path().into())
    }

    /// Where the rows of a writer that was killed were kept, if there were some.
    #[getter]
    fn left(&self) -> Option<PathBuf> {
        self.0.as_ref()?.left().map(Into::into)
    }

    fn write(&mut self, py: Python<'_>, data: &[u8]) -> PyResult<usize> {
        let file = self.0.as_mut().ok_or_else(ended)?;
        py.detach(|| file.write_all(data)).map_err(|error| raised(py, error))?;
        Ok(data.len())
    }

    /// Puts it in its place.
    fn commit(&mut self, py: Python<'_>) -> PyResult<()> {
        let file = self.0.take().ok_or_else(ended)?;
        py.detach(|| file.commit()).map_err(|error| raised(py, error))
    }

    /// Keeps it under another name, which is returned; None if it is empty.
    fn keep(&mut self, py: Python<'_>) -> PyResult<Option<PathBuf>> {
        let file = self.0.take().ok_or_else(ended)?;
        py.detach(|| file.keep()).map_err(|error| raised(py, error))
    }

    /// Removes it, unless it has ended.
    fn discard(&mut self) {
        self.0 = None;
    }
}

/// A folder that is filled beside its name.
#[pyclass(module = "surefix._core")]
pub(crate) struct _AtomicFolder(Option<saving::AtomicFolder>);

#[pymethods]
impl _AtomicFolder {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let folder = py.detach(|| saving::AtomicFolder::new(&path));
        folder.map(|folder| Self(Some(folder))).map_err(|error| raised(py, error))
    }

    /// The folder to fill.
    #[getter]
    fn path(&self) -> PyResult<PathBuf> {
        Ok(self.0.as_ref().ok_or_else(ended)?.path().into())
    }

    /// Puts the files in their place; those of the names `old` go.
    fn commit(&mut self, py: Python<'_>, old: Vec<OsString>, last: &str) -> PyResult<()> {
        let folder = self.0.take().ok_or_else(ended)?;
        py.detach(|| folder.commit(&old, last)).map_err(|error| raised(py, error))
    }

    /// Removes it, unless it has ended.
    fn discard(&mut self) {
        self.0 = None;
    }
}

/// Whether a path leads to a device, a pipe, or what the process has open, such as `/dev/stdout`.
#[pyfunction]
pub(crate) fn _is_stream(path: PathBuf) -> bool {
    saving::is_stream(&path)
}

fn ended() -> PyErr {
    PyValueError::new_err("the file has ended")
}

/// As Python's own files raise it.
fn raised(py: Python<'_>, error: io::Error) -> PyErr {
    let Some(code) = error.raw_os_error() else { return PyOSError::new_err(error.to_string()) };
    let said =
        py.import("os").and_then(|os| os.call_method1("strerror", (code,))?.extract::<String>());
    PyOSError::new_err((code, said.unwrap_or_else(|_| error.to_string())))
}
