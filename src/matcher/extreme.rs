//! The smallest or largest of many numbers, fast, and where it stands first.
//!
//! Most numbers are no better than the best so far: that is all that is asked of a block of them,
//! which takes a comparison each. The few blocks that hold something better are looked at again.

/// How many numbers are asked at a time.
pub(super) const BLOCK: usize = 128;

/// Whether `holds` of any of the numbers. Without a way out in the middle, it runs in vector
/// registers.
#[inline(always)]
pub(super) fn any<T: Copy>(numbers: &[T], holds: impl Fn(T) -> bool) -> bool {
    numbers.iter().fold(false, |any, &x| any | holds(x))
}

/// The best of the numbers and where it stands first, if it beats `best`. `beats(a, b)` is a strict
/// comparison: a NaN never wins.
#[inline(always)]
pub(super) fn first_better<T: Copy + PartialEq>(
    numbers: &[T],
    best: T,
    beats: impl Fn(T, T) -> bool,
) -> Option<(usize, T)> {
    if any(numbers, |x| beats(x, best)) { Some(first_best(numbers, best, beats)) } else { None }
}

/// The best of numbers of which one beats `worst`, and where it stands first.
#[inline(always)]
fn first_best<T: Copy + PartialEq>(
    numbers: &[T],
    worst: T,
    beats: impl Fn(T, T) -> bool,
) -> (usize, T) {
    // Many side by side, in whole blocks, so that they stay in vector registers.
    const LANES: usize = 16;
    let better = |a: T, b: T| if beats(b, a) { b } else { a };
    let (blocks, rest) = numbers.as_chunks::<LANES>();
    let mut lanes = [worst; LANES];
    for block in blocks {
        for lane in 0..LANES {
            lanes[lane] = better(lanes[lane], block[lane]);
        }
    }
    let best = rest.iter().chain(&lanes).fold(worst, |best, &x| better(best, x));
    // Of the two zeros, the first.
    let start =
        blocks.iter().position(|block| any(block, |x| x == best)).unwrap_or(blocks.len()) * LANES;
    let place = start + numbers[start..].iter().position(|&x| x == best).unwrap_or(0);
    (place, numbers[place])
}
