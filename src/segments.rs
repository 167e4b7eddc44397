//! Which places follow each other: gradients and diagonals end at the ends of a segment.

use std::ops::Range;
use std::sync::Arc;

/// The segments of a route, in order: ranges of places that cover it without a gap. A route has one
/// segment for now.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Segments(Arc<[Range<usize>]>);

impl Segments {
    /// One segment of `places` places.
    pub(crate) fn one(places: usize) -> Self {
        Self(std::iter::once(0..places).collect())
    }

    /// Segments of these lengths, one after the other.
    #[cfg(test)]
    pub(crate) fn of_lengths(lengths: &[usize]) -> Self {
        let mut end = 0;
        let next = |length: &usize| {
            end += length;
            end - length..end
        };
        Self(lengths.iter().map(next).collect())
    }

    /// How many places the route has.
    pub(crate) fn places(&self) -> usize {
        self.0.last().map_or(0, |last| last.end)
    }

    /// The segments of some of the places, which count from 0 again.
    pub(crate) fn slice(&self, places: Range<usize>) -> Self {
        let within = |segment: &Range<usize>| {
            let (from, to) = (segment.start.max(places.start), segment.end.min(places.end));
            (from < to).then(|| from - places.start..to - places.start)
        };
        Self(self.iter().filter_map(within).collect())
    }

    pub(crate) fn iter(&self) -> std::slice::Iter<'_, Range<usize>> {
        self.0.iter()
    }

    /// The segment of a place on the route.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "it is asked for every candidate of a search")]
    pub(crate) fn of(&self, place: usize) -> &Range<usize> {
        let index = self.0.partition_point(|segment| segment.end <= place);
        &self.0[index]
    }
}
