//! The matcher's options as keyword arguments: [`Config`] says which there are, and of which type.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyInt, PyList, PyString};
use pythonize::{depythonize, pythonize};
use surefix::{Config, Error, Floor, Given, Motion};

use crate::error::{OrRaise as _, value};

/// The options of `**options`, over the defaults; `floor` is the default of that option.
pub(crate) fn config(
    py: Python<'_>,
    options: Option<&Bound<'_, PyDict>>,
    floor: Floor,
) -> PyResult<Config> {
    let merged = pythonize(py, &Config::default())?.cast_into::<PyDict>()?;
    merged.set_item("floor", pythonize(py, &floor)?)?;
    let mut config = depythonize(&merged)?;
    for (name, given) in options.into_iter().flatten() {
        let Some(default) = merged.get_item(&name)? else {
            let names: Vec<String> = merged.keys().extract()?;
            let names = names.join(", ");
            return Err(value(py, format!("option `{name}`: expected one of {names}")));
        };
        merged.set_item(&name, in_serde(&name, &default, &given)?)?;
        // One by one, so that the error names the option.
        config = depythonize(&merged).or_else(|_| refuse(&name, &default, &given))?;
    }
    Ok(config)
}

/// The value as serde expects it: any iterable as a list, a number for the floor as its variant.
fn in_serde<'py>(
    name: &Bound<'py, PyAny>,
    default: &Bound<'py, PyAny>,
    given: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = given.py();
    if default.is_instance_of::<PyList>() {
        let each = given.try_iter().and_then(Iterator::collect::<PyResult<Vec<_>>>);
        return each
            .map_or_else(|_| Ok(given.clone()), |each| Ok(PyList::new(py, each)?.into_any()));
    }
    if name.eq("motion")? {
        let named = match given.extract() {
            Ok("steady") => Motion::steady(),
            Ok("free") => Motion::free(),
            Ok("any") => Motion::any(),
            // `surefix.Motion`: its fields.
            _ if given.is_instance(&py.import("surefix.motion")?.getattr("Motion")?)? => {
                return given.getattr("__dict__");
            }
            _ if given.is_none() => return Ok(given.clone()),
            _ => return refuse(name, default, given),
        };
        return Ok(pythonize(py, &named)?);
    }
    if name.eq("floor")? && !given.is_instance_of::<PyString>() {
        let fixed = PyDict::new(py);
        fixed.set_item("fixed", given)?;
        return Ok(fixed.into_any());
    }
    Ok(given.clone())
}

/// The error for a value of another type than the default's.
fn refuse<T>(
    name: &Bound<'_, PyAny>,
    default: &Bound<'_, PyAny>,
    given: &Bound<'_, PyAny>,
) -> PyResult<T> {
    let name: String = name.extract()?;
    let expected = match name.as_str() {
        "gradient" => "\"halved\" or \"unhalved\"",
        "floor" => "\"running\", \"global\" or a number",
        "speeds" => "a sequence of numbers, in places a query",
        "motion" => "\"steady\", \"free\", \"any\", a surefix.Motion or None",
        _ if default.is_instance_of::<PyInt>() => WHOLE,
        _ if default.is_instance_of::<PyFloat>() => "a number",
        _ => "another value",
    };
    Err(value(given.py(), format!("option `{name}`: expected {expected}, got {}", shown(given))))
}

/// What is known about a query.
pub(crate) fn given(trusted: Option<bool>, advance: Option<f64>) -> Given {
    let mut given = Given::default();
    (given.trusted, given.advance) = (trusted, advance);
    given
}

const WHOLE: &str = "a whole number of 0 or more";

fn shown(given: &Bound<'_, PyAny>) -> String {
    given.repr().map_or_else(|_| "an object".to_owned(), |text| text.to_string())
}

/// A whole number of 0 or more.
pub(crate) fn whole(name: &'static str, given: &Bound<'_, PyAny>) -> PyResult<usize> {
    given.extract().or_else(|_| wrong(name, WHOLE, given))
}

/// Two whole numbers: width and height.
pub(crate) fn size(name: &'static str, given: &Bound<'_, PyAny>) -> PyResult<(usize, usize)> {
    let sides: Vec<usize> = given.extract().unwrap_or_default();
    match sides.as_slice() {
        [width, height] => Ok((*width, *height)),
        _ => wrong(name, "a width and a height, two whole numbers of 0 or more", given),
    }
}

/// The error for a value that is not `expected`.
pub(crate) fn wrong<T>(
    name: &'static str,
    expected: &str,
    given: &Bound<'_, PyAny>,
) -> PyResult<T> {
    let expected = expected.to_owned();
    Err(Error::Option { name, expected, got: shown(given) }).or_raise(given.py())
}
