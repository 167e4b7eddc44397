//! `surefix.Segments`: how a route's places follow each other.

use numpy::{PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyIterator, PyList};

use crate::arrays::whole_numbers;
use crate::batch::indices;
use crate::error::{OrRaise as _, refused, value};
use crate::options::{whole, wrong};
use crate::pickle::pickled;

/// A stretch of places that follow each other: ``start``, ``end`` (the place after its last) and
/// ``closed``, whether its last place is followed by its first.
#[pyclass(frozen, eq, module = "surefix")]
#[derive(PartialEq)]
pub(crate) struct Segment(surefix::Segment);

pickled!(Segment);

#[pymethods]
impl Segment {
    /// Its first place.
    #[getter]
    fn start(&self) -> usize {
        self.0.start
    }

    /// The place after its last.
    #[getter]
    fn end(&self) -> usize {
        self.0.end
    }

    /// Whether its last place is followed by its first.
    #[getter]
    fn closed(&self) -> bool {
        self.0.closed
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __repr__(&self) -> String {
        let surefix::Segment { start, end, closed, .. } = self.0;
        let closed = if closed { ", closed=True" } else { "" };
        format!("Segment({start}, {end}{closed})")
    }
}

/// How a route's places follow each other: segments, one after the other, that cover all places.
///
/// Gradients, sequences and motion end at the end of a segment. A closed segment has no end: its
/// last place is followed by its first. Links are further successors for the tracker's motion, as
/// at a junction.
///
/// Parameters
/// ----------
/// places : int
///     The number of places of the route.
/// breaks : sequence of int
///     The places at which a new segment begins, ascending, from 1 to ``places - 1``.
/// closed : bool or sequence of int
///     Whether all segments are closed; or the indices of those that are. A closed segment has at
///     least 3 places.
/// links : array, shape (k, 2)
///     Pairs of places: the second may follow the first, beside the one that follows it in its
///     segment.
///
/// Raises
/// ------
/// SurefixValueError
///     For breaks that do not ascend within the route, a closed segment of fewer than 3 places or
///     that there is not, or a link that leads nowhere, to itself or to the place that follows
///     anyway.
///
/// Examples
/// --------
/// >>> import surefix
/// >>> town = surefix.Segments(100, breaks=[60], closed=[1], links=[(59, 60)])
/// >>> list(town)
/// [Segment(0, 60), Segment(60, 100, closed=True)]
/// >>> town.links.tolist()
/// [[59, 60]]
#[pyclass(frozen, eq, module = "surefix")]
#[derive(PartialEq)]
pub(crate) struct Segments(pub(crate) surefix::Segments);

pickled!(Segments);

#[pymethods]
impl Segments {
    #[new]
    #[pyo3(signature = (places, breaks=None, closed=None, links=None), text_signature = "(places, breaks=(), closed=False, links=())")]
    fn new(
        py: Python<'_>,
        places: &Bound<'_, PyAny>,
        breaks: Option<&Bound<'_, PyAny>>,
        closed: Option<&Bound<'_, PyAny>>,
        links: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let places = whole("places", places)?;
        if places < 2 {
            return Err(surefix::Error::TooFewPlaces { what: "segments", got: places })
                .or_raise(py);
        }
        segments_of(py, places, breaks, closed, links).map(Self)
    }

    /// How many places the route has.
    #[getter]
    fn places(&self) -> usize {
        self.0.places()
    }

    /// The places at which a new segment begins.
    #[getter]
    fn breaks<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let breaks = self.0.iter().skip(1).map(|segment| segment.start as i64);
        PyArray1::from_iter(py, breaks)
    }

    /// The links, array of int64, shape (k, 2).
    #[getter]
    fn links<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let links = self.0.links().iter().flat_map(|&(from, to)| [from as i64, to as i64]);
        PyArray1::from_iter(py, links).reshape([self.0.links().len(), 2])
    }

    /// The index of a place's segment.
    ///
    /// Parameters
    /// ----------
    /// place : int
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For a place that there is not.
    fn index_of(&self, place: &Bound<'_, PyAny>) -> PyResult<usize> {
        let (at, places) = (whole("place", place)?, self.0.places());
        if at >= places {
            return wrong("place", &format!("a place from 0 to {}", places - 1), place);
        }
        Ok(self.0.index_of(at))
    }

    /// The segments of a route that keeps only some of its places, as ``Map.keep`` does.
    ///
    /// Parameters
    /// ----------
    /// places : array of int, shape (k,)
    ///     In ascending order.
    ///
    /// Returns
    /// -------
    /// Segments
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     Unless the places ascend within the route, or for none.
    ///
    /// Examples
    /// --------
    /// >>> import surefix
    /// >>> surefix.Segments(10, breaks=[6], links=[(3, 6)]).keep([0, 2, 4, 6, 8]).links
    /// array([[1, 3]])
    fn keep(&self, py: Python<'_>, places: &Bound<'_, PyAny>) -> PyResult<Self> {
        let places = indices(places, "places", "places")?;
        self.0.keep(&places).or_raise(py).map(Self)
    }

    /// Whether places are near each other: in one segment, and at most ``tolerance`` places apart,
    /// the shorter way round a closed one.
    ///
    /// Parameters
    /// ----------
    /// one, other : array of int, shape (m,)
    ///     Places; any other number, such as the -1 of a query off the map, is near none.
    /// tolerance : int
    ///
    /// Returns
    /// -------
    /// array of bool, shape (m,)
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For arrays of two lengths, or of other than whole numbers.
    ///
    /// Examples
    /// --------
    /// >>> import surefix
    /// >>> town = surefix.Segments(100, breaks=[60], closed=[1])
    /// >>> town.are_near([59, 60, 3], [60, 99, -1])
    /// array([False,  True, False])
    #[pyo3(signature = (one, other, tolerance=None), text_signature = "($self, one, other, tolerance=1)")]
    fn are_near<'py>(
        &self,
        one: &Bound<'py, PyAny>,
        other: &Bound<'py, PyAny>,
        tolerance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let py = one.py();
        let tolerance = tolerance.map_or(Ok(1), |given| whole("tolerance", given))?;
        let (ones, others) = (whole_numbers(one, "one")?, whole_numbers(other, "other")?);
        let (expected, got) = (ones.len(), others.len());
        if expected != got {
            return Err(surefix::Error::Length { what: "other", expected, got }).or_raise(py);
        }
        let known = |place: i64| usize::try_from(place).ok().filter(|&at| at < self.0.places());
        let near = ones.into_iter().zip(others).map(|(one, other)| {
            let both = known(one).zip(known(other));
            both.is_some_and(|(one, other)| self.0.are_near(one, other, tolerance))
        });
        Ok(PyArray1::from_iter(py, near))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(
            py,
            self.0
                .iter()
                .copied()
                .map(Segment)
                .map(|one| Py::new(py, one))
                .collect::<PyResult<Vec<_>>>()?,
        )?
        .try_iter()
    }

    fn __getitem__(&self, index: isize) -> PyResult<Segment> {
        let count = self.0.len();
        let at =
            if index < 0 { count.checked_add_signed(index) } else { usize::try_from(index).ok() };
        let segment = at.and_then(|at| self.0.iter().nth(at)).copied().map(Segment);
        segment.ok_or_else(|| PyIndexError::new_err(format!("segment {index} of {count}")))
    }

    fn __repr__(&self) -> String {
        let closed = self.0.iter().filter(|segment| segment.closed).count();
        let (segments, links) = (self.0.len(), self.0.links().len());
        format!(
            "Segments({} places, {segments} segments, {closed} closed, {links} links)",
            self.0.places()
        )
    }
}

/// The segments of the arguments `breaks`, `closed` and `links`.
pub(crate) fn segments_of(
    py: Python<'_>,
    places: usize,
    breaks: Option<&Bound<'_, PyAny>>,
    closed: Option<&Bound<'_, PyAny>>,
    links: Option<&Bound<'_, PyAny>>,
) -> PyResult<surefix::Segments> {
    let breaks =
        breaks.map(|given| indices(given, "breaks", "places")).transpose()?.unwrap_or_default();
    let segments = surefix::Segments::new(places, &breaks).or_raise(py)?;
    let closed = match closed {
        None => Vec::new(),
        Some(given) if given.is_instance_of::<PyBool>() => {
            if given.is_truthy()? {
                (0..segments.len()).collect()
            } else {
                Vec::new()
            }
        }
        Some(given) => indices(given, "closed", "segments")?,
    };
    let links = links.map(pairs).transpose()?.unwrap_or_default();
    segments.with_closed(&closed).and_then(|segments| segments.with_links(&links)).or_raise(py)
}

fn pairs(given: &Bound<'_, PyAny>) -> PyResult<Vec<(usize, usize)>> {
    let py = given.py();
    let expected = "links: expected pairs of places, (k, 2)";
    let message = |error: &Bound<'_, PyAny>| format!("{expected}: {error}");
    let rows = given.try_iter().map_err(|error| refused(py, error, message))?;
    let pair = |row: PyResult<Bound<'_, PyAny>>| match indices(&row?, "links", "places")?[..] {
        [from, to] => Ok((from, to)),
        ref other => Err(value(py, format!("{expected}, got one of {}", other.len()))),
    };
    rows.map(pair).collect()
}

/// The segments of a `segments` argument.
pub(crate) fn given_segments(
    given: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<surefix::Segments>> {
    let Some(given) = given.filter(|given| !given.is_none()) else { return Ok(None) };
    match given.cast::<Segments>() {
        Ok(segments) => Ok(Some(segments.get().0.clone())),
        Err(_) => wrong("segments", "surefix.Segments", given),
    }
}
