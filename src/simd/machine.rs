//! One instruction set's registers, as the scans use them, and the numbers that fill them.

use bytemuck::Pod;
use half::f16;
use half::slice::HalfFloatSliceExt as _;

/// f64 sums of a row of floats, on every machine (method 1.6).
pub(crate) const LANES: usize = 16;
/// Bytes that are taken at a time, on every machine.
pub(crate) const BLOCK: usize = 64;
/// Numbers that are widened to f32 at a time: a multiple of [`LANES`].
pub(crate) const SPACE: usize = 256;

/// A scan, written once for every machine.
pub(crate) trait Kernel {
    /// On a machine's registers.
    fn simd<M: Machine>(self, machine: M);
    /// Without any.
    fn scalar(self);
}

/// One instruction set. The value is the proof that the processor has it, so that everything here
/// is safe to call; loads take arrays, whose length the type knows.
pub(crate) trait Machine: Copy {
    /// [`LANES`] of f32, in registers.
    type Floats: Copy;
    /// A register of f64.
    type Wide: Copy;
    /// [`LANES`] of f64: an array of registers.
    type Lanes: Copy + AsRef<[Self::Wide]> + AsMut<[Self::Wide]>;
    /// [`BLOCK`] bytes.
    type Block: Copy;
    /// [`BLOCK`] numbers of 16 bits.
    type Shorts: Copy;
    /// Sums of whole numbers, of 32 bits or more.
    type Counts: Copy;
    /// [`products_i8`](Self::products_i8) adds this to each number of the row, then multiplies.
    const OFFSET: i64;

    /// Runs the kernel in a function that is compiled for this instruction set.
    fn run<K: Kernel>(self, kernel: K);

    /// Sums of zero.
    fn lanes(self) -> Self::Lanes;
    /// The numbers, in registers.
    fn f32s(self, numbers: &[f32; LANES]) -> Self::Floats;
    /// As [`f32s`](Self::f32s).
    fn f16s(self, numbers: &[f16; LANES]) -> Self::Floats;
    /// As [`f32s`](Self::f32s).
    fn i8s(self, numbers: &[i8; LANES]) -> Self::Floats;
    /// As [`f32s`](Self::f32s).
    fn u8s(self, numbers: &[u8; LANES]) -> Self::Floats;
    /// `a - b`, rounded to f32.
    fn subtract(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// The same numbers in f64.
    fn widen(self, numbers: Self::Floats) -> Self::Lanes;
    /// Prefetches memory that will be read soon, if that pays. Any address is allowed.
    fn fetch<T>(self, _ahead: *const T) {}
    /// `sum + |a|`.
    fn absolute(self, sum: Self::Wide, a: Self::Wide) -> Self::Wide;
    /// `sum + a b`, fused or not: two numbers of 24 bits have a product of 48, which f64 holds
    /// without rounding.
    fn product(self, sum: Self::Wide, a: Self::Wide, b: Self::Wide) -> Self::Wide;
    /// The sixteen sums.
    fn store(self, lanes: Self::Lanes) -> [f64; LANES];

    /// Sums of zero.
    fn counts(self) -> Self::Counts;
    /// The bytes, in a register or several.
    fn block(self, bytes: &[u8; BLOCK]) -> Self::Block;
    /// Signed bytes as unsigned ones that have the same differences.
    fn flip(self, block: Self::Block) -> Self::Block;
    /// For unsigned bytes, `sum + |a - b|`.
    fn differences(self, sum: Self::Counts, a: Self::Block, b: Self::Block) -> Self::Counts;
    /// For unsigned bytes, `sum + (a - b)^2`.
    fn squares(self, sum: Self::Counts, a: Self::Block, b: Self::Block) -> Self::Counts;
    /// For unsigned bytes, `sum + a b`.
    fn products_u8(self, sum: Self::Counts, a: Self::Block, b: Self::Block) -> Self::Counts;
    /// For signed bytes, `sum + query (row + OFFSET)`.
    fn products_i8(self, sum: Self::Counts, query: Self::Block, row: Self::Block) -> Self::Counts;
    /// The numbers, in registers.
    fn shorts(self, numbers: &[i16; BLOCK]) -> Self::Shorts;
    /// For signed bytes, `sum + query row`: at most sixteen products a sum.
    fn products_i16(
        self,
        sum: Self::Counts,
        query: Self::Shorts,
        row: &[i8; BLOCK],
    ) -> Self::Counts;
    /// The total of [`differences`](Self::differences).
    fn total_differences(self, sum: Self::Counts) -> i64;
    /// The total of the others.
    fn total(self, sum: Self::Counts) -> i64;
}

/// A number whose blocks can be read as f32.
pub(crate) trait Widen: Copy {
    /// The block as f32, in `space` if it must be converted.
    fn widen<'a>(block: &'a [Self], space: &'a mut [f32; SPACE]) -> &'a [f32];
}

impl Widen for f32 {
    fn widen<'a>(block: &'a [Self], _: &'a mut [f32; SPACE]) -> &'a [f32] {
        block
    }
}

impl Widen for f16 {
    fn widen<'a>(block: &'a [Self], space: &'a mut [f32; SPACE]) -> &'a [f32] {
        let space = &mut space[..block.len()];
        block.convert_to_f32_slice(space);
        space
    }
}

macro_rules! widen_bytes {
    ($($byte:ty),*) => {$(
        impl Widen for $byte {
            fn widen<'a>(block: &'a [Self], space: &'a mut [f32; SPACE]) -> &'a [f32] {
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

/// A number that is compared as a float.
pub(crate) trait Number: Widen + Default {
    /// A block of them, in registers.
    fn load<M: Machine>(machine: M, numbers: &[Self; LANES]) -> M::Floats;
}

macro_rules! numbers {
    ($($number:ty => $load:ident),*) => {$(
        impl Number for $number {
            #[inline(always)]
            fn load<M: Machine>(machine: M, numbers: &[Self; LANES]) -> M::Floats {
                machine.$load(numbers)
            }
        }
    )*};
}
numbers!(f32 => f32s, f16 => f16s, i8 => i8s, u8 => u8s);

/// A number that is compared as a whole one.
pub(crate) trait Byte: Pod + Default + Into<i32> {
    /// Whether it is an `i8`.
    const SIGNED: bool;
}

impl Byte for u8 {
    const SIGNED: bool = false;
}

impl Byte for i8 {
    const SIGNED: bool = true;
}
