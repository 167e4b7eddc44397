//! `surefix.LoopCloser` and its answers.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyUntypedArray, PyUntypedArrayMethods as _};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use surefix::saving::write_text;
use surefix::{Error, Floor, Graph, Input, LoopConfig, Metric, Poses};

use crate::arrays::{Numbers, as_array, coordinates};
use crate::error::{OrRaise as _, busy, value};
use crate::images::{Pixels, path_of, read_image};
use crate::learned;
use crate::map::Map;
use crate::options::{config, whole};
use crate::pickle::pickled;
use crate::sad::Sad;
use crate::signals::detached;

/// What a ``LoopCloser`` says of a frame.
#[pyclass(frozen, eq, module = "surefix")]
#[derive(PartialEq)]
pub(crate) struct LoopClosure(surefix::LoopClosure);

pickled!(LoopClosure);

#[pymethods]
impl LoopClosure {
    /// The number of the frame, from 0. As a place it has the same number, unless the loop closer
    /// is frozen.
    #[getter]
    fn frame(&self) -> u64 {
        self.0.frame
    }

    /// The most probable place, an earlier frame's number; 0 as long as there are not two to
    /// compare with.
    #[getter]
    fn place(&self) -> usize {
        self.0.place
    }

    /// The belief that the robot is within ``tolerance`` places of it; 0 as long as there are not
    /// two to compare with.
    #[getter]
    fn confidence(&self) -> f64 {
        self.0.confidence
    }

    /// The belief that the robot is at none of the earlier places, as it nearly always is.
    #[getter]
    fn off_map(&self) -> f64 {
        self.0.off_map
    }

    /// Whether it is an edge: the loop is closed between ``frame`` and ``place``.
    #[getter]
    fn edge(&self) -> bool {
        self.0.edge
    }

    /// Whether the frame shows nothing. It becomes a place, and no edge leads from it or to it.
    #[getter]
    fn blank(&self) -> bool {
        self.0.blank
    }

    fn __repr__(&self) -> String {
        let surefix::LoopClosure { frame, place, confidence, off_map, edge, .. } = self.0;
        let edge = if edge { "True" } else { "False" };
        format!(
            "LoopClosure(frame={frame}, place={place}, confidence={confidence:.3}, \
             off_map={off_map:.3}, edge={edge})"
        )
    }
}

/// Closes loops on a road without a map: each frame is compared with all places but the newest
/// ``exclude``, and then becomes a place itself.
///
/// The filter is that of a localizer's track, on a route that grows; the robot begins off the map,
/// and most of the time is. Memory is taken for a block of places (1 MB) at a time, and for the
/// belief twice as much as before at a time; in between, a push takes none. One thread does all of
/// it.
///
/// Parameters
/// ----------
/// descriptor : Sad or surefix.descriptors.Descriptor, optional
///     It describes the images that are pushed. Without one, the first frame decides: an image is
///     described by ``Sad()``; a vector of float32 is a ready descriptor, and so are all after it.
/// exclude : int
///     The newest places, with which a frame is not compared: it looks like them because the robot
///     has only just left them.
/// confidence : float
///     The least confidence of an edge, from 0 to 1.
/// lasting : int
///     The frames in a row that must be as sure, at places that follow each other, before the last
///     of them makes an edge: places that look alike by chance do not for long.
/// tolerance : int
///     Confidence is the belief within this many places of the most probable one.
/// motion : {"steady", "free", "any", "loops"} or Motion
///     How the robot moves along the earlier places, and how often it comes to one.
/// metric : {"cosine", "euclidean", "manhattan"}
///     How ready and learned descriptors are compared.
/// memory : int, optional
///     The most memory in bytes. Before it is passed, the oldest blocks of places go to a file,
///     from which each push reads them.
/// folder : path, optional
///     The folder of that file, which has no name and ends with the program; by default the
///     system's for temporary files.
///
/// Raises
/// ------
/// SurefixValueError
///     For an option outside its range; it names the option.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> places = np.random.default_rng(0).random((60, 64), np.float32)
/// >>> closer = surefix.LoopCloser(metric="euclidean", exclude=10)
/// >>> for frame in range(120):  # the same circle twice
/// ...     answer = closer.push(places[frame % 60])
/// >>> answer.edge, answer.frame, answer.place
/// (True, 119, 59)
/// >>> closer.edges[-1] == answer
/// True
#[pyclass(module = "surefix")]
pub(crate) struct LoopCloser {
    config: LoopConfig,
    metric: Metric,
    /// A descriptor of Python's.
    learned: Option<Py<PyAny>>,
    /// `None` until the first frame has decided what it takes.
    closer: Option<surefix::LoopCloser>,
}

#[pymethods]
impl LoopCloser {
    #[new]
    #[pyo3(
        signature = (descriptor=None, exclude=None, *, confidence=None, lasting=None, tolerance=None, motion=None, metric=None, memory=None, folder=None),
        text_signature = "(descriptor=None, exclude=30, *, confidence=0.9, lasting=10, tolerance=3, motion='loops', metric='cosine', memory=None, folder=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "keywords")]
    fn new(
        py: Python<'_>,
        descriptor: Option<&Bound<'_, PyAny>>,
        exclude: Option<&Bound<'_, PyAny>>,
        confidence: Option<f64>,
        lasting: Option<&Bound<'_, PyAny>>,
        tolerance: Option<&Bound<'_, PyAny>>,
        motion: Option<&Bound<'_, PyAny>>,
        metric: Option<&Bound<'_, PyAny>>,
        memory: Option<&Bound<'_, PyAny>>,
        folder: Option<PathBuf>,
    ) -> PyResult<Self> {
        let mut options = LoopConfig::default();
        if let Some(given) = exclude {
            options.exclude = whole("exclude", given)?;
        }
        if let Some(given) = lasting {
            options.lasting = whole("lasting", given)?;
        }
        if let Some(given) = tolerance {
            options.tolerance = whole("tolerance", given)?;
        }
        options.confidence = confidence.unwrap_or(options.confidence);
        if let Some(given) = motion {
            let named = PyDict::new(py);
            named.set_item("motion", given)?;
            let motion = config(py, Some(&named), Floor::Running)?.motion;
            options.motion = motion.unwrap_or(options.motion);
        }
        options.memory = memory.map(|given| whole("memory", given)).transpose()?;
        options.folder = folder;
        options.validate().or_raise(py)?;
        let metric =
            metric.map_or_else(|| "cosine".to_owned(), ToString::to_string).parse().or_raise(py)?;
        let mut this = Self { config: options, metric, learned: None, closer: None };
        match descriptor {
            None => {}
            Some(given) => match given.cast::<Sad>() {
                Ok(sad) => this.closer = Some(this.of_images(sad.get().0).or_raise(py)?),
                Err(_) if learned::is_learned(given)? => {
                    this.learned = Some(given.clone().unbind());
                }
                Err(_) => {
                    let expected = "a surefix.Sad, or a learned descriptor, with name, recipe and \
                                    describe(images)";
                    let got = given.get_type().name()?;
                    return Err(value(py, format!("descriptor: expected {expected}, got {got}")));
                }
            },
        }
        Ok(this)
    }

    /// Takes a frame, compares it with the places, and makes it one.
    ///
    /// Parameters
    /// ----------
    /// frame : array or path
    ///     An image, (H, W) or (H, W, 3), or a file of one; or a ready descriptor, (dim,), float32.
    /// advance : float, optional
    ///     The places that the robot has moved since the frame before, by odometry. As frames are
    ///     places: in frames at its usual speed.
    ///
    /// Returns
    /// -------
    /// LoopClosure
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For another shape or type, a NaN or an infinity; if there is no memory for the place
    ///     within the limit. It is then as it was.
    /// SurefixFileError
    ///     If places cannot be written to the file, or read from it. It is then as it was.
    #[pyo3(signature = (frame, advance=None))]
    fn push(
        slf: &Bound<'_, Self>,
        frame: &Bound<'_, PyAny>,
        advance: Option<f64>,
    ) -> PyResult<LoopClosure> {
        let py = slf.py();
        let learned = shared(slf)?.learned.as_ref().map(|given| given.clone_ref(py));
        let described = match &learned {
            Some(descriptor) if learned::is_image(frame)? => {
                Some(learned::vector(frame, descriptor.bind(py), None)?)
            }
            _ => None,
        };
        let frame = described.as_ref().unwrap_or(frame);
        let array: Bound<'_, PyUntypedArray> = match path_of(frame)? {
            Some(path) => read_image(py, path)?.cast_into()?,
            None => as_array(frame, "frame")?,
        };
        let (pixels, numbers);
        let input = if array.ndim() == 1 {
            numbers = Numbers::new(&array, "descriptor")?;
            Input::Descriptor(numbers.view()?)
        } else {
            pixels = Pixels::new(&array, "image")?;
            Input::Image(pixels.view(py)?)
        };
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "LoopCloser"))?;
        if let Some(closer) = &mut this.closer {
            return py.detach(|| closer.push(input, advance)).or_raise(py).map(LoopClosure);
        }
        let mut closer = match input {
            Input::Image(_) => this.of_images(surefix::Sad::default()),
            Input::Descriptor(numbers) => {
                let (dim, options) = (numbers.len(), this.config.clone());
                surefix::LoopCloser::of_descriptors(dim, this.metric, options)
            }
        }
        .or_raise(py)?;
        let answer = py.detach(|| closer.push(input, advance)).or_raise(py)?;
        // Only a frame that is accepted decides.
        this.closer = Some(closer);
        Ok(LoopClosure(answer))
    }

    /// Says that the next frame does not follow on the one before. The robot may be anywhere, and
    /// most likely at no earlier place; among the places, a new segment begins.
    ///
    /// Parameters
    /// ----------
    /// advance : float, optional
    ///     The places that the robot moved meanwhile, by odometry: the belief goes on from there.
    #[pyo3(signature = (advance=None))]
    fn gap(slf: &Bound<'_, Self>, advance: Option<f64>) -> PyResult<()> {
        let py = slf.py();
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "LoopCloser"))?;
        match (&mut this.closer, advance) {
            (Some(closer), Some(advance)) => closer.gap_with_advance(advance).or_raise(py),
            (Some(closer), None) => {
                closer.gap();
                Ok(())
            }
            (None, _) => Ok(()),
        }
    }

    /// From now on, frames are compared, and no longer become places: if there is no memory for
    /// more.
    fn freeze(slf: &Bound<'_, Self>) -> PyResult<()> {
        started(&mut *slf.try_borrow_mut().map_err(|_| busy(slf.py(), "LoopCloser"))?, slf.py())?
            .freeze();
        Ok(())
    }

    /// Whether frames no longer become places.
    #[getter]
    fn frozen(slf: &Bound<'_, Self>) -> PyResult<bool> {
        Ok(shared(slf)?.closer.as_ref().is_some_and(surefix::LoopCloser::is_frozen))
    }

    /// Takes the memory of this many more places and edges now: until they have come, a push takes
    /// none, but after a gap and for frames that show nothing.
    ///
    /// Parameters
    /// ----------
    /// frames : int
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If that would pass the limit, or there is not enough; before the first frame, unless it
    ///     was made with a ``Sad``: a place's size is not known then.
    fn reserve(slf: &Bound<'_, Self>, frames: &Bound<'_, PyAny>) -> PyResult<()> {
        let (py, frames) = (slf.py(), whole("frames", frames)?);
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "LoopCloser"))?;
        started(&mut this, py)?.reserve(frames).or_raise(py)
    }

    /// Forgets all frames, places and edges, and goes on at frame 0.
    fn reset(slf: &Bound<'_, Self>) -> PyResult<()> {
        let py = slf.py();
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "LoopCloser"))?;
        this.closer.as_mut().map_or(Ok(()), surefix::LoopCloser::reset).or_raise(py)
    }

    /// All edges so far, in the order of their frames: a list of LoopClosure.
    #[getter]
    fn edges(slf: &Bound<'_, Self>) -> PyResult<Vec<LoopClosure>> {
        let this = shared(slf)?;
        let edges = this.closer.as_ref().map_or(&[][..], surefix::LoopCloser::edges);
        Ok(edges.iter().copied().map(LoopClosure).collect())
    }

    /// How many frames it has taken.
    #[getter]
    fn frames(slf: &Bound<'_, Self>) -> PyResult<u64> {
        Ok(shared(slf)?.closer.as_ref().map_or(0, surefix::LoopCloser::frames))
    }

    /// How many places there are: a frame each, until it is frozen.
    fn __len__(slf: &Bound<'_, Self>) -> PyResult<usize> {
        Ok(shared(slf)?.closer.as_ref().map_or(0, surefix::LoopCloser::places))
    }

    /// Bytes of memory that places, beliefs and edges have, whether in use or reserved.
    #[getter]
    fn memory(slf: &Bound<'_, Self>) -> PyResult<usize> {
        Ok(shared(slf)?.closer.as_ref().map_or(0, surefix::LoopCloser::bytes))
    }

    /// Bytes of places that went to the file, so as not to pass the limit of memory.
    #[getter]
    fn in_file(slf: &Bound<'_, Self>) -> PyResult<usize> {
        Ok(shared(slf)?.closer.as_ref().map_or(0, surefix::LoopCloser::bytes_in_file))
    }

    /// The distances of the newest frame to the places that it was compared with, a copy: float32.
    #[getter]
    fn distances<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let this = shared(slf)?;
        let distances = this.closer.as_ref().map_or(&[][..], surefix::LoopCloser::distances);
        Ok(PyArray1::from_slice(slf.py(), distances))
    }

    /// The belief in each of the places that the newest frame was compared with, a copy: float64.
    /// With ``off_map`` it sums to 1.
    #[getter]
    fn belief<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let this = shared(slf)?;
        let belief = this.closer.iter().flat_map(surefix::LoopCloser::belief);
        Ok(PyArray1::from_iter(slf.py(), belief))
    }

    /// All places as a map: for a ``Localizer``, or to be saved. A gap is a break of its route.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If there are fewer than two places.
    /// SurefixFileError
    ///     If the file of places cannot be read.
    fn to_map(slf: &Bound<'_, Self>) -> PyResult<Map> {
        let py = slf.py();
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "LoopCloser"))?;
        let Some(closer) = &mut this.closer else {
            return Err(Error::TooFewPlaces { what: "map", got: 0 }).or_raise(py);
        };
        let map = detached(py, || closer.to_map())?;
        let Some(learned) = &this.learned else { return Ok(Map(Arc::new(map))) };
        let module = py.import("surefix.descriptors.descriptor")?;
        let recipe = module.call_method1("recipe_of", (learned.bind(py),))?;
        let recipe = learned::recipe_text(&recipe)?;
        Ok(Map(Arc::new(map.with_learned_recipe(&recipe).or_raise(py)?)))
    }

    /// Writes the edges as CSV: ``frame``, ``place`` and ``confidence``.
    ///
    /// Parameters
    /// ----------
    /// path : str or path
    ///
    /// Raises
    /// ------
    /// SurefixFileError
    ///     If the file cannot be written; an older one is then as it was.
    fn to_csv(slf: &Bound<'_, Self>, path: PathBuf) -> PyResult<()> {
        let (py, this) = (slf.py(), shared(slf)?);
        let written = match &this.closer {
            Some(closer) => py.detach(|| {
                let io = |source| Error::Io { path: path.clone(), action: "write the CSV", source };
                write_text(&path, |mut out| closer.write_csv(&mut out)).map_err(io)
            }),
            None => empty(&path, "frame,place,confidence\n"),
        };
        written.or_raise(py)
    }

    /// Writes a pose graph in the text format of g2o, as GTSAM reads it too.
    ///
    /// With poses: a vertex a frame, an edge from each frame to the next by the difference of
    /// their poses, and the loop edges. Without: the loop edges alone (``EDGE_SE2``), to be added
    /// to the graph of an odometry whose vertices are the frames.
    ///
    /// A loop edge leads from the place to the frame. A camera says that they are at one place, and
    /// not how they lie to each other: the measurement is the identity, and the information matrix
    /// is diagonal, ``confidence / deviation ** 2``. An edge can be wrong: give these edges a
    /// robust kernel.
    ///
    /// Parameters
    /// ----------
    /// path : str or path
    /// poses : array, shape (frames, 3) or (frames, 7), optional
    ///     Each frame's x, y and heading in radians, or x, y, z and the quaternion qx, qy, qz, qw.
    /// first : int
    ///     The vertex of frame 0.
    /// deviation : (float, float)
    ///     The standard deviations of a sure loop edge, in metres and radians: how far apart the
    ///     camera may be at what counts as one place.
    /// odometry_deviation : (float, float)
    ///     Those of an odometry edge.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For another number or shape of poses, or a deviation of 0 or less.
    /// SurefixFileError
    ///     If the file cannot be written; an older one is then as it was.
    #[pyo3(
        signature = (path, poses=None, *, first=None, deviation=None, odometry_deviation=None),
        text_signature = "($self, path, poses=None, *, first=0, deviation=(2.0, 0.2), odometry_deviation=(0.1, 0.02))"
    )]
    fn to_g2o(
        slf: &Bound<'_, Self>,
        path: PathBuf,
        poses: Option<&Bound<'_, PyAny>>,
        first: Option<&Bound<'_, PyAny>>,
        deviation: Option<(f64, f64)>,
        odometry_deviation: Option<(f64, f64)>,
    ) -> PyResult<()> {
        let (py, this) = (slf.py(), shared(slf)?);
        let mut graph = Graph::default();
        if let Some(poses) = poses {
            let (numbers, axes) = coordinates(poses, "poses")?;
            graph.poses = Some(Poses::new(numbers, axes).or_raise(py)?);
        }
        if let Some(first) = first {
            graph.first = whole("first", first)? as u64;
        }
        graph.deviation = deviation.unwrap_or(graph.deviation);
        graph.odometry_deviation = odometry_deviation.unwrap_or(graph.odometry_deviation);
        let Some(closer) = &this.closer else { return empty(&path, "").or_raise(py) };
        // The old file is kept if the graph is refused.
        let mut text = Vec::new();
        detached(py, || {
            closer.write_g2o(&mut text, &graph)?;
            let io =
                |source| Error::Io { path: path.clone(), action: "write the pose graph", source };
            write_text(&path, |out| out.write_all(&text)).map_err(io)
        })
    }

    #[expect(clippy::unused_self, reason = "a method of Python's")]
    fn __reduce__(&self) -> PyResult<Py<PyTuple>> {
        let message = "a LoopCloser cannot be pickled: its places may lie in a file of its own; \
                       keep its places by to_map() and its edges by to_csv()";
        Err(PyTypeError::new_err(message))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let this = shared(slf)?;
        let exclude = this.config.exclude;
        Ok(match &this.closer {
            None => format!("LoopCloser(exclude={exclude}, frames=0)"),
            Some(closer) => format!(
                "LoopCloser({} places x {}, exclude={exclude}, frames={}, edges={}, {:.1} MB)",
                closer.places(),
                closer.dim(),
                closer.frames(),
                closer.edges().len(),
                closer.bytes() as f64 / 1e6
            ),
        })
    }
}

impl LoopCloser {
    fn of_images(&self, sad: surefix::Sad) -> Result<surefix::LoopCloser, Error> {
        surefix::LoopCloser::of_images(sad, self.config.clone())
    }
}

/// The loop closer for a look, unless another thread is changing it.
fn shared<'py>(closer: &Bound<'py, LoopCloser>) -> PyResult<PyRef<'py, LoopCloser>> {
    closer.try_borrow().map_err(|_| busy(closer.py(), "LoopCloser"))
}

/// The one that knows what it takes.
fn started<'a>(this: &'a mut LoopCloser, py: Python<'_>) -> PyResult<&'a mut surefix::LoopCloser> {
    let message = "loop closer: expected a frame first, or a Sad as its descriptor: the size of a \
                   place is not known";
    this.closer.as_mut().ok_or_else(|| value(py, message.to_owned()))
}

/// A file without edges.
fn empty(path: &std::path::Path, text: &str) -> Result<(), Error> {
    write_text(path, |out| out.write_all(text.as_bytes())).map_err(|source| Error::Io {
        path: path.to_owned(),
        action: "write the edges",
        source,
    })
}
