//! The smallest or largest of many numbers, fast, and where it stands first.

/// How many extremes run side by side, so that the compiler can use vector registers.
const LANES: usize = 16;

/// The number that `better` prefers to all others, and to `worst`. `better(a, b)` returns `b` only where it is strictly
/// better, so that a NaN never wins.
pub(super) fn extreme<T: Copy>(numbers: &[T], worst: T, better: impl Fn(T, T) -> T) -> T {
    let mut lanes = [worst; LANES];
    let blocks = numbers.chunks_exact(LANES);
    for (lane, &x) in lanes.iter_mut().zip(blocks.remainder()) {
        *lane = better(*lane, x);
    }
    for block in blocks {
        for (lane, &x) in lanes.iter_mut().zip(block) {
            *lane = better(*lane, x);
        }
    }
    lanes.iter().fold(worst, |best, &x| better(best, x))
}

/// The index of the first number that equals `wanted`; 0 where none does, as for a NaN.
pub(super) fn first_equal<T: Copy + PartialEq>(numbers: &[T], wanted: T) -> usize {
    const BLOCK: usize = 64;
    let holds = |block: &[T]| block.iter().fold(false, |holds, &x| holds | (x == wanted));
    let Some(block) = numbers.chunks(BLOCK).position(holds) else { return 0 };
    let start = block * BLOCK;
    start + numbers[start..].iter().position(|&x| x == wanted).unwrap_or(0)
}
