//! Screens: bounds of distances from a scan of the map's codes, a quarter of the bytes of its rows
//! (method 2.1).
//!
//! Most rows of a large map are far from being a query's nearest, and bounds show that as well as
//! distances do. A row's code leaves out a remainder whose length is known. By the triangle's
//! inequality and by that of Cauchy and Schwarz, this length limits how far the distance can be
//! from the one to the code. Only rows whose bounds leave a doubt are then read.

#![allow(clippy::inline_always, reason = "inlined functions are compiled for the instruction set")]

use std::ops::{Add as _, Range};

use crate::distance::{Metric, Query, Tuning, short_products};
use crate::dtype::Dtype;
use crate::error::Error;
use crate::map::{Codes, Map, Storage};
use crate::numbers::View;
use crate::parallel::{each, each_row};
use crate::simd::Isa;

/// The largest code of a row's number, on both sides of 0.
const CODE: f64 = 127.0;
/// The largest code of a query's number: 14 bits with the sign, so that a kernel's sums of products
/// do not overflow.
const QUERY_CODE: f64 = 8191.0;
/// Rows whose ranges are found at a time.
const ROWS: usize = 1024;
/// A frame with larger distances is not screened. Sums of smaller ones do not overflow.
pub(crate) const MAX_SCREENED: f32 = 1e30;
/// Twice the relative error of a number that was rounded to float32.
const ROUNDED: f64 = 1.0 / (1 << 23) as f64;

/// A query as codes, and the terms of its bounds: memory that is used again for each query.
#[derive(Clone, Debug)]
pub(crate) struct EncodedQuery {
    /// The query's numbers, times the scales, in units of `step`.
    pub(crate) codes: Vec<i16>,
    step: f64,
    /// The part that does not depend on the row: of the product with it, or of the squared
    /// distance.
    constant: f64,
    /// The error that the codes of the query, and rounding, can cause.
    slack: f64,
    /// The query's length, for the euclidean distance less the offsets.
    length: f64,
}

impl EncodedQuery {
    pub(crate) fn new(dim: usize) -> Self {
        Self { codes: vec![0; dim], step: 0.0, constant: 0.0, slack: 0.0, length: 0.0 }
    }
}

impl Map {
    /// The same map with a screen: a copy of its rows in signed bytes, a quarter more memory. A
    /// [`Localizer`](crate::Localizer) scans those, which gives bounds of each distance, and reads
    /// only the rows whose bounds leave a doubt. Its answers are the same as without, to the last
    /// bit.
    ///
    /// This pays if the map is larger than the cache and its places differ: a push then costs
    /// little more than the scan of the bytes. If it does not pay, the localizer notices, and
    /// scans the rows for a while before it tries again. Rows of fewer than 256 numbers are always
    /// scanned as they are, and so is a map of several traverses. In the worst case one push computes
    /// the distances of all queries of the window, once: for a bound on every push, do without. A
    /// screen is not saved with the map: making it takes about as long as a few pushes.
    ///
    /// ```
    /// use surefix::{Dtype, Map, Metric};
    /// let map = Map::from_descriptors(vec![0.0_f32, 1.0, 1.0, 0.0], 2, Metric::Cosine)?;
    /// let map = map.with_screen(Dtype::I8)?;
    /// assert_eq!(map.screen(), Some(Dtype::I8));
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Option`] for another type than `I8`, for a map of other numbers than float32, for
    /// the manhattan distance, and if there is not enough memory; [`Error::NotFinite`] for a NaN or
    /// an infinity in a mapped map.
    pub fn with_screen(self, dtype: Dtype) -> Result<Self, Error> {
        let refused = |expected: &str, got: String| {
            Err(Error::Option { name: "screen", expected: expected.to_owned(), got })
        };
        if dtype != Dtype::I8 {
            return refused("int8, \"i8\"", dtype.to_string());
        }
        if self.dtype() != Dtype::F32 {
            return refused("a map of float32 descriptors", format!("one of {}", self.dtype()));
        }
        if self.metric() == Metric::Manhattan {
            return refused(
                "a map for the euclidean distance or the cosine",
                format!("one for {}", self.metric()),
            );
        }
        self.blocks().check_finite("descriptors")?;
        let Some(codes) = Codes::of(&self)? else {
            return refused("memory for a quarter more", "none left".to_owned());
        };
        Ok(self.with_codes(codes))
    }

    /// The type of the screen's numbers, if the map has a screen.
    pub fn screen(&self) -> Option<Dtype> {
        self.codes().map(|codes| codes.rows.view().dtype())
    }

    /// Writes the bounds of each distance, from the sums of [`Codes::scan`]. True if all of them
    /// are below [`MAX_SCREENED`].
    pub(crate) fn bounds(
        &self,
        query: &EncodedQuery,
        sums: &[f32],
        low: &mut [f32],
        high: &mut [f32],
    ) -> bool {
        let Some(codes) = self.codes() else { return false };
        match self.metric() {
            Metric::Cosine => self.each_block(0..self.places(), |rows, at| {
                let (low, high) = (&mut low[at.clone()], &mut high[at.clone()]);
                let sums = &sums[at.clone()];
                self.isa().run(|| codes.cosines(query, rows.norms, at, sums, low, high));
            }),
            _ => self.isa().run(|| codes.euclideans(query, sums, low, high)),
        }
        high.iter().fold(true, |near, &d| near & (d < MAX_SCREENED))
    }
}

/// More than the relative error of any sum of `dim` terms here, and of a kernel's.
fn rounding(dim: usize) -> f64 {
    (dim + 64) as f64 * 4.0 * f64::EPSILON
}

/// Squared lengths that belong to a row of codes.
#[derive(Clone, Copy, Default)]
struct Coded {
    /// Of the remainder that the codes leave out.
    error: f64,
    /// Of `scale * code`, and of the row less the offsets.
    square: f64,
    row_square: f64,
    /// Of the codes.
    length: f64,
}

impl Codes {
    /// The codes of a map's rows, which are finite; `None` if there is no memory for them.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the work is to stop.
    fn of(map: &Map) -> Result<Option<Self>, Error> {
        let (isa, dim) = (map.isa(), map.dim());
        let (least, most) = ranges(map)?;
        let half = |sign: f64| {
            let ends = least.iter().zip(&most);
            ends.map(|(&least, &most)| 0.5 * (f64::from(most) + sign * f64::from(least)))
                .collect::<Vec<f64>>()
        };
        let offset = half(1.0);
        let scale: Vec<f64> = half(-1.0).into_iter().map(|half| half / CODE).collect();
        let rounding = rounding(dim);
        let reach = offset
            .iter()
            .zip(&scale)
            .map(|(offset, scale)| (offset.abs() + (CODE + 1.0) * scale).powi(2));
        let extent = reach.sum::<f64>().sqrt();
        let room = Storage::try_zeros(Dtype::I8, map.blocks().rows() * dim);
        let Some(mut codes) = room else { return Ok(None) };
        let made = each_row(codes.bytes_mut(), dim, |row, codes| {
            let Some(View::F32(numbers)) = map.blocks().row(row) else {
                return Ok(Coded::default());
            };
            Ok(isa.run(|| encode(numbers, &offset, &scale, bytemuck::must_cast_slice_mut(codes))))
        })?;
        let longest = made.iter().map(|row| row.length).fold(0.0, f64::max).sqrt();
        let error = made
            .iter()
            .map(|row| row.error.sqrt() * (1.0 + rounding) + rounding * extent)
            .collect();
        let square = made.iter().map(|row| row.square).collect();
        let row_square = made.iter().map(|row| row.row_square).collect();
        Ok(Some(Self { rows: codes, offset, scale, error, square, row_square, longest, extent }))
    }

    /// Encodes a query of float32.
    pub(crate) fn encode(
        &self,
        isa: Isa,
        metric: Metric,
        query: Query<'_>,
        encoded: &mut EncodedQuery,
    ) {
        let View::F32(numbers) = query.numbers else { return };
        let centred = metric != Metric::Cosine;
        let Sums { step, constant, scaled, rest } =
            isa.run(|| self.encode_query(numbers, centred, &mut encoded.codes));
        let rounding = rounding(self.offset.len());
        // The error of the product of the codes: Cauchy and Schwarz, for the remainder that the
        // query's codes leave out.
        let codes = (rest * (1.0 + rounding) + rounding * scaled) * self.longest;
        encoded.slack = if centred {
            2.0 * codes + rounding * (constant + 2.0 * scaled * self.longest)
        } else {
            codes + rounding * (query.length * self.extent + scaled * self.longest)
        };
        encoded.length = if centred { constant.sqrt() } else { query.length };
        (encoded.step, encoded.constant) = (step, constant);
    }

    /// Writes the codes of a query, less the offsets if it is `centred`, times the scales.
    #[inline(always)]
    fn encode_query(&self, numbers: &[f32], centred: bool, codes: &mut [i16]) -> Sums {
        let weight = if centred { 1.0 } else { 0.0 };
        let (offset, scale) = (self.offset.as_slice(), self.scale.as_slice());
        let each = |at: usize| (f64::from(numbers[at]) - weight * offset[at]) * scale[at];
        let [largest] = in_lanes(numbers.len(), f64::max, |at| [each(at).abs()]);
        let step = largest / QUERY_CODE;
        let inverse = if step > 0.0 { 1.0 / step } else { 0.0 };
        for (code, at) in codes.iter_mut().zip(0..numbers.len()) {
            *code = (each(at) * inverse).round_ties_even().clamp(-QUERY_CODE, QUERY_CODE) as i16;
        }
        let [square, rest, constant] = in_lanes(numbers.len(), f64::add, |at| {
            let (number, left) = (each(at), each(at) - step * f64::from(codes[at]));
            let (number_alone, offset) = (f64::from(numbers[at]), offset[at]);
            let constant = if centred {
                (number_alone - offset) * (number_alone - offset)
            } else {
                number_alone * offset
            };
            [number * number, left * left, constant]
        });
        Sums { step, constant, scaled: square.sqrt(), rest: rest.sqrt() }
    }

    /// Writes the products of a query's codes with those of some places into `out`.
    pub(crate) fn scan(&self, isa: Isa, codes: &[i16], places: Range<usize>, out: &mut [f32]) {
        if let View::I8(rows) = self.rows.view() {
            short_products(
                (isa, Tuning::of(rows.len())),
                codes,
                &rows[places.start * codes.len()..places.end * codes.len()],
                out,
            );
        }
    }

    /// Writes the bounds of some places, from their rows' norms and sums.
    ///
    /// The product with a row is `constant + step * sum`, with an error of at most `slack` and, by
    /// Cauchy and Schwarz, `|q|` times the length that the row's codes leave out. All further
    /// operations are those of the distance. They are monotonic, rounding included, so bounds stay
    /// bounds.
    #[inline(always)]
    fn cosines(
        &self,
        query: &EncodedQuery,
        norms: &[f64],
        places: Range<usize>,
        sums: &[f32],
        low: &mut [f32],
        high: &mut [f32],
    ) {
        let length = query.length * (1.0 + rounding(self.offset.len()));
        let count = sums.len();
        let (error, norms) = (&self.error[places][..count], &norms[..count]);
        let (low, high) = (&mut low[..count], &mut high[..count]);
        for at in 0..count {
            let part = query.step * f64::from(sums[at]);
            let (product, around) =
                (query.constant + part, length * error[at] + query.slack + part.abs() * ROUNDED);
            let both = query.length * norms[at];
            low[at] = (1.0 - (product + around) / both).clamp(0.0, 2.0) as f32;
            high[at] = (1.0 - (product - around) / both).clamp(0.0, 2.0) as f32;
        }
    }

    /// The squared distance to a row of codes is `constant - 2 step sum + square`, with an error of
    /// at most `slack`; the row itself lies within its `error` of that (the triangle's inequality).
    /// With the row's own square in place of that of its codes, it is the squared distance to the
    /// row, with an error of at most twice the product of the query with the remainder that the
    /// codes leave out (Cauchy and Schwarz). The first is closer for near rows, the second for far
    /// ones, and both hold. They are bounds of the true distance. The computed one comes from
    /// differences that were rounded to float32: its relative error is at most half of [`ROUNDED`].
    #[inline(always)]
    fn euclideans(&self, query: &EncodedQuery, sums: &[f32], low: &mut [f32], high: &mut [f32]) {
        let rounding = rounding(self.offset.len());
        let length = 2.0 * query.length * (1.0 + rounding);
        let count = sums.len();
        let (errors, squares) = (&self.error[..count], &self.square[..count]);
        let row_squares = &self.row_square[..count];
        let (low, high) = (&mut low[..count], &mut high[..count]);
        for at in 0..count {
            let (error, square, row_square) = (errors[at], squares[at], row_squares[at]);
            let part = 2.0 * query.step * f64::from(sums[at]);
            let slack = query.slack + part.abs() * ROUNDED;
            let (codes, row) = (query.constant - part + square, query.constant - part + row_square);
            let around_codes = slack + rounding * square;
            let around_row = slack + rounding * row_square + length * error;
            let nearest = (codes - around_codes).max(0.0).sqrt() - error;
            let farthest = (codes + around_codes).max(0.0).sqrt() + error;
            let nearest = nearest.max((row - around_row).max(0.0).sqrt());
            let farthest = farthest.min((row + around_row).max(0.0).sqrt());
            low[at] = (nearest * (1.0 - rounding - ROUNDED)) as f32;
            high[at] = (farthest * (1.0 + rounding + ROUNDED)) as f32;
        }
    }
}

/// Sums over a query as it is encoded.
struct Sums {
    step: f64,
    constant: f64,
    /// The length of the query times the scales, and of the remainder that its codes leave out.
    scaled: f64,
    rest: f64,
}

/// Writes the codes of a row.
#[inline(always)]
fn encode(numbers: &[f32], offset: &[f64], scale: &[f64], codes: &mut [i8]) -> Coded {
    for (code, ((&x, offset), scale)) in codes.iter_mut().zip(numbers.iter().zip(offset).zip(scale))
    {
        // If all rows have the same number, the scale is 0, and so is the dividend.
        let whole = ((f64::from(x) - offset) / scale.max(f64::MIN_POSITIVE)).round_ties_even();
        *code = whole.clamp(-CODE, CODE) as i8;
    }
    let [error, square, row_square, length] = in_lanes(numbers.len(), f64::add, |at| {
        let (number, code) = (f64::from(numbers[at]) - offset[at], f64::from(codes[at]));
        let (coded, left) = (scale[at] * code, number - scale[at] * code);
        [left * left, coded * coded, number * number, code * code]
    });
    Coded { error, square, row_square, length }
}

/// Combines `terms(0)`, `terms(1)`, ... by `put`, in several lanes, which is as exact and runs in
/// vector registers.
#[inline(always)]
fn in_lanes<const N: usize>(
    count: usize,
    put: impl Fn(f64, f64) -> f64,
    terms: impl Fn(usize) -> [f64; N],
) -> [f64; N] {
    const LANES: usize = 8;
    let mut lanes = [[0.0; LANES]; N];
    let whole = count - count % LANES;
    for start in (0..whole).step_by(LANES) {
        for lane in 0..LANES {
            for (lanes, term) in lanes.iter_mut().zip(terms(start + lane)) {
                lanes[lane] = put(lanes[lane], term);
            }
        }
    }
    for at in whole..count {
        for (lanes, term) in lanes.iter_mut().zip(terms(at)) {
            lanes[0] = put(lanes[0], term);
        }
    }
    lanes.map(|lanes| lanes.into_iter().fold(0.0, &put))
}

/// The smallest and the largest number of each dimension.
fn ranges(map: &Map) -> Result<(Vec<f32>, Vec<f32>), Error> {
    let (isa, dim) = (map.isa(), map.dim());
    let nothing = || (vec![f32::INFINITY; dim], vec![f32::NEG_INFINITY; dim]);
    let mut pieces: Vec<&[f32]> = Vec::new();
    for block in map.blocks().iter() {
        if let View::F32(rows) = block.rows() {
            pieces.extend(rows.chunks(dim * ROWS));
        }
    }
    let found = each(
        0..pieces.len(),
        || (),
        |(), piece| {
            let (mut least, mut most) = nothing();
            for row in pieces[piece].chunks_exact(dim) {
                isa.run(|| widen(&mut least, &mut most, row, row));
            }
            Ok((least, most))
        },
    )?;
    Ok(found.into_iter().fold(nothing(), |(mut least, mut most), (low, high)| {
        widen(&mut least, &mut most, &low, &high);
        (least, most)
    }))
}

#[inline(always)]
fn widen(least: &mut [f32], most: &mut [f32], low: &[f32], high: &[f32]) {
    least.iter_mut().zip(low).for_each(|(least, &x)| *least = if x < *least { x } else { *least });
    most.iter_mut().zip(high).for_each(|(most, &x)| *most = if x > *most { x } else { *most });
}

#[cfg(test)]
#[path = "screen_tests.rs"]
mod tests;
