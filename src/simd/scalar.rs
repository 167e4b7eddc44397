//! The plain sums: no instruction set assumed, and the oracle for those that assume one.
//!
//! Bytes are summed in exact integer arithmetic, floats in sixteen sums of f64 (method 1.6).

use super::machine::{LANES, SPACE, Widen};

/// Bytes that are summed in 31 bits: a term is below 2^16.
const BYTES: usize = 1 << 14;
/// Products of bytes and numbers of 14 bits that are: a term is below 2^20.
const SHORTS: usize = 1 << 10;

/// The sum of `term(a, b)` over two vectors of floats of one length: number `i` goes to lane `i`
/// modulo sixteen.
pub(crate) fn sum<A: Widen, B: Widen>(a: &[A], b: &[B], term: impl Fn(f32, f32) -> f64) -> f64 {
    let (mut space_a, mut space_b) = ([0.0; SPACE], [0.0; SPACE]);
    let mut lanes = [0.0; LANES];
    for (a, b) in a.chunks(SPACE).zip(b.chunks(SPACE)) {
        let (a, b) = (A::widen(a, &mut space_a), B::widen(b, &mut space_b));
        let ((a, rest_of_a), (b, rest_of_b)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
        for at in 0..a.len() {
            for lane in 0..LANES {
                lanes[lane] += term(a[at][lane], b[at][lane]);
            }
        }
        for lane in 0..rest_of_a.len() {
            lanes[lane] += term(rest_of_a[lane], rest_of_b[lane]);
        }
    }
    sum_of_lanes(lanes)
}

/// The upper half is added to the lower one until one number is left.
#[inline(always)]
pub(crate) fn sum_of_lanes(mut lanes: [f64; LANES]) -> f64 {
    let mut half = LANES / 2;
    while half > 0 {
        let (low, high) = lanes.split_at_mut(half);
        for lane in 0..half {
            low[lane] += high[lane];
        }
        half /= 2;
    }
    lanes[0]
}

/// The sum of `term(a, b)` over two vectors of bytes of one length, exactly.
pub(crate) fn total<B: Copy + Into<i32>>(a: &[B], b: &[B], term: impl Fn(i32, i32) -> i32) -> i64 {
    let mut total = 0;
    for (a, b) in a.chunks(BYTES).zip(b.chunks(BYTES)) {
        let (b, mut sum) = (&b[..a.len()], 0);
        for at in 0..a.len() {
            sum += term(a[at].into(), b[at].into());
        }
        total += i64::from(sum);
    }
    total
}

/// The sum of the products of numbers of 14 bits with bytes, exactly.
pub(crate) fn short_total(a: &[i16], b: &[i8]) -> i64 {
    let mut total = 0;
    for (a, b) in a.chunks(SHORTS).zip(b.chunks(SHORTS)) {
        let (b, mut sum) = (&b[..a.len()], 0);
        for at in 0..a.len() {
            sum += i32::from(a[at]) * i32::from(b[at]);
        }
        total += i64::from(sum);
    }
    total
}
