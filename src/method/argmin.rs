//! The smallest or largest of many numbers, and its first place.
//!
//! Most numbers are no better than the best so far. So a block of them is first asked only whether
//! any beats it, one comparison a number in vector registers without a branch; only the few blocks
//! that answer yes are searched. If the numbers are known by lower bounds alone, [`first_least`]
//! finds the first of the least and computes as few of them as possible.

/// Numbers that are compared at a time.
pub(super) const BLOCK: usize = 128;

/// Whether `holds` for any number. Without an early exit, it runs in vector registers.
#[inline(always)]
pub(super) fn any<T: Copy>(numbers: &[T], holds: impl Fn(T) -> bool) -> bool {
    numbers.iter().fold(false, |any, &x| any | holds(x))
}

/// The best number and its first index, if it beats `best`. `beats(a, b)` is a strict comparison: a
/// NaN never wins.
#[inline(always)]
pub(super) fn first_better<T: Copy + PartialEq>(
    numbers: &[T],
    best: T,
    beats: impl Fn(T, T) -> bool,
) -> Option<(usize, T)> {
    if any(numbers, |x| beats(x, best)) { Some(first_best(numbers, best, beats)) } else { None }
}

/// The best of numbers of which one beats `worst`, and its first index.
#[inline(always)]
fn first_best<T: Copy + PartialEq>(
    numbers: &[T],
    worst: T,
    beats: impl Fn(T, T) -> bool,
) -> (usize, T) {
    // Lane by lane, in whole blocks, so that the best stay in vector registers.
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
    // Zero equals negative zero: the first of both.
    let start = blocks.iter().position(|block| any(block, |x| x == best)).unwrap_or(blocks.len());
    let start = start * LANES;
    let place = start + numbers[start..].iter().position(|&x| x == best).unwrap_or(0);
    (place, numbers[place])
}

/// A number, or a lower bound of it, and its place.
pub(super) type Candidate = (f64, usize);

/// The result of [`first_least`].
pub(super) enum Search {
    /// The first of the least numbers, or the best so far if none beats it.
    Best(Option<Candidate>),
    /// Too many bounds lie below the best.
    TooMany,
}

/// Whether a candidate comes before the best so far: less, or equal and at a lower place.
pub(super) fn beats(one: Candidate, best: Option<Candidate>) -> bool {
    best.is_none_or(|(least, at)| one.0 < least || (one.0 == least && one.1 < at))
}

/// The first of the least numbers, given a lower bound of each. The numbers belong to the places
/// `first`, `first + 1`, ...
///
/// The number with the least bound is computed first: most other bounds lie above it. The rest are
/// computed in order of their bounds until the next bound cannot beat the best. `number(place,
/// best)` computes one; `None` if it turns out on the way that it cannot beat `best`. More than
/// `most` remaining candidates end the search.
pub(super) fn first_least<T: Copy + PartialOrd + Into<f64>>(
    bounds: &[T],
    first: usize,
    mut best: Option<Candidate>,
    most: usize,
    candidates: &mut Vec<Candidate>,
    mut number: impl FnMut(usize, Option<Candidate>) -> Option<f64>,
) -> Search {
    let mut compute = |candidate: Candidate, best: &mut Option<Candidate>| {
        if beats(candidate, *best)
            && let Some(number) = number(candidate.1, *best)
            && beats((number, candidate.1), *best)
        {
            *best = Some((number, candidate.1));
        }
    };
    let Some(promising) = least(bounds) else { return Search::Best(best) };
    compute((bounds[promising].into(), first + promising), &mut best);
    candidates.clear();
    for (block, bounds) in bounds.chunks(BLOCK).enumerate() {
        let limit = best.map_or(f64::INFINITY, |(least, _)| least);
        if !any(bounds, |bound| bound.into() <= limit) {
            continue;
        }
        for (at, &bound) in bounds.iter().enumerate() {
            let at = block * BLOCK + at;
            let candidate = (bound.into(), first + at);
            if at != promising && beats(candidate, best) {
                if candidates.len() >= most {
                    return Search::TooMany;
                }
                candidates.push(candidate);
            }
        }
    }
    candidates.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for &candidate in &*candidates {
        if !beats(candidate, best) {
            break;
        }
        compute(candidate, &mut best);
    }
    Search::Best(best)
}

/// The index of the first of the least numbers; `None` if there are none, or only NaNs.
fn least<T: Copy + PartialOrd>(numbers: &[T]) -> Option<usize> {
    let mut best: Option<(usize, T)> = None;
    for (block, numbers) in numbers.chunks(BLOCK).enumerate() {
        let start = match (best, numbers.first()) {
            (Some((_, least)), _) => first_better(numbers, least, |a, b| a < b),
            (None, first) => {
                first.map(|&first| first_better(numbers, first, |a, b| a < b).unwrap_or((0, first)))
            }
        };
        if let Some((at, number)) = start {
            best = Some((block * BLOCK + at, number));
        }
    }
    best.map(|(at, _)| at)
}
