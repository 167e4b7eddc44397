//! Rows at a quarter of the bytes, beside a map's own, and how far the distances of those can be
//! from theirs (method 2.1).

#![allow(clippy::inline_always, reason = "what is inlined is compiled for the instruction set")]

use std::ops::{Add as _, Range};

use super::Map;
use super::storage::Storage;
use crate::distance::{Metric, Query, short_products};
use crate::dtype::Dtype;
use crate::error::Error;
use crate::numbers::View;
use crate::parallel::{each, each_row};
use crate::simd::Isa;

/// The largest code of a row's number, on both sides of 0.
const CODE: f64 = 127.0;
/// The largest code of a query's number: 14 bits with the sign, so that a kernel's sums of products
/// do not overflow.
const QUERY_CODE: f64 = 8191.0;
/// How many rows are looked at between two rows of ranges.
const ROWS: usize = 1024;
/// Distances from here on are left to the rows themselves: sums of smaller ones overflow nothing.
pub(crate) const FAR: f32 = 1e30;
/// By how much a number can be off, of its size, that was rounded to float32, and twice as much.
const ROUNDED: f64 = 1.0 / (1 << 23) as f64;

/// The rows as codes: number `j` of row `i` is `offset[j] + scale[j] * code[i, j]`, and what that
/// is off by, over the row, has the length `error[i]` at most.
#[derive(Debug)]
pub(crate) struct Screen {
    codes: Storage,
    offset: Vec<f64>,
    scale: Vec<f64>,
    error: Vec<f64>,
    /// The squared length of each row's `scale * code`, and of the row less `offset`, for the
    /// euclidean distance.
    square: Vec<f64>,
    row_square: Vec<f64>,
    /// No row of codes is longer.
    longest: f64,
    /// No row, and not `offset`, is longer.
    extent: f64,
}

/// A query as codes, and what the bounds of its distances are made of: memory that is used again
/// for each query.
#[derive(Clone, Debug)]
pub(crate) struct Aim {
    /// The query's numbers, times the scales, in units of `step`.
    pub(crate) codes: Vec<i16>,
    step: f64,
    /// What does not depend on the row: of the product with it, or of its squared distance.
    constant: f64,
    /// What the codes of the query, and rounding, can be off by.
    slack: f64,
    /// The query's length, for the euclidean distance less the offsets.
    length: f64,
}

impl Aim {
    pub(crate) fn new(dim: usize) -> Self {
        Self { codes: vec![0; dim], step: 0.0, constant: 0.0, slack: 0.0, length: 0.0 }
    }
}

impl Map {
    /// The same map with a screen: a copy of its rows in signed bytes, a quarter more memory. A
    /// [`Localizer`](crate::Localizer) scans those, which says of each distance between which two
    /// numbers it lies, and looks only at the rows that these leave in doubt. Its answers are those
    /// that it would give without, to the last bit.
    ///
    /// This pays where the map is larger than the cache and its places differ: a push then costs
    /// little more than the scan of the bytes. Where it does not pay, the localizer notices, and
    /// scans the rows for a while before it tries again. Rows of fewer than 256 numbers are always
    /// scanned as they are. A screen is not saved with the map: making it takes about as long as a
    /// few pushes.
    ///
    /// ```
    /// use surefix::{Dtype, Map, Metric};
    /// let map = Map::from_descriptors(vec![0.0_f32, 1.0, 1.0, 0.0], 2, Metric::Cosine)?.with_screen(Dtype::I8)?;
    /// assert_eq!(map.screen(), Some(Dtype::I8));
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Option`] for another type than `I8`, for a map of other numbers than float32, for
    /// the manhattan distance, and where there is not enough memory; [`Error::NotFinite`] for a NaN
    /// or an infinity in a mapped map.
    pub fn with_screen(mut self, dtype: Dtype) -> Result<Self, Error> {
        let refused = |expected: &str, got: String| {
            Err(Error::Option { name: "screen", expected: expected.to_owned(), got })
        };
        if dtype != Dtype::I8 {
            return refused("int8, \"i8\"", dtype.to_string());
        }
        let View::F32(rows) = self.descriptors() else {
            return refused("a map of float32 descriptors", format!("one of {}", self.dtype()));
        };
        if self.metric() == Metric::Manhattan {
            return refused(
                "a map for the euclidean distance or the cosine",
                format!("one for {}", self.metric()),
            );
        }
        self.descriptors().check_finite("descriptors", self.dim)?;
        let Some(screen) = Screen::new(self.isa, rows, self.dim) else {
            return refused("memory for a quarter more", "none left".to_owned());
        };
        self.screen = Some(screen.into());
        Ok(self)
    }

    /// The type of the screen's numbers, where the map has a screen.
    pub fn screen(&self) -> Option<Dtype> {
        self.screen.as_ref().map(|screen| screen.codes.view().dtype())
    }

    /// Between which two numbers each distance lies, from the sums that [`Screen::scan`] gave;
    /// whether all of them are below [`FAR`].
    pub(crate) fn bounds(
        &self,
        screen: &Screen,
        aim: &Aim,
        sums: &[f32],
        low: &mut [f32],
        high: &mut [f32],
    ) -> bool {
        match self.metric {
            Metric::Cosine => self.isa.run(|| screen.cosines(aim, &self.norms, sums, low, high)),
            _ => self.isa.run(|| screen.euclideans(aim, sums, low, high)),
        }
        high.iter().fold(true, |near, &d| near & (d < FAR))
    }
}

/// More than the relative error of any sum of `dim` terms here, and of a kernel's.
fn rounding(dim: usize) -> f64 {
    (dim + 64) as f64 * 4.0 * f64::EPSILON
}

/// What a row of codes leaves out, and lengths.
#[derive(Clone, Copy)]
struct Coded {
    error: f64,
    /// The squared length of `scale * code`, and of what that stands for.
    square: f64,
    row_square: f64,
    /// That of the codes.
    length: f64,
}

impl Screen {
    /// A screen of finite rows; nothing where there is no memory for it.
    fn new(isa: Isa, rows: &[f32], dim: usize) -> Option<Self> {
        let (least, most) = ranges(isa, rows, dim);
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
        let mut codes = Storage::try_zeros(Dtype::I8, rows.len())?;
        let made = each_row(codes.bytes_mut(), dim, |row, codes| {
            let numbers = &rows[row * dim..(row + 1) * dim];
            isa.run(|| encode(numbers, &offset, &scale, bytemuck::must_cast_slice_mut(codes)))
        });
        let longest = made.iter().map(|row| row.length).fold(0.0, f64::max).sqrt();
        let error = made
            .iter()
            .map(|row| row.error.sqrt() * (1.0 + rounding) + rounding * extent)
            .collect();
        let square = made.iter().map(|row| row.square).collect();
        let row_square = made.iter().map(|row| row.row_square).collect();
        Some(Self { codes, offset, scale, error, square, row_square, longest, extent })
    }

    /// Takes aim with a query of float32.
    pub(crate) fn aim(&self, isa: Isa, metric: Metric, query: Query<'_>, aim: &mut Aim) {
        let View::F32(numbers) = query.numbers else { return };
        let centred = metric != Metric::Cosine;
        let Aimed { step, constant, scaled, rest } =
            isa.run(|| self.encode_query(numbers, centred, &mut aim.codes));
        let rounding = rounding(self.offset.len());
        // What the product of the codes can be off by: Cauchy and Schwarz, for what the query's
        // codes leave out.
        let codes = (rest * (1.0 + rounding) + rounding * scaled) * self.longest;
        aim.slack = if centred {
            2.0 * codes + rounding * (constant + 2.0 * scaled * self.longest)
        } else {
            codes + rounding * (query.length * self.extent + scaled * self.longest)
        };
        aim.length = if centred { constant.sqrt() } else { query.length };
        (aim.step, aim.constant) = (step, constant);
    }

    /// Writes the codes of a query, less the offsets if it is `centred`, times the scales.
    #[inline(always)]
    fn encode_query(&self, numbers: &[f32], centred: bool, codes: &mut [i16]) -> Aimed {
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
        Aimed { step, constant, scaled: square.sqrt(), rest: rest.sqrt() }
    }

    /// Writes the products of a query's codes with those of some places into `out`.
    pub(crate) fn scan(&self, isa: Isa, codes: &[i16], places: Range<usize>, out: &mut [f32]) {
        if let View::I8(rows) = self.codes.view() {
            short_products(
                isa,
                codes,
                &rows[places.start * codes.len()..places.end * codes.len()],
                out,
            );
        }
    }

    /// The product with a row is `constant + step * sum`, but for what the row's codes leave out
    /// (`|q|` times that, by Cauchy and Schwarz) and for `slack`. From there on each operation is
    /// the distance's own, and none of them turns an order around: rounding included, the bounds
    /// stay bounds.
    #[inline(always)]
    fn cosines(&self, aim: &Aim, norms: &[f64], sums: &[f32], low: &mut [f32], high: &mut [f32]) {
        let length = aim.length * (1.0 + rounding(self.offset.len()));
        let rows = sums.iter().zip(&self.error).zip(norms);
        for (((&sum, error), norm), (low, high)) in rows.zip(low.iter_mut().zip(high)) {
            let part = aim.step * f64::from(sum);
            let (product, around) =
                (aim.constant + part, length * error + aim.slack + part.abs() * ROUNDED);
            let cosine =
                |product: f64| (1.0 - product / (aim.length * norm)).clamp(0.0, 2.0) as f32;
            (*low, *high) = (cosine(product + around), cosine(product - around));
        }
    }

    /// The squared distance to a row of codes is `constant - 2 step sum + square`, but for `slack`;
    /// the row itself lies within its error of that (the triangle's inequality). With the row's own
    /// square in place of that of its codes it is the squared distance to the row, but for twice
    /// the product of the query with what the codes leave out (Cauchy and Schwarz). The first is
    /// closer for near rows, the second for far ones, and both hold. They are those of the true
    /// distance: the computed one comes from differences that were rounded to float32, and is off
    /// by half of [`ROUNDED`] of itself at most.
    #[inline(always)]
    fn euclideans(&self, aim: &Aim, sums: &[f32], low: &mut [f32], high: &mut [f32]) {
        let rounding = rounding(self.offset.len());
        let length = 2.0 * aim.length * (1.0 + rounding);
        let rows = sums.iter().zip(&self.error).zip(self.square.iter().zip(&self.row_square));
        for (((&sum, error), (square, row_square)), (low, high)) in
            rows.zip(low.iter_mut().zip(high))
        {
            let part = 2.0 * aim.step * f64::from(sum);
            let slack = aim.slack + part.abs() * ROUNDED;
            let (codes, row) = (aim.constant - part + square, aim.constant - part + row_square);
            let around_codes = slack + rounding * square;
            let around_row = slack + rounding * row_square + length * error;
            let nearest = (codes - around_codes).max(0.0).sqrt() - error;
            let farthest = (codes + around_codes).max(0.0).sqrt() + error;
            let nearest = nearest.max((row - around_row).max(0.0).sqrt());
            let farthest = farthest.min((row + around_row).max(0.0).sqrt());
            *low = (nearest * (1.0 - rounding - ROUNDED)) as f32;
            *high = (farthest * (1.0 + rounding + ROUNDED)) as f32;
        }
    }
}

/// What is found out about a query as it is encoded.
struct Aimed {
    step: f64,
    constant: f64,
    /// The length of the query times the scales, and of what its codes leave out of that.
    scaled: f64,
    rest: f64,
}

/// Writes the codes of a row.
#[inline(always)]
fn encode(numbers: &[f32], offset: &[f64], scale: &[f64], codes: &mut [i8]) -> Coded {
    for (code, ((&x, offset), scale)) in codes.iter_mut().zip(numbers.iter().zip(offset).zip(scale))
    {
        // Where all rows have the same number, the scale is 0 and so is what stands above it.
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

/// Puts `terms(0)`, `terms(1)`, ... together, each of the numbers in several lanes, which is as
/// exact and runs in vector registers.
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
fn ranges(isa: Isa, rows: &[f32], dim: usize) -> (Vec<f32>, Vec<f32>) {
    let nothing = || (vec![f32::INFINITY; dim], vec![f32::NEG_INFINITY; dim]);
    let pieces: Vec<&[f32]> = rows.chunks(dim * ROWS).collect();
    let found = each(
        0..pieces.len(),
        || (),
        |(), piece| {
            let (mut least, mut most) = nothing();
            for row in pieces[piece].chunks_exact(dim) {
                isa.run(|| widen(&mut least, &mut most, row, row));
            }
            (least, most)
        },
    );
    found.into_iter().fold(nothing(), |(mut least, mut most), (low, high)| {
        widen(&mut least, &mut most, &low, &high);
        (least, most)
    })
}

#[inline(always)]
fn widen(least: &mut [f32], most: &mut [f32], low: &[f32], high: &[f32]) {
    least.iter_mut().zip(low).for_each(|(least, &x)| *least = if x < *least { x } else { *least });
    most.iter_mut().zip(high).for_each(|(most, &x)| *most = if x > *most { x } else { *most });
}
