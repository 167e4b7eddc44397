//! What only Rust can see: memory that is asked for, a panic, a second thread.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::ffi::{CStr, CString};
use std::mem::MaybeUninit;
use std::ptr;

use surefix::{Metric, Values, quiet};

use crate::door::{ErrorText, Failure, Status, door};
use crate::fix::Fix;
use crate::image::{Image, Pixels};
use crate::localizer::*;
use crate::map::*;
use crate::options::*;

#[path = "../../tests/all/counting.rs"]
mod counting;
use counting::allocations;

/// A localizer through the functions of the header.
struct Robot(*mut Localizer);

impl Robot {
    fn on(map: &surefix::Map, options: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.safetensors");
        map.save(&path).unwrap();
        let path = CString::new(path.to_str().unwrap()).unwrap();
        let (mut map, mut localizer) = (ptr::null_mut(), ptr::null_mut());
        let (mut given, none) = (ptr::null_mut(), ptr::null_mut());
        // SAFETY: what the header asks for.
        unsafe {
            assert_eq!(surefix_map_open(path.as_ptr(), &raw mut map, none), Status::Ok);
            assert_eq!(surefix_options_new(&raw mut given, none), Status::Ok);
            for (name, value) in options {
                let (name, value) = (CString::new(*name).unwrap(), CString::new(*value).unwrap());
                let done = surefix_options_set(given, name.as_ptr(), value.as_ptr(), none);
                assert_eq!(done, Status::Ok);
            }
            assert_eq!(surefix_localizer_new(map, given, &raw mut localizer, none), Status::Ok);
            surefix_options_free(given);
            surefix_map_free(map);
        }
        Self(localizer)
    }

    fn push_image(
        &self,
        pixels: &[u8],
        row: usize,
        format: Pixels,
        error: *mut ErrorText,
    ) -> Status {
        let (pixels, width, stride) = (pixels.as_ptr().cast(), 64, row);
        let image = Image { pixels, width, height: 32, stride, format: format as i32 };
        let mut fix = MaybeUninit::<Fix>::uninit();
        // SAFETY: the image has 32 rows of the stride.
        unsafe {
            surefix_push_image(self.0, &raw const image, &raw const ONE, fix.as_mut_ptr(), error)
        }
    }

    fn push_values(&self, values: &[f32], error: *mut ErrorText) -> Status {
        let (mut fix, none) = (MaybeUninit::<Fix>::uninit(), ptr::null());
        let (to, at) = (fix.as_mut_ptr(), values.as_ptr().cast());
        // SAFETY: what the header asks for.
        unsafe {
            surefix_push_descriptor(self.0, at, values.len(), Dtype::F32 as i32, none, to, error)
        }
    }
}

static ONE: f64 = 1.0;

impl Drop for Robot {
    fn drop(&mut self) {
        // SAFETY: it is the last use.
        unsafe { surefix_localizer_free(self.0) };
    }
}

fn ready() -> surefix::Map {
    let rows: Vec<f32> = (0..400).map(|at| (at * 37 % 101) as f32).collect();
    surefix::Map::from_descriptors(Values::F32(rows), 8, Metric::Euclidean).unwrap()
}

#[test]
fn a_push_allocates_nothing_after_the_first_image() {
    let pixels: Vec<u8> = (0..64 * 32 * 5).map(|at| (at * 31 % 253) as u8).collect();
    let image = |seed: usize| {
        let pixels = pixels[seed..seed + 64 * 32].to_vec();
        surefix::Image::new(64, 32, surefix::Channels::Grey, pixels).unwrap()
    };
    let images: Vec<_> = (0..30).map(image).collect();
    let map = surefix::Map::from_images(&images, surefix::Sad::default(), &mut quiet).unwrap();
    for options in [&[][..], &[("motion", "any"), ("sequence_length", "5")]] {
        let robot = Robot::on(&map, options);
        // Every way that pixels are taken: borrowed, and copied from rows with bytes between them.
        let layouts = [
            (Pixels::Bgra8, 64 * 4 + 5),
            (Pixels::Rgb8, 64 * 3),
            (Pixels::Bgr8, 64 * 3),
            (Pixels::Rgba8, 64 * 4),
            (Pixels::Grey8, 64),
            (Pixels::Grey8, 70),
            (Pixels::Grey16, 64 * 2 + 1),
        ];
        let drive = || {
            for (format, row) in layouts {
                assert_eq!(robot.push_image(&pixels, row, format, ptr::null_mut()), Status::Ok);
            }
        };
        drive();
        assert_eq!(allocations(drive), 0);
    }
}

#[test]
fn a_descriptor_allocates_nothing_from_the_start() {
    for options in [&[][..], &[("motion", "free")]] {
        let robot = Robot::on(&ready(), options);
        let values = [1.0, 9.0, 3.0, 5.0, 2.0, 8.0, 4.0, 7.0];
        let calls = allocations(|| {
            for _ in 0..20 {
                assert_eq!(robot.push_values(&values, ptr::null_mut()), Status::Ok);
            }
        });
        assert_eq!(calls, 0);
    }
}

fn text(error: &ErrorText) -> &str {
    // SAFETY: it ends with a zero byte.
    unsafe { CStr::from_ptr(error.message.as_ptr()) }.to_str().unwrap()
}

#[test]
fn a_panic_is_a_status_and_words() {
    let mut error = ErrorText { status: Status::Ok, message: [1; 1020] };
    let status = door(&raw mut error, || panic!("number {}", 7));
    assert_eq!((status, error.status), (Status::Internal, Status::Internal));
    assert_eq!(text(&error), "a defect of surefix: number 7");
    assert_eq!(door(ptr::null_mut(), || std::panic::panic_any(3)), Status::Internal);
    // A long text is cut between two characters.
    door(&raw mut error, || Err(Failure::data("é".repeat(1000))));
    assert_eq!(text(&error), format!("{}...", "é".repeat(508)));
    // One that just fits is not.
    door(&raw mut error, || Err(Failure::data("n".repeat(1019))));
    assert_eq!(text(&error), "n".repeat(1019));
}

#[test]
fn a_localizer_that_is_busy_or_broken_says_so() {
    let (robot, values) = (Robot::on(&ready(), &[]), [1.0; 8]);
    let mut error = ErrorText { status: Status::Ok, message: [0; 1020] };
    // SAFETY: it is not freed yet.
    let localizer = unsafe { &*robot.0 };
    let turn = localizer.turn().unwrap();
    assert_eq!(robot.push_values(&values, &raw mut error), Status::Busy);
    assert!(text(&error).contains("in use by another thread"));
    drop(turn);
    assert_eq!(robot.push_values(&values, &raw mut error), Status::Ok);
    let status = door(&raw mut error, || {
        let _turn = localizer.turn()?;
        panic!("half way");
    });
    assert_eq!(status, Status::Internal);
    for _ in 0..2 {
        assert_eq!(robot.push_values(&values, &raw mut error), Status::Internal);
        assert!(text(&error).contains("broken by a defect in an earlier call"));
    }
}
