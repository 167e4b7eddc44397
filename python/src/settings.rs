//! `surefix.Settings`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::pythonize;
use surefix::{Floor, MapMark};

use crate::calibrate::Threshold;
use crate::error::OrRaise as _;
use crate::inputs::maps;
use crate::options::settings;
use crate::pickle::pickled;

/// The options and the threshold that suit a route, for ``Localizer(map, config=...)``; as a file,
/// ``route.toml``, for ``surefix run --config`` and Rust's ``Settings::open``.
///
/// Parameters
/// ----------
/// threshold : Threshold, optional
///     Which fixes are accepted.
/// maps : Map or list of Map, optional
///     Those that they are for, one a technique; any by default.
/// measured : dict of str, optional
///     Where and how they were measured, for those who read the file.
/// **options
///     As for ``Matcher``; ``config``, other settings or a file of them, of which these take all
///     that is not given here.
///
/// Raises
/// ------
/// SurefixValueError
///     For an unknown option, or one of another type.
///
/// Examples
/// --------
/// >>> import surefix
/// >>> settings = surefix.Settings(sequence_length=5, motion="steady")
/// >>> settings.save("route.toml")   # doctest: +SKIP
/// >>> options = settings.options
/// >>> options.get("sequence_length"), options.get("motion").get("speeds")
/// (5, [1.0])
#[pyclass(frozen, eq, module = "surefix")]
#[derive(Clone, PartialEq)]
pub(crate) struct Settings(pub(crate) surefix::Settings);

pickled!(Settings);

#[pymethods]
impl Settings {
    #[new]
    #[pyo3(signature = (*, threshold=None, maps=None, measured=None, **options))]
    fn new(
        py: Python<'_>,
        threshold: Option<&Threshold>,
        maps: Option<&Bound<'_, PyAny>>,
        measured: Option<BTreeMap<String, String>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut settings = settings(py, options, Floor::Running, threshold.is_some())?;
        if let Some(threshold) = threshold {
            settings.threshold = Some(threshold.0.clone());
        }
        if let Some(measured) = measured {
            settings.measured = measured;
        }
        if let Some(maps) = maps {
            let maps = self::maps(maps)?;
            settings.maps = py.detach(|| maps.iter().map(|map| MapMark::of(map)).collect());
        }
        Ok(Self(settings))
    }

    /// Reads a file.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///
    /// Raises
    /// ------
    /// SurefixFileError
    ///     If it cannot be read.
    /// SurefixValueError
    ///     If it holds no settings; the line is said.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        surefix::Settings::open(path).map(Self).or_raise(py)
    }

    /// Writes a file, in place of one that is there.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///
    /// Raises
    /// ------
    /// SurefixFileError
    ///     If it cannot be written. One that was there is then as it was.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        self.0.save(path).or_raise(py)
    }

    /// All options, by their names; ``motion`` as a dict of its own.
    #[getter]
    fn options<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize(py, &self.0.config)?)
    }
    /// Which fixes are accepted.
    #[getter]
    fn threshold(&self) -> Option<Threshold> {
        self.0.threshold.clone().map(Threshold)
    }
    /// Where and how they were measured.
    #[getter]
    fn measured(&self) -> BTreeMap<String, String> {
        self.0.measured.clone()
    }

    fn __str__(&self, py: Python<'_>) -> PyResult<String> {
        self.0.to_toml().or_raise(py)
    }

    fn __repr__(&self) -> String {
        let options = &self.0.config;
        let threshold = self.0.threshold.as_ref().map_or_else(String::new, |t| format!(", {t}"));
        format!("Settings({options:?}{threshold})")
    }
}
