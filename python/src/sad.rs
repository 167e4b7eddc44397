//! `surefix.Sad`.

use pyo3::prelude::*;
use surefix::{Dtype, Error};

use crate::arrays::{as_array, image_to_py, rows_to_py};
use crate::error::{OrRaise as _, if_it_can};
use crate::images::Pixels;
use crate::options::{self, whole};
use crate::pickle::pickled;
use crate::places;
use crate::signals::detached;

/// The SAD descriptor: an image in grey, made small, normalised patch by patch.
///
/// Parameters
/// ----------
/// size : (int, int)
///     Width and height of the small image, in pixels.
/// patch : int
///     The side of a patch, in pixels; it must divide both sides.
/// dtype : {"u8", "f32"}
///     "u8" keeps ``clamp(round(128 + 32 z))``: a quarter of the memory, exact integer distances.
///     "f32" keeps ``z``.
/// levels : (int, int), optional
///     The samples of uint16 images that become black and white. A map of such images measures
///     them if they are not given, and its queries are described by the map's; without a map, the
///     full range is taken. uint8 images are taken as they are.
///
/// Raises
/// ------
/// SurefixValueError
///     For a patch that does not divide the sides, or another dtype.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> sad = surefix.Sad(size=(64, 32), patch=8)
/// >>> sad.describe(np.zeros((480, 640, 3), np.uint8)).shape
/// (2048,)
#[pyclass(frozen, module = "surefix")]
pub(crate) struct Sad(pub(crate) surefix::Sad);

pickled!(Sad);

#[pymethods]
impl Sad {
    #[new]
    #[pyo3(signature = (size=None, patch=None, dtype=None, levels=None), text_signature = "(size=(64, 32), patch=8, dtype='u8', levels=None)")]
    fn new(
        py: Python<'_>,
        size: Option<&Bound<'_, PyAny>>,
        patch: Option<&Bound<'_, PyAny>>,
        dtype: Option<&Bound<'_, PyAny>>,
        levels: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let default = surefix::Sad::default();
        let size = size.map_or(Ok(default.size()), |given| options::size("size", given))?;
        let patch = patch.map_or(Ok(default.patch()), |given| whole("patch", given))?;
        let dtype = dtype.map_or(Ok(default.dtype()), dtype_named)?;
        let levels = levels.map(places::range).transpose()?;
        Ok(Self(surefix::Sad::new(size, patch, dtype).or_raise(py)?.with_levels(levels)))
    }

    /// The image's descriptor.
    ///
    /// Parameters
    /// ----------
    /// image : array of uint8 or uint16, shape (H, W) or (H, W, 3) RGB
    ///
    /// Returns
    /// -------
    /// array of uint8 or float32, shape (width * height,), row by row
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For another type or shape.
    fn describe<'py>(
        &self,
        py: Python<'py>,
        image: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let pixels = Pixels::new(&as_array(image, "image")?, "image")?;
        let view = pixels.view(py)?;
        let values = detached(py, || self.0.describe(view))?;
        rows_to_py(py, values.view(), &[values.len()])
    }

    /// Whether an image shows nothing: a lens cap, a tunnel, a text on black, whatever describes it.
    ///
    /// Parameters
    /// ----------
    /// image : array of uint8, shape (H, W) or (H, W, 3) RGB
    ///
    /// Returns
    /// -------
    /// bool
    fn shows_nothing(&self, py: Python<'_>, image: &Bound<'_, PyAny>) -> PyResult<bool> {
        let pixels = Pixels::new(&as_array(image, "image")?, "image")?;
        let view = pixels.view(py)?;
        detached(py, || self.0.shows_nothing(view))
    }

    /// The image that the descriptor normalises: in grey, made small (as Pillow's
    /// ``convert("L").resize(size, BILINEAR)``).
    ///
    /// Parameters
    /// ----------
    /// image : array of uint8 or uint16, shape (H, W) or (H, W, 3) RGB
    ///
    /// Returns
    /// -------
    /// array of uint8, shape (height, width) of the descriptor
    fn thumbnail<'py>(
        &self,
        py: Python<'py>,
        image: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let pixels = Pixels::new(&as_array(image, "image")?, "image")?;
        let view = pixels.view(py)?;
        let small = detached(py, || self.0.thumbnail(view))?;
        image_to_py(py, &small)
    }

    /// Width and height of the small image, in pixels.
    #[getter]
    fn size(&self) -> (usize, usize) {
        self.0.size()
    }

    /// The side of a patch, in pixels.
    #[getter]
    fn patch(&self) -> usize {
        self.0.patch()
    }

    /// How many numbers a descriptor has.
    #[getter]
    fn dim(&self) -> usize {
        self.0.dim()
    }

    /// The type of the descriptor's numbers: "u8" or "f32".
    #[getter]
    fn dtype(&self) -> &'static str {
        if self.0.dtype() == Dtype::U8 { "u8" } else { "f32" }
    }

    /// The samples of uint16 images that become black and white; None if that is not fixed.
    #[getter]
    fn levels(&self) -> Option<(u16, u16)> {
        self.0.levels().map(Into::into)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.0 == other.0
    }

    fn __repr__(&self) -> String {
        let (width, height) = self.0.size();
        let levels = self
            .levels()
            .map_or_else(String::new, |(low, high)| format!(", levels=({low}, {high})"));
        let (patch, dtype) = (self.0.patch(), self.dtype());
        format!("Sad(size=({width}, {height}), patch={patch}, dtype='{dtype}'{levels})")
    }
}

/// The type that "u8", "uint8", `np.uint8` and the like name.
fn dtype_named(given: &Bound<'_, PyAny>) -> PyResult<Dtype> {
    let py = given.py();
    let short = match given.extract::<String>().as_deref() {
        Ok("u8") => Some("uint8".to_owned()),
        Ok("f32") => Some("float32".to_owned()),
        _ => {
            let dtype = py.import("numpy")?.call_method1("dtype", (given,));
            if_it_can(py, dtype)?.map(|dtype| dtype.to_string())
        }
    };
    match short.as_deref() {
        Some("uint8") => Ok(Dtype::U8),
        Some("float32") => Ok(Dtype::F32),
        _ => {
            let (expected, got) = ("\"u8\" or \"f32\"".to_owned(), given.to_string());
            Err(Error::Option { name: "dtype", expected, got }).or_raise(py)
        }
    }
}
