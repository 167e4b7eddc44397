//! `surefix.Map`: the positions, the names and the thumbnails of its places.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods as _, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use surefix::Dtype;

use crate::arrays::{as_array, contiguous, dtype_of, image_to_py, shape_of};
use crate::error::{OrRaise as _, value};
use crate::images::Pixels;
use crate::map::Map;
use crate::options::{whole, wrong};
use crate::places;

#[pymethods]
impl Map {
    /// Where each place is, in planar metres: shape (n, 2) or (n, 3), or None. ``origin`` or
    /// ``plane`` say on which plane, if that is known.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(positions) = self.0.positions() else { return Ok(None) };
        let array = PyArray1::from_slice(py, positions.metres());
        Ok(Some(array.reshape([positions.len(), positions.axes()])?.into_any()))
    }

    /// How many places a robot passes in a metre, by the map's positions
    /// (``surefix.datasets.places_per_metre``); None without positions. An odometry's metres times
    /// this are the ``advance`` of ``Localizer.push``.
    #[getter]
    fn places_per_metre<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(positions) = self.positions(py)? else { return Ok(None) };
        let metres = py.import("surefix.tables.metres")?;
        metres.call_method1("places_per_metre", (positions,)).map(Some)
    }

    /// Latitude and longitude of the origin of the positions' local plane, in degrees; None if it is
    /// not known. Metres on this plane are those of ``surefix.datasets.local_metres``.
    #[getter]
    fn origin(&self) -> Option<(f64, f64)> {
        self.0.positions()?.origin().map(Into::into)
    }

    /// The name of the plane that the positions lie on, such as "UTM 55S"; None if it is not known,
    /// or a local one around ``origin``.
    #[getter]
    fn plane(&self) -> Option<String> {
        self.0.positions()?.plane().map(ToOwned::to_owned)
    }

    /// Latitude and longitude of each place: shape (n, 2), float64; None if the origin is not known.
    #[getter]
    fn degrees<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.0.positions().map_or(Ok(None), |positions| degrees_of(py, positions))
    }

    /// The same map with a position for each place.
    ///
    /// Parameters
    /// ----------
    /// positions : array, shape (n, 2) or (n, 3)
    ///     In planar metres.
    /// origin : (float, float) or str, optional
    ///     As for ``from_images``.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     Unless there is a position for each place; for an origin that is none.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> route = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32))
    /// >>> route = route.with_positions([[0, 0], [0, 60], [0, 120]], origin=(51.5, -0.12))
    /// >>> route.degrees.round(4)[2]
    /// array([51.5011, -0.12  ])
    #[pyo3(signature = (positions, *, origin=None))]
    fn with_positions(
        &self,
        py: Python<'_>,
        positions: &Bound<'_, PyAny>,
        origin: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let Some(positions) = places::positions(Some(positions), origin)? else {
            return wrong("positions", "an array (n, 2) or (n, 3)", positions);
        };
        let map = surefix::Map::clone(&self.0);
        Ok(Self(Arc::new(map.with_positions(positions).or_raise(py)?)))
    }

    /// A name for each place, or None.
    #[getter]
    fn names(&self) -> Option<Vec<String>> {
        self.0.names().map(<[String]>::to_vec)
    }

    /// A small grey picture of each place, a copy: shape (n, height, width), uint8; None if the map
    /// keeps none.
    #[getter]
    fn thumbnails<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(pictures) = self.0.thumbnails() else { return Ok(None) };
        let (width, height) = pictures.size();
        let mut pixels = Vec::with_capacity(pictures.len() * width * height);
        for place in 0..pictures.len() {
            pixels.extend_from_slice(pictures.get(place).map_or(&[], |picture| picture.pixels()));
        }
        let array = PyArray1::from_vec(py, pixels);
        Ok(Some(array.reshape([pictures.len(), height, width])?.into_any()))
    }

    /// The small grey picture of a place, a copy; None if the map keeps none.
    ///
    /// Parameters
    /// ----------
    /// place : int
    ///
    /// Returns
    /// -------
    /// array of uint8, shape (height, width), or None
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For a place that there is not.
    fn thumbnail<'py>(
        &self,
        py: Python<'py>,
        place: &Bound<'_, PyAny>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let at = whole("place", place)?;
        if at >= self.0.places() {
            return wrong("place", &format!("a place from 0 to {}", self.0.places() - 1), place);
        }
        let Some(picture) = self.0.thumbnails().and_then(|pictures| pictures.get(at)) else {
            return Ok(None);
        };
        let array = PyArray1::from_slice(py, picture.pixels());
        Ok(Some(array.reshape([picture.height(), picture.width()])?.into_any()))
    }

    /// The same map with a small grey picture of each place.
    ///
    /// Parameters
    /// ----------
    /// thumbnails : array of uint8, shape (n, height, width)
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For another type or shape, or unless there is a picture for each place.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> route = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32))
    /// >>> route.with_thumbnails(np.zeros((3, 54, 96), np.uint8)).thumbnail(2).shape
    /// (54, 96)
    fn with_thumbnails(&self, thumbnails: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = thumbnails.py();
        let array = as_array(thumbnails, "thumbnails")?;
        let pixels = contiguous::<u8>(&array)?.filter(|_| array.ndim() == 3);
        let Some(pixels) = pixels else {
            let got = format!("{} of the shape {}", dtype_of(&array), shape_of(&array));
            let expected = "thumbnails: expected uint8 of the shape (n, height, width)";
            return Err(value(py, format!("{expected}, got {got}")));
        };
        let (width, height) = (array.shape()[2], array.shape()[1]);
        let pixels = pixels.as_slice()?.to_vec();
        let pictures = surefix::Thumbnails::new(width, height, pixels).or_raise(py)?;
        let map = surefix::Map::clone(&self.0);
        Ok(Self(Arc::new(map.with_thumbnails(pictures).or_raise(py)?)))
    }
}

/// Latitude and longitude of each position, if the origin is known.
pub(crate) fn degrees_of<'py>(
    py: Python<'py>,
    positions: &surefix::Positions,
) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
    let degrees: Option<Vec<_>> = (0..positions.len()).map(|at| positions.degrees(at)).collect();
    let Some(degrees) = degrees.filter(|_| positions.origin().is_some()) else { return Ok(None) };
    let array = PyArray1::from_vec(py, degrees.concat());
    Ok(Some(array.reshape([positions.len(), 2])?))
}

/// A small grey picture of an image, as a map keeps them: of this width and height, else 96 pixels
/// on the longer side. Levels make images of more than 8 bits 8-bit ones.
#[pyfunction]
#[pyo3(signature = (image, size=None, levels=None))]
pub(crate) fn thumbnail<'py>(
    image: &Bound<'py, PyAny>,
    size: Option<(usize, usize)>,
    levels: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = image.py();
    let pixels = Pixels::new(&as_array(image, "image")?, "image")?;
    let view = pixels.view(py)?;
    let of = (view.width(), view.height());
    let size = size.unwrap_or_else(|| surefix::Thumbnails::size_for(of));
    let levels = levels.filter(|given| !given.is_none()).map(places::range).transpose()?;
    let small =
        py.detach(|| surefix::Sad::new(size, 1, Dtype::U8)?.with_levels(levels).thumbnail(view));
    image_to_py(py, &small.or_raise(py)?)
}
