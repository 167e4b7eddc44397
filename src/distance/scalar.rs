//! The plain kernels: no instruction set assumed, and the oracle for those that assume one.
//!
//! Bytes are compared in exact integer arithmetic. Floats are subtracted and summed in f64, so a distance is
//! the true one rounded to f32, up to one unit in the last place.

use half::f16;
use half::slice::HalfFloatSliceExt as _;

use super::{Metric, Rows, View, each_type};
use crate::error::Error;

/// How many numbers are widened to f32 at a time.
const BLOCK: usize = 256;
/// How many sums run side by side, so that the compiler can use vector registers.
const LANES: usize = 8;

/// A number that a block of which can be read as f32.
pub(super) trait Widen: Copy {
    /// The block as f32, in `space` where it must be converted.
    fn widen<'a>(block: &'a [Self], space: &'a mut [f32; BLOCK]) -> &'a [f32];
}

impl Widen for f32 {
    fn widen<'a>(block: &'a [Self], _: &'a mut [f32; BLOCK]) -> &'a [f32] {
        block
    }
}

impl Widen for f16 {
    fn widen<'a>(block: &'a [Self], space: &'a mut [f32; BLOCK]) -> &'a [f32] {
        let space = &mut space[..block.len()];
        block.convert_to_f32_slice(space);
        space
    }
}

macro_rules! widen_bytes {
    ($($byte:ty),*) => {$(
        impl Widen for $byte {
            fn widen<'a>(block: &'a [Self], space: &'a mut [f32; BLOCK]) -> &'a [f32] {
                let space = &mut space[..block.len()];
                for (wide, &byte) in space.iter_mut().zip(block) {
                    *wide = f32::from(byte);
                }
                space
            }
        }
    )*};
}
widen_bytes!(i8, u8);

/// A byte, signed or not, whose differences and products are whole numbers.
pub(super) trait Byte: Copy {
    fn difference(self, other: Self) -> u32;
    fn product(self, other: Self) -> i32;
}

impl Byte for u8 {
    fn difference(self, other: Self) -> u32 {
        u32::from(self.abs_diff(other))
    }
    fn product(self, other: Self) -> i32 {
        i32::from(self) * i32::from(other)
    }
}

impl Byte for i8 {
    fn difference(self, other: Self) -> u32 {
        u32::from(self.abs_diff(other))
    }
    fn product(self, other: Self) -> i32 {
        i32::from(self) * i32::from(other)
    }
}

/// A block of bytes whose sum of products (each at most 2^16) stays inside 31 bits.
const BYTES: usize = 1 << 14;

fn sum_of_differences<T: Byte>(a: &[T], b: &[T]) -> u64 {
    let blocks = a.chunks(BYTES).zip(b.chunks(BYTES));
    blocks.map(|(a, b)| a.iter().zip(b).map(|(&a, &b)| a.difference(b)).sum::<u32>() as u64).sum()
}

fn sum_of_squares<T: Byte>(a: &[T], b: &[T]) -> u64 {
    let square = |(&a, &b): (&T, &T)| {
        let difference = a.difference(b);
        difference * difference
    };
    let blocks = a.chunks(BYTES).zip(b.chunks(BYTES));
    blocks.map(|(a, b)| a.iter().zip(b).map(square).sum::<u32>() as u64).sum()
}

fn sum_of_products<T: Byte>(a: &[T], b: &[T]) -> i64 {
    let blocks = a.chunks(BYTES).zip(b.chunks(BYTES));
    blocks.map(|(a, b)| a.iter().zip(b).map(|(&a, &b)| a.product(b)).sum::<i32>() as i64).sum()
}

/// The distances of bytes to bytes, exact until the one rounding at the end.
pub(super) fn integer<T: Byte>(
    query: &[T],
    values: &[T],
    rows: Rows<'_>,
    out: &mut [f32],
) -> Result<(), Error> {
    let each_row = values.chunks_exact(rows.dim).zip(out);
    match rows.metric {
        Metric::Manhattan => {
            let count = rows.dim as f64 * rows.unit;
            each_row.for_each(|(row, d)| *d = (sum_of_differences(query, row) as f64 / count) as f32);
        }
        Metric::Euclidean => {
            let length = |row| (sum_of_squares(query, row) as f64).sqrt();
            each_row.for_each(|(row, d)| *d = (length(row) / rows.unit) as f32);
        }
        Metric::Cosine => {
            let length = direction((sum_of_products(query, query) as f64).sqrt())?;
            for ((row, d), norm) in each_row.zip(rows.norms) {
                *d = cosine(sum_of_products(query, row) as f64, length, *norm);
            }
        }
    }
    Ok(())
}

/// The distances of float numbers (or of floats to bytes), summed in f64.
pub(super) fn float<Q: Widen, R: Widen>(
    query: &[Q],
    values: &[R],
    rows: Rows<'_>,
    out: &mut [f32],
) -> Result<(), Error> {
    let each_row = values.chunks_exact(rows.dim).zip(out);
    match rows.metric {
        Metric::Manhattan => {
            let count = rows.dim as f64 * rows.unit;
            let total = |row| sum(query, row, |a, b| (a - b).abs());
            each_row.for_each(|(row, d)| *d = (total(row) / count) as f32);
        }
        Metric::Euclidean => {
            let total = |row| sum(query, row, |a, b| (a - b) * (a - b));
            each_row.for_each(|(row, d)| *d = (total(row).sqrt() / rows.unit) as f32);
        }
        Metric::Cosine => {
            let length = direction(sum(query, query, |a, b| a * b).sqrt())?;
            for ((row, d), norm) in each_row.zip(rows.norms) {
                *d = cosine(sum(query, row, |a, b| a * b), length, *norm);
            }
        }
    }
    Ok(())
}

/// The euclidean length of a row.
pub(crate) fn norm(row: View<'_>) -> f64 {
    each_type!(View, row, v => sum(v, v, |a, b| a * b)).sqrt()
}

fn direction(length: f64) -> Result<f64, Error> {
    if length > 0.0 { Ok(length) } else { Err(Error::NoDirection { what: "descriptor", row: None }) }
}

fn cosine(product: f64, query: f64, row: f64) -> f32 {
    (1.0 - product / (query * row)).clamp(0.0, 2.0) as f32
}

/// The sum of `term(a, b)` over two vectors of one length, in f64, several lanes at a time.
fn sum<A: Widen, B: Widen>(a: &[A], b: &[B], term: impl Fn(f64, f64) -> f64) -> f64 {
    let (mut space_a, mut space_b) = ([0.0; BLOCK], [0.0; BLOCK]);
    let mut lanes = [0.0; LANES];
    for (a, b) in a.chunks(BLOCK).zip(b.chunks(BLOCK)) {
        let (a, b) = (A::widen(a, &mut space_a), B::widen(b, &mut space_b));
        let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
        for (lane, (&a, &b)) in lanes.iter_mut().zip(a.remainder().iter().zip(b.remainder())) {
            *lane += term(f64::from(a), f64::from(b));
        }
        for (a, b) in a.zip(b) {
            for (lane, (&a, &b)) in lanes.iter_mut().zip(a.iter().zip(b)) {
                *lane += term(f64::from(a), f64::from(b));
            }
        }
    }
    lanes.iter().sum()
}
