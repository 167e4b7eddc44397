//! The matcher's options as keyword arguments: [`Config`] says which there are, and of which type.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyInt, PyList, PyString};
use pythonize::{depythonize, pythonize};
use surefix::{Config, Error, Floor, Given};

use crate::error::{OrRaise as _, if_it_can, value};
use crate::images::path_of;
use crate::settings::Settings;

/// The options of `**options`, over those of its `config`, over the defaults; `floor` is the
/// default of that option.
pub(crate) fn config(
    py: Python<'_>,
    options: Option<&Bound<'_, PyDict>>,
    floor: Floor,
) -> PyResult<Config> {
    Ok(settings(py, options, floor, true)?.config)
}

/// The settings of `config`, with the options of `**options` in place of its own: another value only
/// if there is no threshold, or if it is `renewed`.
pub(crate) fn settings(
    py: Python<'_>,
    options: Option<&Bound<'_, PyDict>>,
    floor: Floor,
    renewed: bool,
) -> PyResult<surefix::Settings> {
    let mut settings = surefix::Settings::default();
    settings.config.floor = floor;
    let given = options.map(|options| options.get_item("config")).transpose()?.flatten();
    if let Some(given) = given.filter(|given| !given.is_none()) {
        settings = if let Ok(settings) = given.cast::<Settings>() {
            settings.get().0.clone()
        } else if let Some(path) = path_of(&given)? {
            surefix::Settings::open(path).or_raise(py)?
        } else {
            let shown = shown(&given)?;
            let message =
                format!("config: expected a surefix.Settings or a file of one, got {shown}");
            return Err(value(py, message));
        };
    }
    let known = std::mem::take(&mut settings.config);
    settings.config = merged(py, &known, options)?;
    // A threshold is of the options that it was calibrated with.
    let other = settings.threshold.is_some() && settings.config != known;
    if other && !renewed {
        let names = options.into_iter().flatten().map(|(name, _)| name.to_string());
        let names: Vec<_> = names.filter(|name| name != "config").collect();
        let message = format!(
            "option `{}`: expected that of the settings, whose threshold was calibrated with it, got \
             another",
            names.join("`, `")
        );
        return Err(value(py, message));
    }
    Ok(settings)
}

/// The options of `**options` over those of `config`.
fn merged(
    py: Python<'_>,
    config: &Config,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Config> {
    let merged = pythonize(py, config)?.cast_into::<PyDict>()?;
    let mut config = config.clone();
    for (name, given) in options.into_iter().flatten() {
        if name.eq("config")? {
            continue;
        }
        let Some(default) = merged.get_item(&name)? else {
            let names: Vec<String> = merged.keys().extract()?;
            let names = names.join(", ");
            return Err(value(py, format!("option `{name}`: expected one of {names}")));
        };
        merged.set_item(&name, in_serde(&name, &default, &given)?)?;
        // One by one, so that the error names the option.
        let read = if_it_can(py, depythonize(&merged).map_err(PyErr::from))?;
        config = read.map_or_else(|| refuse(&name, &default, &given), Ok)?;
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
        let each = if_it_can(py, each)?;
        return each
            .map_or_else(|| Ok(given.clone()), |each| Ok(PyList::new(py, each)?.into_any()));
    }
    if name.eq("motion")? {
        // `surefix.Motion`: its fields.
        if given.is_instance(&py.import("surefix.motion")?.getattr("Motion")?)? {
            return given.getattr("__dict__");
        }
        let known = given.is_none() || given.is_instance_of::<PyString>();
        return if known { Ok(given.clone()) } else { refuse(name, default, given) };
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
        "technique_weights" => "a sequence of numbers, one a technique",
        "motion" => "\"steady\", \"free\", \"any\", a surefix.Motion or None",
        _ if default.is_instance_of::<PyInt>() => WHOLE,
        _ if default.is_instance_of::<PyFloat>() => "a number",
        _ => "another value",
    };
    Err(value(given.py(), format!("option `{name}`: expected {expected}, got {}", shown(given)?)))
}

/// What is known about a query.
pub(crate) fn given(trusted: Option<bool>, advance: Option<f64>) -> Given {
    let mut given = Given::default();
    (given.trusted, given.advance) = (trusted, advance);
    given
}

const WHOLE: &str = "a whole number of 0 or more";

pub(crate) fn shown(given: &Bound<'_, PyAny>) -> PyResult<String> {
    let text = if_it_can(given.py(), given.repr())?;
    Ok(text.map_or_else(|| "an object".to_owned(), |text| text.to_string()))
}

/// A whole number of 0 or more.
pub(crate) fn whole(name: &'static str, given: &Bound<'_, PyAny>) -> PyResult<usize> {
    if_it_can(given.py(), given.extract())?.map_or_else(|| wrong(name, WHOLE, given), Ok)
}

/// Two whole numbers: width and height.
pub(crate) fn size(name: &'static str, given: &Bound<'_, PyAny>) -> PyResult<(usize, usize)> {
    let sides: Vec<usize> = if_it_can(given.py(), given.extract())?.unwrap_or_default();
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
    Err(Error::Option { name, expected, got: shown(given)? }).or_raise(given.py())
}
