//! `surefix.Localizer`.

use numpy::{PyArray1, PyUntypedArray};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyInt, PyIterator, PyTuple};
use surefix::Floor;
use surefix::calibration::Alarm;

use crate::calibrate::Threshold;
use crate::error::{OrRaise as _, busy, if_it_can, value};
use crate::fix::Fix;
use crate::images::{files_in, foreign_endings, names_of, path_of, read_image};
use crate::inputs::{Input, descriptors, listed, maps};
use crate::map::Map;
use crate::options::{config, given, settings, shown, whole};
use crate::signals::detached;

/// Localizes along a map, one camera frame at a time.
///
/// Parameters
/// ----------
/// map : Map or list of Map
///     The known route. Many localizers can share one. Several maps of the same places, each of
///     another technique, are fused: the single match and the sequence run on the mean of their
///     standardised distances, the track on the evidence of all.
/// descriptor : surefix.descriptors.Descriptor, or a list with one or None for each map, optional
///     On a map of learned descriptors: it describes the images that are pushed. Its name is the
///     one in the map's recipe.
/// config : Settings or path, optional
///     The settings of this route, as ``tune`` makes them: options, and a threshold, by which fixes
///     have ``accepted`` and ``probability``. Beside a threshold, ``**options`` can change none.
/// threads : int, optional
///     The number of threads of the scan, the caller's own among them. None chooses by size: one
///     for every 8 MB, up to all cores, so one for a map below 16 MB. The answers are the same to
///     the last bit. A forked child has one.
/// **options
///     As for ``Matcher``: sequence_length, weight, tolerance, smoothing, gradient, floor, speeds,
///     motion.
///
/// Raises
/// ------
/// SurefixValueError
///     For an option outside its range; it names the option.
///
/// Examples
/// --------
/// >>> import numpy as np, surefix
/// >>> frames = np.random.default_rng(0).integers(0, 255, (5, 48, 96), np.uint8)
/// >>> localizer = surefix.Localizer(surefix.Map.from_images(frames))
/// >>> [fix.place for fix in localizer.stream(frames)]
/// [0, 1, 2, 3, 4]
#[pyclass(module = "surefix")]
pub(crate) struct Localizer(surefix::Localizer, Vec<Option<Py<PyAny>>>);

#[pymethods]
impl Localizer {
    #[new]
    #[pyo3(
        signature = (map, *, descriptor=None, threads=None, **options)
    )]
    fn new(
        py: Python<'_>,
        map: &Bound<'_, PyAny>,
        descriptor: Option<&Bound<'_, PyAny>>,
        threads: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let settings = settings(py, options, Floor::Running, false)?;
        let threads = threads.map(|given| whole("threads", given)).transpose()?;
        let maps = maps(map)?;
        let descriptors = descriptors(descriptor, &maps)?;
        let localizer = settings.localizer(maps);
        let localizer =
            localizer.and_then(|localizer| localizer.with_threads(threads)).or_raise(py)?;
        Ok(Self(localizer, descriptors))
    }

    /// Takes one camera frame, and says where the robot is.
    ///
    /// Parameters
    /// ----------
    /// frame : array or path
    ///     A uint8 image, (H, W) or (H, W, 3), or a file of one, described as the map's own images
    ///     were (or of uint16, by the map's ``levels``); or a descriptor, (input_dim,), of the map's own type, or float32 on a map of ready
    ///     descriptors, as it is before post-processing. On several maps, an image for all of them,
    ///     or a list with one of these for each map.
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
    ///     For another shape or type, a NaN or an infinity, or an image on a map of ready
    ///     descriptors. The localizer is then as it was.
    #[pyo3(signature = (frame, trusted=None, advance=None))]
    fn push(
        slf: &Bound<'_, Self>,
        frame: &Bound<'_, PyAny>,
        trusted: Option<bool>,
        advance: Option<f64>,
    ) -> PyResult<Fix> {
        let given = given(trusted, advance);
        let py = slf.py();
        let inputs = {
            let this = shared(slf)?;
            let several = this.1.len() > 1;
            // A list has an input for each map.
            let each = listed(frame)?.filter(|_| several);
            if let Some(each) = each.as_ref().filter(|each| each.len() != this.1.len()) {
                let (expected, got) = (this.1.len(), each.len());
                let message =
                    format!("frame: expected one input for each of {expected} maps, got {got}");
                return Err(value(py, message));
            }
            let image = match path_of(frame)? {
                Some(path) if several => Some(read_image(py, path)?),
                _ => None,
            };
            let frame = image.as_ref().unwrap_or(frame);
            let inputs =
                this.0.maps().zip(&this.1).enumerate().map(|(index, (map, descriptor))| {
                    let frame = each.as_ref().map_or(frame, |each| &each[index]);
                    Input::new(frame, map, descriptor.as_ref().map(|given| given.bind(py)))
                });
            inputs.collect::<PyResult<Vec<_>>>()?
        };
        let views = inputs.iter().map(|input| input.view(py)).collect::<PyResult<Vec<_>>>()?;
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "Localizer"))?;
        let localizer = &mut this.0;
        let fix = py.detach(|| localizer.push_inputs(&views, given)).or_raise(py)?;
        Ok(Fix(fix, localizer.position(&fix)))
    }

    /// A fix for each frame, as it comes.
    ///
    /// Parameters
    /// ----------
    /// frames : iterable of arrays or paths, or a path
    ///     Each as for ``push``. A path is a folder or a pattern of images, or whatever else
    ///     ``surefix.frames.open`` opens: a video, a bag, a camera by its number or URL, a
    ///     file of arrays. Or a source that reports lost frames, such as
    ///     ``surefix.frames.Frames``: an iterable of objects with an ``image`` to push, and ``gap``
    ///     and ``dropped``. If ``gap`` is true, or ``dropped``, the number of frames lost just
    ///     before this one, is more than 0, ``Localizer.gap`` comes first. It holds even if the
    ///     image is then refused. An ``advance`` of theirs is pushed with the image, and bridges
    ///     the gap; that of an image that is refused bridges a gap in its place.
    ///
    /// Returns
    /// -------
    /// iterator of Fix
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     As for ``push``, when the frame's turn comes.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> from types import SimpleNamespace
    /// >>> images = np.random.default_rng(0).integers(0, 255, (5, 48, 96), np.uint8)
    /// >>> frames = [SimpleNamespace(image=images[i], gap=False, dropped=int(i == 3)) for i in (0, 1, 3, 4)]
    /// >>> localizer = surefix.Localizer(surefix.Map.from_images(images))
    /// >>> [(fix.place, fix.sequence is not None) for fix in localizer.stream(frames)]
    /// [(0, False), (1, True), (3, False), (4, True)]
    fn stream(slf: &Bound<'_, Self>, frames: &Bound<'_, PyAny>) -> PyResult<FixStream> {
        let py = slf.py();
        let opened = || py.import("surefix.frames")?.call_method1("open", (frames,))?.try_iter();
        let frames = match path_of(frames)? {
            Some(place) => match if_it_can(py, files_in(py, place, "name", &foreign_endings(py)?))?
            {
                Some(images) => names_of(&images).into_pyobject(py)?.try_iter()?,
                // A video, a bag or a camera; if there is none, the error is its own.
                None => opened()?,
            },
            None if frames.is_instance_of::<PyInt>() => opened()?,
            None => frames.try_iter()?,
        };
        Ok(FixStream { localizer: slf.clone().unbind(), frames: frames.unbind() })
    }

    /// The distances from the newest frame to every place, a copy: shape (n,), float32; zeros
    /// before the first, and right after a gap. On a map with a screen, those that were not needed
    /// for the fix are computed now.
    #[getter]
    fn distances<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let py = slf.py();
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "Localizer"))?;
        let localizer = &mut this.0;
        Ok(PyArray1::from_slice(py, py.detach(|| localizer.distances())))
    }

    /// The track's belief in each place after the newest frame, a copy: shape (n,), float64. With
    /// ``off_map`` of the track, it sums to 1. None without the option ``motion``.
    #[getter]
    fn belief<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let this = shared(slf)?;
        Ok(this.0.belief().map(|belief| PyArray1::from_iter(slf.py(), belief)))
    }

    /// Whether the scores are no longer those of the calibration drive of the settings' threshold,
    /// so that its promise holds no longer: it is raised on at most 1 % of drives like that one.
    /// False without a threshold.
    #[getter]
    fn alarm(slf: &Bound<'_, Self>) -> PyResult<bool> {
        Ok(shared(slf)?.0.alarm().is_some_and(Alarm::raised))
    }

    /// The threshold that judges its fixes; None without.
    #[getter]
    fn threshold(slf: &Bound<'_, Self>) -> PyResult<Option<Threshold>> {
        Ok(shared(slf)?.0.threshold().cloned().map(Threshold))
    }

    /// How many of the map's rows the newest frame made it look at: all of them, or, on a map with
    /// a screen, those that were left in doubt, for this query and for the ones before it in the
    /// window. 0 before the first frame.
    #[getter]
    fn looked_at(slf: &Bound<'_, Self>) -> PyResult<usize> {
        Ok(shared(slf)?.0.looked_at())
    }

    /// Says that the next frame does not follow on the one before: frames were dropped, or the
    /// camera was away.
    ///
    /// As ``Matcher.gap``: ``fix.sequence`` is None until ``sequence_length`` frames have come;
    /// frame numbers, the running floor and a drive's statistics (``surefix.post.Standardize``) go
    /// on.
    ///
    /// Parameters
    /// ----------
    /// advance : float, optional
    ///     The places that the robot moved meanwhile, by odometry: the track goes on from there.
    ///     Without it, the robot may be anywhere.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> rows = np.eye(6, dtype=np.float32)
    /// >>> localizer = surefix.Localizer(surefix.Map.from_descriptors(rows))
    /// >>> [localizer.push(row).sequence is None for row in rows[:3]]
    /// [True, False, False]
    /// >>> localizer.gap()
    /// >>> [localizer.push(row).sequence is None for row in rows[4:]]
    /// [True, False]
    #[pyo3(signature = (advance=None))]
    fn gap(slf: &Bound<'_, Self>, advance: Option<f64>) -> PyResult<()> {
        let py = slf.py();
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "Localizer"))?;
        if let Some(advance) = advance {
            return this.0.gap_with_advance(advance).or_raise(py);
        }
        this.0.gap();
        Ok(())
    }

    /// Forgets all frames and the statistics of the drive: the next one is frame 0.
    fn reset(slf: &Bound<'_, Self>) -> PyResult<()> {
        slf.try_borrow_mut().map_err(|_| busy(slf.py(), "Localizer"))?.0.reset();
        Ok(())
    }

    /// The state as bytes, a drive's statistics among it, without the map; ``Localizer.restore``
    /// goes on from it bit-identically.
    fn snapshot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyBytes>> {
        let py = slf.py();
        let this = shared(slf)?;
        let localizer = &this.0;
        let blob = detached(py, || localizer.snapshot())?;
        Ok(PyBytes::new(py, &blob))
    }

    /// A localizer that goes on where the snapshot was taken, on the same map.
    ///
    /// Parameters
    /// ----------
    /// map : Map
    ///     The map that the snapshot was taken on.
    /// blob : bytes
    ///     From ``snapshot``.
    /// threads : int, optional
    ///     As for ``Localizer``.
    /// **options
    ///     If given, as for ``Localizer``: the snapshot must have been taken under exactly these.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If the bytes are damaged, of another map, of other options or of a newer version.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> route = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
    /// >>> localizer = surefix.Localizer(route)
    /// >>> blob = localizer.snapshot()
    /// >>> surefix.Localizer.restore(route, blob)
    /// Localizer(Map(4 places x 4 float32, cosine, 0.0 MB), frames=0)
    #[staticmethod]
    #[pyo3(
        signature = (map, blob, *, descriptor=None, threads=None, **options)
    )]
    fn restore(
        py: Python<'_>,
        map: &Bound<'_, PyAny>,
        blob: &[u8],
        descriptor: Option<&Bound<'_, PyAny>>,
        threads: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let threads = threads.map(|given| whole("threads", given)).transpose()?;
        let expected =
            options.map(|options| config(py, Some(options), Floor::Running)).transpose()?;
        let maps = maps(map)?;
        let descriptors = descriptors(descriptor, &maps)?;
        let localizer = detached(py, || {
            surefix::Localizer::restore_fused(maps, blob, expected.as_ref())?.with_threads(threads)
        })?;
        Ok(Self(localizer, descriptors))
    }

    // As a snapshot, with the maps: the alarm of a threshold begins anew.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, blob) = (slf.py(), Self::snapshot(slf)?);
        let this = shared(slf)?;
        let descriptors: Vec<_> =
            this.1.iter().map(|given| given.as_ref().map(|d| d.bind(py))).collect();
        let threshold = this.0.threshold().cloned().map(Threshold);
        let state = (Self::maps(slf)?, blob, descriptors, this.0.threads(), threshold);
        (slf.get_type().getattr("_unpickled")?, state).into_pyobject(py)
    }

    #[staticmethod]
    fn _unpickled(
        py: Python<'_>,
        maps: &Bound<'_, PyAny>,
        blob: &[u8],
        descriptors: &Bound<'_, PyAny>,
        threads: &Bound<'_, PyAny>,
        threshold: Option<&Threshold>,
    ) -> PyResult<Self> {
        let Self(localizer, descriptors) =
            Self::restore(py, maps, blob, Some(descriptors), Some(threads), None)?;
        let judged = match threshold {
            Some(threshold) => localizer.with_threshold(threshold.0.clone()).or_raise(py)?,
            None => localizer,
        };
        Ok(Self(judged, descriptors))
    }

    /// The map that it localizes on, the first if there are several.
    #[getter]
    fn map(slf: &Bound<'_, Self>) -> PyResult<Map> {
        Ok(Map(shared(slf)?.0.map().clone()))
    }

    /// The maps, one for each technique.
    #[getter]
    fn maps(slf: &Bound<'_, Self>) -> PyResult<Vec<Map>> {
        Ok(shared(slf)?.0.maps().cloned().map(Map).collect())
    }

    /// How many threads scan the map, the caller's own among them.
    #[getter]
    fn threads(slf: &Bound<'_, Self>) -> PyResult<usize> {
        Ok(shared(slf)?.0.threads())
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let this = shared(slf)?;
        let maps: Vec<String> = this.0.maps().cloned().map(|map| Map(map).__repr__()).collect();
        Ok(format!("Localizer({}, frames={})", maps.join(" + "), this.0.frames()))
    }
}

/// The localizer for a look, unless another thread is changing it.
fn shared<'py>(localizer: &Bound<'py, Localizer>) -> PyResult<PyRef<'py, Localizer>> {
    localizer.try_borrow().map_err(|_| busy(localizer.py(), "Localizer"))
}

/// The fixes of ``Localizer.stream``, one a frame.
#[pyclass(frozen, module = "surefix")]
pub(crate) struct FixStream {
    localizer: Py<Localizer>,
    frames: Py<PyIterator>,
}

#[pymethods]
impl FixStream {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Fix>> {
        let Some(item) = self.frames.bind(py).clone().next() else { return Ok(None) };
        let (item, localizer) = (item?, self.localizer.bind(py));
        let Some(Reported { image, follows, advance }) = Reported::of(&item)? else {
            return Localizer::push(localizer, &item, None, None).map(Some);
        };
        if !follows {
            // The advance counts from the frame before.
            Localizer::gap(localizer, advance.map(|_| 0.0))?;
        }
        let fix = Localizer::push(localizer, &image, None, advance);
        if fix.is_err() && advance.is_some() {
            // A frame that is refused is lost, but the robot has moved. The error that is raised is
            // that of the frame, which may be its advance.
            let _ = Localizer::gap(localizer, advance);
        }
        fix.map(Some)
    }
}

/// A frame that reports lost frames (``surefix.frames.Frame``): its image, whether it follows on
/// the one before, and the places that the robot moved since then.
struct Reported<'py> {
    image: Bound<'py, PyAny>,
    follows: bool,
    advance: Option<f64>,
}

impl<'py> Reported<'py> {
    /// `None` for an array or a path.
    fn of(item: &Bound<'py, PyAny>) -> PyResult<Option<Self>> {
        if item.is_instance_of::<PyUntypedArray>() {
            return Ok(None);
        }
        let parts =
            (item.getattr_opt("image")?, item.getattr_opt("gap")?, item.getattr_opt("dropped")?);
        let (Some(image), Some(gap), Some(dropped)) = parts else { return Ok(None) };
        let cut: bool = reported("gap", "True or False", &gap, gap.extract())?;
        let whole = "a whole number of 0 or more";
        let lost: u64 = reported("dropped", whole, &dropped, dropped.extract())?;
        let advance = match item.getattr_opt("advance")? {
            None => None,
            Some(places) => {
                reported("advance", "a number of places, or None", &places, places.extract())?
            }
        };
        Ok(Some(Self { image, follows: !cut && lost == 0, advance }))
    }
}

/// What a frame reports, as it must be.
fn reported<T>(
    name: &str,
    expected: &str,
    got: &Bound<'_, PyAny>,
    read: PyResult<T>,
) -> PyResult<T> {
    if let Some(read) = if_it_can(got.py(), read)? {
        return Ok(read);
    }
    let got_one = shown(got)?;
    Err(value(got.py(), format!("frame: {name}: expected {expected}, got {got_one}")))
}
