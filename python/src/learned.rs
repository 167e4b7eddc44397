//! Descriptors that Python computes: `surefix.descriptors`.

use std::path::Path;

use pyo3::call::PyCallArgs;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use surefix::Recipe;

use crate::arrays::{as_array, dtype_of, shape_of};
use crate::error::{if_it_can, refused, value};
use crate::images::{Pixels, path_of, read_image};
use crate::sad::Sad;
use crate::signals::detached;

/// Vectors of at most 8 numbers are points, and the origin is a point too.
const POINT: usize = 8;

/// Whether a `descriptor` argument is one of Python's.
pub(crate) fn is_learned(given: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(!given.is_none()
        && !given.is_instance_of::<Sad>()
        && if_it_can(given.py(), given.hasattr("describe"))?.unwrap_or(false))
}

/// The map of images that such a descriptor describes.
pub(crate) fn map_of_images<'py, const N: usize>(
    images: &Bound<'py, PyAny>,
    descriptor: &Bound<'py, PyAny>,
    options: [(&str, Option<&Bound<'py, PyAny>>); N],
) -> PyResult<Bound<'py, PyAny>> {
    mapping(images.py(), "map_of_images", (images, descriptor), options)
}

/// The map in a file, longer by images that such a descriptor describes.
pub(crate) fn append_images<'py, const N: usize>(
    path: &Path,
    images: &Bound<'py, PyAny>,
    descriptor: &Bound<'py, PyAny>,
    options: [(&str, Option<&Bound<'py, PyAny>>); N],
) -> PyResult<()> {
    mapping(images.py(), "append_images", (path, images, descriptor), options).map(|_| ())
}

/// Calls a function of `surefix.descriptors.mapping` with the options that are given.
fn mapping<'py, const N: usize>(
    py: Python<'py>,
    name: &str,
    arguments: impl PyCallArgs<'py>,
    options: [(&str, Option<&Bound<'py, PyAny>>); N],
) -> PyResult<Bound<'py, PyAny>> {
    let given = PyDict::new(py);
    for (name, option) in options {
        if let Some(option) = option {
            given.set_item(name, option)?;
        }
    }
    py.import("surefix.descriptors.mapping")?.getattr(name)?.call(arguments, Some(&given))
}

/// Images described one batch after the other: an array (n, dim).
pub(crate) fn extracted<'py>(
    images: &Bound<'py, PyAny>,
    descriptor: &Bound<'py, PyAny>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let options = PyDict::new(images.py());
    options.set_item("progress", progress)?;
    let module = images.py().import("surefix.descriptors")?;
    module.call_method("extract", (images, descriptor), Some(&options))
}

/// A recipe as JSON.
pub(crate) fn recipe_text(recipe: &Bound<'_, PyAny>) -> PyResult<String> {
    let py = recipe.py();
    let as_dict = py.get_type::<PyDict>().call1((recipe,));
    let text =
        as_dict.and_then(|recipe| py.import("json")?.call_method1("dumps", (recipe,))?.extract());
    let expected = "recipe: expected a mapping that JSON can hold, with a \"name\"";
    text.map_err(|e| refused(py, e, |e| format!("{expected}: {e}")))
}

/// The name in a map's recipe.
fn name_of(map: &surefix::Map) -> Option<String> {
    let recipe: serde_json::Value = serde_json::from_str(map.learned_recipe()?).ok()?;
    recipe.get("name")?.as_str().map(ToOwned::to_owned)
}

/// The range of deep images in a map's recipe.
pub(crate) fn levels(map: &surefix::Map) -> Option<(u16, u16)> {
    let recipe: serde_json::Value = serde_json::from_str(map.learned_recipe()?).ok()?;
    serde_json::from_value(recipe.get("levels")?.clone()).ok()
}

/// The descriptor for a localizer on this map.
pub(crate) fn checked(descriptor: &Bound<'_, PyAny>, map: &surefix::Map) -> PyResult<Py<PyAny>> {
    let py = descriptor.py();
    if map.recipe() != Recipe::Ready || !is_learned(descriptor)? {
        let expected =
            "a learned descriptor, with name, recipe and describe(images), on a map of such";
        let got = descriptor.get_type().name()?;
        return Err(value(py, format!("descriptor: expected {expected}, got {got}")));
    }
    let name: String = descriptor.getattr("name")?.extract()?;
    if let Some(expected) = name_of(map)
        && name != expected
        && if_it_can(py, gives_the_same(descriptor, map))? != Some(true)
    {
        return Err(value(
            py,
            format!("descriptor: expected {expected:?}, as the map's own, got {name:?}"),
        ));
    }
    Ok(descriptor.clone().unbind())
}

/// Whether the descriptor is the map's own under another name: a network's file was renamed.
fn gives_the_same(descriptor: &Bound<'_, PyAny>, map: &surefix::Map) -> PyResult<bool> {
    let (py, Some(known)) = (descriptor.py(), map.learned_recipe()) else { return Ok(false) };
    let known = py.import("json")?.call_method1("loads", (known,))?;
    // They are of the images, and not of the network.
    known.call_method1("pop", ("levels", py.None()))?;
    let module = py.import("surefix.descriptors.descriptor")?;
    let given = module.call_method1("recipe_of", (descriptor,))?;
    module.call_method1("same_vectors", (known, given))?.extract()
}

/// The frame's vector, if it is an image and the map's descriptors are learned.
pub(crate) fn described<'py>(
    frame: &Bound<'py, PyAny>,
    map: &surefix::Map,
    descriptor: Option<&Bound<'py, PyAny>>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let py = frame.py();
    let Some(descriptor) = descriptor else {
        if map.recipe() != Recipe::Ready || !is_image(frame)? {
            return Ok(None);
        }
        // An array of floats with more axes than a descriptor is most likely a network's batch of
        // one.
        let batch =
            if_it_can(py, as_array(frame, "frame"))?.filter(|array| dtype_of(array) != "uint8");
        let batch =
            batch.map(|array| format!("{} of the shape {}", dtype_of(&array), shape_of(&array)));
        let own =
            name_of(map).map(|name| format!(", or Localizer(map, descriptor=...) with {name:?}"));
        if batch.is_none() && own.is_none() {
            return Ok(None);
        }
        let expected = format!("a descriptor ({},){}", map.input_dim(), own.unwrap_or_default());
        let got = batch.unwrap_or_else(|| "an image".to_owned());
        return Err(value(py, format!("frame: expected {expected}, got {got}")));
    };
    if !is_image(frame)? {
        return Ok(None);
    }
    vector(frame, descriptor, levels(map)).map(Some)
}

/// The vector of an image by a learned descriptor; zeros if the image shows nothing.
pub(crate) fn vector<'py>(
    frame: &Bound<'py, PyAny>,
    descriptor: &Bound<'py, PyAny>,
    levels: Option<(u16, u16)>,
) -> PyResult<Bound<'py, PyAny>> {
    use numpy::PyUntypedArrayMethods as _;
    let py = frame.py();
    let image = match path_of(frame)? {
        Some(path) => read_image(py, path)?,
        None => as_array(frame, "frame")?.into_any(),
    };
    let image = py.import("surefix.frames.levels")?.call_method1("in_8_bits", (image, levels))?;
    let vectors = descriptor.call_method1("describe", (PyList::new(py, [&image])?,))?;
    let shape = as_array(&vectors, "descriptor")?.shape().to_vec();
    if shape.len() != 2 || shape[0] != 1 {
        let name = descriptor.getattr("name")?;
        let reason =
            format!("{name}: expected a vector for one image, shape (1, dim), got {shape:?}");
        return Err(value(py, reason));
    }
    let vector = vectors.get_item(0)?;
    if shape[1] <= POINT || !shows_nothing(&image)? {
        return Ok(vector);
    }
    // As `extract` does: whatever a network makes of such an image says nothing.
    py.import("numpy")?.call_method1("zeros_like", (vector,))
}

/// Whether an image of bytes shows nothing. Others are the descriptor's own affair.
fn shows_nothing(image: &Bound<'_, PyAny>) -> PyResult<bool> {
    let py = image.py();
    let pixels = Pixels::new(&as_array(image, "image")?, "image");
    let Some(pixels) = if_it_can(py, pixels)? else { return Ok(false) };
    let view = pixels.view(py)?;
    detached(py, || surefix::Sad::default().shows_nothing(view))
}

/// Whether it can only be an image: a file's, or an array of more than one axis.
pub(crate) fn is_image(frame: &Bound<'_, PyAny>) -> PyResult<bool> {
    use numpy::PyUntypedArrayMethods as _;
    if path_of(frame)?.is_some() {
        return Ok(true);
    }
    Ok(if_it_can(frame.py(), as_array(frame, "frame"))?.is_some_and(|array| array.ndim() > 1))
}
