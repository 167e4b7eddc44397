//! `surefix.Matcher`.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use surefix::Floor;

use crate::arrays::floats;
use crate::error::{OrRaise as _, busy};
use crate::fix::Fix;
use crate::options::{config, given, whole};
use crate::segments::Segments;
use crate::signals::detached;

/// Turns distance vectors into fixes, one at a time: the paper's method, for any technique that
/// yields distances.
///
/// Parameters
/// ----------
/// places : int or Segments
///     The number of places of the route, at least 2; or how they follow each other, if that is not
///     in one segment.
/// sequence_length : int
///     `L`, the number of queries of a sequence (Eq. 5), from 1 to `places`, or to those of the
///     longest segment if none is closed.
/// weight : float
///     `w`, how far a trusted cell is drawn to the floor (Eq. 4), from 0 (the plain sequence) to 1.
/// tolerance : int
///     The most places between the minimum and the gradient's peak of a trusted match (Eq.
///     3), on one segment.
/// smoothing : int
///     The number of gradients that are summed along the diagonal (the paper's 3 x 3 kernel); 1 if
///     queries come in any order.
/// gradient : {"halved", "unhalved"}
///     Eq. 1 as printed, or without its 1/2 as in the authors' public code; they can differ only at
///     the route's ends.
/// floor : {"running"} or float
///     The target of trusted cells: the smallest distance so far, or this number if it is
///     smaller still.
/// speeds : sequence of float
///     Slopes to try, in places a query; the best mean wins. Halves of a place round up.
/// motion : {"steady", "free", "any"} or Motion, optional
///     How the robot moves, for the tracker: fixes then have a ``track``. None for the paper alone.
///
/// Raises
/// ------
/// SurefixValueError
///     For an option outside its range; it names the option.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> matcher = surefix.Matcher(places=4)
/// >>> matcher.push(np.array([0.1, 0.8, 0.9, 0.7], np.float32)).sequence is None    # warming up: L is 2
/// True
/// >>> fix = matcher.push(np.array([0.9, 0.2, 0.8, 0.9], np.float32))
/// >>> fix.place, fix.trusted, fix.sequence.anchors
/// (1, True, 2)
#[pyclass(module = "surefix")]
pub(crate) struct Matcher(surefix::Matcher);

#[pymethods]
impl Matcher {
    #[new]
    #[pyo3(
        signature = (places, **options)
    )]
    fn new(
        py: Python<'_>,
        places: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let config = config(py, options, Floor::Running)?;
        let segments = match places.cast::<Segments>() {
            Ok(segments) => segments.get().0.clone(),
            Err(_) => surefix::Segments::one(whole("places", places)?),
        };
        Ok(Self(surefix::Matcher::along(segments, config).or_raise(py)?))
    }

    /// Takes the distances from the current query to every place, and says where the robot is.
    ///
    /// Its cost grows with the places, and for each of them with ``sequence_length`` times the number
    /// of speeds (an addition each) and the number of speeds of a motion. Data and flags make a push
    /// at most three times as dear as the usual one of the same options.
    ///
    /// Parameters
    /// ----------
    /// distances : array of float32, shape (places,)
    ///     Any technique's distances; less is more alike. Read without a copy if contiguous.
    /// trusted : bool, optional
    ///     An external predictor's word in place of the consensus.
    /// advance : float, optional
    ///     The places that the robot has moved since the query before, by odometry: 0 if it stands
    ///     still, negative if it reverses.
    ///
    /// Returns
    /// -------
    /// Fix
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For a wrong length or type, a NaN or an infinity, or an advance that is not finite. The
    ///     matcher is then as it was.
    #[pyo3(signature = (distances, trusted=None, advance=None))]
    fn push(
        slf: &Bound<'_, Self>,
        distances: &Bound<'_, PyAny>,
        trusted: Option<bool>,
        advance: Option<f64>,
    ) -> PyResult<Fix> {
        let py = slf.py();
        let distances = floats(distances, "distances", 1)?;
        let distances = distances.as_slice()?;
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "Matcher"))?;
        let matcher = &mut this.0;
        let fix = py.detach(|| matcher.push_with(distances, given(trusted, advance)));
        Ok(Fix(fix.or_raise(py)?, None))
    }

    /// Says that the next query does not follow on the one before: frames were dropped, or the
    /// camera was away.
    ///
    /// The diagonal is broken there, so that no gradient is summed and no sequence made across:
    /// ``fix.sequence`` is None until ``sequence_length`` queries have come. Frame numbers and the
    /// running floor go on. A gap before the first query, or right after another, changes nothing.
    ///
    /// Parameters
    /// ----------
    /// advance : float, optional
    ///     The places that the robot moved meanwhile, by odometry: the track goes on from there.
    ///     Those of several gaps and of the next query add up. Without it, the robot may be
    ///     anywhere.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> matcher = surefix.Matcher(places=4)
    /// >>> columns = 1 - np.eye(4, dtype=np.float32)
    /// >>> [matcher.push(column).sequence is None for column in columns[:2]]
    /// [True, False]
    /// >>> matcher.gap()
    /// >>> matcher.push(columns[3])
    /// Fix(frame=2, place=3, score=0, trusted=True, sequence=None)
    #[pyo3(signature = (advance=None))]
    fn gap(slf: &Bound<'_, Self>, advance: Option<f64>) -> PyResult<()> {
        let py = slf.py();
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "Matcher"))?;
        if let Some(advance) = advance {
            return this.0.gap_with_advance(advance).or_raise(py);
        }
        this.0.gap();
        Ok(())
    }

    /// Forgets all queries: the next one is frame 0.
    fn reset(slf: &Bound<'_, Self>) -> PyResult<()> {
        slf.try_borrow_mut().map_err(|_| busy(slf.py(), "Matcher"))?.0.reset();
        Ok(())
    }

    /// The whole state as bytes; ``Matcher.restore`` goes on from it bit-identically.
    ///
    /// Examples
    /// --------
    /// >>> import surefix
    /// >>> blob = surefix.Matcher(places=4).snapshot()
    /// >>> surefix.Matcher.restore(blob).places
    /// 4
    fn snapshot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyBytes>> {
        let py = slf.py();
        let this = slf.try_borrow().map_err(|_| busy(py, "Matcher"))?;
        let matcher = &this.0;
        let blob = detached(py, || matcher.snapshot())?;
        Ok(PyBytes::new(py, &blob))
    }

    /// A matcher that goes on where the snapshot was taken.
    ///
    /// Parameters
    /// ----------
    /// blob : bytes
    ///     From ``snapshot``.
    /// **options
    ///     If given, as for ``Matcher``: the snapshot must have been taken under exactly these.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If the bytes are damaged, foreign, of a newer version, or of other options.
    #[staticmethod]
    #[pyo3(
        signature = (blob, **options)
    )]
    fn restore(py: Python<'_>, blob: &[u8], options: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let expected =
            options.map(|options| config(py, Some(options), Floor::Running)).transpose()?;
        Ok(Self(detached(py, || surefix::Matcher::restore(blob, expected.as_ref()))?))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let restore = slf.get_type().getattr("restore")?;
        (restore, (Self::snapshot(slf)?,)).into_pyobject(slf.py())
    }

    /// The track's belief in each place after the newest query, a copy: shape (places,), float64. With
    /// ``off_map`` of the track, it sums to 1. None without the option ``motion``.
    #[getter]
    fn belief<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let this = slf.try_borrow().map_err(|_| busy(slf.py(), "Matcher"))?;
        Ok(this.0.belief().map(|belief| PyArray1::from_iter(slf.py(), belief)))
    }

    /// The number of places of the route.
    #[getter]
    fn places(&self) -> usize {
        self.0.places()
    }

    /// How the places follow each other.
    #[getter]
    fn segments(&self) -> Segments {
        Segments(self.0.segments().clone())
    }

    /// How many queries it has taken since the start or the last reset.
    #[getter]
    fn frames(&self) -> u64 {
        self.0.frames()
    }

    fn __repr__(&self) -> String {
        let length = self.0.config().sequence_length;
        format!(
            "Matcher(places={}, sequence_length={length}, frames={})",
            self.0.places(),
            self.0.frames()
        )
    }
}
