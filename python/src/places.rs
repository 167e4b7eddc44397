//! Arguments that come with a map's descriptors: their recipe, the places' names and positions.

use pyo3::prelude::*;
use pyo3::types::PyString;
use surefix::{Extras, Positions};

use crate::arrays::coordinates;
use crate::error::{OrRaise as _, if_it_can, value};
use crate::options::{shown, size, wrong};
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
    let Some((low, high)) = if_it_can(py, given.extract::<(u16, u16)>())? else {
        let got = shown(given)?;
        let expected = "levels: expected (low, high), from 0 to 65535";
        return Err(value(py, format!("{expected}, got {got}")));
    };
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
    let some = Positions::new(kept.iter().flat_map(row).copied().collect(), axes)?;
    match (positions.origin(), positions.plane()) {
        (Some(origin), _) => some.with_origin(origin).map(Some),
        (None, Some(plane)) => some.with_plane(plane).map(Some),
        (None, None) => Ok(Some(some)),
    }
}

/// The segments of some of the images.
pub(crate) fn segments_of_some(
    segments: &surefix::Segments,
    kept: Option<&[usize]>,
) -> Result<surefix::Segments, surefix::Error> {
    kept.map_or_else(|| Ok(segments.clone()), |kept| segments.keep(kept))
}

/// The thumbnails that the argument `thumbnails` asks for: True, or (width, height).
pub(crate) fn thumbnails(given: Option<&Bound<'_, PyAny>>) -> PyResult<Extras<'static>> {
    let none = Extras::default();
    let Some(given) = given.filter(|given| !given.is_none()) else { return Ok(none) };
    match if_it_can(given.py(), given.extract::<bool>())? {
        Some(true) => Ok(none.thumbnails()),
        Some(false) => Ok(none),
        None => size("thumbnails", given).map(|size| none.thumbnails_of(size)),
    }
}

/// What is given with the images of a map, beside its thumbnails.
pub(crate) fn extras<'a>(
    thumbnails: Extras<'a>,
    positions: Option<&'a Positions>,
    segments: &'a surefix::Segments,
) -> Extras<'a> {
    let extras = thumbnails.segments(segments);
    positions.map_or(extras, |positions| extras.positions(positions))
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
    if_it_can(names.py(), each)?.ok_or_else(|| {
        value(names.py(), "names: expected a sequence of strings, one a place".to_owned())
    })
}

/// The positions of the arguments `positions` and `origin`.
pub(crate) fn positions(
    given: Option<&Bound<'_, PyAny>>,
    origin: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<Positions>> {
    let origin = origin.filter(|origin| !origin.is_none());
    let Some(given) = given.filter(|given| !given.is_none()) else {
        return match origin {
            None => Ok(None),
            Some(origin) => {
                let expected = "origin: expected positions beside it, got none";
                Err(value(origin.py(), expected.to_owned()))
            }
        };
    };
    let py = given.py();
    let (metres, axes) = coordinates(given, "positions")?;
    let positions = Positions::new(metres, axes).or_raise(py)?;
    let Some(origin) = origin else { return Ok(Some(positions)) };
    if let Ok(plane) = origin.extract::<&str>() {
        return positions.with_plane(plane).or_raise(py).map(Some);
    }
    let Some((latitude, longitude)) = if_it_can(py, origin.extract::<(f64, f64)>())? else {
        return wrong("origin", "(latitude, longitude), or the name of another plane", origin);
    };
    let origin = surefix::Origin::new(latitude, longitude);
    origin.and_then(|origin| positions.with_origin(origin)).or_raise(py).map(Some)
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
