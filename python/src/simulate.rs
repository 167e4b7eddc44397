//! `surefix.simulate`: the generated route.

use numpy::PyArray1;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surefix_simulate::{Conditions, RouteConfig};

use crate::arrays::image_to_py;
use crate::error::{OrRaise as _, value};
use crate::options::{self, whole};

/// A generated route: a drive past structured scenery, the same for the same seed on every machine.
///
/// Parameters
/// ----------
/// places : int
///     Frames of a traverse, at least 2. Frames are rendered when asked for: a million places need
///     no storage.
/// size : (int, int)
///     Width and height of a frame, in pixels.
/// spacing : float
///     Metres from one frame of the reference drive to the next.
/// seed : int
///     Another seed is another route.
///
/// Raises
/// ------
/// SurefixValueError
///     For an option outside its range.
///
/// Examples
/// --------
/// >>> from surefix.simulate import Route
/// >>> route = Route(places=100, size=(64, 32))
/// >>> summer, winter = route.reference(), route.revisit()
/// >>> winter[0].shape
/// (32, 64, 3)
#[pyclass(frozen, module = "surefix.simulate")]
pub(crate) struct Route(surefix_simulate::Route);

#[pymethods]
impl Route {
    #[new]
    #[pyo3(
        signature = (places=None, size=None, spacing=3.0, seed=None),
        text_signature = "(places=1000, size=(320, 160), spacing=3.0, seed=1)"
    )]
    fn new(
        py: Python<'_>,
        places: Option<&Bound<'_, PyAny>>,
        size: Option<&Bound<'_, PyAny>>,
        spacing: f64,
        seed: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let mut config = RouteConfig { spacing, ..RouteConfig::default() };
        if let Some(given) = places {
            config.places = whole("places", given)?;
        }
        if let Some(given) = size {
            (config.width, config.height) = options::size("size", given)?;
        }
        if let Some(given) = seed {
            config.seed = whole("seed", given)? as u64;
        }
        Ok(Self(surefix_simulate::Route::new(config).or_raise(py)?))
    }

    /// The reference drive: summer, noon, nothing in the way.
    fn reference(&self, py: Python<'_>) -> PyResult<Traverse> {
        self.drive(py, Conditions::reference())
    }

    /// The default second drive: another season, light, lane, speed and traffic. Each can be
    /// changed.
    ///
    /// Parameters
    /// ----------
    /// **conditions
    ///     As for ``traverse``, over the defaults of the second drive.
    #[pyo3(
        signature = (**conditions),
        text_signature = "($self, *, light=..., season=..., lateral_offset=..., speed_jitter=..., occluders=..., noise=..., seed=...)"
    )]
    fn revisit(
        &self,
        py: Python<'_>,
        conditions: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Traverse> {
        self.drive(py, changed(Conditions::revisit(), conditions)?)
    }

    /// A drive in the given conditions; those not given are the reference drive's, of which each is
    /// 0.
    ///
    /// Parameters
    /// ----------
    /// light, season, speed_jitter, occluders, noise : float
    ///     From 0 (as in the reference drive) to 1.
    /// lateral_offset : float
    ///     How far to the side the camera drives, in metres.
    /// seed : int
    ///     Another seed has other traffic and noise.
    #[pyo3(
        signature = (**conditions),
        text_signature = "($self, *, light=0.0, season=0.0, lateral_offset=0.0, speed_jitter=0.0, occluders=0.0, noise=0.0, seed=0)"
    )]
    fn traverse(
        &self,
        py: Python<'_>,
        conditions: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Traverse> {
        self.drive(py, changed(Conditions::reference(), conditions)?)
    }

    fn __repr__(&self) -> String {
        let RouteConfig { places, width, height, spacing, seed } = self.0.config();
        format!("Route(places={places}, size=({width}, {height}), spacing={spacing}, seed={seed})")
    }
}

impl Route {
    fn drive(&self, py: Python<'_>, conditions: Conditions) -> PyResult<Traverse> {
        Ok(Traverse(self.0.traverse(conditions).or_raise(py)?))
    }
}

fn changed(mut conditions: Conditions, given: Option<&Bound<'_, PyDict>>) -> PyResult<Conditions> {
    for (name, given) in given.into_iter().flatten() {
        let name: String = name.extract()?;
        let number = match name.as_str() {
            "light" => &mut conditions.light,
            "season" => &mut conditions.season,
            "lateral_offset" => &mut conditions.lateral_offset,
            "speed_jitter" => &mut conditions.speed_jitter,
            "occluders" => &mut conditions.occluders,
            "noise" => &mut conditions.noise,
            "seed" => {
                conditions.seed = whole("seed", &given)? as u64;
                continue;
            }
            _ => {
                let names = "light, season, lateral_offset, speed_jitter, occluders, noise, seed";
                return Err(value(
                    given.py(),
                    format!("condition `{name}`: expected one of {names}"),
                ));
            }
        };
        *number = given.extract()?;
    }
    Ok(conditions)
}

/// A drive along a generated route: a sequence of frames, each rendered when asked for, uint8 (H,
/// W, 3).
///
/// Examples
/// --------
/// >>> from surefix.simulate import Route
/// >>> drive = Route(places=10, size=(64, 32)).reference()
/// >>> len(drive), drive[-1].shape
/// (10, (32, 64, 3))
#[pyclass(frozen, sequence, module = "surefix.simulate")]
pub(crate) struct Traverse(pub(crate) surefix_simulate::Traverse);

#[pymethods]
impl Traverse {
    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: isize) -> PyResult<Bound<'py, PyAny>> {
        let count = self.0.len();
        let from =
            if index < 0 { count.checked_add_signed(index) } else { usize::try_from(index).ok() };
        let Some(index) = from.filter(|&index| index < count) else {
            return Err(PyIndexError::new_err(format!("frame {index} of {count}")));
        };
        let frame = py.detach(|| self.0.frame(index));
        image_to_py(py, &frame)
    }

    /// How far along the route each frame was taken, in metres: shape (n,), float64.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, (0..self.0.len()).map(|index| self.0.position(index)))
    }

    /// The true place of each frame on a map of the drive ``reference``: shape (n,), int64, -1 off
    /// the map.
    fn truth<'py>(&self, py: Python<'py>, reference: &Self) -> Bound<'py, PyArray1<i64>> {
        let truth = py.detach(|| self.0.truth(&reference.0));
        PyArray1::from_iter(
            py,
            truth.into_iter().map(|place| place.map_or(-1, |place| place as i64)),
        )
    }

    fn __repr__(&self) -> String {
        format!("Traverse({} frames)", self.0.len())
    }
}
