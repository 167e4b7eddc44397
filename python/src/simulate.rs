//! `surefix.simulate`: the generated route.

use numpy::PyArray1;
use pyo3::exceptions::{PyIndexError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surefix::Error;
use surefix_simulate::{Conditions, Leg, RouteConfig};

use crate::arrays::image_to_py;
use crate::error::{OrRaise as _, if_it_can, value};
use crate::options::{self, whole, wrong};
use crate::pickle::pickled;

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

pickled!(Route);

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
        self.drive(py, Conditions::reference(), None, 1.0)
    }

    /// The default second drive: another season, light, lane, speed and traffic. Each can be
    /// changed.
    ///
    /// Parameters
    /// ----------
    /// legs, speed
    ///     As for ``traverse``.
    /// **conditions
    ///     As for ``traverse``, over the defaults of the second drive.
    #[pyo3(
        signature = (*, legs=None, speed=1.0, **conditions),
        text_signature = "($self, *, legs=None, speed=1.0, light=..., season=..., lateral_offset=..., speed_jitter=..., occluders=..., noise=..., seed=...)"
    )]
    fn revisit(
        &self,
        py: Python<'_>,
        legs: Option<&Bound<'_, PyAny>>,
        speed: f64,
        conditions: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Traverse> {
        self.drive(py, changed(Conditions::revisit(), conditions)?, legs, speed)
    }

    /// A drive in the given conditions; those not given are the reference drive's, of which each is
    /// 0.
    ///
    /// Parameters
    /// ----------
    /// legs : sequence of (str, int) or (str, int, float), optional
    ///     What the drive does from place 0 on: the kind of a leg, its frames, and its speed if it
    ///     is not ``speed``. By default it drives the whole route.
    ///
    ///     "drive"
    ///         On along the route.
    ///     "stop"
    ///         Standing still, on the street of the leg before.
    ///     "reverse"
    ///         Backwards along the route.
    ///     "detour"
    ///         Off the map along a parallel street, and back as far ahead as if the drive had
    ///         stayed on the route.
    ///     "loop"
    ///         Off the map, around and back: as far behind as the drive went meanwhile, so that it
    ///         comes to earlier places once more.
    /// speed : float
    ///     Places of the route a frame.
    /// light, season, speed_jitter, occluders, noise : float
    ///     From 0 (as in the reference drive) to 1.
    /// lateral_offset : float
    ///     How far to the side the camera drives, in metres.
    /// seed : int
    ///     Another seed has other traffic and noise, and other errors of the wheels.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For a condition outside its range; for a leg of another kind, without frames, with a
    ///     speed of 0 or less, or with an end that is not on the route.
    ///
    /// Examples
    /// --------
    /// >>> from surefix.simulate import Route
    /// >>> route = Route(places=100, size=(64, 32))
    /// >>> legs = [("drive", 40), ("stop", 10), ("detour", 20), ("drive", 30, 0.5)]
    /// >>> drive = route.revisit(legs=legs)
    /// >>> truth = drive.truth(route.reference())
    /// >>> truth[40:50].tolist() == [int(truth[39])] * 10, truth[50:70].max()
    /// (True, np.int64(-1))
    /// >>> advance = drive.odometry(scale=1.02, noise=0.05) / 3.0  # metres to places
    #[pyo3(
        signature = (*, legs=None, speed=1.0, **conditions),
        text_signature = "($self, *, legs=None, speed=1.0, light=0.0, season=0.0, lateral_offset=0.0, speed_jitter=0.0, occluders=0.0, noise=0.0, seed=0)"
    )]
    fn traverse(
        &self,
        py: Python<'_>,
        legs: Option<&Bound<'_, PyAny>>,
        speed: f64,
        conditions: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Traverse> {
        self.drive(py, changed(Conditions::reference(), conditions)?, legs, speed)
    }

    fn __repr__(&self) -> String {
        let RouteConfig { places, width, height, spacing, seed } = self.0.config();
        format!("Route(places={places}, size=({width}, {height}), spacing={spacing}, seed={seed})")
    }
}

impl Route {
    fn drive(
        &self,
        py: Python<'_>,
        conditions: Conditions,
        legs: Option<&Bound<'_, PyAny>>,
        speed: f64,
    ) -> PyResult<Traverse> {
        let legs = if let Some(given) = legs {
            let each: Vec<Bound<'_, PyAny>> =
                given.extract().or_else(|_| wrong("legs", "a sequence of legs", given))?;
            each.iter().map(|given| leg(given, speed)).collect::<PyResult<_>>()?
        } else {
            // Tenths do not divide exactly.
            let steps = (self.0.config().places - 1) as f64 / speed + 1e-6;
            let frames = if steps.is_finite() { steps as usize } else { 0 };
            vec![Leg::Drive(frames.saturating_add(1), speed)]
        };
        Ok(Traverse(self.0.drive(conditions, &legs).or_raise(py)?))
    }
}

/// A leg of its kind, its frames and, perhaps, its speed.
fn leg(given: &Bound<'_, PyAny>, speed: f64) -> PyResult<Leg> {
    let py = given.py();
    let parts: Vec<Bound<'_, PyAny>> = if_it_can(py, given.extract())?.unwrap_or_default();
    let parts = match parts.as_slice() {
        [kind, frames] => kind.extract().and_then(|kind| Ok(((kind, frames.extract()?), speed))),
        [kind, frames, own] => {
            kind.extract().and_then(|kind| Ok(((kind, frames.extract()?), own.extract()?)))
        }
        _ => Err(PyTypeError::new_err("neither two nor three")),
    };
    let parts = if_it_can(py, parts)?;
    let of_kind = |((kind, frames), speed): ((String, _), _)| match kind.as_str() {
        "drive" => Some(Leg::Drive(frames, speed)),
        "stop" => Some(Leg::Stop(frames)),
        "reverse" => Some(Leg::Reverse(frames, speed)),
        "detour" => Some(Leg::Detour(frames, speed)),
        "loop" => Some(Leg::Loop(frames, speed)),
        _ => None,
    };
    parts.and_then(of_kind).map_or_else(
        || {
            let kinds = "\"drive\", \"stop\", \"reverse\", \"detour\" or \"loop\"";
            wrong("legs", &format!("{kinds}, a number of frames and, optionally, a speed"), given)
        },
        Ok,
    )
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

pickled!(Traverse);

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

    /// How far along the route each frame was taken, in metres: shape (n,), float64, NaN off the
    /// map.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let position = |index| self.0.position(index).unwrap_or(f64::NAN);
        PyArray1::from_iter(py, (0..self.0.len()).map(position))
    }

    /// The metres that the wheels count from each frame to the next, on the map and off it.
    ///
    /// Parameters
    /// ----------
    /// scale : float
    ///     1 for wheels that count right.
    /// noise : float
    ///     The standard deviation of a step's error, as a share of the step.
    ///
    /// Returns
    /// -------
    /// array of float64, shape (n,)
    ///     From the frame before to each frame: 0 for the first one and while standing, negative
    ///     backwards. The same for the same seed of the conditions.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If a number is not finite, or the noise is negative.
    ///
    /// Examples
    /// --------
    /// >>> from surefix.simulate import Route
    /// >>> drive = Route(places=10, size=(64, 32)).traverse(legs=[("drive", 3), ("reverse", 1)])
    /// >>> drive.odometry(scale=1.5)
    /// array([ 0. ,  4.5,  4.5, -4.5])
    #[pyo3(signature = (*, scale=1.0, noise=0.0))]
    fn odometry<'py>(
        &self,
        py: Python<'py>,
        scale: f64,
        noise: f64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let bad = |name, expected: &str, got: f64| {
            Err(Error::Option { name, expected: expected.to_owned(), got: got.to_string() })
        };
        if !scale.is_finite() {
            bad("scale", "a finite number", scale).or_raise(py)?;
        }
        if !(noise >= 0.0 && noise.is_finite()) {
            bad("noise", "a finite number of 0 or more", noise).or_raise(py)?;
        }
        let metres = (0..self.0.len()).map(|index| self.0.odometry(index, scale, noise));
        Ok(PyArray1::from_iter(py, metres))
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
