//! Blocks of rows turned on their side, so that a vector register holds one pixel of many rows.
//!
//! Four by four, because compilers turn these loops into the shuffles of whichever instruction set
//! they compile for.

/// `out[i]` is the `i`-th of each row.
#[inline(always)]
pub(super) fn interleave<T: Copy>(rows: [&[T]; 4], out: &mut [[T; 4]]) {
    let [a, b, c, d] = rows.map(|row| &row[..out.len()]);
    for i in 0..out.len() {
        out[i] = [a[i], b[i], c[i], d[i]];
    }
}

/// The way back: the `i`-th of each row is from `columns[i]`.
#[inline(always)]
pub(super) fn deinterleave<T: Copy>(columns: &[[T; 4]], rows: [&mut [T]; 4]) {
    let [a, b, c, d] = rows.map(|row| &mut row[..columns.len()]);
    for i in 0..columns.len() {
        [a[i], b[i], c[i], d[i]] = columns[i];
    }
}
