//! Which places follow each other: segments end at breaks, closed ones begin again, and links lead
//! from one to another.

mod editing;

use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Arc;

use crate::error::Error;

/// The fewest places of a closed segment: with two, each would be before and after the other.
const LEAST_CLOSED: usize = 3;

/// A stretch of places that follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Segment {
    /// Its first place.
    pub start: usize,
    /// The place after its last.
    pub end: usize,
    /// Whether its last place is followed by its first.
    pub closed: bool,
}

impl Segment {
    /// Its places.
    pub fn places(&self) -> Range<usize> {
        self.start..self.end
    }

    /// How many places it has, at least one.
    #[expect(clippy::len_without_is_empty, reason = "no segment is empty")]
    pub fn len(&self) -> usize {
        self.end - self.start
    }

    /// The place that lies `by` places after one of its places, or before it if `by` is negative;
    /// `None` beyond the ends of an open segment.
    pub(crate) fn onward(&self, place: usize, by: isize) -> Option<usize> {
        let at = (place - self.start) as isize;
        let len = self.len() as isize;
        let to = if self.closed { (at + by % len).rem_euclid(len) } else { at.saturating_add(by) };
        (0..len).contains(&to).then(|| self.start + to as usize)
    }

    /// The place that lies `back` places before one of its places. It must lie on the segment, if
    /// that is open.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "it is asked for every cell of a diagonal")]
    pub(crate) fn before(&self, place: usize, back: usize) -> usize {
        let ahead = place - self.start;
        if back <= ahead {
            return place - back;
        }
        self.end - 1 - (back - ahead - 1) % self.len()
    }

    /// How many places lie between two of its places, the shorter way.
    pub(crate) fn apart(&self, one: usize, other: usize) -> usize {
        let straight = one.abs_diff(other);
        if self.closed { straight.min(self.len() - straight) } else { straight }
    }
}

/// How a route's places follow each other (method 1.14): segments, one after the other, that cover
/// them all. Gradients, diagonals and motion end at the end of a segment. A closed segment has no
/// end: its last place is followed by its first. Links are further successors for the tracker's
/// motion, as at a junction.
///
/// ```
/// use surefix::Segments;
/// // Two roads of 60 and 40 places; at place 59 the robot may turn into the second, a loop.
/// let town = Segments::new(100, &[60])?.with_closed(&[1])?.with_links(&[(59, 60)])?;
/// assert_eq!(town.len(), 2);
/// assert_eq!(town.index_of(75), 1);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts", into = "Parts")]
pub struct Segments {
    list: Arc<[Segment]>,
    /// In order.
    links: Arc<[(usize, usize)]>,
}

impl Default for Segments {
    /// Of no places.
    fn default() -> Self {
        Self::one(0)
    }
}

impl Segments {
    /// One open segment of `places` places.
    pub fn one(places: usize) -> Self {
        let segment = Segment { start: 0, end: places, closed: false };
        Self { list: Arc::new([segment]), links: Arc::new([]) }
    }

    /// Open segments of `places` places in all. A new one begins at each place in `breaks`.
    ///
    /// # Errors
    /// [`Error::Option`] unless the breaks ascend from 1 to `places - 1`.
    pub fn new(places: usize, breaks: &[usize]) -> Result<Self, Error> {
        let mut before = 0;
        for &at in breaks {
            if at <= before || at >= places {
                let last = places.saturating_sub(1);
                let expected = format!("places in ascending order, from 1 to {last}");
                let got = match before {
                    0 => at.to_string(),
                    before => format!("{at} after {before}"),
                };
                return Err(Error::Option { name: "breaks", expected, got });
            }
            before = at;
        }
        let starts = [0].iter().chain(breaks);
        let ends = breaks.iter().chain([&places]);
        let list = starts.zip(ends).map(|(&start, &end)| Segment { start, end, closed: false });
        Ok(Self { list: list.collect(), links: Arc::new([]) })
    }

    /// Segments that follow each other from place 0 on, at least one.
    pub(crate) fn of_list(list: Vec<Segment>) -> Self {
        Self { list: list.into(), links: Arc::new([]) }
    }

    /// The same, with the segments of these indices closed, and no others.
    ///
    /// # Errors
    /// [`Error::Option`] for a segment that there is not, or one of fewer than 3 places.
    pub fn with_closed(mut self, closed: &[usize]) -> Result<Self, Error> {
        let mut list = self.list.to_vec();
        let count = list.len();
        for segment in &mut list {
            segment.closed = false;
        }
        for &index in closed {
            let expected = || match count {
                1 => "a segment: there is one, 0".to_owned(),
                _ => format!("segments from 0 to {}", count - 1),
            };
            let Some(segment) = list.get_mut(index) else {
                return Err(Error::Option {
                    name: "closed",
                    expected: expected(),
                    got: index.to_string(),
                });
            };
            if segment.len() < LEAST_CLOSED {
                let expected = format!("a segment of at least {LEAST_CLOSED} places");
                let got = format!("segment {index} of {}", segment.len());
                return Err(Error::Option { name: "closed", expected, got });
            }
            segment.closed = true;
        }
        self.list = list.into();
        Ok(self)
    }

    /// The same, with these links and no others: after the first place of each pair may come the
    /// second, beside the one that follows it in its segment.
    ///
    /// # Errors
    /// [`Error::Option`] for a place that there is not, a link from a place to itself or to the one
    /// that follows it anyway, or the same link twice.
    pub fn with_links(mut self, links: &[(usize, usize)]) -> Result<Self, Error> {
        let refused = |expected: String, (from, to): (usize, usize)| Error::Option {
            name: "links",
            expected,
            got: format!("{from} to {to}"),
        };
        let places = self.places();
        let mut sorted = links.to_vec();
        sorted.sort_unstable();
        for (index, &(from, to)) in sorted.iter().enumerate() {
            if from >= places || to >= places {
                let expected = format!("places from 0 to {}", places - 1);
                return Err(refused(expected, (from, to)));
            }
            if from == to || self.of(from).onward(from, 1) == Some(to) {
                let expected = "from a place to one that does not follow it anyway".to_owned();
                return Err(refused(expected, (from, to)));
            }
            if index > 0 && sorted[index - 1] == (from, to) {
                return Err(refused("each link once".to_owned(), (from, to)));
            }
        }
        self.links = sorted.into();
        Ok(self)
    }

    /// How many places the route has.
    pub fn places(&self) -> usize {
        self.list.last().map_or(0, |last| last.end)
    }

    /// How many segments there are, at least one.
    #[expect(clippy::len_without_is_empty, reason = "there is at least one")]
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// The segments, in order.
    #[allow(clippy::iter_without_into_iter, reason = "one way to go through them is enough")]
    pub fn iter(&self) -> std::slice::Iter<'_, Segment> {
        self.list.iter()
    }

    /// The links, in order.
    pub fn links(&self) -> &[(usize, usize)] {
        &self.links
    }

    /// The index of a place's segment, which must be on the route.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "it is asked for every candidate of a search")]
    pub fn index_of(&self, place: usize) -> usize {
        self.list.partition_point(|segment| segment.end <= place)
    }

    /// The segment of a place, which must be on the route.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "it is asked for every candidate of a search")]
    pub(crate) fn of(&self, place: usize) -> &Segment {
        &self.list[self.index_of(place)]
    }

    /// The segments that hold some of these places.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "it is asked for every chunk of a belief")]
    pub(crate) fn within(&self, places: Range<usize>) -> &[Segment] {
        let first = self.index_of(places.start);
        let rest = &self.list[first..];
        &rest[..rest.partition_point(|segment| segment.start < places.end)]
    }

    /// Whether two places, which must be on the route, lie in one segment, at most `tolerance` places
    /// apart: the shorter way round a closed one.
    pub fn are_near(&self, one: usize, other: usize, tolerance: usize) -> bool {
        let segment = self.of(one);
        segment.places().contains(&other) && segment.apart(one, other) <= tolerance
    }

    /// One place more, at the end of the last segment, or as the first of a new one. Nothing is
    /// allocated for a segment that goes on, unless a copy shares it.
    pub(crate) fn lengthen(&mut self, new: bool) {
        let end = self.places();
        if new && end > 0 {
            let next = Segment { start: end, end: end + 1, closed: false };
            self.list = self.iter().copied().chain([next]).collect();
        } else if let Some(last) = Arc::make_mut(&mut self.list).last_mut() {
            last.end += 1;
        }
    }

    /// The segments of some of the places, which count from 0 again. A closed segment that is cut
    /// becomes open, and links to places that are left out are no more.
    pub(crate) fn slice(&self, places: Range<usize>) -> Self {
        let within = |segment: &Segment| {
            let (from, to) = (segment.start.max(places.start), segment.end.min(places.end));
            (from < to).then(|| Segment {
                start: from - places.start,
                end: to - places.start,
                closed: segment.closed && to - from == segment.len(),
            })
        };
        let kept = |&&(from, to): &&(usize, usize)| places.contains(&from) && places.contains(&to);
        let links = self.links.iter().filter(kept);
        let links = links.map(|(from, to)| (from - places.start, to - places.start));
        Self { list: self.iter().filter_map(within).collect(), links: links.collect() }
    }
}

/// What [`Segments`] are made of.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Parts {
    places: usize,
    #[serde(default)]
    breaks: Vec<usize>,
    #[serde(default)]
    closed: Vec<usize>,
    #[serde(default)]
    links: Vec<(usize, usize)>,
}

impl From<Segments> for Parts {
    fn from(segments: Segments) -> Self {
        let closed = segments.iter().enumerate().filter(|(_, segment)| segment.closed);
        Self {
            places: segments.places(),
            breaks: segments.iter().skip(1).map(|segment| segment.start).collect(),
            closed: closed.map(|(index, _)| index).collect(),
            links: segments.links.to_vec(),
        }
    }
}

impl TryFrom<Parts> for Segments {
    type Error = Error;

    fn try_from(parts: Parts) -> Result<Self, Error> {
        let Parts { places, breaks, closed, links } = parts;
        Self::new(places, &breaks)?.with_closed(&closed)?.with_links(&links)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn breaks_cut_and_closed_segments_begin_again() {
        let route = Segments::new(10, &[4, 5]).unwrap().with_closed(&[0, 2]).unwrap();
        let ends: Vec<_> = route.iter().map(|s| (s.start, s.end, s.closed)).collect();
        assert_eq!(ends, [(0, 4, true), (4, 5, false), (5, 10, true)]);
        let (first, last) = (route.of(3), route.of(9));
        assert_eq!([1, -4, 9].map(|by| first.onward(3, by)), [Some(0), Some(3), Some(0)]);
        assert_eq!([1, -6].map(|by| last.onward(9, by)), [Some(5), Some(8)]);
        assert_eq!([0, 1, -1].map(|by| route.of(4).onward(4, by)), [Some(4), None, None]);
        assert!(route.are_near(0, 3, 1) && !route.are_near(3, 4, 1) && !route.are_near(5, 8, 1));
        assert_eq!(route.within(4..6).len(), 2);
        assert_eq!(route.within(0..4).len(), 1);
    }

    #[test]
    fn the_first_place_lengthens_a_route_of_none() {
        for new in [false, true] {
            let mut route = Segments::default();
            route.lengthen(new);
            assert_eq!(route, Segments::one(1));
            route.lengthen(new);
            assert_eq!((route.places(), route.len()), (2, if new { 2 } else { 1 }));
        }
        for (breaks, words) in [(&[][..], "there is one, 0"), (&[4], "segments from 0 to 1")] {
            let refused = Segments::new(9, breaks).unwrap().with_closed(&[2]);
            assert!(refused.is_err_and(|refused| refused.to_string().contains(words)), "{words}");
        }
    }

    #[test]
    fn impossible_breaks_closed_segments_and_links_are_refused() {
        for breaks in [&[0][..], &[10], &[11], &[5, 5], &[6, 4], &[3, 10]] {
            let error = Segments::new(10, breaks).unwrap_err().to_string();
            assert!(
                error.contains("option `breaks`: expected places in ascending order"),
                "{error}"
            );
        }
        let two = || Segments::new(10, &[2]).unwrap();
        assert!(two().with_closed(&[0]).unwrap_err().to_string().contains("at least 3 places"));
        assert!(two().with_closed(&[2]).unwrap_err().to_string().contains("from 0 to 1"));
        for link in [(0, 10), (10, 0), (4, 4), (4, 5)] {
            assert!(two().with_links(&[link]).is_err(), "{link:?}");
        }
        assert!(two().with_links(&[(1, 2), (9, 0), (4, 3)]).is_ok());
        assert!(two().with_links(&[(1, 2), (1, 2)]).is_err());
        assert!(two().with_closed(&[1]).unwrap().with_links(&[(9, 2)]).is_err());
    }

    #[test]
    fn a_slice_keeps_the_segments_and_links_inside_it() {
        let links = [(3, 8), (9, 0), (7, 4)];
        let route = Segments::new(10, &[4]).unwrap().with_closed(&[1]).unwrap();
        let route = route.with_links(&links).unwrap();
        let cut = route.slice(3..10);
        let expected = Segments::new(7, &[1]).unwrap().with_closed(&[1]).unwrap();
        assert_eq!(cut, expected.with_links(&[(0, 5), (4, 1)]).unwrap());
        assert!(!route.slice(3..9).of(1).closed);
        assert_eq!(route.slice(0..2), Segments::one(2));
        let text = serde_json::to_string(&route).unwrap();
        assert_eq!(serde_json::from_str::<Segments>(&text).unwrap(), route);
    }
}
