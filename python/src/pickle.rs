//! Pickles, and so copies, of answers and settings: their fields as MessagePack, which keeps every
//! number to the last bit.

use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::value;

/// The bytes of a value.
pub(crate) fn packed(py: Python<'_>, given: &impl Serialize) -> PyResult<Vec<u8>> {
    rmp_serde::to_vec_named(given).map_err(|e| value(py, format!("cannot be pickled: {e}")))
}

/// The value again.
pub(crate) fn unpacked<T: DeserializeOwned>(py: Python<'_>, bytes: &[u8]) -> PyResult<T> {
    let expected = "a pickle of this version of surefix";
    rmp_serde::from_slice(bytes).map_err(|e| value(py, format!("expected {expected}, got {e}")))
}

/// Makes a class that holds nothing but a value of the crate one that `pickle` and `copy` take; or
/// one that a function makes of it again.
macro_rules! pickled {
    ($class:ident) => {
        $crate::pickle::pickled!($class, $class);
    };
    ($class:ident, $again:expr) => {
        #[pyo3::pymethods]
        impl $class {
            fn __reduce__<'py>(
                slf: &pyo3::Bound<'py, Self>,
            ) -> pyo3::PyResult<pyo3::Bound<'py, pyo3::types::PyTuple>> {
                use pyo3::{IntoPyObject as _, types::PyAnyMethods as _};
                let py = slf.py();
                let this =
                    slf.try_borrow().map_err(|_| $crate::error::busy(py, stringify!($class)))?;
                let bytes = $crate::pickle::packed(py, &this.0)?;
                let again = slf.get_type().getattr("_unpickled")?;
                (again, (pyo3::types::PyBytes::new(py, &bytes),)).into_pyobject(py)
            }

            #[staticmethod]
            fn _unpickled(py: pyo3::Python<'_>, bytes: &[u8]) -> pyo3::PyResult<Self> {
                $crate::pickle::unpacked(py, bytes).map($again)
            }
        }
    };
}
pub(crate) use pickled;
