//! What a run or an alignment was made of: its distances are computed when they are asked for.

use std::sync::Arc;

use numpy::{PyArray1, PyArrayMethods as _, PyUntypedArrayMethods as _};
use once_cell::race::OnceBox;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surefix::{Config, Values, drive_distances, fused_distances};

use crate::arrays::{Numbers, as_array, matrix, query};
use crate::batch::{Rows, views};
use crate::error::value;
use crate::images::with_progress;

/// The distances, or what they can be computed of. Nothing is copied: matrices and ready descriptors
/// are the caller's own.
enum Given {
    Matrices(Vec<Py<PyAny>>),
    Queries {
        maps: Vec<Arc<surefix::Map>>,
        rows: Vec<Kept>,
    },
    /// A pickle does not keep them.
    Lost,
}

/// [`Rows`] that outlive the call.
enum Kept {
    Given(Py<PyAny>),
    Described(Values),
}

/// The distances of a drive.
pub(crate) struct Distances {
    given: Given,
    config: Config,
    computed: OnceBox<Py<PyAny>>,
}

impl Distances {
    fn new(given: Given, config: Config) -> Self {
        Self { given, config, computed: OnceBox::new() }
    }

    /// Those of a run from a pickle.
    pub(crate) fn lost() -> Self {
        Self::new(Given::Lost, Config::default())
    }

    pub(crate) fn of_matrices<'py>(
        matrices: impl IntoIterator<Item = Bound<'py, PyAny>>,
        config: Config,
    ) -> Self {
        let matrices = matrices.into_iter().map(Bound::unbind).collect();
        Self::new(Given::Matrices(matrices), config)
    }

    pub(crate) fn of_queries(
        maps: Vec<Arc<surefix::Map>>,
        rows: Vec<Rows<'_>>,
        config: Config,
    ) -> Self {
        let kept = |rows| match rows {
            Rows::Given(numbers) => Kept::Given(numbers.object().unbind()),
            Rows::Described(values) => Kept::Described(values),
        };
        let rows = rows.into_iter().map(kept).collect();
        Self::new(Given::Queries { maps, rows }, config)
    }

    /// The matrix, (n, m), which cannot be written to: computed at the first call, for `what`.
    pub(crate) fn array<'py>(&self, py: Python<'py>, what: &str) -> PyResult<Bound<'py, PyAny>> {
        let computed = self.computed.get_or_try_init(|| self.compute(py, what).map(Box::new));
        Ok(computed?.bind(py).clone())
    }

    fn compute(&self, py: Python<'_>, what: &str) -> PyResult<Py<PyAny>> {
        let columns = match &self.given {
            Given::Lost => {
                let a = if what.starts_with('a') { "an" } else { "a" };
                let got = "got one from a pickle, which does not keep them: make it again";
                let message = format!("distances: expected {a} {what} of this process, {got}");
                return Err(value(py, message));
            }
            Given::Matrices(matrices) => {
                if let [only] = &matrices[..] {
                    return read_only(only.bind(py).call_method0("view")?);
                }
                let each: Vec<_> = matrices
                    .iter()
                    .map(|given| matrix(given.bind(py), "distances"))
                    .collect::<PyResult<_>>()?;
                let places = each.first().map_or(0, |matrix| matrix.shape()[0]);
                let views = views(py, &each)?;
                let fused = with_progress(py, None, |progress| {
                    Ok(py.detach(|| fused_distances(&views, &self.config, progress)))
                });
                (fused?, places)
            }
            Given::Queries { maps, rows } => {
                let places = maps.first().map_or(0, |map| map.places());
                let rows: Vec<_> = rows
                    .iter()
                    .zip(maps)
                    .map(|(rows, map)| match rows {
                        Kept::Described(values) => Ok(Held::Values(values)),
                        Kept::Given(array) => {
                            let array = as_array(array.bind(py), "queries")?;
                            query(&array, "queries", map).map(Held::Numbers)
                        }
                    })
                    .collect::<PyResult<_>>()?;
                let views = rows.iter().map(Held::view).collect::<PyResult<Vec<_>>>()?;
                let computed = with_progress(py, None, |progress| {
                    Ok(py.detach(|| drive_distances(maps, &views, &self.config, progress)))
                });
                (computed?, places)
            }
        };
        let (numbers, places) = columns;
        read_only(as_matrix(py, numbers, places)?)
    }
}

enum Held<'a, 'py> {
    Values(&'a Values),
    Numbers(Numbers<'py>),
}

impl Held<'_, '_> {
    fn view(&self) -> PyResult<surefix::View<'_>> {
        match self {
            Self::Values(values) => Ok(values.view()),
            Self::Numbers(numbers) => numbers.view(),
        }
    }
}

/// Columns of `places` numbers as an array (n, m).
pub(crate) fn as_matrix(
    py: Python<'_>,
    columns: Vec<f32>,
    places: usize,
) -> PyResult<Bound<'_, PyAny>> {
    let shape = [columns.len() / places.max(1), places];
    PyArray1::from_vec(py, columns).reshape(shape)?.call_method0("transpose")
}

fn read_only(array: Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
    let flags = PyDict::new(array.py());
    flags.set_item("write", false)?;
    array.call_method("setflags", (), Some(&flags))?;
    Ok(array.unbind())
}
