//! The matcher's options as keyword arguments.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use surefix::{Config, Error, Floor, Gradient};

use crate::error::{OrRaise as _, value};

const NAMES: &str = "sequence_length, weight, tolerance, smoothing, gradient, floor, speeds";

/// The options of `**options`, over the defaults; `floor` says which floor is the default.
pub(crate) fn config(
    py: Python<'_>,
    options: Option<&Bound<'_, PyDict>>,
    floor: Floor,
) -> PyResult<Config> {
    let mut config = Config { floor, ..Config::default() };
    for (name, given) in options.into_iter().flatten() {
        let name: String = name.extract()?;
        match name.as_str() {
            "sequence_length" => config.sequence_length = whole("sequence_length", &given)?,
            "tolerance" => config.tolerance = whole("tolerance", &given)?,
            "smoothing" => config.smoothing = whole("smoothing", &given)?,
            "weight" => config.weight = number("weight", &given)?,
            "gradient" => config.gradient = gradient(&given)?,
            "floor" => config.floor = floor_of(&given)?,
            "speeds" => config.speeds = speeds(&given)?,
            _ => return Err(value(py, format!("option `{name}`: expected one of {NAMES}"))),
        }
    }
    Ok(config)
}

fn refuse<T>(name: &'static str, expected: &str, given: &Bound<'_, PyAny>) -> PyResult<T> {
    let got = given.repr().map_or_else(|_| "an object".to_owned(), |text| text.to_string());
    Err(Error::Option { name, expected: expected.to_owned(), got }).or_raise(given.py())
}

pub(crate) fn whole(name: &'static str, given: &Bound<'_, PyAny>) -> PyResult<usize> {
    given.extract().or_else(|_| refuse(name, "a whole number of 0 or more", given))
}

/// Two whole numbers: width and height.
pub(crate) fn size(name: &'static str, given: &Bound<'_, PyAny>) -> PyResult<(usize, usize)> {
    let sides: Vec<usize> = given.extract().unwrap_or_default();
    match sides.as_slice() {
        [width, height] => Ok((*width, *height)),
        _ => refuse(name, "a width and a height, two whole numbers of 0 or more", given),
    }
}

fn number(name: &'static str, given: &Bound<'_, PyAny>) -> PyResult<f64> {
    given.extract().or_else(|_| refuse(name, "a number", given))
}

fn gradient(given: &Bound<'_, PyAny>) -> PyResult<Gradient> {
    match given.extract::<String>().as_deref() {
        Ok("halved") => Ok(Gradient::Halved),
        Ok("unhalved") => Ok(Gradient::Unhalved),
        _ => refuse("gradient", "\"halved\" or \"unhalved\"", given),
    }
}

fn floor_of(given: &Bound<'_, PyAny>) -> PyResult<Floor> {
    if let Ok(name) = given.cast::<PyString>() {
        match name.to_string().as_str() {
            "running" => return Ok(Floor::Running),
            "global" => return Ok(Floor::Global),
            _ => {}
        }
    } else if let Ok(floor) = given.extract() {
        return Ok(Floor::Fixed(floor));
    }
    refuse("floor", "\"running\", \"global\" or a number", given)
}

fn speeds(given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let each = given.try_iter().and_then(|each| each.map(|speed| speed?.extract()).collect());
    each.or_else(|_| refuse("speeds", "a sequence of numbers, in places a query", given))
}
