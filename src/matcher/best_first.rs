//! The least of numbers of which lower bounds are known, with a look at as few of them as possible
//! (method 1.9).

use super::extreme::{BLOCK, any, first_better};

/// A number, or a bound of it, and its place.
pub(super) type Candidate = (f64, usize);

/// What a search ends with.
pub(super) enum Found {
    /// The first of the least numbers, or what was known before where nothing beats that.
    Best(Option<Candidate>),
    /// Too many that can be the least.
    Crowd,
}

/// Whether a number, or what it may be at best, comes before the best so far: less, or equal and at
/// a lower place.
pub(super) fn beats(one: Candidate, best: Option<Candidate>) -> bool {
    best.is_none_or(|(least, at)| one.0 < least || (one.0 == least && one.1 < at))
}

/// The first of the least of some numbers, of places `first`, `first + 1`, ..., which are not below
/// their `bounds`. `number(place, best)` looks at one: the number, or nothing where it turns out
/// that it does not beat the best so far. Of the many that may beat the first one that is looked
/// at, more than `most` are too many.
pub(super) fn first_least<T: Copy + PartialOrd + Into<f64>>(
    bounds: &[T],
    first: usize,
    mut best: Option<Candidate>,
    most: usize,
    candidates: &mut Vec<Candidate>,
    mut number: impl FnMut(usize, Option<Candidate>) -> Option<f64>,
) -> Found {
    let mut look = |candidate: Candidate, best: &mut Option<Candidate>| {
        if beats(candidate, *best)
            && let Some(number) = number(candidate.1, *best)
            && beats((number, candidate.1), *best)
        {
            *best = Some((number, candidate.1));
        }
    };
    let Some(promising) = least(bounds) else { return Found::Best(best) };
    look((bounds[promising].into(), first + promising), &mut best);
    candidates.clear();
    for (block, numbers) in bounds.chunks(BLOCK).enumerate() {
        let limit = best.map_or(f64::INFINITY, |(least, _)| least);
        if !any(numbers, |bound| bound.into() <= limit) {
            continue;
        }
        for (at, &bound) in numbers.iter().enumerate() {
            let at = block * BLOCK + at;
            let candidate = (bound.into(), first + at);
            if at != promising && beats(candidate, best) {
                if candidates.len() >= most {
                    return Found::Crowd;
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
        look(candidate, &mut best);
    }
    Found::Best(best)
}

/// The place of the first of the least numbers, where one is a number.
fn least<T: Copy + PartialOrd + Into<f64>>(numbers: &[T]) -> Option<usize> {
    let mut found: Option<(usize, T)> = None;
    for (block, numbers) in numbers.chunks(BLOCK).enumerate() {
        let start = match found {
            Some((_, best)) => first_better(numbers, best, |a, b| a < b),
            None => numbers
                .first()
                .map(|&first| first_better(numbers, first, |a, b| a < b).unwrap_or((0, first))),
        };
        if let Some((at, number)) = start {
            found = Some((block * BLOCK + at, number));
        }
    }
    found.map(|(at, _)| at)
}
