//! The terms that are summed over a row: differences, squares or products, of floats or of bytes.

use crate::simd::{Byte, Machine};

/// One of [`Differences`], [`Squares`] and [`Products`].
pub(super) trait Term: Copy {
    /// The term of two floats.
    fn float(a: f32, b: f32) -> f64;
    /// The term of two bytes.
    fn byte(a: i32, b: i32) -> i32;
    /// Adds the terms of a block of floats, to each lane its own.
    fn add<M: Machine>(machine: M, lanes: &mut M::Lanes, a: M::Floats, b: M::Floats);
    /// Adds the terms of a block of bytes.
    fn count<M: Machine, B: Byte>(
        machine: M,
        sum: M::Counts,
        query: M::Block,
        row: M::Block,
    ) -> M::Counts;
    /// The total of [`count`](Self::count).
    #[inline(always)]
    fn total<M: Machine>(machine: M, sum: M::Counts) -> i64 {
        machine.total(sum)
    }
    /// By how much that is too large, for any row.
    #[inline(always)]
    fn excess<M: Machine, B: Byte>(_: &[B]) -> i64 {
        0
    }
}

/// Absolute differences, for the manhattan distance.
#[derive(Clone, Copy)]
pub(super) struct Differences;
/// Squared differences, for the euclidean distance.
#[derive(Clone, Copy)]
pub(super) struct Squares;
/// Products, for the cosine.
#[derive(Clone, Copy)]
pub(super) struct Products;

/// Bytes whose differences are those of unsigned ones.
#[inline(always)]
fn unsigned<M: Machine, B: Byte>(machine: M, block: M::Block) -> M::Block {
    if B::SIGNED { machine.flip(block) } else { block }
}

impl Term for Differences {
    #[inline(always)]
    fn float(a: f32, b: f32) -> f64 {
        f64::from((a - b).abs())
    }
    #[inline(always)]
    fn byte(a: i32, b: i32) -> i32 {
        (a - b).abs()
    }
    #[inline(always)]
    fn add<M: Machine>(machine: M, lanes: &mut M::Lanes, a: M::Floats, b: M::Floats) {
        let differences = machine.widen(machine.subtract(a, b));
        let (sums, differences) = (lanes.as_mut(), differences.as_ref());
        for at in 0..sums.len() {
            sums[at] = machine.absolute(sums[at], differences[at]);
        }
    }
    #[inline(always)]
    fn count<M: Machine, B: Byte>(
        machine: M,
        sum: M::Counts,
        query: M::Block,
        row: M::Block,
    ) -> M::Counts {
        machine.differences(sum, unsigned::<M, B>(machine, query), unsigned::<M, B>(machine, row))
    }
    #[inline(always)]
    fn total<M: Machine>(machine: M, sum: M::Counts) -> i64 {
        machine.total_differences(sum)
    }
}

impl Term for Squares {
    #[inline(always)]
    fn float(a: f32, b: f32) -> f64 {
        f64::from(a - b) * f64::from(a - b)
    }
    #[inline(always)]
    fn byte(a: i32, b: i32) -> i32 {
        (a - b) * (a - b)
    }
    #[inline(always)]
    fn add<M: Machine>(machine: M, lanes: &mut M::Lanes, a: M::Floats, b: M::Floats) {
        let differences = machine.widen(machine.subtract(a, b));
        let (sums, differences) = (lanes.as_mut(), differences.as_ref());
        for at in 0..sums.len() {
            sums[at] = machine.product(sums[at], differences[at], differences[at]);
        }
    }
    #[inline(always)]
    fn count<M: Machine, B: Byte>(
        machine: M,
        sum: M::Counts,
        query: M::Block,
        row: M::Block,
    ) -> M::Counts {
        machine.squares(sum, unsigned::<M, B>(machine, query), unsigned::<M, B>(machine, row))
    }
}

impl Term for Products {
    #[inline(always)]
    fn float(a: f32, b: f32) -> f64 {
        f64::from(a) * f64::from(b)
    }
    #[inline(always)]
    fn byte(a: i32, b: i32) -> i32 {
        a * b
    }
    #[inline(always)]
    fn add<M: Machine>(machine: M, lanes: &mut M::Lanes, a: M::Floats, b: M::Floats) {
        let (a, b) = (machine.widen(a), machine.widen(b));
        let (sums, a, b) = (lanes.as_mut(), a.as_ref(), b.as_ref());
        for at in 0..sums.len() {
            sums[at] = machine.product(sums[at], a[at], b[at]);
        }
    }
    #[inline(always)]
    fn count<M: Machine, B: Byte>(
        machine: M,
        sum: M::Counts,
        query: M::Block,
        row: M::Block,
    ) -> M::Counts {
        if B::SIGNED {
            machine.products_i8(sum, query, row)
        } else {
            machine.products_u8(sum, query, row)
        }
    }
    #[inline(always)]
    fn excess<M: Machine, B: Byte>(query: &[B]) -> i64 {
        if B::SIGNED {
            let mut sum = 0;
            for &x in query {
                sum += i64::from(x.into());
            }
            M::OFFSET * sum
        } else {
            0
        }
    }
}
