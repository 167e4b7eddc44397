//! The smallest or largest of many numbers, fast, and where it stands first.

/// How many extremes run side by side: enough vector registers that none waits for the one before.
const LANES: usize = 64;

/// The number that `better` prefers to all others, and to `worst`. `better(a, b)` returns `b` only where it is strictly
/// better, so that a NaN never wins. Of equals it is any: the zeros are two.
#[inline(always)]
pub(super) fn extreme<T: Copy>(numbers: &[T], worst: T, better: impl Fn(T, T) -> T) -> T {
    let mut lanes = [worst; LANES];
    let (blocks, rest) = numbers.as_chunks::<LANES>();
    for (lane, &x) in lanes.iter_mut().zip(rest) {
        *lane = better(*lane, x);
    }
    for block in blocks {
        for (lane, &x) in lanes.iter_mut().zip(block) {
            *lane = better(*lane, x);
        }
    }
    // Halves against halves, which are vectors again for the most part.
    let mut width = LANES / 2;
    while width > 0 {
        for lane in 0..width {
            lanes[lane] = better(lanes[lane], lanes[lane + width]);
        }
        width /= 2;
    }
    lanes[0]
}

/// The index of the first number that equals `wanted`; 0 where none does, as for a NaN.
#[inline(always)]
pub(super) fn first_equal<T: Copy + PartialEq>(numbers: &[T], wanted: T) -> usize {
    const BLOCK: usize = 64;
    let holds = |block: &[T]| block.iter().fold(false, |holds, &x| holds | (x == wanted));
    let Some(block) = numbers.chunks(BLOCK).position(holds) else { return 0 };
    let start = block * BLOCK;
    start + numbers[start..].iter().position(|&x| x == wanted).unwrap_or(0)
}
