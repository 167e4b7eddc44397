//! A fix and its parts.

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};

use crate::pickle::{packed, pickled, unpacked};
use crate::position::Position;

fn python_bool(flag: bool) -> &'static str {
    if flag { "True" } else { "False" }
}

/// Where the robot is, as far as one query tells, and whether to believe it.
///
/// Attributes
/// ----------
/// frame : int
///     Which query this is, counted from 0 since the start or the last reset.
/// trusted : bool
///     Whether the single match is trusted (Eq. 3 of the paper), or an external predictor's word.
/// blank : bool
///     Whether the query shows nothing: an image or a descriptor without content, or distances that
///     are all equal. It is never trusted, whatever ``place`` says.
/// place : int
///     The track's place if there is motion; else the sequence's once it is ready, and before that
///     the single match's.
/// segment : int
///     The index of that place's segment: 0 on a route without breaks.
/// segment_place : int
///     That place, counted from its segment's first.
/// score : float
///     The score of that place: ``1 - confidence`` of the track, the sequence's score, or the
///     single match's distance. Less is better.
/// single : Single
///     The best match of this query alone: ``place`` and ``distance``.
/// gradient : Peak
///     Where the enhanced gradient peaks: ``place`` and ``value``.
/// sequence : Sequence or None
///     The sequence's match: ``place``, ``score``, ``anchors``, ``speed``. None while the matcher
///     warms up, for the first ``sequence_length - 1`` queries, and again after a gap.
/// track : Track or None
///     Where the robot is by all queries so far: ``place``, ``confidence``, ``off_map``, ``speed``,
///     ``interval``. None without the option ``motion``.
/// position : Position or None
///     Where ``place`` is: ``metres``, and ``degrees`` or None. None on a map without positions.
/// accepted : bool or None
///     Whether it is above the threshold of a calibration (``Localizer(config=...)``).
/// probability : float or None
///     How probable it is that the place is right, by that calibration.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> matcher = surefix.Matcher(places=4, sequence_length=1)
/// >>> fix = matcher.push(np.array([0.9, 0.1, 0.8, 0.9], np.float32))
/// >>> fix.place, fix.trusted, fix.sequence.anchors
/// (1, True, 1)
#[pyclass(frozen, eq, module = "surefix")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Fix(pub(crate) surefix::Fix, pub(crate) Option<surefix::Position>);

#[pymethods]
impl Fix {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, fix) = (slf.py(), slf.get());
        let bytes = PyBytes::new(py, &packed(py, &(fix.0, fix.1))?);
        (slf.get_type().getattr("_unpickled")?, (bytes,)).into_pyobject(py)
    }
    #[staticmethod]
    fn _unpickled(py: Python<'_>, bytes: &[u8]) -> PyResult<Self> {
        unpacked(py, bytes).map(|(fix, position)| Self(fix, position))
    }

    /// Where ``place`` is: ``metres`` and ``degrees``. None on a map without positions, and of a
    /// ``Matcher``, which knows no map.
    #[getter]
    fn position(&self) -> Option<Position> {
        self.1.map(Into::into)
    }
    /// Which query this is, counted from 0.
    #[getter]
    fn frame(&self) -> u64 {
        self.0.frame
    }
    /// Whether the single match is trusted.
    #[getter]
    fn trusted(&self) -> bool {
        self.0.trusted
    }
    /// Whether the query shows nothing, so that it can never be trusted.
    #[getter]
    fn blank(&self) -> bool {
        self.0.blank
    }
    /// The track's place, else the sequence's once it is ready, else the single match's.
    #[getter]
    fn place(&self) -> usize {
        self.0.place
    }
    /// The index of that place's segment.
    #[getter]
    fn segment(&self) -> usize {
        self.0.segment
    }
    /// That place, counted from its segment's first.
    #[getter]
    fn segment_place(&self) -> usize {
        self.0.segment_place
    }
    /// The score of that place: ``1 - confidence``, the sequence's score, or the single match's
    /// distance. Less is better.
    #[getter]
    fn score(&self) -> f32 {
        self.0.score
    }
    /// The best match of this query alone.
    #[getter]
    fn single(&self) -> Single {
        Single(self.0.single)
    }
    /// Where the enhanced gradient peaks.
    #[getter]
    fn gradient(&self) -> Peak {
        Peak(self.0.gradient)
    }
    /// Whether it is above the threshold of the localizer's settings; None without one.
    #[getter]
    fn accepted(&self) -> Option<bool> {
        self.0.accepted
    }
    /// The probability that the place is right, by the calibration of the localizer's settings;
    /// None without one, and while the fix is not ready.
    #[getter]
    fn probability(&self) -> Option<f64> {
        self.0.probability
    }
    /// The sequence's match; None while the matcher warms up.
    #[getter]
    fn sequence(&self) -> Option<Sequence> {
        self.0.sequence.map(Sequence)
    }
    /// Where the robot is by all queries so far; None without the option ``motion``.
    #[getter]
    fn track(&self) -> Option<Track> {
        self.0.track.map(Track)
    }
    /// The track's confidence; None without the option ``motion``.
    #[getter]
    fn confidence(&self) -> Option<f64> {
        self.0.confidence()
    }
    /// The track's belief that the robot is off the map; None without the option ``motion``.
    #[getter]
    fn off_map(&self) -> Option<f64> {
        self.0.off_map()
    }
    /// The track's speed, else the sequence's slope, in places a query; None in the warm-up.
    #[getter]
    fn speed(&self) -> Option<f64> {
        self.0.speed()
    }
    fn __repr__(&self) -> String {
        let surefix::Fix { frame, trusted, place, score, sequence, track, blank, .. } = self.0;
        let blank = if blank { ", blank=True" } else { "" };
        let trusted = python_bool(trusted);
        if let Some(surefix::Track { confidence, off_map, .. }) = track {
            return format!(
                "Fix(frame={frame}, place={place}, confidence={confidence:.3}, off_map={off_map:.3}, trusted={trusted}{blank})"
            );
        }
        let warming = if sequence.is_none() { ", sequence=None" } else { "" };
        format!(
            "Fix(frame={frame}, place={place}, score={score}, trusted={trusted}{blank}{warming})"
        )
    }
}

/// The best match of one query alone: the smallest distance. Ties go to the lowest place.
#[pyclass(frozen, eq, module = "surefix")]
#[derive(PartialEq)]
pub(crate) struct Single(surefix::Single);

pickled!(Single);

#[pymethods]
impl Single {
    #[getter]
    fn place(&self) -> usize {
        self.0.place
    }
    #[getter]
    fn distance(&self) -> f32 {
        self.0.distance
    }
    fn __repr__(&self) -> String {
        format!("Single(place={}, distance={})", self.0.place, self.0.distance)
    }
}

/// Where the enhanced gradient peaks (Eqs. 1 and 2, with the 3 x 3 kernel).
///
/// ``place`` is the place whose distance dips most sharply; ``value`` the enhanced gradient there,
/// in units of distance.
#[pyclass(frozen, eq, module = "surefix")]
#[derive(PartialEq)]
pub(crate) struct Peak(surefix::Peak);

pickled!(Peak);

#[pymethods]
impl Peak {
    #[getter]
    fn place(&self) -> usize {
        self.0.place
    }
    #[getter]
    fn value(&self) -> f32 {
        self.0.value
    }
    fn __repr__(&self) -> String {
        format!("Peak(place={}, value={})", self.0.place, self.0.value)
    }
}

/// The best match of the last ``sequence_length`` queries together (Eqs. 4 to 6).
///
/// ``place`` is the current query's place; ``score`` the mean of the weighted distances along the
/// diagonal that ends there; ``anchors`` the number of trusted matches on it; ``speed`` its slope,
/// in places a query.
#[pyclass(frozen, eq, module = "surefix")]
#[derive(PartialEq)]
pub(crate) struct Sequence(surefix::Sequence);

pickled!(Sequence);

#[pymethods]
impl Sequence {
    #[getter]
    fn place(&self) -> usize {
        self.0.place
    }
    #[getter]
    fn score(&self) -> f32 {
        self.0.score
    }
    #[getter]
    fn anchors(&self) -> usize {
        self.0.anchors
    }
    #[getter]
    fn speed(&self) -> f64 {
        self.0.speed
    }
    fn __repr__(&self) -> String {
        let surefix::Sequence { place, score, anchors, speed } = self.0;
        format!("Sequence(place={place}, score={score}, anchors={anchors}, speed={speed})")
    }
}

/// Where the robot is by all queries so far: a Bayes filter over places, speeds and a state off the
/// map (method 1.9).
///
/// ``place`` is the most probable place; ``confidence`` the belief that the robot is within
/// ``tolerance`` places of it; ``off_map`` the belief that it is off the map, which ranks well and
/// is a lower bound as a probability; ``speed`` in places a query, or the advance if it is known;
/// ``interval`` the first and the last place of those that hold 95 % of the belief on the map; on
/// more than 65,536 places, ends far from ``place`` are rounded outwards, by up to 255 places.
#[pyclass(frozen, eq, module = "surefix")]
#[derive(PartialEq)]
pub(crate) struct Track(surefix::Track);

pickled!(Track);

#[pymethods]
impl Track {
    /// The most probable place.
    #[getter]
    fn place(&self) -> usize {
        self.0.place
    }
    /// The belief that the robot is within ``tolerance`` places of it.
    #[getter]
    fn confidence(&self) -> f64 {
        self.0.confidence
    }
    /// The belief that the robot is off the map.
    #[getter]
    fn off_map(&self) -> f64 {
        self.0.off_map
    }
    /// In places a query; the advance if it is known.
    #[getter]
    fn speed(&self) -> f64 {
        self.0.speed
    }
    /// The first and the last place of those that hold 95 % of the belief on the map. On a
    /// closed route it may go round: the first is then the greater.
    #[getter]
    fn interval(&self) -> (usize, usize) {
        self.0.interval
    }
    fn __repr__(&self) -> String {
        let surefix::Track { place, confidence, off_map, speed, interval, .. } = self.0;
        format!(
            "Track(place={place}, confidence={confidence:.3}, off_map={off_map:.3}, speed={speed:.2}, interval={interval:?})"
        )
    }
}
