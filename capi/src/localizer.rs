//! The loop that a robot runs.

use std::cell::UnsafeCell;
use std::ffi::c_void;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use half::f16;
use surefix::View;

use crate::door::{ErrorText, Failure, Status, door, give, numbers, object, object_mut, take};
use crate::fix::Fix;
use crate::image::{Copies, Image};
use crate::map::Map;
use crate::options::Options;

/// Localizes along a map, one camera frame at a time.
pub struct Localizer {
    state: AtomicU8,
    inner: UnsafeCell<Inner>,
}

pub(crate) struct Inner {
    localizer: surefix::Localizer,
    copies: Copies,
}

/// It is not in use.
const FREE: u8 = 0;
/// A thread is.
const BUSY: u8 = 1;
/// A panic may have left it in the middle of a step.
const BROKEN: u8 = 2;

/// Alone with the localizer until it is dropped.
pub(crate) struct Turn<'a>(&'a Localizer);

impl Localizer {
    fn new(localizer: surefix::Localizer) -> Self {
        let inner = UnsafeCell::new(Inner { localizer, copies: Copies::default() });
        Self { state: AtomicU8::new(FREE), inner }
    }

    /// # Errors
    /// `Busy` if a thread is using it, `Internal` after a panic.
    pub(crate) fn turn(&self) -> Result<Turn<'_>, Failure> {
        let found = self.state.compare_exchange(FREE, BUSY, Ordering::Acquire, Ordering::Relaxed);
        let (status, message) = match found {
            Ok(_) => return Ok(Turn(self)),
            Err(BUSY) => (
                Status::Busy,
                "localizer: in use by another thread: give each thread its own, on one shared map",
            ),
            Err(_) => (
                Status::Internal,
                "localizer: broken by a defect in an earlier call: free it and make another",
            ),
        };
        Err(Failure { status, message: message.to_owned() })
    }
}

impl Deref for Turn<'_> {
    type Target = Inner;

    fn deref(&self) -> &Inner {
        // SAFETY: no other turn is taken before this one ends.
        unsafe { &*self.0.inner.get() }
    }
}

impl DerefMut for Turn<'_> {
    fn deref_mut(&mut self) -> &mut Inner {
        // SAFETY: no other turn is taken before this one ends.
        unsafe { &mut *self.0.inner.get() }
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        let next = if std::thread::panicking() { BROKEN } else { FREE };
        self.0.state.store(next, Ordering::Release);
    }
}

impl Inner {
    fn fix(&self, fix: &surefix::Fix) -> Fix {
        let alarm = self.localizer.alarm().is_some_and(surefix::calibration::Alarm::raised);
        Fix::new(fix, self.localizer.position(fix), alarm)
    }
}

/// The type of the numbers of a descriptor.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dtype {
    /// float.
    F32 = 0,
    /// 16-bit floats (IEEE 754 binary16).
    F16 = 1,
    /// int8_t.
    I8 = 2,
    /// uint8_t.
    U8 = 3,
}

/// A localizer on a map. Free it with surefix_localizer_free. Options may be NULL for the defaults.
/// All of its memory is allocated here but that for images, whose size the largest one sets. A map
/// of 16 MB or more is scanned by several threads, which the option `threads` limits.
///
/// Errors: SUREFIX_STATUS_ARGUMENT for an option outside its range, SUREFIX_STATUS_FORMAT for
/// settings of another map, SUREFIX_STATUS_MEMORY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_localizer_new(
    map: *const Map,
    options: *const Options,
    localizer: *mut *mut Localizer,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let (map, options) = unsafe { (object(map, "map")?, options.as_ref()) };
        let Options { settings, threads } = options.cloned().unwrap_or_default();
        let make = || {
            let made = settings.localizer(vec![Arc::clone(&map.map)])?;
            Ok(Localizer::new(with_threads(made, threads)?))
        };
        // SAFETY: the contract of the header.
        unsafe { give(localizer, make) }
    })
}

/// A localizer that goes on where a snapshot was taken, on the same map. Options are NULL for those
/// of the snapshot; else they must be the ones that it was taken with, and their threshold judges
/// from here on.
///
/// Errors: SUREFIX_STATUS_FORMAT if the bytes are damaged, of another map, of other options, or of
/// a newer version.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_localizer_restore(
    map: *const Map,
    options: *const Options,
    snapshot: *const u8,
    size: usize,
    localizer: *mut *mut Localizer,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let (map, options, snapshot) = unsafe {
            (object(map, "map")?, options.as_ref(), numbers(snapshot, size, "snapshot")?)
        };
        let make = || {
            let expected = options.map(|options| &options.settings.config);
            let mut made = surefix::Localizer::restore(Arc::clone(&map.map), snapshot, expected)?;
            if let Some(Options { settings, threads }) = options {
                settings.check_maps([&*map.map])?;
                if let Some(threshold) = &settings.threshold {
                    made = made.with_threshold(threshold.clone())?;
                }
                made = with_threads(made, *threads)?;
            }
            Ok(Localizer::new(made))
        };
        // SAFETY: the contract of the header.
        unsafe { give(localizer, make) }
    })
}

fn with_threads(
    localizer: surefix::Localizer,
    threads: Option<usize>,
) -> Result<surefix::Localizer, Failure> {
    match threads {
        None => Ok(localizer),
        threads => Ok(localizer.with_threads(threads)?),
    }
}

/// Ends a localizer. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_localizer_free(localizer: *mut Localizer) {
    // SAFETY: the contract of the header.
    unsafe { take(localizer) }
}

/// Localizes by a camera image, described as the map's own were. It allocates nothing after the
/// first image of the largest size.
///
/// advance: NULL, or the places that the robot has moved since the query before, by odometry: 0 if
/// it stands still, negative if it reverses. It is metres times places per metre of the map.
///
/// Errors: SUREFIX_STATUS_DATA for an image that is none, and if the map takes descriptors;
/// SUREFIX_STATUS_ARGUMENT for an advance that is not finite. The fix is then left alone.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_push_image(
    localizer: *mut Localizer,
    image: *const Image,
    advance: *const f64,
    fix: *mut Fix,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let (localizer, image, fix) = unsafe {
            (object(localizer, "localizer")?, object(image, "image")?, object_mut(fix, "fix")?)
        };
        let mut turn = localizer.turn()?;
        let Inner { localizer, copies } = &mut *turn;
        // SAFETY: the contract of the header.
        let (view, given) = unsafe { (image.view(copies)?, given(advance)) };
        let found = localizer.push_image_with(view, given)?;
        *fix = turn.fix(&found);
        Ok(())
    })
}

/// Localizes by a descriptor of surefix_map_descriptor_size numbers, of the map's own type, or
/// float on a map that takes no images. It allocates nothing.
///
/// type: one of surefix_dtype. advance: as for surefix_push_image.
///
/// Errors: SUREFIX_STATUS_DATA for another number of values, another type, a NaN or an infinity;
/// SUREFIX_STATUS_ARGUMENT for an advance that is not finite, or a pointer that the numbers' size
/// does not divide. The fix is then left alone.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_push_descriptor(
    localizer: *mut Localizer,
    values: *const c_void,
    count: usize,
    r#type: i32,
    advance: *const f64,
    fix: *mut Fix,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let (localizer, fix) =
            unsafe { (object(localizer, "localizer")?, object_mut(fix, "fix")?) };
        // SAFETY: the contract of the header.
        let (view, given) = unsafe { (view(values, count, r#type)?, given(advance)) };
        let mut turn = localizer.turn()?;
        let found = turn.localizer.push_descriptor_with(view, given)?;
        *fix = turn.fix(&found);
        Ok(())
    })
}

/// Says that the next frame does not follow on the one before, as after lost frames: fixes have no
/// sequence until it is full again. advance: NULL, or the places that the robot moved meanwhile.
///
/// Errors: SUREFIX_STATUS_ARGUMENT for an advance that is not finite.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_gap(
    localizer: *mut Localizer,
    advance: *const f64,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let (localizer, advance) = unsafe { (object(localizer, "localizer")?, advance.as_ref()) };
        let localizer = &mut localizer.turn()?.localizer;
        match advance {
            Some(&advance) => localizer.gap_with_advance(advance)?,
            None => localizer.gap(),
        }
        Ok(())
    })
}

/// Forgets all frames: the next one is frame 0.
///
/// Errors: none but of a NULL or a busy localizer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_reset(localizer: *mut Localizer, error: *mut ErrorText) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let localizer = unsafe { object(localizer, "localizer") }?;
        localizer.turn()?.localizer.reset();
        Ok(())
    })
}

/// The state as bytes, without the map, for surefix_localizer_restore: fixes go on with the same
/// bits. Free them with surefix_snapshot_free.
///
/// Errors: none but of a NULL or a busy localizer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_snapshot(
    localizer: *const Localizer,
    snapshot: *mut *mut u8,
    size: *mut usize,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let (localizer, snapshot, size) = unsafe {
            (
                object(localizer, "localizer")?,
                object_mut(snapshot, "snapshot")?,
                object_mut(size, "size")?,
            )
        };
        let bytes = localizer.turn()?.localizer.snapshot()?.into_boxed_slice();
        *size = bytes.len();
        *snapshot = Box::into_raw(bytes).cast();
        Ok(())
    })
}

/// Ends the bytes of a snapshot, whose size must be the one that came with them. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_snapshot_free(snapshot: *mut u8, size: usize) {
    if !snapshot.is_null() {
        // SAFETY: the contract of the header.
        drop(unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(snapshot, size)) });
    }
}

/// # Safety
/// NULL, or a number.
unsafe fn given(advance: *const f64) -> surefix::Given {
    let given = surefix::Given::default();
    // SAFETY: the caller's promise.
    unsafe { advance.as_ref() }.map_or(given, |&advance| given.advance(advance))
}

/// # Safety
/// `values` is NULL, or `count` numbers of the type.
unsafe fn view<'a>(values: *const c_void, count: usize, dtype: i32) -> Result<View<'a>, Failure> {
    let what = "descriptor";
    // SAFETY: the caller's promise.
    unsafe {
        Ok(match dtype {
            dtype if dtype == Dtype::F32 as i32 => View::F32(numbers(values.cast(), count, what)?),
            dtype if dtype == Dtype::F16 as i32 => {
                View::F16(numbers::<f16>(values.cast(), count, what)?)
            }
            dtype if dtype == Dtype::I8 as i32 => View::I8(numbers(values.cast(), count, what)?),
            dtype if dtype == Dtype::U8 as i32 => View::U8(numbers(values.cast(), count, what)?),
            other => {
                let expected = "a type of surefix_dtype, 0 to 3";
                let message = format!("descriptor: expected {expected}, got {other}");
                return Err(Failure::argument(message));
            }
        })
    }
}
