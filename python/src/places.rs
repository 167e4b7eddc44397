//! Arguments that come with a map's descriptors: their recipe, the places' names and positions.

use pyo3::prelude::*;
use pyo3::types::PyString;
use surefix::Positions;

use crate::arrays::coordinates;
use crate::error::{OrRaise as _, value};
use crate::sad::Sad;

/// The recipe of a `descriptor` argument.
pub(crate) fn recipe(
    py: Python<'_>,
    descriptor: Option<&Bound<'_, PyAny>>,
) -> PyResult<surefix::Sad> {
    match descriptor.filter(|given| !given.is_none()).map(Bound::cast::<Sad>) {
        None => Ok(surefix::Sad::default()),
        Some(Ok(sad)) => Ok(sad.get().0),
        Some(Err(_)) => Err(value(py, "descriptor: expected a surefix.Sad".to_owned())),
    }
}

/// The recipe of a new map, with the `levels` argument.
pub(crate) fn levelled_recipe(
    py: Python<'_>,
    descriptor: Option<&Bound<'_, PyAny>>,
    levels: Option<&Bound<'_, PyAny>>,
) -> PyResult<surefix::Sad> {
    let sad = recipe(py, descriptor)?;
    Ok(levels.map(range).transpose()?.map_or(sad, |levels| sad.with_levels(Some(levels))))
}

/// The range of a `levels` argument.
pub(crate) fn range(given: &Bound<'_, PyAny>) -> PyResult<surefix::Levels> {
    let py = given.py();
    let (low, high) = given.extract::<(u16, u16)>().map_err(|_| {
        let got = given.repr().map_or_else(|_| "something else".to_owned(), |r| r.to_string());
        value(py, format!("levels: expected (low, high), from 0 to 65535, got {got}"))
    })?;
    surefix::Levels::new(low, high).or_raise(py)
}

/// The positions of some of the images.
pub(crate) fn positions_of(
    positions: Option<&Positions>,
    kept: Option<&[usize]>,
    images: usize,
) -> Result<Option<Positions>, surefix::Error> {
    let (Some(positions), Some(kept)) = (positions, kept) else { return Ok(positions.cloned()) };
    if positions.len() != images {
        let (what, got) = ("positions", positions.len());
        return Err(surefix::Error::Length { what, expected: images, got });
    }
    let axes = positions.axes();
    let row = |&image: &usize| &positions.metres()[image * axes..(image + 1) * axes];
    Positions::new(kept.iter().flat_map(row).copied().collect(), axes).map(Some)
}

/// A name for each place.
pub(crate) fn names(names: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    if names.is_instance_of::<PyString>() {
        return Err(value(
            names.py(),
            "names: expected a sequence of strings, one a place, got a string".to_owned(),
        ));
    }
    let each = names.try_iter().and_then(|each| each.map(|name| name?.extract()).collect());
    each.map_err(|_| {
        value(names.py(), "names: expected a sequence of strings, one a place".to_owned())
    })
}

/// The positions of a `positions` argument.
pub(crate) fn positions(given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Positions>> {
    let Some(given) = given.filter(|given| !given.is_none()) else { return Ok(None) };
    let (metres, axes) = coordinates(given, "positions")?;
    Positions::new(metres, axes).or_raise(given.py()).map(Some)
}

pub(crate) fn with_positions(
    map: surefix::Map,
    given: Option<Positions>,
) -> Result<surefix::Map, surefix::Error> {
    match given {
        Some(positions) => map.with_positions(positions),
        None => Ok(map),
    }
}
