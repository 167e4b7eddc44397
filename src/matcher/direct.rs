//! The sums of short windows, and of diagonals of any slope: each distance is read where it lies.

use std::ops::Range;

use super::order::Runs;
use super::ring::Ring;

/// How many sums are made at a time: they stay in the first-level cache.
pub(super) const BLOCK: usize = 256;

/// Writes to `sums`, at most [`BLOCK`], those of the diagonals that end in `start`, `start + 1`,
/// ..., in the order of [`diagonal_sum`](super::order::diagonal_sum). A diagonal lies `back(age)`
/// places back `age` queries ago; the caller sees to it that all of it is on the route.
#[inline(always)]
pub(super) fn direct_sums(
    columns: &Ring,
    runs: Runs,
    back: impl Fn(usize) -> usize,
    start: usize,
    sums: &mut [f64],
) {
    let count = sums.len();
    let terms = |age: usize| &columns.column(age)[start - back(age)..][..count];
    let Runs { newest, full, rest } = runs;
    // The shortest windows in one go: three columns or fewer are a column a run.
    if newest + full + rest <= 3 {
        return match newest + full + rest {
            1 => each(sums, terms(0), terms(0), terms(0), |a, _, _| a),
            2 => each(sums, terms(0), terms(1), terms(1), |a, b, _| a + b),
            _ => each(sums, terms(0), terms(1), terms(2), |a, b, c| a + b + c),
        };
    }
    total((0..newest).rev().map(terms), sums);
    if full == 1 {
        add(terms(newest), sums);
    } else if full > 1 {
        add_total((newest..newest + full).rev().map(terms), sums);
    }
    if rest == 1 {
        add(terms(newest + full), sums);
    } else if rest > 1 {
        add_total((newest + full..newest + full + rest).map(terms), sums);
    }
}

/// Whether it is sure that no diagonal that ends in these places has a sum below `least`: known of
/// most blocks, for windows of three columns at most, without a sum being written anywhere.
#[inline(always)]
pub(super) fn none_below(columns: &Ring, back: &[usize], places: Range<usize>, least: f64) -> bool {
    let (length, whole) = (back.len(), places.len() == BLOCK);
    if !whole || length > 3 {
        return false;
    }
    let terms = |age: usize| columns.column(age)[places.start - back[age]..].first_chunk();
    let oldest = length - 1;
    let (Some(a), Some(b), Some(c)) = (terms(0), terms(oldest.min(1)), terms(oldest)) else {
        return false;
    };
    !match length {
        1 => any_of(a, b, c, |a, _, _| a < least),
        2 => any_of(a, b, c, |a, b, _| a + b < least),
        _ => any_of(a, b, c, |a, b, c| a + b + c < least),
    }
}

/// Whether it holds of any three of the numbers. Without a way out in the middle, it runs in vector
/// registers.
#[inline(always)]
fn any_of(
    a: &[f32; BLOCK],
    b: &[f32; BLOCK],
    c: &[f32; BLOCK],
    holds: impl Fn(f64, f64, f64) -> bool,
) -> bool {
    let mut any = false;
    for at in 0..BLOCK {
        any |= holds(a[at].into(), b[at].into(), c[at].into());
    }
    any
}

/// A sum of three columns at most.
#[inline(always)]
fn each(sums: &mut [f64], a: &[f32], b: &[f32], c: &[f32], sum_of: impl Fn(f64, f64, f64) -> f64) {
    let columns = a.iter().zip(b).zip(c);
    for (sum, ((&a, &b), &c)) in sums.iter_mut().zip(columns) {
        *sum = sum_of(f64::from(a), f64::from(b), f64::from(c));
    }
}

/// The sum of the columns, in their order.
#[inline(always)]
fn total<'a>(mut columns: impl Iterator<Item = &'a [f32]>, sums: &mut [f64]) {
    if let Some(first) = columns.next() {
        sums.iter_mut().zip(first).for_each(|(sum, &term)| *sum = f64::from(term));
    }
    for column in columns {
        add(column, sums);
    }
}

#[inline(always)]
fn add(column: &[f32], sums: &mut [f64]) {
    sums.iter_mut().zip(column).for_each(|(sum, &term)| *sum += f64::from(term));
}

#[inline(always)]
fn add_total<'a>(columns: impl Iterator<Item = &'a [f32]>, sums: &mut [f64]) {
    let mut part = [0.0_f64; BLOCK];
    let part = &mut part[..sums.len()];
    total(columns, part);
    sums.iter_mut().zip(part).for_each(|(sum, part)| *sum += *part);
}
