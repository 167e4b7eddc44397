//! A camera's buffer as an image: borrowed if its pixels are as the crate takes them, else copied
//! into memory that is kept.

use std::ffi::c_void;

use surefix::{Channels, ImageView};

use crate::door::{Failure, numbers};

/// A side that is longer is not meant.
const MAX_SIDE: usize = 65_535;

/// How a camera lays a pixel out.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pixels {
    /// One byte: brightness.
    Grey8 = 0,
    /// Two bytes in the machine's order, as of a thermal camera. The map says which range of them
    /// is black to white.
    Grey16 = 1,
    /// Three bytes: red, green, blue.
    Rgb8 = 2,
    /// Three bytes: blue, green, red, as of OpenCV.
    Bgr8 = 3,
    /// Four bytes: red, green, blue, and one that is not looked at.
    Rgba8 = 4,
    /// Four bytes: blue, green, red, and one that is not looked at.
    Bgra8 = 5,
}

/// An image in the caller's memory, row by row from the top left. It is read during the call only.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Image {
    /// The first pixel.
    pub pixels: *const c_void,
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Bytes from one row to the next; 0 if no bytes lie between them.
    pub stride: usize,
    /// One of surefix_pixels.
    pub format: i32,
}

/// Memory for images that are not as the crate takes them. It grows to the largest.
#[derive(Debug, Default)]
pub(crate) struct Copies {
    bytes: Vec<u8>,
    samples: Vec<u16>,
}

impl Pixels {
    const ALL: [Self; 6] =
        [Self::Grey8, Self::Grey16, Self::Rgb8, Self::Bgr8, Self::Rgba8, Self::Bgra8];

    fn of(format: i32) -> Result<Self, Failure> {
        let known = Self::ALL.into_iter().find(|known| *known as i32 == format);
        known.ok_or_else(|| {
            let last = Self::ALL.len() - 1;
            Failure::argument(format!(
                "image: expected a format of surefix_pixels, 0 to {last}, got {format}"
            ))
        })
    }

    /// Bytes a pixel.
    fn size(self) -> usize {
        match self {
            Self::Grey8 => 1,
            Self::Grey16 => 2,
            Self::Rgb8 | Self::Bgr8 => 3,
            Self::Rgba8 | Self::Bgra8 => 4,
        }
    }
}

impl Image {
    /// The image as the crate takes it.
    ///
    /// # Safety
    /// `pixels` is NULL or good for all rows.
    pub(crate) unsafe fn view<'a>(
        &'a self,
        copies: &'a mut Copies,
    ) -> Result<ImageView<'a>, Failure> {
        let &Self { pixels, width, height, stride, format } = self;
        let format = Pixels::of(format)?;
        if ![width, height].iter().all(|side| (1..=MAX_SIDE).contains(side)) {
            let expected = format!("sides of 1 to {MAX_SIDE} pixels");
            return Err(Failure::data(format!(
                "image: expected {expected}, got {width} x {height}"
            )));
        }
        let row = width * format.size();
        let step = if stride == 0 { row } else { stride };
        if step < row {
            let expected = format!("{row} bytes or more, {width} pixels of {}", format.size());
            let message = format!("image: expected a stride of {expected}, got {step}");
            return Err(Failure::data(message));
        }
        let length = step.checked_mul(height - 1).and_then(|before| before.checked_add(row));
        let length = length.ok_or_else(|| {
            Failure::data(format!("image: expected a stride that fits into memory, got {step}"))
        })?;
        // SAFETY: the caller's promise.
        let bytes = unsafe { numbers(pixels.cast::<u8>(), length, "image: pixels") }?;
        let rows = || bytes.chunks(step).map(|chunk| &chunk[..row]);
        let tight = step == row;
        let view = match format {
            Pixels::Grey8 if tight => ImageView::new(width, height, Channels::Grey, bytes),
            Pixels::Rgb8 if tight => ImageView::new(width, height, Channels::Rgb, bytes),
            Pixels::Grey16 => {
                // SAFETY: each pair of bytes is a number.
                let (before, samples, after) = unsafe { bytes.align_to::<u16>() };
                if tight && before.is_empty() && after.is_empty() {
                    ImageView::new_deep(width, height, Channels::Grey, samples)
                } else {
                    copies.samples.clear();
                    for row in rows() {
                        let pairs = row.as_chunks::<2>().0;
                        copies.samples.extend(pairs.iter().map(|&pair| u16::from_ne_bytes(pair)));
                    }
                    ImageView::new_deep(width, height, Channels::Grey, &copies.samples)
                }
            }
            Pixels::Grey8 => {
                let copied = copies.of(rows(), row, <[u8]>::clone_from_slice);
                ImageView::new(width, height, Channels::Grey, copied)
            }
            Pixels::Rgb8 | Pixels::Bgr8 | Pixels::Rgba8 | Pixels::Bgra8 => {
                let copy = match format {
                    Pixels::Rgb8 => <[u8]>::clone_from_slice,
                    Pixels::Bgr8 => of_bgr,
                    Pixels::Rgba8 => |to: &mut [u8], from: &[u8]| {
                        each(to, from, |&[r, g, b, _]: &[u8; 4]| [r, g, b]);
                    },
                    _ => |to: &mut [u8], from: &[u8]| {
                        each(to, from, |&[b, g, r, _]: &[u8; 4]| [r, g, b]);
                    },
                };
                let copied = copies.of(rows(), 3 * width, copy);
                ImageView::new(width, height, Channels::Rgb, copied)
            }
        };
        Ok(view?)
    }
}

impl Copies {
    /// All rows, as rows of `size` bytes, by `copy(to, from)`.
    fn of<'b>(
        &mut self,
        rows: impl ExactSizeIterator<Item = &'b [u8]>,
        size: usize,
        copy: impl Fn(&mut [u8], &[u8]),
    ) -> &[u8] {
        self.bytes.resize(rows.len() * size, 0);
        for (to, from) in self.bytes.chunks_exact_mut(size).zip(rows) {
            copy(to, from);
        }
        &self.bytes
    }
}

/// Each pixel of a row, turned.
fn each<const FROM: usize>(to: &mut [u8], from: &[u8], turn: impl Fn(&[u8; FROM]) -> [u8; 3]) {
    let pixels = from.as_chunks::<FROM>().0;
    for (to, pixel) in to.as_chunks_mut::<3>().0.iter_mut().zip(pixels) {
        *to = turn(pixel);
    }
}

/// A row of RGB of one of BGR: four pixels at a time in three words, which vector registers hold.
/// Byte by byte it would take as long as all the rest of a push.
fn of_bgr(to: &mut [u8], from: &[u8]) {
    let (to, to_rest) = to.as_chunks_mut::<12>();
    let (from, from_rest) = from.as_chunks::<12>();
    for (to, from) in to.iter_mut().zip(from) {
        let word =
            |at: usize| u32::from_le_bytes([from[at], from[at + 1], from[at + 2], from[at + 3]]);
        // From the first byte to the last: b g r b, g r b g, r b g r.
        let (x, y, z) = (word(0), word(4), word(8));
        let byte = |word: u32, at: u32, to: u32| ((word >> (8 * at)) & 0xFF) << (8 * to);
        let first = byte(x, 2, 0) | (x & 0xFF00) | byte(x, 0, 2) | byte(y, 1, 3);
        let second = byte(y, 0, 0) | byte(x, 3, 1) | byte(z, 0, 2) | (y & 0xFF00_0000);
        let third = byte(y, 2, 0) | byte(z, 3, 1) | (z & 0x00FF_0000) | byte(z, 1, 3);
        to[..4].copy_from_slice(&first.to_le_bytes());
        to[4..8].copy_from_slice(&second.to_le_bytes());
        to[8..].copy_from_slice(&third.to_le_bytes());
    }
    each(to_rest, from_rest, |&[b, g, r]: &[u8; 3]| [r, g, b]);
}
