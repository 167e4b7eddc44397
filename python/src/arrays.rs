//! NumPy arrays, and objects that can become one, as slices: without a copy if they are contiguous.

use half::f16;
use numpy::{
    Element, IxDyn, PyArrayDescrMethods as _, PyArrayDyn, PyArrayMethods as _, PyReadonlyArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods as _, dtype,
};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList, PySequence, PyString, PyTuple};
use surefix::{Channels, Dtype, Image, View};

use crate::error::{if_it_can, refused, value};

/// `object` as a NumPy array: itself, or by `__array__` or DLPack (a torch tensor, for one), in the
/// same memory if possible; or of a list of numbers or of arrays.
pub(crate) fn as_array<'py>(
    object: &Bound<'py, PyAny>,
    what: &str,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = object.py();
    if let Ok(array) = object.cast_exact::<PyUntypedArray>() {
        return in_native_order(array.clone());
    }
    let numpy = py.import("numpy")?;
    let converted = if object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>() {
        of_sequence(&numpy, object)
    } else if is_of_pillow(object) {
        // Upright, and in grey or RGB.
        py.import("surefix.frames.pillow")?.call_method1("array_of", (object, what))
    } else if object.hasattr("__array__")? {
        check_no_mask(object, what)?;
        numpy.call_method1("asarray", (object,))
    } else if object.hasattr("__dlpack__")? {
        numpy.call_method1("from_dlpack", (object,))
    } else {
        let kind = object
            .get_type()
            .name()
            .map_or_else(|_| "an object".to_owned(), |name| name.to_string());
        let expected = "a NumPy array, or anything with __array__ or __dlpack__";
        return Err(value(py, format!("{what}: expected {expected}, got {kind}")));
    };
    let converted = converted
        .map_err(|e| refused(py, e, |e| format!("{what}: cannot be read as a NumPy array: {e}")))?;
    in_native_order(converted.cast_into()?)
}

/// Whether it is a `PIL.Image.Image`, or of a class made from it, such as the images of pillow-heif.
pub(crate) fn is_of_pillow(object: &Bound<'_, PyAny>) -> bool {
    let classes = object.get_type().mro();
    classes.iter().any(|class| {
        class.getattr("__module__").is_ok_and(|name| name.eq("PIL.Image").unwrap_or(false))
    })
}

/// Numbers of another byte order are copied: the same numbers.
fn in_native_order(array: Bound<'_, PyUntypedArray>) -> PyResult<Bound<'_, PyUntypedArray>> {
    let dtype = array.dtype();
    if dtype.is_native_byteorder() != Some(false) {
        return Ok(array);
    }
    let native = dtype.call_method1("newbyteorder", ("=",))?;
    Ok(array.call_method1("astype", (native,))?.cast_into()?)
}

/// A list as an array. Python's own numbers have no type that anybody chose: those with a point are
/// float32 then, as descriptors are.
fn of_sequence<'py>(
    numpy: &Bound<'py, PyModule>,
    object: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let array = numpy.call_method1("asarray", (object,))?;
    let py = object.py();
    let typed = object.get_item(0).and_then(|first| first.hasattr("dtype"));
    let untyped = if_it_can(py, typed)? == Some(false);
    if untyped && array.getattr("dtype")?.getattr("name")?.eq("float64")? {
        return array.call_method1("astype", ("float32",));
    }
    Ok(array)
}

/// Refuses a masked array that hides numbers: they would be taken as if they were not.
fn check_no_mask(object: &Bound<'_, PyAny>, what: &str) -> PyResult<()> {
    let py = object.py();
    let masked = py.import("numpy.ma")?;
    if !object.is_instance(&masked.getattr("MaskedArray")?)? {
        return Ok(());
    }
    let hidden: usize = masked.call_method1("count_masked", (object,))?.extract()?;
    if hidden == 0 {
        return Ok(());
    }
    let (expected, got) = ("an array without a mask", format!("one that hides {hidden} numbers"));
    Err(value(py, format!("{what}: expected {expected}, got {got}")))
}

/// The array's shape as Python writes it.
pub(crate) fn shape_of(array: &Bound<'_, PyUntypedArray>) -> String {
    let sides: Vec<String> = array.shape().iter().map(ToString::to_string).collect();
    if let [side] = sides.as_slice() {
        format!("({side},)")
    } else {
        format!("({})", sides.join(", "))
    }
}

/// The name of the array's type, such as `float64`.
pub(crate) fn dtype_of(array: &Bound<'_, PyUntypedArray>) -> String {
    array
        .dtype()
        .str()
        .map_or_else(|_| "?".to_owned(), |name: Bound<'_, PyString>| name.to_string())
}

/// The array with numbers of the type `T`, in its own memory layout; nothing for another type.
pub(crate) fn typed<'py, T: Element>(
    array: &Bound<'py, PyUntypedArray>,
) -> Option<PyReadonlyArrayDyn<'py, T>> {
    let array = array.cast::<PyArrayDyn<T>>().ok()?;
    array.try_readonly().ok()
}

/// Whether each number lies at a multiple of its size from the first, as slices and `ndarray`
/// count, and is aligned. A field of a packed structure is not so.
fn is_regular(array: &Bound<'_, PyUntypedArray>, size: usize) -> PyResult<bool> {
    let aligned = array.getattr("flags")?.getattr("aligned")?.extract::<bool>()?;
    Ok(aligned && array.strides().iter().all(|stride| stride.unsigned_abs().is_multiple_of(size)))
}

/// The same in C order: copied only if it is not contiguous.
pub(crate) fn contiguous<'py, T: Element>(
    array: &Bound<'py, PyUntypedArray>,
) -> PyResult<Option<PyReadonlyArrayDyn<'py, T>>> {
    let py = array.py();
    // A contiguous array is regular if its first number is aligned.
    if let Ok(typed) = array.cast::<PyArrayDyn<T>>()
        && typed.is_c_contiguous()
        && typed.data().is_aligned()
        && let Ok(numbers) = typed.try_readonly()
    {
        return Ok(Some(numbers));
    }
    let wanted = dtype::<T>(py);
    if !array.dtype().is_equiv_to(&wanted) {
        return Ok(None);
    }
    // A copy: the array is strided, transposed, or not aligned.
    let copy = py.import("numpy")?.call_method1("require", (array, wanted, ["C", "A"]))?;
    Ok(typed(copy.cast::<PyUntypedArray>()?))
}

/// Float32 numbers of `axes` dimensions, in one piece.
pub(crate) fn floats<'py>(
    object: &Bound<'py, PyAny>,
    what: &str,
    axes: usize,
) -> PyResult<PyReadonlyArrayDyn<'py, f32>> {
    let array = as_array(object, what)?;
    check_axes(&array, what, axes)?;
    contiguous(&array)?.ok_or_else(|| wrong_dtype(&array, what, "float32", "float32"))
}

/// Float32 numbers of two dimensions, however they lie in memory.
pub(crate) fn matrix<'py>(
    object: &Bound<'py, PyAny>,
    what: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, f32>> {
    let array = as_array(object, what)?;
    check_axes(&array, what, 2)?;
    if is_regular(&array, size_of::<f32>())?
        && let Some(array) = typed(&array)
    {
        return Ok(array);
    }
    contiguous(&array)?.ok_or_else(|| wrong_dtype(&array, what, "float32", "float32"))
}

pub(crate) fn check_axes(
    array: &Bound<'_, PyUntypedArray>,
    what: &str,
    axes: usize,
) -> PyResult<()> {
    if array.ndim() == axes {
        return Ok(());
    }
    let shape = shape_of(array);
    Err(value(
        array.py(),
        format!("{what}: expected an array of {axes} dimension(s), got the shape {shape}"),
    ))
}

/// The refusal of a type, which says how to convert.
pub(crate) fn wrong_dtype(
    array: &Bound<'_, PyUntypedArray>,
    what: &str,
    expected: &str,
    into: &str,
) -> PyErr {
    let got = dtype_of(array);
    let message = format!(
        "{what}: expected {expected}, got {got}; convert it with array.astype(np.{into}) if that is meant"
    );
    value(array.py(), message)
}

/// Numbers of one of the descriptor types, in one piece.
pub(crate) enum Numbers<'py> {
    F32(PyReadonlyArrayDyn<'py, f32>),
    F16(PyReadonlyArrayDyn<'py, f16>),
    I8(PyReadonlyArrayDyn<'py, i8>),
    U8(PyReadonlyArrayDyn<'py, u8>),
}

impl<'py> Numbers<'py> {
    /// The array's numbers, if descriptors can have their type.
    pub(crate) fn new(array: &Bound<'py, PyUntypedArray>, what: &str) -> PyResult<Self> {
        if let Some(numbers) = contiguous(array)? {
            return Ok(Self::F32(numbers));
        }
        if let Some(numbers) = contiguous(array)? {
            return Ok(Self::U8(numbers));
        }
        if let Some(numbers) = contiguous(array)? {
            return Ok(Self::F16(numbers));
        }
        if let Some(numbers) = contiguous(array)? {
            return Ok(Self::I8(numbers));
        }
        Err(wrong_dtype(array, what, "float32, float16, int8 or uint8", "float32"))
    }

    /// The array itself.
    pub(crate) fn object(&self) -> Bound<'py, PyAny> {
        match self {
            Self::F32(v) => v.as_any().clone(),
            Self::F16(v) => v.as_any().clone(),
            Self::I8(v) => v.as_any().clone(),
            Self::U8(v) => v.as_any().clone(),
        }
    }

    pub(crate) fn view(&self) -> PyResult<View<'_>> {
        Ok(match self {
            Self::F32(v) => View::F32(v.as_slice()?),
            Self::F16(v) => View::F16(v.as_slice()?),
            Self::I8(v) => View::I8(v.as_slice()?),
            Self::U8(v) => View::U8(v.as_slice()?),
        })
    }
}

/// The array as float32, the only type that is accepted.
pub(crate) fn float32s<'py>(
    array: &Bound<'py, PyUntypedArray>,
    what: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, f32>> {
    contiguous(array)?.ok_or_else(|| wrong_dtype(array, what, "float32", "float32"))
}

/// The numbers of a query for a map: of a type that it takes.
pub(crate) fn query<'py>(
    array: &Bound<'py, PyUntypedArray>,
    what: &str,
    map: &surefix::Map,
) -> PyResult<Numbers<'py>> {
    if map.dtype() == Dtype::F32 || map.post().is_some() {
        return float32s(array, what).map(Numbers::F32);
    }
    Numbers::new(array, what)
}

/// Float64 coordinates, converted from any numbers, with their count a place.
pub(crate) fn coordinates(object: &Bound<'_, PyAny>, what: &str) -> PyResult<(Vec<f64>, usize)> {
    let py = object.py();
    let numpy = py.import("numpy")?;
    let array =
        numpy.call_method1("ascontiguousarray", (object, dtype::<f64>(py))).map_err(|e| {
            refused(py, e, |e| format!("{what}: expected numbers (n, 2) or (n, 3), got {e}"))
        })?;
    let array = array.cast::<PyUntypedArray>()?;
    check_axes(array, what, 2)?;
    let axes = array.shape()[1];
    let numbers =
        contiguous::<f64>(array)?.ok_or_else(|| wrong_dtype(array, what, "float64", "float64"))?;
    Ok((numbers.as_slice()?.to_vec(), axes))
}

/// Whole numbers of one dimension, such as the true places.
pub(crate) fn whole_numbers(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<i64>> {
    converted(object, what, "iu", ("whole numbers", "int64"))
}

/// Numbers, (m,), of any type.
pub(crate) fn numbers(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<f64>> {
    converted(object, what, "fiu", ("numbers", "float64"))
}

/// The numbers of an array or a sequence, (m,), whose NumPy kind is one of `kinds`.
fn converted<T: Element + Copy>(
    object: &Bound<'_, PyAny>,
    what: &str,
    kinds: &str,
    (expected, advice): (&str, &str),
) -> PyResult<Vec<T>> {
    let array = sequence_or_array(object, what)?;
    check_axes(&array, what, 1)?;
    let known = kinds.contains(char::from(array.dtype().kind()));
    if !known && array.len() > 0 {
        return Err(wrong_dtype(&array, what, expected, advice));
    }
    let converted = array.call_method1("astype", (dtype::<T>(array.py()),))?;
    let numbers = contiguous::<T>(converted.cast::<PyUntypedArray>()?)?;
    let numbers = numbers.ok_or_else(|| wrong_dtype(&array, what, expected, advice))?;
    Ok(numbers.as_slice()?.to_vec())
}

/// Flags of one dimension.
pub(crate) fn flags(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<bool>> {
    let array = sequence_or_array(object, what)?;
    check_axes(&array, what, 1)?;
    let flags =
        contiguous::<bool>(&array)?.ok_or_else(|| wrong_dtype(&array, what, "bool", "bool_"))?;
    Ok(flags.as_slice()?.to_vec())
}

/// Any sequence, such as a list or a range, is as good as an array for flags and truths.
pub(crate) fn sequence_or_array<'py>(
    object: &Bound<'py, PyAny>,
    what: &str,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = object.py();
    let text = object.is_instance_of::<PyString>() || object.is_instance_of::<PyBytes>();
    if !text && !object.hasattr("__array__")? && object.cast::<PySequence>().is_ok() {
        let array = py.import("numpy")?.call_method1("asarray", (object,));
        let array = array.map_err(|e| refused(py, e, |e| format!("{what}: {e}")))?;
        return array.cast_into().map_err(PyErr::from);
    }
    as_array(object, what)
}

/// `numbers` as a NumPy array of the shape `(places, dim)`.
pub(crate) fn rows_to_py<'py>(
    py: Python<'py>,
    numbers: View<'_>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    fn reshaped<'py, T: Element + Copy>(
        py: Python<'py>,
        v: &[T],
        shape: &[usize],
    ) -> PyResult<Bound<'py, PyAny>> {
        let array = numpy::PyArray1::from_slice(py, v);
        Ok(array.reshape(IxDyn(shape))?.into_any())
    }
    match numbers {
        View::F32(v) => reshaped(py, v, shape),
        View::F16(v) => reshaped(py, v, shape),
        View::I8(v) => reshaped(py, v, shape),
        View::U8(v) => reshaped(py, v, shape),
    }
}

/// An image as an array, (H, W) or (H, W, 3).
pub(crate) fn image_to_py<'py>(py: Python<'py>, image: &Image) -> PyResult<Bound<'py, PyAny>> {
    let (height, width) = (image.height(), image.width());
    let shape: &[usize] = match image.channels() {
        Channels::Grey => &[height, width],
        channels => &[height, width, channels.count()],
    };
    if image.is_deep() {
        let samples = numpy::PyArray1::from_iter(py, image.deep_samples());
        return Ok(samples.reshape(IxDyn(shape))?.into_any());
    }
    rows_to_py(py, image.pixels().into(), shape)
}
