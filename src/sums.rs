//! Sums over places in an order that does not depend on the instruction set: by lanes in chunks, by
//! chunks in blocks, and by blocks in order. Whoever has some of the blocks can sum these alone.

#![allow(
    clippy::inline_always,
    reason = "functions inlined into `Isa::run` are compiled for the instruction set"
)]

/// Numbers that are added side by side.
pub(crate) const LANES: usize = 8;
/// Places that are updated at a time: they stay in the first-level cache.
pub(crate) const CHUNK: usize = 256;
/// Places whose sums are added up before they are added to those of other blocks.
pub(crate) const BLOCK: usize = 4096;

/// The sum of numbers, side by side in lanes.
#[inline(always)]
pub(crate) fn sum(numbers: &[f64]) -> f64 {
    sum_of(numbers, |number| number)
}

/// The same of what is made of each.
#[inline(always)]
pub(crate) fn sum_of<T: Copy>(numbers: &[T], of: impl Fn(T) -> f64) -> f64 {
    let mut lanes = [0.0; LANES];
    let (groups, rest) = numbers.as_chunks::<LANES>();
    for group in groups {
        for lane in 0..LANES {
            lanes[lane] += of(group[lane]);
        }
    }
    for (lane, &number) in lanes.iter_mut().zip(rest) {
        *lane += of(number);
    }
    total(&lanes)
}

/// The sum of the lanes.
#[inline(always)]
pub(crate) fn total(lanes: &[f64; LANES]) -> f64 {
    let [a, b, c, d, e, f, g, h] = *lanes;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}
