//! Segments (method 1.14): which place lies before which.

use surefix::Segments;

/// The places from `first` to before `end`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Road {
    pub(crate) first: usize,
    pub(crate) end: usize,
    pub(crate) closed: bool,
}

impl Road {
    pub(crate) fn all(segments: &Segments) -> Vec<Self> {
        let road = |s: &surefix::Segment| Self { first: s.start, end: s.end, closed: s.closed };
        segments.iter().map(road).collect()
    }

    pub(crate) fn count(self) -> usize {
        self.end - self.first
    }

    pub(crate) fn has(self, place: usize) -> bool {
        (self.first..self.end).contains(&place)
    }

    /// The place `back` places before one, after it if `back` is negative.
    pub(crate) fn back(self, place: usize, back: i64) -> Option<usize> {
        let to = i128::from((place - self.first) as u64) - i128::from(back);
        let count = self.count() as i128;
        let to = if self.closed { to.rem_euclid(count) } else { to };
        (0..count).contains(&to).then(|| self.first + to as usize)
    }

    /// How far apart two of its places lie.
    pub(crate) fn apart(self, a: usize, b: usize) -> usize {
        let straight = a.abs_diff(b);
        if self.closed { straight.min(self.count() - straight) } else { straight }
    }
}
