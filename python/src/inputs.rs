//! Frames and queries as the maps of a localizer take them.

use numpy::{PyUntypedArray, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use std::sync::Arc;

use crate::arrays::{Numbers, as_array, is_of_pillow, query};
use crate::error::{if_it_can, value};
use crate::images::{Pixels, path_of, read_image};
use crate::learned;
use crate::map::Map;

/// A map's part of a frame, kept in memory.
pub(crate) enum Input<'py> {
    Image(Pixels<'py>),
    Descriptor(Numbers<'py>),
}

impl<'py> Input<'py> {
    /// The frame for one map: an image that the map or the learned descriptor describes, or a
    /// descriptor.
    pub(crate) fn new(
        frame: &Bound<'py, PyAny>,
        map: &surefix::Map,
        descriptor: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let described = learned::described(frame, map, descriptor)?;
        let frame = described.as_ref().unwrap_or(frame);
        let array: Bound<'py, PyUntypedArray> = match path_of(frame)? {
            Some(path) => read_image(frame.py(), path)?.cast_into()?,
            None => as_array(frame, "frame")?,
        };
        if array.ndim() == 1 {
            return query(&array, "descriptor", map).map(Self::Descriptor);
        }
        Pixels::new(&array, "image").map(Self::Image)
    }

    pub(crate) fn view(&self, py: Python<'_>) -> PyResult<surefix::Input<'_>> {
        Ok(match self {
            Self::Image(pixels) => surefix::Input::Image(pixels.view(py)?),
            Self::Descriptor(numbers) => surefix::Input::Descriptor(numbers.view()?),
        })
    }
}

/// Whether queries are one or many.
pub(crate) enum One<'py> {
    Descriptor(Bound<'py, PyUntypedArray>),
    Image,
    Many,
}

impl<'py> One<'py> {
    /// One descriptor has one axis. One image is a file, an image of Pillow, an array of three axes
    /// of which the last is colours, or, if images are `described`, one of two axes that is not as
    /// wide as `dim`.
    pub(crate) fn of(given: &Bound<'py, PyAny>, dim: usize, described: bool) -> PyResult<Self> {
        if let Some(path) = path_of(given)? {
            return Ok(if path.is_file() { Self::Image } else { Self::Many });
        }
        if is_of_pillow(given) {
            return Ok(Self::Image);
        }
        if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() {
            let number = given.get_item(0).and_then(|first| first.extract::<f64>());
            let number = if_it_can(given.py(), number)?.is_some();
            let array = number.then(|| as_array(given, "descriptor")).transpose()?;
            return Ok(array.map_or(Self::Many, Self::Descriptor));
        }
        let Some(array) = if_it_can(given.py(), as_array(given, "queries"))? else {
            return Ok(Self::Many);
        };
        Ok(match array.shape() {
            [_] => Self::Descriptor(array),
            [_, width] if described && *width != dim => Self::Image,
            [_, _, 1 | 3 | 4] => Self::Image,
            _ => Self::Many,
        })
    }
}

/// One map, or several of one route.
pub(crate) fn maps(given: &Bound<'_, PyAny>) -> PyResult<Vec<Arc<surefix::Map>>> {
    if let Ok(map) = given.cast::<Map>() {
        return Ok(vec![map.borrow().0.clone()]);
    }
    let refused = |got: &Bound<'_, PyAny>| {
        let kind = got.get_type().name().map_or_else(|_| "an object".to_owned(), |n| n.to_string());
        value(got.py(), format!("map: expected a surefix.Map, or a list of maps, got {kind}"))
    };
    let mut maps = Vec::new();
    for map in listed(given)?.ok_or_else(|| refused(given))? {
        maps.push(map.cast::<Map>().map_err(|_| refused(&map))?.borrow().0.clone());
    }
    Ok(maps)
}

/// The learned descriptor of each map, from one for the only map that needs one, or a list with
/// None for the others.
pub(crate) fn descriptors(
    given: Option<&Bound<'_, PyAny>>,
    maps: &[Arc<surefix::Map>],
) -> PyResult<Vec<Option<Py<PyAny>>>> {
    let mut all: Vec<Option<Py<PyAny>>> = maps.iter().map(|_| None).collect();
    let Some(given) = given else { return Ok(all) };
    let Some(each) = listed(given)? else {
        let ready = |map: &&Arc<surefix::Map>| map.recipe() == surefix::Recipe::Ready;
        let index = maps.iter().position(|map| ready(&map)).unwrap_or(0);
        all[index] = Some(learned::checked(given, &maps[index])?);
        return Ok(all);
    };
    if each.len() != maps.len() {
        let (expected, got) = (maps.len(), each.len());
        let message =
            format!("descriptor: expected {expected} entries, one for each map, got {got}");
        return Err(value(given.py(), message));
    }
    for ((slot, given), map) in all.iter_mut().zip(each).zip(maps) {
        if !given.is_none() {
            *slot = Some(learned::checked(&given, map)?);
        }
    }
    Ok(all)
}

/// The items of a list or a tuple.
pub(crate) fn listed<'py>(given: &Bound<'py, PyAny>) -> PyResult<Option<Vec<Bound<'py, PyAny>>>> {
    let listed = given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>();
    if listed { if_it_can(given.py(), given.extract()) } else { Ok(None) }
}
