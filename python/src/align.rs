//! `surefix.align` and `surefix.Alignment`.

use std::path::PathBuf;

use numpy::{Element, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surefix::saving::write_text;
use surefix::{Drive, Floor, Motion, align_descriptors, align_distances};

use crate::arrays::{numbers, whole_numbers};
use crate::batch::{Rows, matrices, views};
use crate::error::{if_it_can, value};
use crate::images::{progress_callback, with_progress};
use crate::inputs::{descriptors, listed, maps};
use crate::kept::Distances;
use crate::map::Map;
use crate::options::config;
use crate::pickle::pickled;
use crate::pictures::{html, plotted};
use crate::segments::{Segments, given_segments};
use crate::signals::detached;

/// Where each query of a drive was, by all of its queries: arrays of the shape (m,).
///
/// ``place`` is the most probable place, int64; ``confidence`` the belief that the query is
/// within ``tolerance`` places of it, ``off_map`` that it is off the map, and ``speed`` the places a
/// query, float64; ``interval``, int64 of the shape (m, 2), the first and the last place of those
/// that hold 95 % of the belief on the map (rounded as those of a ``Track``). ``single_place`` is
/// each query's best match alone, and ``single_right`` the belief that it is right. ``right``,
/// (k, m), is what is believed of the places that ``align`` was asked about with ``at``.
#[pyclass(frozen, module = "surefix")]
pub(crate) struct Alignment(pub(crate) surefix::Alignment, Distances);

pickled!(Alignment, |alignment| Self(alignment, Distances::lost()));

impl Alignment {
    fn column<'py, T: Element>(
        &self,
        py: Python<'py>,
        of: impl Fn(&surefix::Aligned) -> T,
    ) -> Bound<'py, PyArray1<T>> {
        PyArray1::from_iter(py, self.0.queries.iter().map(of))
    }
}

#[pymethods]
impl Alignment {
    /// The most probable place: int64.
    #[getter]
    fn place<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.column(py, |one| one.track.place as i64)
    }
    /// The belief that the query is within ``tolerance`` places of it: float64.
    #[getter]
    fn confidence<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |one| one.track.confidence)
    }
    /// The belief that the query is off the map: float64.
    #[getter]
    fn off_map<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |one| one.track.off_map)
    }
    /// The speed in places a query, or the advance if it is known: float64.
    #[getter]
    fn speed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |one| one.track.speed)
    }
    /// The first and the last place that hold 95 % of the belief on the map: int64, (m, 2).
    /// On a closed route it may go round: the first is then the greater.
    #[getter]
    fn interval<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let rows: Vec<Vec<i64>> = self
            .0
            .queries
            .iter()
            .map(|one| vec![one.track.interval.0 as i64, one.track.interval.1 as i64])
            .collect();
        if rows.is_empty() {
            return Ok(PyArray2::zeros(py, [0, 2], false));
        }
        Ok(PyArray2::from_vec2(py, &rows)?)
    }

    /// The best match of each query alone: int64.
    #[getter]
    fn single_place<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.column(py, |one| one.single.place as i64)
    }
    /// The belief that this match is right, within ``tolerance`` places: float64.
    #[getter]
    fn single_right<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |one| one.single_right)
    }

    /// The belief that each query is within ``tolerance`` places of those of ``at``: float64,
    /// (k, m).
    #[getter]
    fn right<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let surefix::Alignment { right, queries, .. } = &self.0;
        if right.is_empty() {
            return Ok(PyArray2::zeros(py, [0, queries.len()], false));
        }
        Ok(PyArray2::from_vec2(py, right)?)
    }

    /// How the route's places follow each other.
    #[getter]
    fn segments(&self) -> Segments {
        Segments(self.0.segments.clone())
    }

    /// The distances that were aligned: float32, (n, m), as ``Run.distances``.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If the alignment comes from a pickle, or the memory does not suffice.
    #[getter]
    fn distances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.1.array(py, "alignment")
    }

    /// Draws the distances (n, m) as tones, dark if a query looks like a place, and on them the place
    /// of each query; stretches without a sure place are shaded.
    ///
    /// Parameters
    /// ----------
    /// ax : matplotlib.axes.Axes, optional
    ///     Where to draw; by default a new figure of ``matplotlib.pyplot``.
    /// **options
    ///     As for ``surefix.plot.aligned_track``, such as ``least``.
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
    /// >>> alignment.plot().figure.savefig("alignment.png")  # doctest: +SKIP
    #[pyo3(signature = (*, ax=None, **options))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        ax: Option<&Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        plotted(slf, "of_alignment", ax, &[], options)
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        html(slf, "of_alignment")
    }

    // It never changes: a copy is the alignment itself.
    fn __copy__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    fn __deepcopy__<'py>(slf: Bound<'py, Self>, _memo: &Bound<'py, PyAny>) -> Bound<'py, Self> {
        slf
    }

    /// Writes a CSV file: a line of names, then a line a query. If the map has positions, that of
    /// ``place`` is in the columns ``x``, ``y`` and ``z``.
    ///
    /// Parameters
    /// ----------
    /// path : path
    /// least : float
    ///     The column ``reference`` is the place, or -1 if the confidence is below this. With the
    ///     column ``query`` it is a truth for ``surefix eval --truth``.
    ///
    /// Raises
    /// ------
    /// SurefixFileError
    ///     If the file cannot be written; an older one is then as it was.
    #[pyo3(signature = (path, least=0.0))]
    fn to_csv(&self, py: Python<'_>, path: PathBuf, least: f64) -> PyResult<()> {
        detached(py, || {
            let io =
                |source| surefix::Error::Io { path: path.clone(), action: "write the CSV", source };
            write_text(&path, |mut out| self.0.write_csv(&mut out, least)).map_err(io)
        })
    }

    fn __len__(&self) -> usize {
        self.0.queries.len()
    }

    fn __repr__(&self) -> String {
        let queries = &self.0.queries;
        let sure = queries.iter().filter(|one| one.track.confidence > 0.95).count();
        format!("Alignment({} queries, {sure} of confidence above 0.95)", queries.len())
    }
}

/// Aligns a whole drive with a route, without any label: the tracker in both directions (method
/// 1.10), so that each query's place is that of all queries, those after it too.
///
/// Parameters
/// ----------
/// map : Map; or array of float32, shape (n, m); or a list of maps or of arrays
///     The known route; or distances, where ``distances[i, j]`` is between place ``i`` and query
///     ``j``. Several techniques are fused, as by ``Localizer``.
/// queries : array of descriptors, shape (m, dim); images, as for ``Map.from_images``; or a list
///     As for ``match``. None with distances.
/// motion : {"any", "steady", "free"} or Motion
///     How the robot moves. "steady" is the most exact if both drives took frames at the same
///     distances.
/// advance : array of float, shape (m,), optional
///     The places that the robot moved before each query, by odometry.
/// gaps : array or list of int, optional
///     As for ``match``.
/// segments : Segments, optional
///     With distances: how the places follow each other. A map knows it.
/// tolerance : int
///     The confidence is the belief within this many places.
/// at : array of int, shape (k, m), optional
///     Places to ask about, one a query in each row, such as the matches of other methods:
///     ``Alignment.right`` is what is believed of them.
/// descriptor : surefix.descriptors.Descriptor, optional
///     On maps of learned descriptors: what describes the images, as for ``match``.
/// progress : callable, optional
///     As for ``Map.from_images``.
///
/// Returns
/// -------
/// Alignment
///
/// Raises
/// ------
/// SurefixValueError
///     As for ``match`` and ``match_distances``, and for a place in ``at`` that there is not.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> distances = 1 - np.eye(30, dtype=np.float32)
/// >>> alignment = surefix.align(distances, motion="steady")
/// >>> alignment.place.tolist() == list(range(30))
/// True
/// >>> at = [alignment.place, alignment.place[::-1]]
/// >>> surefix.align(distances, motion="steady", at=at).right.mean(1).round(1)
/// array([1. , 0.1])
#[pyfunction]
#[pyo3(
    signature = (
        map, queries=None, *, motion=None, advance=None, gaps=None, segments=None, tolerance=None,
        at=None, descriptor=None, progress=None
    )
)]
#[expect(clippy::too_many_arguments, reason = "the options of Python's function")]
pub(crate) fn align(
    py: Python<'_>,
    map: &Bound<'_, PyAny>,
    queries: Option<&Bound<'_, PyAny>>,
    motion: Option<&Bound<'_, PyAny>>,
    advance: Option<&Bound<'_, PyAny>>,
    gaps: Option<&Bound<'_, PyAny>>,
    segments: Option<&Bound<'_, PyAny>>,
    tolerance: Option<&Bound<'_, PyAny>>,
    at: Option<&Bound<'_, PyAny>>,
    descriptor: Option<&Bound<'_, PyAny>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Alignment> {
    let options = PyDict::new(py);
    for (name, given) in [("motion", motion), ("tolerance", tolerance)] {
        if let Some(given) = given {
            options.set_item(name, given)?;
        }
    }
    let mut config = config(py, Some(&options), Floor::Running)?;
    config.motion.get_or_insert_with(Motion::any);
    config.sequence_length = 1;
    let advance = advance.map(|advance| numbers(advance, "advance")).transpose()?;
    let gaps = gaps.map(crate::batch::gaps).transpose()?.unwrap_or_default();
    let mut drive = Drive::default().gaps(&gaps);
    drive.advance = advance.as_deref();
    let segments = given_segments(segments)?;
    drive.segments = segments.as_ref();
    let at = at.map(places).transpose()?.unwrap_or_default();
    let at: Vec<&[usize]> = at.iter().map(Vec::as_slice).collect();
    let Some(queries) = queries else {
        let listed = listed(map)?.unwrap_or_else(|| vec![map.clone()]);
        if listed.iter().any(PyAnyMethods::is_instance_of::<Map>) {
            return Err(value(py, "queries: expected images or descriptors, got none".to_owned()));
        }
        let matrices = matrices(map)?;
        let views = views(py, &matrices)?;
        let callback = progress_callback(py, progress, "Aligning")?;
        let alignment = with_progress(py, callback.as_ref(), |progress| {
            Ok(py.detach(|| align_distances(&views, &config, drive, &at, progress)))
        });
        let given = matrices.iter().map(|matrix| matrix.as_any().clone());
        return Ok(Alignment(alignment?, Distances::of_matrices(given, config)));
    };
    let maps = maps(map)?;
    let descriptors = descriptors(descriptor, &maps)?;
    let rows = Rows::of_each(queries, &maps, &descriptors, progress)?;
    let views = rows.iter().map(Rows::view).collect::<PyResult<Vec<_>>>()?;
    let callback = progress_callback(py, progress, "Aligning")?;
    let alignment = with_progress(py, callback.as_ref(), |progress| {
        Ok(py.detach(|| align_descriptors(&maps, &views, &config, drive, &at, progress)))
    })?;
    drop(views);
    Ok(Alignment(alignment, Distances::of_queries(maps, rows, config)))
}

/// Lists of places, one a query in each.
fn places(at: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<usize>>> {
    let py = at.py();
    let refused =
        |got: String| value(py, format!("at: expected places, (k, m), from 0, got {got}"));
    let rows = if_it_can(py, at.try_iter())?.ok_or_else(|| refused("no array".to_owned()))?;
    rows.map(|row| {
        let places = whole_numbers(&row?, "at: each row")?.into_iter();
        let places = places.map(|at| usize::try_from(at).map_err(|_| refused(at.to_string())));
        places.collect()
    })
    .collect()
}
