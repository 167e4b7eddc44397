//! The places that a shard looks at: its own, and those beside them on their segments that its sums
//! reach, in one line.
//!
//! A segment that has own places gives one piece of the line. If it is whole, it stays as it is, so
//! that the method works on the line as on a route; the ends of one that is cut mean nothing: own
//! places lie so far from them that no sum of theirs comes across.

use std::ops::Range;

use crate::segments::{Segment, Segments};

/// Moves by more places do not follow links: the cost is bounded.
pub(super) const FARTHEST: usize = 64;

/// A shard's line of places.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    own: Range<usize>,
    /// How many places each piece has before and after its own, at least, if its segment goes on.
    reach: [usize; 2],
    /// The line's segments, one a piece.
    segments: Segments,
    pieces: Vec<Piece>,
    /// Ranges beside the line from which links lead to own places, in order, and where they are.
    beside: Vec<(Range<usize>, usize)>,
}

/// The part of a segment that is on the line.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// The whole segment, of the route.
    whole: Segment,
    /// Its places on the line.
    line: Range<usize>,
    /// The place of the route with which it begins.
    first: usize,
    /// Its own places on the line.
    own: Range<usize>,
}

impl Layout {
    /// That of the places `own`, with `before` and `after` more on their segments, as far as there
    /// are.
    pub(crate) fn new(segments: &Segments, own: Range<usize>, [before, after]: [usize; 2]) -> Self {
        let (mut pieces, mut list, mut start) = (Vec::new(), Vec::new(), 0);
        for &whole in segments.within(own.clone()) {
            let (from, to) = (whole.start.max(own.start), whole.end.min(own.end));
            let wanted = before.saturating_add(after).saturating_add(to - from);
            let (first, len) = if wanted >= whole.len() && whole.closed {
                (whole.start, whole.len())
            } else if whole.closed {
                (whole.before(from, before), wanted)
            } else {
                let first = from.saturating_sub(before).max(whole.start);
                (first, to.saturating_add(after).min(whole.end) - first)
            };
            let line = start..start + len;
            let ahead = if from < first { from + whole.len() - first } else { from - first };
            let own = line.start + ahead..line.start + ahead + (to - from);
            let closed = whole.closed && len == whole.len();
            list.push(Segment { start: line.start, end: line.end, closed });
            start = line.end;
            pieces.push(Piece { whole, line, first, own });
        }
        let (segments, beside) = (Segments::of_list(list), Vec::new());
        Self { own, reach: [before, after], segments, pieces, beside }
    }

    /// With the places around the two ends of each link near own places: from there, walks by it
    /// come.
    pub(crate) fn with_junctions(mut self, segments: &Segments) -> Self {
        let around = |place: usize| {
            let segment = *segments.of(place);
            if segment.closed && segment.len() <= 2 * FARTHEST {
                return [segment.places(), 0..0];
            }
            let end = |by: isize| segment.onward(place, by * FARTHEST as isize);
            match [end(-1), end(1)] {
                [Some(first), Some(last)] if first > last => {
                    [first..segment.end, segment.start..last + 1]
                }
                [first, last] => {
                    [first.unwrap_or(segment.start)..last.map_or(segment.end, |at| at + 1), 0..0]
                }
            }
        };
        let own = self.own();
        let mut ranges: Vec<_> = segments
            .links()
            .iter()
            .map(|&(from, to)| [around(from), around(to)])
            .filter(|both| both.iter().flatten().any(|r| r.start < own.end && own.start < r.end))
            .flatten()
            .flatten()
            .filter(|range| !range.is_empty())
            .collect();
        ranges.sort_unstable_by_key(|range| range.start);
        let mut end = self.len();
        for range in ranges {
            let start = self.beside.last().map_or(0, |(last, _)| last.end).max(range.start);
            if start < range.end {
                self.beside.push((start..range.end, end));
                end += range.end - start;
            }
        }
        self
    }

    /// How many places it has, those beside the line among them.
    pub(crate) fn total(&self) -> usize {
        self.beside.last().map_or(self.len(), |(range, at)| at + range.len())
    }

    /// Where it has a place of the route, on the line or beside it.
    pub(crate) fn anywhere(&self, place: usize) -> Option<usize> {
        self.at(place).or_else(|| {
            let index = self.beside.partition_point(|(range, _)| range.end <= place);
            let (range, at) = self.beside.get(index)?;
            range.contains(&place).then(|| at + (place - range.start))
        })
    }

    /// Where some of the own places, which count from the first, are on the line.
    #[inline(always)]
    pub(crate) fn own_parts(
        &self,
        places: Range<usize>,
    ) -> impl Iterator<Item = (usize, Range<usize>)> {
        let first = self.own.start;
        let start = first + places.start;
        let piece = self.pieces.partition_point(|piece| piece.whole.end <= start);
        self.pieces[piece..].iter().map_while(move |piece| {
            let from = piece.whole.start.max(first) - first;
            let (begin, end) = (from.max(places.start), places.end.min(from + piece.own.len()));
            (begin < end).then(|| (piece.own.start + (begin - from), begin..end))
        })
    }

    /// The shard's own places of the route.
    pub(crate) fn own(&self) -> Range<usize> {
        self.own.clone()
    }

    /// How many places it has before and after its own.
    pub(crate) fn reach(&self) -> [usize; 2] {
        self.reach
    }

    /// How many places the line has.
    pub(crate) fn len(&self) -> usize {
        self.segments.places()
    }

    pub(crate) fn segments(&self) -> &Segments {
        &self.segments
    }

    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Where the line has a place of the route.
    #[inline(always)]
    pub(crate) fn at(&self, place: usize) -> Option<usize> {
        let piece = self.pieces.partition_point(|piece| piece.whole.end <= place);
        self.pieces.get(piece)?.at(place)
    }

    /// The ranges of the route that the line is made of, each with where it begins on the line.
    pub(crate) fn ranges(&self) -> impl Iterator<Item = (Range<usize>, usize)> {
        self.pieces.iter().flat_map(Piece::ranges)
    }

    /// Those of them, and of those beside the line, that are not the shard's own.
    pub(crate) fn foreign(&self) -> impl Iterator<Item = (Range<usize>, usize)> {
        let own = self.own();
        self.ranges().chain(self.beside.iter().cloned()).flat_map(move |(range, at)| {
            let before = range.start..range.end.min(own.start.max(range.start));
            let after = range.start.max(own.end.min(range.end))..range.end;
            let behind = at + (after.start - range.start);
            [(before, at), (after, behind)].into_iter().filter(|(range, _)| !range.is_empty())
        })
    }

    /// The first two and the last two places of each open segment that is not whole: the mean of its
    /// gradient is made of their distances.
    pub(crate) fn ends(&self) -> impl Iterator<Item = [usize; 4]> {
        self.pieces.iter().filter_map(Piece::ends)
    }
}

impl Piece {
    pub(crate) fn whole(&self) -> Segment {
        self.whole
    }

    /// Its own places on the line.
    pub(crate) fn own(&self) -> Range<usize> {
        self.own.clone()
    }

    /// Its own places on the route.
    pub(crate) fn own_places(&self) -> Range<usize> {
        let first = self.place(self.own.start);
        first..first + self.own.len()
    }

    /// The place of the route that lies somewhere on the line.
    pub(crate) fn place(&self, at: usize) -> usize {
        let place = self.first + (at - self.line.start);
        if place >= self.whole.end { place - self.whole.len() } else { place }
    }

    fn at(&self, place: usize) -> Option<usize> {
        if place < self.whole.start {
            return None;
        }
        // Places before the first go round: of an open segment, beyond the line.
        let lap = if place < self.first { self.whole.len() } else { 0 };
        let ahead = place + lap - self.first;
        (ahead < self.line.len()).then(|| self.line.start + ahead)
    }

    fn ranges(&self) -> impl Iterator<Item = (Range<usize>, usize)> + use<> {
        let Self { whole, line, first, .. } = self.clone();
        let straight = line.len().min(whole.end - first);
        let again = whole.start..whole.start + (line.len() - straight);
        let ranges = [(first..first + straight, line.start), (again, line.start + straight)];
        ranges.into_iter().filter(|(range, _)| !range.is_empty())
    }

    /// As [`Layout::ends`].
    pub(crate) fn ends(&self) -> Option<[usize; 4]> {
        let Segment { start, end, closed } = self.whole;
        let cut = !closed && self.line.len() < self.whole.len();
        cut.then(|| [start, start + 1, end - 2, end - 1])
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;
    use proptest::sample::Index;

    use super::*;
    use crate::cases::cases;

    /// A route, own places and a reach.
    fn case() -> impl Strategy<Value = (Segments, Range<usize>, [usize; 2])> {
        of_lengths(1..12_usize)
    }

    /// One with links, and segments about as long as what a link reaches.
    fn with_links() -> impl Strategy<Value = (Segments, Range<usize>, [usize; 2])> {
        let lengths = prop_oneof![1..12_usize, 60..70_usize, 125..135_usize, 180..200_usize];
        let links = proptest::collection::vec(any::<[Index; 2]>(), 1..4);
        (of_lengths(lengths), links).prop_map(|((segments, own, reach), links)| {
            let places = segments.places();
            let links = links.iter().map(|[from, to]| (from.index(places), to.index(places)));
            let follows =
                |&(from, to): &(usize, usize)| segments.of(from).onward(from, 1) == Some(to);
            let links: BTreeSet<_> =
                links.filter(|link| link.0 != link.1 && !follows(link)).collect();
            let links: Vec<_> = links.into_iter().collect();
            (segments.with_links(&links).unwrap_or_default(), own, reach)
        })
    }

    fn of_lengths(
        length: impl Strategy<Value = usize>,
    ) -> impl Strategy<Value = (Segments, Range<usize>, [usize; 2])> {
        let lengths = proptest::collection::vec((length, any::<bool>()), 1..6);
        let reach = [0..15_usize, 0..15_usize];
        (lengths, any::<[Index; 2]>(), reach, any::<[bool; 2]>()).prop_map(
            |(lengths, [from, to], reach, [from_start, to_end])| {
                let mut start = 0;
                let list = lengths.iter().map(|&(len, closed)| {
                    start += len;
                    Segment { start: start - len, end: start, closed: closed && len > 2 }
                });
                let segments = Segments::of_list(list.collect());
                let (from, to) = (from.index(start), to.index(start));
                let (first, last) = (from.min(to), from.max(to));
                let first = if from_start { segments.of(first).start } else { first };
                let end = if to_end { segments.of(last).end } else { last + 1 };
                (segments, first..end, reach)
            },
        )
    }

    proptest! {
        #![proptest_config(cases(2_000))]

        #[test]
        fn a_line_has_each_own_place_and_its_neighbours((segments, own, reach) in case()) {
            let layout = Layout::new(&segments, own.clone(), reach);
            let mut line = vec![usize::MAX; layout.len()];
            for (range, at) in layout.ranges() {
                for (to, place) in line[at..].iter_mut().zip(range) {
                    *to = place;
                }
            }
            for (at, &place) in line.iter().enumerate() {
                prop_assert_eq!(layout.at(place), Some(at), "{} of {:?}", place, line);
            }
            let near = own.clone().flat_map(|place| {
                let segment = *segments.of(place);
                let by = -(reach[0] as isize)..=reach[1] as isize;
                by.filter_map(move |by| segment.onward(place, by))
            });
            prop_assert_eq!(line.iter().copied().collect::<BTreeSet<_>>(), near.collect());
            let mut owned = Vec::new();
            for (piece, local) in layout.pieces().iter().zip(layout.segments().iter()) {
                owned.extend(piece.own_places());
                for at in piece.line.clone() {
                    prop_assert_eq!(piece.place(at), line[at]);
                }
                let of_line: Vec<_> = piece.own().map(|at| line[at]).collect();
                prop_assert_eq!(of_line, piece.own_places().collect::<Vec<_>>());
                for at in piece.own() {
                    for by in -(reach[0] as isize)..=reach[1] as isize {
                        let there = piece.whole().onward(line[at], by);
                        prop_assert_eq!(local.onward(at, by).map(|at| line[at]), there);
                    }
                }
            }
            prop_assert_eq!(owned, own.clone().collect::<Vec<_>>());
            let mut foreign: Vec<_> = layout.foreign().flat_map(|(range, at)| range.zip(at..)).collect();
            let all = line.iter().copied().zip(0..);
            let mut expected: Vec<_> = all.filter(|(place, _)| !own.contains(place)).collect();
            foreign.sort_unstable();
            expected.sort_unstable();
            prop_assert_eq!(foreign, expected);
        }

        #[test]
        fn own_places_are_found_by_their_number((segments, own, reach) in case(), part in any::<[Index; 2]>()) {
            let layout = Layout::new(&segments, own.clone(), reach);
            let [from, to] = part.map(|index| index.index(own.len() + 1));
            let (from, to) = (from.min(to), from.max(to));
            let mut next = from;
            for (at, places) in layout.own_parts(from..to) {
                prop_assert_eq!(places.start, next);
                prop_assert!(!places.is_empty());
                for (at, place) in (at..).zip(places.clone()) {
                    prop_assert_eq!(layout.at(own.start + place), Some(at));
                }
                next = places.end;
            }
            prop_assert_eq!(next, to);
        }

        #[test]
        fn a_cut_segment_has_its_ends((segments, own, reach) in case()) {
            let layout = Layout::new(&segments, own.clone(), reach);
            let cut = |segment: &&Segment| {
                !segment.closed && segment.places().any(|place| layout.at(place).is_none())
            };
            let ends = segments.within(own).iter().filter(cut);
            let ends = ends.map(|&Segment { start, end, .. }| [start, start + 1, end - 2, end - 1]);
            prop_assert!(layout.ends().eq(ends));
        }
    }

    proptest! {
        #![proptest_config(cases(500))]

        /// The places of a line and those at most 64 from both ends of each link near own places.
        #[test]
        fn links_bring_the_places_around_their_ends((segments, own, reach) in with_links()) {
            let of = |place: usize| {
                let by = -(FARTHEST as isize)..=FARTHEST as isize;
                let segment = segments.of(place);
                by.filter_map(move |by| segment.onward(place, by))
            };
            let around = |&(from, to): &(usize, usize)| -> BTreeSet<usize> { of(from).chain(of(to)).collect() };
            let links = segments.links().iter().map(around);
            let beside: BTreeSet<usize> =
                links.filter(|places| own.clone().any(|place| places.contains(&place))).flatten().collect();
            let line = Layout::new(&segments, own.clone(), reach);
            let layout = line.clone().with_junctions(&segments);
            prop_assert_eq!(layout.total(), line.len() + beside.len());
            for place in 0..segments.places() {
                let at = layout.anywhere(place);
                prop_assert_eq!(at.is_some(), line.at(place).is_some() || beside.contains(&place), "{}", place);
                prop_assert!(line.at(place).is_none_or(|on_the_line| at == Some(on_the_line)));
            }
            let foreign: Vec<_> = layout.foreign().flat_map(|(range, at)| range.zip(at..)).collect();
            let count = foreign.len();
            let foreign: BTreeSet<_> = foreign.into_iter().collect();
            let distinct: BTreeSet<_> = foreign.iter().map(|one| one.1).collect();
            prop_assert_eq!(distinct.len(), count);
            prop_assert!(distinct.last().is_none_or(|&at| at < layout.total()));
            let others = (0..segments.places()).filter(|place| !own.contains(place));
            for place in others {
                prop_assert!(layout.anywhere(place).is_none_or(|at| foreign.contains(&(place, at))));
            }
            for (place, _) in foreign {
                prop_assert!(!own.contains(&place) && layout.anywhere(place).is_some());
            }
        }
    }
}
