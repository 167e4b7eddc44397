//! Images from Python: arrays, files, folders, and anything that yields them.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use numpy::{PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods as _};
use once_cell::race::OnceBox;
use pyo3::prelude::*;
use pyo3::types::{PyList, PySlice, PyString, PyTuple};
use surefix::{Channels, Error, Image, ImageFiles, ImageSource, ImageView, Order, ReadableImages};

use crate::arrays::{as_array, contiguous, dtype_of, image_to_py, shape_of};
use crate::error::{OrRaise as _, if_it_can, is_none_of_ours, to_py, value};
use crate::signals::{detached, watched};
use crate::simulate::Traverse;

/// A uint8 or uint16 array (H, W), (H, W, 1), (H, W, 3) or (H, W, 4), whose alpha is left out, held
/// for as long as it is read.
pub(crate) struct Pixels<'py> {
    samples: Samples<'py>,
    width: usize,
    height: usize,
    channels: Channels,
}

enum Samples<'py> {
    U8(PyReadonlyArrayDyn<'py, u8>),
    U16(PyReadonlyArrayDyn<'py, u16>),
}

impl<'py> Pixels<'py> {
    pub(crate) fn new(array: &Bound<'py, PyUntypedArray>, what: &str) -> PyResult<Self> {
        let opaque = match *array.shape() {
            [_, _, 4] => Some(without_alpha(array)?),
            _ => None,
        };
        let array = opaque.as_ref().unwrap_or(array);
        let (height, width, channels) = match *array.shape() {
            [height, width] | [height, width, 1] => (height, width, Channels::Grey),
            [height, width, 3] => (height, width, Channels::Rgb),
            _ => {
                let shape = shape_of(array);
                return Err(value(
                    array.py(),
                    format!("{what}: expected (H, W) or (H, W, 3), got the shape {shape}"),
                ));
            }
        };
        let samples = match contiguous(array)? {
            Some(bytes) => Samples::U8(bytes),
            None => Samples::U16(contiguous(array)?.ok_or_else(|| not_pixels(array, what))?),
        };
        Ok(Self { samples, width, height, channels })
    }

    pub(crate) fn view(&self, py: Python<'_>) -> PyResult<ImageView<'_>> {
        let &Self { width, height, channels, ref samples } = self;
        match samples {
            Samples::U8(bytes) => ImageView::new(width, height, channels, bytes.as_slice()?),
            Samples::U16(deep) => ImageView::new_deep(width, height, channels, deep.as_slice()?),
        }
        .or_raise(py)
    }
}

/// Red, green and blue.
fn without_alpha<'py>(array: &Bound<'py, PyUntypedArray>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = array.py();
    let key = (py.Ellipsis(), PySlice::new(py, 0, 3, 1));
    Ok(array.get_item(key)?.cast_into()?)
}

/// The refusal of pixels of another type, which says how to convert them.
fn not_pixels(array: &Bound<'_, PyUntypedArray>, what: &str) -> PyErr {
    let got = dtype_of(array);
    let how = match got.as_str() {
        "bool" | "float16" | "float32" | "float64" => {
            "(255 * image).astype(np.uint8), if 1 is white"
        }
        _ => "image.astype(np.uint8), if 255 is white",
    };
    let expected = "expected uint8, or uint16 for more than 8 bits";
    value(array.py(), format!("{what}: {expected}, got {got}; convert it with {how}"))
}

/// A traverse's images, wherever they come from.
pub(crate) enum Images<'py> {
    Files(ImageFiles),
    Arrays(Vec<Pixels<'py>>),
    Sequence(Sequence),
    Traverse(surefix_simulate::Traverse),
}

impl<'py> Images<'py> {
    /// A folder or a pattern; a generated traverse; an array of images as ``Pixels`` takes them; an iterable
    /// of paths or of arrays; or any other sequence of arrays, each of which is asked for when it
    /// is its turn.
    pub(crate) fn new(object: &Bound<'py, PyAny>) -> PyResult<Self> {
        let py = object.py();
        if let Ok(traverse) = object.cast::<Traverse>() {
            return Ok(Self::Traverse(traverse.get().0.clone()));
        }
        if let Some(place) = path_of(object)? {
            return Self::found(py, place);
        }
        let in_memory = object.is_instance_of::<PyList>()
            || object.is_instance_of::<PyTuple>()
            || object.is_instance_of::<PyUntypedArray>();
        if !in_memory && object.hasattr("__len__")? && object.hasattr("__getitem__")? {
            return Ok(Self::Sequence(Sequence::new(object)?));
        }
        if let Ok(array) = object.cast::<PyUntypedArray>()
            && (array.ndim() < 3 || (array.ndim() == 3 && [1, 3, 4].contains(&array.shape()[2])))
        {
            let (expected, got) = ("(n, H, W) or (n, H, W, 3), one image a place", shape_of(array));
            return Err(value(py, format!("images: expected {expected}, got the shape {got}")));
        }
        let not_images = || {
            let kind =
                object.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
            value(
                py,
                format!(
                    "images: expected a folder, a pattern, or a sequence of images or paths, got {kind}"
                ),
            )
        };
        let items: Vec<Bound<'py, PyAny>> =
            if_it_can(py, object.try_iter())?.ok_or_else(not_images)?.collect::<PyResult<_>>()?;
        let paths = items.iter().map(path_of).take_while(|path| !matches!(path, Ok(None)));
        let paths: Vec<PathBuf> = paths.filter_map(PyResult::transpose).collect::<PyResult<_>>()?;
        if !items.is_empty() && paths.len() == items.len() {
            return Self::of_files(py, ImageFiles::list(paths));
        }
        let arrays = items.iter().enumerate().map(|(index, item)| {
            let what = format!("image {index}");
            Pixels::new(&as_array(item, &what)?, &what)
        });
        Ok(Self::Arrays(arrays.collect::<PyResult<_>>()?))
    }

    /// The images of a folder or a pattern, some of which Python may have to read.
    fn found(py: Python<'py>, place: PathBuf) -> PyResult<Self> {
        Self::of_files(py, files_in(py, place, "name", &foreign_endings(py)?)?)
    }

    fn of_files(py: Python<'py>, files: ImageFiles) -> PyResult<Self> {
        if !files.paths().iter().any(|path| may_be_foreign(path)) {
            return Ok(Self::Files(files));
        }
        let images = py.import("surefix.frames.images")?;
        let images = images.call_method1("ImageFiles", (files.paths(),))?;
        Ok(Self::Sequence(Sequence::new(&images)?))
    }

    /// The number of images.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Files(files) => files.len(),
            Self::Traverse(traverse) => traverse.len(),
            Self::Sequence(sequence) => sequence.len(),
            Self::Arrays(arrays) => arrays.len(),
        }
    }

    /// Runs `work` on the images with the GIL released.
    pub(crate) fn with_source<R: Send>(
        &self,
        py: Python<'_>,
        work: impl Send + FnOnce(&dyn ImageSource) -> R,
    ) -> PyResult<R> {
        Ok(match self {
            Self::Files(files) => py.detach(|| work(files)),
            Self::Traverse(traverse) => py.detach(|| work(traverse)),
            Self::Sequence(sequence) => {
                let result = py.detach(|| work(sequence));
                if let Some(error) = sequence.raised.get() {
                    return Err(error.clone_ref(py));
                }
                result
            }
            Self::Arrays(arrays) => {
                let views =
                    arrays.iter().map(|array| array.view(py)).collect::<PyResult<Vec<_>>>()?;
                py.detach(|| work(&Views(views)))
            }
        })
    }
}

/// How a map is made of images.
#[derive(Clone, Copy)]
pub(crate) struct Terms {
    pub(crate) skip_bad: bool,
    pub(crate) mixed_sizes: bool,
}

impl Terms {
    /// Runs `work` on the images; if one cannot be read, and that is allowed, once more on those
    /// that can, which it is told. The others are said.
    pub(crate) fn each<R: Send>(
        self,
        py: Python<'_>,
        images: &Images<'_>,
        progress: surefix::Progress<'_>,
        work: impl Send
        + Fn(&dyn ImageSource, Option<&[usize]>, surefix::Progress<'_>) -> Result<R, Error>,
    ) -> PyResult<Result<R, Error>> {
        let mut bad = Vec::new();
        let said = &mut bad;
        let done = images.with_source(py, move |source| {
            let source = Mixed { source, mixed: self.mixed_sizes };
            match work(&source, None, progress) {
                Err(Error::Image { .. }) if self.skip_bad => {
                    let readable = ReadableImages::of(&source, progress)?;
                    let done = work(&readable, Some(readable.kept()), progress)?;
                    said.extend(readable.bad().iter().map(|(_, error)| error.to_string()));
                    Ok(done)
                }
                done => done,
            }
        })?;
        for error in bad {
            passed_over(py, &error)?;
        }
        Ok(done)
    }
}

/// Says that an image was passed over.
fn passed_over(py: Python<'_>, error: &str) -> PyResult<()> {
    let log = py.import("logging")?.call_method1("getLogger", ("surefix",))?;
    log.call_method1("warning", ("Passed over: %s", error)).map(drop)
}

/// Images whose sizes may differ.
struct Mixed<'a> {
    source: &'a dyn ImageSource,
    mixed: bool,
}

impl ImageSource for Mixed<'_> {
    fn len(&self) -> usize {
        self.source.len()
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        self.source.load(index)
    }

    fn name(&self, index: usize) -> String {
        self.source.name(index)
    }

    fn has_mixed_sizes(&self) -> bool {
        self.mixed
    }
}

/// Images in NumPy's memory.
struct Views<'a>(Vec<ImageView<'a>>);

impl ImageSource for Views<'_> {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        Ok(self.0[index].to_image())
    }
}

/// A Python sequence of arrays, such as a data set's images, with its `names`, if it has any.
pub(crate) struct Sequence {
    items: Py<PyAny>,
    count: usize,
    names: Option<Vec<String>>,
    /// Ctrl-C, an exit or the like in the sequence's own code: no fault of an image.
    raised: OnceBox<PyErr>,
}

impl Sequence {
    fn new(object: &Bound<'_, PyAny>) -> PyResult<Self> {
        let count = object.len()?;
        let names = object.getattr("names").and_then(|names| names.extract::<Vec<String>>());
        let names = if_it_can(object.py(), names)?.filter(|names| names.len() == count);
        Ok(Self { items: object.clone().unbind(), count, names, raised: OnceBox::new() })
    }
}

impl ImageSource for Sequence {
    fn len(&self) -> usize {
        self.count
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        let load = |py: Python<'_>| -> PyResult<Image> {
            let what = format!("image {index}");
            let item = self.items.bind(py).get_item(index)?;
            let pixels = Pixels::new(&as_array(&item, &what)?, &what)?;
            Ok(pixels.view(py)?.to_image())
        };
        Python::attach(|py| {
            load(py).map_err(|error| {
                if is_none_of_ours(py, &error) {
                    // The first counts.
                    let _ = self.raised.set(Box::new(error));
                    return Error::Interrupted { done: 0, total: 0 };
                }
                let reason = error.value(py).to_string();
                Error::Image { name: self.name(index), reason }
            })
        })
    }

    fn name(&self, index: usize) -> String {
        self.names.as_ref().map_or_else(|| index.to_string(), |names| names[index].clone())
    }
}

/// The path that a string or a path object names.
pub(crate) fn path_of(object: &Bound<'_, PyAny>) -> PyResult<Option<PathBuf>> {
    let py = object.py();
    let named = object.is_instance_of::<PyString>()
        || if_it_can(py, object.hasattr("__fspath__"))?.unwrap_or(false);
    if named { if_it_can(py, object.extract()) } else { Ok(None) }
}

/// Reads an image file (png, jpeg, bmp, tiff, webp or pnm; with ``surefix[heif]`` heic and avif too),
/// upright: turned and mirrored as its EXIF orientation says.
///
/// Parameters
/// ----------
/// path : str or path
///
/// Returns
/// -------
/// array of uint8, shape (H, W) for a grey file, (H, W, 3) RGB for any other
///     Of uint16 if the file has more than 8 bits a sample. The levels of a map say which range of
///     them is black to white (``Sad``).
///
/// Raises
/// ------
/// SurefixFileError
///     If the file cannot be opened.
/// SurefixValueError
///     If it is not an image that can be decoded whole, or has more pixels than ``max_pixels()``.
#[pyfunction]
pub(crate) fn read_image(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    if may_be_foreign(&path) && foreign_endings(py)?.contains(&ending_of(&path)) {
        return py.import("surefix.frames.foreign")?.call_method1("read_any", (path,));
    }
    let image = detached(py, || surefix::read_image(path))?;
    image_to_py(py, &image)
}

/// The most pixels that are decoded at once, by all threads together: 100,000,000 unless
/// ``set_max_pixels`` has set another number.
///
/// Returns
/// -------
/// int
#[pyfunction]
pub(crate) fn max_pixels() -> u64 {
    surefix::max_pixels()
}

/// Sets how many pixels are decoded at once, in the whole process: of image files, and of the frames
/// of bags and videos. A larger image is refused; smaller ones wait for each other if several threads
/// read them. Pixels of more than 4 bytes, such as RGB of 16 bits, count as more. Decoding takes up
/// to about 8 bytes a pixel. The command line has ``--max-pixels``.
///
/// Parameters
/// ----------
/// pixels : int
///     More than 0.
///
/// Raises
/// ------
/// SurefixValueError
///     For another number.
///
/// Examples
/// --------
/// >>> import surefix
/// >>> surefix.set_max_pixels(242_000_000)   # panoramas of 22,000 x 11,000
/// >>> surefix.max_pixels()
/// 242000000
/// >>> surefix.set_max_pixels(100_000_000)
#[pyfunction]
pub(crate) fn set_max_pixels(pixels: &Bound<'_, PyAny>) -> PyResult<()> {
    let wrong =
        || value(pixels.py(), format!("pixels: expected a whole number above 0, got {pixels}"));
    let count = pixels.extract::<u64>().map_err(|_| wrong())?;
    if count == 0 {
        return Err(wrong());
    }
    surefix::set_max_pixels(count);
    Ok(())
}

/// The endings of the images that Python reads with what is installed.
pub(crate) fn foreign_endings(py: Python<'_>) -> PyResult<Vec<String>> {
    py.import("surefix.frames.foreign")?.call_method0("endings")?.extract()
}

/// Whether Python may read this file: without asking it.
fn may_be_foreign(path: &Path) -> bool {
    ["avif", "heic", "heif"].contains(&ending_of(path).as_str())
}

fn ending_of(path: &Path) -> String {
    path.extension().map_or_else(String::new, |ending| ending.to_string_lossy().to_lowercase())
}

/// Decodes the bytes of an image file, such as a camera driver's compressed frame, as
/// ``read_image`` does.
///
/// Parameters
/// ----------
/// data : bytes
/// name : str
///     What the error calls it.
///
/// Returns
/// -------
/// array of uint8 or uint16, shape (H, W) for a grey image, (H, W, 3) RGB for any other
///
/// Raises
/// ------
/// SurefixValueError
///     As for ``read_image``.
#[pyfunction]
#[pyo3(signature = (data, name="image"))]
pub(crate) fn decode_image<'py>(
    py: Python<'py>,
    data: &[u8],
    name: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let image = detached(py, || surefix::decode_image(data, name))?;
    image_to_py(py, &image)
}

/// The image files of a folder or of a pattern like ``route/*.png``, in route order: ``frame10``
/// follows ``Frame9``.
///
/// Parameters
/// ----------
/// place : str or path
/// order : {"name", "decimals", "whole", "time", "exif"}
///     "name" is by names, as a person counts. In numbers with a point, such as the seconds of
///     ``9.25.png``, the digits after it are decimals, unless one of them ends in 0 and none begins
///     with 0; "decimals" (9.25 before 9.5) and "whole" (9.5 before 9.25, as of unpadded
///     nanoseconds) choose. "time" is by the time of the file's last change, "exif" by the time at
///     which the camera took it.
///
/// Returns
/// -------
/// list of str
///
/// Raises
/// ------
/// SurefixFileError
///     If there is no such folder.
/// SurefixValueError
///     If it holds no images; for another order, or a file without the time of capture.
#[pyfunction]
#[pyo3(signature = (place, order="name"))]
pub(crate) fn find_images(py: Python<'_>, place: PathBuf, order: &str) -> PyResult<Vec<OsString>> {
    files_in(py, place, order, &[]).map(|files| names_of(&files))
}

/// The files of ``find_images``, and what a user should know: the files that were left out, an
/// order that the names leave open, two drives in one folder, files of which only the first image is
/// taken.
///
/// Parameters
/// ----------
/// place, order
///     As for ``find_images``.
/// also : list of str
///     Other endings that count as images, such as "heic".
///
/// Returns
/// -------
/// (list of str, list of str)
#[pyfunction]
#[pyo3(signature = (place, order="name", also=vec![]), text_signature = "(place, order='name', also=())")]
pub(crate) fn image_files(
    py: Python<'_>,
    place: PathBuf,
    order: &str,
    also: Vec<String>,
) -> PyResult<(Vec<OsString>, Vec<String>)> {
    let files = files_in(py, place, order, &also)?;
    Ok((names_of(&files), detached(py, || Ok(files.remarks()))?))
}

pub(crate) fn files_in(
    py: Python<'_>,
    place: PathBuf,
    order: &str,
    also: &[String],
) -> PyResult<ImageFiles> {
    let order: Order = order.parse().or_raise(py)?;
    detached(py, || ImageFiles::find_also(place, order, also))
}

pub(crate) fn names_of(files: &ImageFiles) -> Vec<OsString> {
    files.paths().iter().map(|path| path.as_os_str().to_owned()).collect()
}

/// Tells `callback(done, total)` of the work that `run` does, and stops it on Ctrl-C, or if the
/// callback raises or returns False.
pub(crate) fn with_progress<T>(
    py: Python<'_>,
    callback: Option<&Py<PyAny>>,
    run: impl FnOnce(surefix::Progress<'_>) -> PyResult<Result<T, Error>>,
) -> PyResult<T> {
    let mut raised = None;
    let mut report = |done: usize, total: usize| {
        let heard = Python::attach(|py| {
            py.check_signals()?;
            let Some(callback) = callback else { return Ok(true) };
            let answer = callback.bind(py).call1((done, total))?;
            Ok(!answer.is(pyo3::types::PyBool::new(py, false).as_any()))
        });
        match heard {
            Ok(true) => std::ops::ControlFlow::Continue(()),
            Ok(false) => std::ops::ControlFlow::Break(()),
            Err(error) => {
                raised = Some(error);
                std::ops::ControlFlow::Break(())
            }
        }
    };
    let result = watched(|| run(&mut report))??;
    match (result, raised) {
        (_, Some(error)) => Err(error),
        (result, None) => result.map_err(|error| to_py(py, &error)),
    }
}

/// The callback for a `progress` argument: None is a bar on a terminal, False is nothing.
pub(crate) fn progress_callback(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    label: &str,
) -> PyResult<Option<Py<PyAny>>> {
    match progress {
        Some(given) if given.is_callable() => Ok(Some(given.clone().unbind())),
        Some(given) if !given.is_truthy()? => Ok(None),
        _ => {
            let bar = py.import("surefix._progress")?.call_method1("terminal_bar", (label,))?;
            Ok((!bar.is_none()).then(|| bar.unbind()))
        }
    }
}
