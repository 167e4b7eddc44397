//! The truth as Python gives it: places, a matrix, or positions; and `surefix.evaluate_trust`.

use numpy::{PyArrayDescrMethods as _, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use surefix::evaluate::{TrustTable, Truth};
use surefix::{Error, Positions, Segments};

use crate::arrays::{contiguous, coordinates, numbers, sequence_or_array, shape_of, whole_numbers};
use crate::batch::Run;
use crate::error::{OrRaise as _, value};
use crate::pickle::pickled;
use crate::pictures::plotted;
use crate::signals::detached;

/// Positions of fewer places or queries may all be near, or far, by chance.
const FEW: usize = 20;

/// Warns of a truth by positions that makes all matches right, or all wrong: it may be of another
/// unit. `given` is what `truth` was made of.
pub(crate) fn warn_of_units(
    given: &Bound<'_, PyAny>,
    truth: &Truth,
    tolerance: f64,
) -> PyResult<()> {
    let py = given.py();
    let Some(extent) = truth.extent() else { return Ok(()) };
    if truth.len() < FEW || given.get_item(0)?.len()? < FEW {
        return Ok(());
    }
    let advice = "are both in metres, on one plane (surefix.datasets.local_metres)?";
    let said = if (0..truth.len()).all(|query| !truth.exists(query)) {
        format!("truth: no query is within the tolerance of {tolerance} m of a place: {advice}")
    } else if extent <= tolerance {
        format!(
            "truth: all places lie within {extent:.3} m, the tolerance is {tolerance} m: {advice}"
        )
    } else {
        return Ok(());
    };
    let said = std::ffi::CString::new(said)?;
    PyErr::warn(py, &py.get_type::<pyo3::exceptions::PyUserWarning>(), &said, 1)
}

/// The truth from an array of places (m,), a matrix (n, m), or a pair of positions ((n, k), (m,
/// k)).
fn truth_of(object: &Bound<'_, PyAny>, tolerance: f64) -> PyResult<Truth> {
    let py = object.py();
    if let Ok(pair) = object.cast::<PyTuple>()
        && pair.len() == 2
        && !pair.get_item(0)?.is_instance_of::<pyo3::types::PyInt>()
    {
        let (places, place_axes) = coordinates(&pair.get_item(0)?, "truth: places")?;
        let (mut queries, query_axes) = coordinates(&pair.get_item(1)?, "truth: queries")?;
        let unknown = without_nan(&mut queries, query_axes);
        let places = Positions::new(places, place_axes).or_raise(py)?;
        let queries = Positions::new(queries, query_axes).or_raise(py)?;
        let truth = detached(py, || Truth::positions(places, queries, tolerance))?;
        return Ok(truth.ignoring(unknown));
    }
    let tolerance = frames(py, tolerance)?;
    let array = sequence_or_array(object, "truth")?;
    if array.ndim() != 2 {
        if array.ndim() == 1 && array.dtype().kind() == b'f' {
            let (truth, unknown) = whole_or_nan(object)?;
            return Ok(Truth::places(truth, tolerance).ignoring(unknown));
        }
        return Ok(Truth::places(places(object)?, tolerance));
    }
    let kind = char::from(array.dtype().kind());
    if !"biu".contains(kind) {
        let shape = shape_of(&array);
        let expected =
            "places (m,), a matrix (n, m) of bool or of 1, 0 and -1, or a pair of positions";
        return Err(value(
            py,
            format!("truth: expected {expected}, got {} {shape}", array.dtype()),
        ));
    }
    // Wide enough that no cell wraps around to an allowed one.
    let cells = clipped(&array)?;
    let cells = contiguous::<i8>(cells.cast()?)?
        .ok_or_else(|| value(py, "truth: cannot be read as whole numbers".to_owned()))?;
    let view = cells.as_array();
    let view = view.into_dimensionality().map_err(|e| value(py, e.to_string()))?;
    detached(py, || Truth::cells(&view, tolerance))
}

/// [`truth_of`], on the segments of a run.
pub(crate) fn truth_along(
    object: &Bound<'_, PyAny>,
    tolerance: f64,
    segments: Option<&Segments>,
) -> PyResult<Truth> {
    let truth = truth_of(object, tolerance)?;
    Ok(match segments {
        Some(segments) => truth.along(segments),
        None => truth,
    })
}

/// The rows with a NaN, which become zeros: positions that are not known.
fn without_nan(rows: &mut [f64], axes: usize) -> Vec<usize> {
    let mut unknown = Vec::new();
    for (query, row) in rows.chunks_exact_mut(axes.max(1)).enumerate() {
        if row.iter().any(|metres| metres.is_nan()) {
            row.fill(0.0);
            unknown.push(query);
        }
    }
    unknown
}

/// Places in floats, as of a table with holes: a NaN is a query whose place is not known.
fn whole_or_nan(object: &Bound<'_, PyAny>) -> PyResult<(Vec<Option<usize>>, Vec<usize>)> {
    let (mut truth, mut unknown) = (Vec::new(), Vec::new());
    for (query, place) in numbers(object, "truth")?.into_iter().enumerate() {
        if place.is_nan() {
            unknown.push(query);
        } else if place < -1.0 || place.fract() != 0.0 || place > f64::from(u32::MAX) {
            let expected = "whole numbers: a place, -1 if there is none, NaN if it is not known";
            let message = format!("truth: expected {expected}; got {place} for query {query}");
            return Err(value(object.py(), message));
        }
        truth.push((place >= 0.0).then_some(place as usize));
    }
    Ok((truth, unknown))
}

fn clipped<'py>(array: &Bound<'py, numpy::PyUntypedArray>) -> PyResult<Bound<'py, PyAny>> {
    let py = array.py();
    let numpy = py.import("numpy")?;
    if array.dtype().kind() == b'b' {
        return array.call_method1("astype", (numpy.getattr("int8")?,));
    }
    let wide = array.call_method1("astype", (numpy.getattr("int64")?,))?;
    let clipped = numpy.call_method1("clip", (wide, -2, 2))?;
    let kwargs = PyDict::new(py);
    kwargs.set_item("copy", false)?;
    clipped.call_method("astype", (numpy.getattr("int8")?,), Some(&kwargs))
}

fn places(object: &Bound<'_, PyAny>) -> PyResult<Vec<Option<usize>>> {
    let truth = whole_numbers(object, "truth")?;
    if let Some(query) = truth.iter().position(|&place| place < -1) {
        let got = truth[query];
        let message =
            format!("truth: expected a place, or -1 if there is none, got {got} for query {query}");
        return Err(value(object.py(), message));
    }
    Ok(truth.into_iter().map(|place| usize::try_from(place).ok()).collect())
}

fn frames(py: Python<'_>, tolerance: f64) -> PyResult<usize> {
    if tolerance >= 0.0 && tolerance.fract() == 0.0 && tolerance <= f64::from(u32::MAX) {
        return Ok(tolerance as usize);
    }
    let expected =
        "a whole number of places, 0 or more (metres only if the truth is positions)".to_owned();
    Err(Error::Option { name: "tolerance", expected, got: tolerance.to_string() }).or_raise(py)
}

/// The confusion table of a run's trust flags, which speak of its single matches: positive is
/// trusted, true is correct.
///
/// Parameters
/// ----------
/// run : Run
/// truth, tolerance
///     As for ``evaluate``.
///
/// Returns
/// -------
/// Trust
///
/// Raises
/// ------
/// SurefixValueError
///     As for ``evaluate``.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> run = surefix.match_distances(1 - np.eye(5, dtype=np.float32))
/// >>> trust = surefix.evaluate_trust(run, np.arange(5))
/// >>> trust.precision, trust.share_trusted
/// (1.0, 1.0)
#[pyfunction]
#[pyo3(
    signature = (run, truth, tolerance=1.0),
    text_signature = "(run, truth, tolerance=1)"
)]
pub(crate) fn evaluate_trust(
    py: Python<'_>,
    run: &Run,
    truth: &Bound<'_, PyAny>,
    tolerance: f64,
) -> PyResult<Trust> {
    let truth = truth_along(truth, tolerance, Some(&run.0.segments))?;
    Ok(Trust(surefix::evaluate::evaluate_trust(&run.0, &truth).or_raise(py)?))
}

/// The confusion table of a trust flag: positive is trusted, true is a correct single match.
#[pyclass(frozen, module = "surefix")]
pub(crate) struct Trust(TrustTable);

pickled!(Trust);

#[pymethods]
impl Trust {
    /// Trusted, and correct.
    #[getter]
    fn true_positives(&self) -> usize {
        self.0.true_positives
    }
    /// Trusted, but wrong.
    #[getter]
    fn false_positives(&self) -> usize {
        self.0.false_positives
    }
    /// Correct, but not trusted.
    #[getter]
    fn false_negatives(&self) -> usize {
        self.0.false_negatives
    }
    /// Not trusted, and wrong.
    #[getter]
    fn true_negatives(&self) -> usize {
        self.0.true_negatives
    }
    /// The share of the trusted matches that is correct; 0 if none is trusted.
    #[getter]
    fn precision(&self) -> f64 {
        self.0.precision()
    }
    /// The share of the correct matches that is trusted (the true positive rate); 0 if none is
    /// correct.
    #[getter]
    fn recall(&self) -> f64 {
        self.0.recall()
    }
    /// The share of the wrong matches that is trusted; 0 if none is wrong.
    #[getter]
    fn false_positive_rate(&self) -> f64 {
        self.0.false_positive_rate()
    }
    /// The share of all matches that is trusted.
    #[getter]
    fn share_trusted(&self) -> f64 {
        self.0.share_trusted()
    }

    /// Draws the four counts as a table, trusted or not by right or wrong.
    ///
    /// Parameters
    /// ----------
    /// ax : matplotlib.axes.Axes, optional
    ///     Where to draw; by default a new figure of ``matplotlib.pyplot``.
    /// **options
    ///     As for ``surefix.plot.trust_table``.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    ///
    /// Raises
    /// ------
    /// ModuleNotFoundError
    ///     If matplotlib is not installed.
    ///
    /// Examples
    /// --------
    /// >>> trust.plot().figure.savefig("trust.png")  # doctest: +SKIP
    #[pyo3(signature = (*, ax=None, **options))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        ax: Option<&Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        plotted(slf, "of_trust", ax, &[], options)
    }

    fn __repr__(&self) -> String {
        let TrustTable { true_positives, false_positives, false_negatives, true_negatives } =
            self.0;
        format!(
            "Trust(true_positives={true_positives}, false_positives={false_positives}, \
             false_negatives={false_negatives}, true_negatives={true_negatives})"
        )
    }
}
