//! Images from Python: arrays, files, folders, and anything that yields them.

use std::ffi::OsString;
use std::path::PathBuf;

use numpy::{PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString, PyTuple};
use surefix::{Channels, Error, Image, ImageFiles, ImageSource, ImageView};

use crate::arrays::{as_array, contiguous, dtype_of, image_to_py, shape_of};
use crate::error::{OrRaise as _, to_py, value};
use crate::simulate::Traverse;

/// A uint8 array (H, W) or (H, W, 3), held for as long as it is read.
pub(crate) struct Pixels<'py> {
    array: PyReadonlyArrayDyn<'py, u8>,
    width: usize,
    height: usize,
    channels: Channels,
}

impl<'py> Pixels<'py> {
    pub(crate) fn new(array: &Bound<'py, PyUntypedArray>, what: &str) -> PyResult<Self> {
        let (height, width, channels) = match *array.shape() {
            [height, width] => (height, width, Channels::Grey),
            [height, width, 3] => (height, width, Channels::Rgb),
            _ => {
                let shape = shape_of(array);
                return Err(value(
                    array.py(),
                    format!("{what}: expected (H, W) or (H, W, 3), got the shape {shape}"),
                ));
            }
        };
        let array = contiguous(array)?.ok_or_else(|| not_bytes(array, what))?;
        Ok(Self { array, width, height, channels })
    }

    pub(crate) fn view(&self, py: Python<'_>) -> PyResult<ImageView<'_>> {
        ImageView::new(self.width, self.height, self.channels, self.array.as_slice()?).or_raise(py)
    }
}

/// The refusal of pixels that are no bytes, which says how to make them bytes.
fn not_bytes(array: &Bound<'_, PyUntypedArray>, what: &str) -> PyErr {
    let got = dtype_of(array);
    let how = match got.as_str() {
        "uint16" => "(image >> 8).astype(np.uint8)",
        "bool" | "float16" | "float32" | "float64" => {
            "(255 * image).astype(np.uint8), if 1 is white"
        }
        _ => "image.astype(np.uint8), if 255 is white",
    };
    value(array.py(), format!("{what}: expected uint8, got {got}; convert it with {how}"))
}

/// A traverse's images, wherever they come from.
pub(crate) enum Images<'py> {
    Files(ImageFiles),
    Arrays(Vec<Pixels<'py>>),
    Sequence(Sequence),
    Traverse(surefix_simulate::Traverse),
}

impl<'py> Images<'py> {
    /// A folder or a pattern; a generated traverse; an array (n, H, W) or (n, H, W, 3); an iterable
    /// of paths or of arrays; or any other sequence of arrays, each of which is asked for when it
    /// is its turn.
    pub(crate) fn new(object: &Bound<'py, PyAny>) -> PyResult<Self> {
        let py = object.py();
        if let Ok(traverse) = object.cast::<Traverse>() {
            return Ok(Self::Traverse(traverse.get().0.clone()));
        }
        if let Some(place) = path_of(object) {
            return Ok(Self::Files(ImageFiles::find(place).or_raise(py)?));
        }
        let in_memory = object.is_instance_of::<PyList>()
            || object.is_instance_of::<PyTuple>()
            || object.is_instance_of::<PyUntypedArray>();
        if !in_memory && object.hasattr("__len__")? && object.hasattr("__getitem__")? {
            return Ok(Self::Sequence(Sequence::new(object)?));
        }
        if let Ok(array) = object.cast::<PyUntypedArray>()
            && (array.ndim() < 3 || (array.ndim() == 3 && array.shape()[2] == 3))
        {
            let (expected, got) = ("(n, H, W) or (n, H, W, 3), one image a place", shape_of(array));
            return Err(value(py, format!("images: expected {expected}, got the shape {got}")));
        }
        let not_images = |_| {
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
            object.try_iter().map_err(not_images)?.collect::<PyResult<_>>()?;
        if !items.is_empty() && items.iter().all(|item| path_of(item).is_some()) {
            return Ok(Self::Files(ImageFiles::list(items.iter().filter_map(path_of).collect())));
        }
        let arrays = items.iter().enumerate().map(|(index, item)| {
            let what = format!("image {index}");
            Pixels::new(&as_array(item, &what)?, &what)
        });
        Ok(Self::Arrays(arrays.collect::<PyResult<_>>()?))
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
            Self::Sequence(sequence) => py.detach(|| work(sequence)),
            Self::Arrays(arrays) => {
                let views =
                    arrays.iter().map(|array| array.view(py)).collect::<PyResult<Vec<_>>>()?;
                py.detach(|| work(&Views(views)))
            }
        })
    }
}

/// Images in NumPy's memory.
struct Views<'a>(Vec<ImageView<'a>>);

impl ImageSource for Views<'_> {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        let view = self.0[index];
        Image::new(view.width(), view.height(), view.channels(), view.pixels().to_vec())
    }
}

/// A Python sequence of arrays, such as a data set's images, with its `names`, if it has any.
pub(crate) struct Sequence {
    items: Py<PyAny>,
    count: usize,
    names: Option<Vec<String>>,
}

impl Sequence {
    fn new(object: &Bound<'_, PyAny>) -> PyResult<Self> {
        let count = object.len()?;
        let names =
            object.getattr("names").ok().and_then(|names| names.extract::<Vec<String>>().ok());
        let names = names.filter(|names| names.len() == count);
        Ok(Self { items: object.clone().unbind(), count, names })
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
            let view = pixels.view(py)?;
            Image::new(view.width(), view.height(), view.channels(), view.pixels().to_vec())
                .or_raise(py)
        };
        Python::attach(|py| {
            load(py).map_err(|error| {
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
pub(crate) fn path_of(object: &Bound<'_, PyAny>) -> Option<PathBuf> {
    let named =
        object.is_instance_of::<PyString>() || object.hasattr("__fspath__").unwrap_or(false);
    named.then(|| object.extract().ok()).flatten()
}

/// Reads an image file (png, jpeg, bmp, tiff, webp or pnm) with the library's own decoder.
///
/// Parameters
/// ----------
/// path : str or path
///
/// Returns
/// -------
/// array of uint8, shape (H, W) for a grey file, (H, W, 3) RGB for any other
///
/// Raises
/// ------
/// SurefixFileError
///     If the file cannot be opened.
/// SurefixValueError
///     If it is not an image that can be decoded.
#[pyfunction]
pub(crate) fn read_image(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    let image = py.detach(|| surefix::read_image(path)).or_raise(py)?;
    image_to_py(py, &image)
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
/// array of uint8, shape (H, W) for a grey image, (H, W, 3) RGB for any other
///
/// Raises
/// ------
/// SurefixValueError
///     If it is not an image that can be decoded.
#[pyfunction]
#[pyo3(signature = (data, name="image"))]
pub(crate) fn decode_image<'py>(
    py: Python<'py>,
    data: &[u8],
    name: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let image = py.detach(|| surefix::decode_image(data, name)).or_raise(py)?;
    image_to_py(py, &image)
}

/// The image files of a folder or of a pattern like ``route/*.png``, in route order: ``frame10``
/// follows ``frame9``.
///
/// Parameters
/// ----------
/// place : str or path
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
///     If it holds no images.
#[pyfunction]
pub(crate) fn find_images(py: Python<'_>, place: PathBuf) -> PyResult<Vec<OsString>> {
    let files = py.detach(|| ImageFiles::find(place)).or_raise(py)?;
    Ok(files.paths().iter().map(|path| path.as_os_str().to_owned()).collect())
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
    let result = run(&mut report)?;
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
