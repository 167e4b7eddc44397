//! Distances between a query's descriptor and every row of a map (method 1.6).
//!
//! Manhattan and euclidean distances are computed by direct differences: the expansion
//! `|a|^2 + |b|^2 - 2ab` loses its digits near zero, the range of matches.
//!
//! # Instruction sets
//!
//! The sums are computed with the registers of an [`Isa`], chosen once a call: AVX-512 (with VNNI
//! for the products of signed bytes), AVX2, NEON, or plain Rust. All of them give the same
//! distances, bit for bit:
//!
//! - Bytes against bytes of their own type are summed as whole numbers. There is one exact sum,
//!   whatever the order.
//! - Floats, and floats against bytes, are subtracted as f32. The terms are widened to f64 and
//!   summed in sixteen sums: number `i` is added to sum `i` modulo 16, in order of `i`, and the
//!   sums are then added by halves (8 to 8, 4 to 4, 2 to 2, 1 to 1). A wider register holds more of
//!   the sixteen, and that is all that it changes. Squares, and the products of the cosine, may be
//!   fused with their addition or not: two numbers of 24 bits have a product of 48, which f64 holds
//!   as it is.
//!
//! In which order rows are read, and how far ahead memory is prefetched, is learned from the times
//! that scans of large maps take ([`Tuning`]). It changes the speed only.
//!
//! So a manhattan or euclidean distance has the relative error of its differences, at most `2^-24`,
//! that of its f64 sum, at most `(dim / 16 + 8) 2^-53`, and then the one rounding to f32: up to
//! tens of millions of numbers a row it is within two units in the last place of the true one. The
//! cosine has the error of its sum absolutely, as `1 - x` has.

#![allow(
    clippy::inline_always,
    reason = "what is inlined is compiled for the caller's instruction set"
)]

mod metric;
mod padded;
mod scan;
mod term;
#[cfg(test)]
mod tests;
mod tuning;

use crate::dtype::Dtype;
use crate::error::Error;
use crate::numbers::{View, each_type};
use crate::simd::{Byte, Isa, Number};
use term::{Differences, Products, Squares};

pub use metric::Metric;
pub(crate) use tuning::Tuning;

/// The rows of a map as the kernels see them.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    pub(crate) values: View<'a>,
    pub(crate) dim: usize,
    pub(crate) metric: Metric,
    /// One unit of distance, in the numbers of the rows: 32 for SAD in u8, else 1.
    pub(crate) unit: f64,
    /// The length of each row, for the cosine; else empty.
    pub(crate) norms: &'a [f64],
    /// The instruction set of the kernels. It decides the speed only.
    pub(crate) isa: Isa,
    /// How they read the rows. It decides the speed only, too.
    pub(crate) tuning: Tuning,
}

/// A query that has been checked: it can be compared with the rows of a map.
#[derive(Clone, Copy)]
pub(crate) struct Query<'a> {
    pub(crate) numbers: View<'a>,
    /// Its length, for the cosine; else 0.
    pub(crate) length: f64,
}

impl<'a> Query<'a> {
    /// A query is float32, or of the rows' own type. The caller has checked its length.
    ///
    /// # Errors
    /// [`Error::Dtype`] for another type, [`Error::NotFinite`] for a NaN or an infinity,
    /// [`Error::NoDirection`] for a cosine of zeros.
    pub(crate) fn new(numbers: View<'a>, rows: Rows<'_>) -> Result<Self, Error> {
        let what = "descriptor";
        numbers.check_finite(what, rows.dim)?;
        let (map, got) = (rows.values.dtype(), numbers.dtype());
        if got != map && got != Dtype::F32 {
            return Err(Error::Dtype { what, map, or_float: true, got });
        }
        let length = match rows.metric {
            Metric::Cosine => norm_on(numbers, rows.isa),
            Metric::Manhattan | Metric::Euclidean => 0.0,
        };
        if rows.metric == Metric::Cosine && length == 0.0 {
            return Err(Error::NoDirection { what, row: None });
        }
        Ok(Self { numbers, length })
    }
}

/// Writes the distance from `query` to each row into `out`, which has a number for each.
pub(crate) fn distances(query: Query<'_>, rows: Rows<'_>, out: &mut [f32]) {
    let Query { numbers, length } = query;
    match (numbers, rows.values) {
        (View::U8(q), View::U8(r)) => bytes(q, r, length, rows, out),
        (View::I8(q), View::I8(r)) => bytes(q, r, length, rows, out),
        (View::F16(q), View::F16(r)) => floats(q, r, length, rows, out),
        (View::F32(q), values) => each_type!(View, values, r => floats(q, r, length, rows, out)),
        // No such query is made.
        _ => out.fill(f32::NAN),
    }
}

/// Writes the sum of the products of `query`, numbers of up to 14 bits, with each row of signed
/// bytes into `out`, which has a number for each row: the exact sum, rounded once.
pub(crate) fn short_products(how: (Isa, Tuning), query: &[i16], rows: &[i8], out: &mut [f32]) {
    scan::shorts(how, query, rows, out, |_, sum| sum as f32);
}

/// Writes the product of `vector` with each row into `out`, which has a number for each row: summed
/// in f64, rounded once.
pub(crate) fn products(isa: Isa, vector: &[f32], rows: &[f32], out: &mut [f32]) {
    let how = (isa, Tuning::of(size_of_val(rows)));
    scan::floats::<Products, _, _, _>(how, vector, rows, out, |_, sum| sum as f32);
}

/// The same, not rounded.
#[cfg(feature = "pca")]
pub(crate) fn wide_products(isa: Isa, vector: &[f32], rows: &[f32], out: &mut [f64]) {
    let how = (isa, Tuning::of(size_of_val(rows)));
    scan::floats::<Products, _, _, _>(how, vector, rows, out, |_, sum| sum);
}

/// The distances of bytes to bytes, exact until the one rounding at the end.
fn bytes<B: Byte>(query: &[B], values: &[B], length: f64, rows: Rows<'_>, out: &mut [f32]) {
    let Rows { dim, metric, unit, norms, isa, tuning, .. } = rows;
    let how = (isa, tuning);
    match metric {
        Metric::Manhattan => {
            let count = dim as f64 * unit;
            scan::bytes::<Differences, _, _>(how, query, values, out, |_, sum| {
                (sum as f64 / count) as f32
            });
        }
        Metric::Euclidean => {
            let finish = |_, sum| ((sum as f64).sqrt() / unit) as f32;
            scan::bytes::<Squares, _, _>(how, query, values, out, finish);
        }
        Metric::Cosine => {
            let finish = |row: usize, sum| cosine(sum as f64, length, norms[row]);
            scan::bytes::<Products, _, _>(how, query, values, out, finish);
        }
    }
}

/// The distances of floats to floats or to bytes, subtracted in f32 and summed in f64.
fn floats<Q: Number, R: Number>(
    query: &[Q],
    values: &[R],
    length: f64,
    rows: Rows<'_>,
    out: &mut [f32],
) {
    let Rows { dim, metric, unit, norms, isa, tuning, .. } = rows;
    let how = (isa, tuning);
    match metric {
        Metric::Manhattan => {
            let count = dim as f64 * unit;
            scan::floats::<Differences, _, _, _>(how, query, values, out, |_, sum| {
                (sum / count) as f32
            });
        }
        Metric::Euclidean => {
            let finish = |_, sum: f64| (sum.sqrt() / unit) as f32;
            scan::floats::<Squares, _, _, _>(how, query, values, out, finish);
        }
        Metric::Cosine => {
            let finish = |row: usize, sum| cosine(sum, length, norms[row]);
            scan::floats::<Products, _, _, _>(how, query, values, out, finish);
        }
    }
}

fn cosine(product: f64, query: f64, row: f64) -> f32 {
    (1.0 - product / (query * row)).clamp(0.0, 2.0) as f32
}

/// The euclidean length of a row.
pub(crate) fn norm(row: View<'_>) -> f64 {
    norm_on(row, Isa::best())
}

fn norm_on(row: View<'_>, isa: Isa) -> f64 {
    let mut square = [0.0];
    let how = (isa, Tuning::of(row.bytes().len()));
    match row {
        View::U8(v) => scan::bytes::<Products, _, _>(how, v, v, &mut square, |_, sum| sum as f64),
        View::I8(v) => scan::bytes::<Products, _, _>(how, v, v, &mut square, |_, sum| sum as f64),
        View::F16(v) => scan::floats::<Products, _, _, _>(how, v, v, &mut square, |_, sum| sum),
        View::F32(v) => scan::floats::<Products, _, _, _>(how, v, v, &mut square, |_, sum| sum),
    }
    square[0].sqrt()
}
