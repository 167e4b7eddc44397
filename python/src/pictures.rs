//! Pictures and HTML of an object, which Python draws.

use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Draws an object by a function of `surefix.plot.objects`, on the axes if they are given.
pub(crate) fn plotted<'py>(
    object: &Bound<'py, PyAny>,
    function: &str,
    ax: Option<&Bound<'py, PyAny>>,
    given: &[(&str, Option<&Bound<'py, PyAny>>)],
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = object.py();
    let all = options.map_or_else(|| Ok(PyDict::new(py)), PyDictMethods::copy)?;
    all.set_item("ax", ax)?;
    for (name, given) in given {
        if let Some(given) = given {
            all.set_item(name, given)?;
        }
    }
    py.import("surefix.plot.objects")?.call_method(function, (object,), Some(&all))
}

/// An object as HTML, by a function of `surefix._html`.
pub(crate) fn html(object: &Bound<'_, PyAny>, function: &str) -> PyResult<String> {
    object.py().import("surefix._html")?.call_method1(function, (object,))?.extract()
}
