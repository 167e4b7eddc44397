//! `surefix.Position`, and the positions of runs and alignments.

use numpy::{PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use surefix::Positions;

use crate::align::Alignment;
use crate::batch::Run;
use crate::map_places::degrees_of;
use crate::pickle::pickled;

/// Where a place is: ``metres``, a tuple of 2 or 3 coordinates on the plane of the map's positions
/// (``Map.origin``, ``Map.plane``), and ``degrees``, latitude and longitude, or None if the origin
/// of the plane is not known.
#[pyclass(frozen, eq, module = "surefix")]
#[derive(PartialEq)]
pub(crate) struct Position(surefix::Position);

pickled!(Position);

impl From<surefix::Position> for Position {
    fn from(position: surefix::Position) -> Self {
        Self(position)
    }
}

#[pymethods]
impl Position {
    /// Two or three coordinates in metres: east, north and height, if the plane is one of degrees.
    #[getter]
    fn metres<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.0.metres())
    }
    /// Latitude and longitude; None if the origin of the plane is not known.
    #[getter]
    fn degrees(&self) -> Option<(f64, f64)> {
        self.0.degrees().map(Into::into)
    }
    fn __repr__(&self) -> String {
        let metres: Vec<_> = self.0.metres().iter().map(|metre| format!("{metre:?}")).collect();
        let degrees = self
            .0
            .degrees()
            .map(|[latitude, longitude]| format!(", degrees=({latitude:?}, {longitude:?})"));
        format!("Position(metres=({}){})", metres.join(", "), degrees.unwrap_or_default())
    }
}

#[pymethods]
impl Run {
    /// The position of each query's place in metres: float64, (m, 2) or (m, 3); None if the map has
    /// no positions, and of distances.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.0.positions.as_ref().map(|known| metres_of(py, known)).transpose()
    }
    /// Latitude and longitude of each query's place: float64, (m, 2); None if they are not known.
    #[getter]
    fn degrees<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.0.positions.as_ref().map_or(Ok(None), |known| degrees_of(py, known))
    }
}

#[pymethods]
impl Alignment {
    /// The position of each query's place in metres: float64, (m, 2) or (m, 3); None if the map has
    /// no positions.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.0.positions.as_ref().map(|known| metres_of(py, known)).transpose()
    }
    /// Latitude and longitude of each query's place: float64, (m, 2); None if they are not known.
    #[getter]
    fn degrees<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.0.positions.as_ref().map_or(Ok(None), |known| degrees_of(py, known))
    }
}

fn metres_of<'py>(py: Python<'py>, known: &Positions) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, known.metres()).reshape([known.len(), known.axes()])
}
