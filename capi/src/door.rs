//! What every function shares: the status, the text of an error, and no panic that leaves.

use std::any::Any;
use std::ffi::{CStr, OsStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use surefix::Error;

/// What became of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// It did what it should.
    Ok = 0,
    /// An argument or an option is not what it must be: NULL, an unknown name, outside its range.
    Argument = 1,
    /// The image or descriptor does not fit the map: its size, its type, a NaN. The next one may.
    Data = 2,
    /// The system refused a file.
    File = 3,
    /// A file or a snapshot is damaged, of a newer version, or for another map.
    Format = 4,
    /// Not enough memory.
    Memory = 5,
    /// Another thread is using this localizer.
    Busy = 6,
    /// A defect of the library. The localizer that it happened in only says so from then on.
    Internal = 7,
}

/// What went wrong in a call that failed. A call that does not fail leaves it alone.
#[repr(C)]
pub struct ErrorText {
    /// The status that the call returned.
    pub status: Status,
    /// What was expected, what came, and where. Cut if it is longer.
    pub message: [c_char; 1020],
}

/// Why a call failed.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) status: Status,
    pub(crate) message: String,
}

impl Failure {
    pub(crate) fn argument(message: impl Into<String>) -> Self {
        Self { status: Status::Argument, message: message.into() }
    }

    pub(crate) fn data(message: impl Into<String>) -> Self {
        Self { status: Status::Data, message: message.into() }
    }

    fn of_panic(panic: &(dyn Any + Send)) -> Self {
        let text = panic.downcast_ref::<&str>().copied();
        let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
        let message = format!("a defect of surefix: {}", text.unwrap_or("a panic"));
        Self { status: Status::Internal, message }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match &error {
            Error::Io { source, .. } if source.kind() == std::io::ErrorKind::OutOfMemory => {
                Status::Memory
            }
            Error::Io { .. } => Status::File,
            Error::MapFile { .. }
            | Error::MapVersion { .. }
            | Error::Snapshot { .. }
            | Error::Settings { .. } => Status::Format,
            Error::Memory { .. } | Error::MemoryLimit { .. } | Error::Copy { .. } => Status::Memory,
            Error::Length { .. }
            | Error::Shape { .. }
            | Error::NotFinite { .. }
            | Error::NoDirection { .. }
            | Error::Dtype { .. }
            | Error::NoDescriptor => Status::Data,
            _ => Status::Argument,
        };
        Self { status, message: error.to_string() }
    }
}

/// Runs the work of a function: an error, or a panic, becomes a status and its text.
pub(crate) fn door(error: *mut ErrorText, work: impl FnOnce() -> Result<(), Failure>) -> Status {
    let failure = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => return Status::Ok,
        Ok(Err(failure)) => failure,
        Err(panic) => Failure::of_panic(&*panic),
    };
    // SAFETY: NULL, or a place for an error by the contract of every function.
    if let Some(error) = unsafe { error.as_mut() } {
        error.status = failure.status;
        copy(&failure.message, &mut error.message);
    }
    failure.status
}

/// Runs the work of a function that cannot fail; if it panics, the answer is `fallback`.
pub(crate) fn getter<T>(fallback: T, work: impl FnOnce() -> T) -> T {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or(fallback)
}

/// The text, cut between two characters if it must be, and a zero byte. A zero within ends it.
fn copy(text: &str, to: &mut [c_char]) {
    let (most, more) = (to.len() - 1, "...");
    let shown = if text.len() <= most {
        [text, ""]
    } else {
        let end = (0..=most - more.len()).rev().find(|&end| text.is_char_boundary(end));
        [&text[..end.unwrap_or(0)], more]
    };
    let bytes = shown.iter().flat_map(|part| part.bytes());
    let mut to = to.iter_mut();
    for (to, byte) in to.by_ref().zip(bytes.chain([0])) {
        *to = c_char::from_ne_bytes([byte]);
    }
}

/// The object behind a pointer.
///
/// # Safety
/// NULL, or an object that nothing changes as long as the reference lives.
pub(crate) unsafe fn object<'a, T>(pointer: *const T, what: &str) -> Result<&'a T, Failure> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(what))
}

/// The object behind a pointer, to be changed.
///
/// # Safety
/// NULL, or an object that no one else uses as long as the reference lives.
pub(crate) unsafe fn object_mut<'a, T>(pointer: *mut T, what: &str) -> Result<&'a mut T, Failure> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(what))
}

/// `count` numbers behind a pointer.
///
/// # Safety
/// NULL, or `count` numbers that nothing changes as long as the slice lives.
pub(crate) unsafe fn numbers<'a, T>(
    pointer: *const T,
    count: usize,
    what: &str,
) -> Result<&'a [T], Failure> {
    if pointer.is_null() {
        return Err(null(what));
    }
    if !pointer.is_aligned() {
        let size = align_of::<T>();
        return Err(Failure::argument(format!("{what}: expected an address that {size} divides")));
    }
    if count > isize::MAX as usize / size_of::<T>() {
        return Err(Failure::argument(format!("{what}: expected fewer numbers, got {count}")));
    }
    // SAFETY: the caller's promise, and what was checked.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// Text in UTF-8.
///
/// # Safety
/// NULL, or text that ends with a zero byte.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, Failure> {
    // SAFETY: the caller's promise.
    let bytes = unsafe { c_text(pointer, what) }?;
    bytes.to_str().map_err(|_| Failure::argument(format!("{what}: expected UTF-8, got {bytes:?}")))
}

/// The name of a file: bytes on Unix, UTF-8 elsewhere.
///
/// # Safety
/// NULL, or text that ends with a zero byte.
pub(crate) unsafe fn path<'a>(pointer: *const c_char) -> Result<&'a OsStr, Failure> {
    #[cfg(unix)]
    // SAFETY: the caller's promise.
    return unsafe { c_text(pointer, "path") }
        .map(|text| std::os::unix::ffi::OsStrExt::from_bytes(text.to_bytes()));
    #[cfg(not(unix))]
    // SAFETY: the caller's promise.
    return unsafe { text(pointer, "path") }.map(OsStr::new);
}

unsafe fn c_text<'a>(pointer: *const c_char, what: &str) -> Result<&'a CStr, Failure> {
    if pointer.is_null() {
        return Err(null(what));
    }
    // SAFETY: the caller's promise.
    Ok(unsafe { CStr::from_ptr(pointer) })
}

/// Gives an object to the caller.
///
/// # Safety
/// `to` is NULL, or a place for a pointer.
pub(crate) unsafe fn give<T>(
    to: *mut *mut T,
    made: impl FnOnce() -> Result<T, Failure>,
) -> Result<(), Failure> {
    // SAFETY: the caller's promise.
    let to = unsafe { object_mut(to, "out") }?;
    *to = Box::into_raw(Box::new(made()?));
    Ok(())
}

/// Takes an object back and ends it.
///
/// # Safety
/// NULL, or an object that [`give`] gave, for the last time.
pub(crate) unsafe fn take<T>(object: *mut T) {
    if !object.is_null() {
        // SAFETY: the caller's promise.
        let object = unsafe { Box::from_raw(object) };
        getter((), || drop(object));
    }
}

fn null(what: &str) -> Failure {
    Failure::argument(format!("{what}: expected a pointer, got NULL"))
}
