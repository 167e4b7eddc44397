//! Segments of routes that are joined, and of those that lose places.

use super::{LEAST_CLOSED, Segment, Segments};
use crate::error::Error;

impl Segments {
    /// These and then those of `more`, whose places count on. Its first segment goes on with the
    /// last of these, unless it `begins` a new one: both must be open then.
    pub(crate) fn followed_by(&self, more: &Self, begins: bool) -> Self {
        let shift = self.places();
        let mut list = self.list.to_vec();
        let mut added = more.list.iter().map(|&Segment { start, end, closed }| Segment {
            start: start + shift,
            end: end + shift,
            closed,
        });
        if !begins && let (Some(last), Some(first)) = (list.last_mut(), added.next()) {
            last.end = first.end;
        }
        list.extend(added);
        let links = more.links.iter().map(|&(from, to)| (from + shift, to + shift));
        Self { list: list.into(), links: self.links.iter().copied().chain(links).collect() }
    }

    /// The segments of a route that keeps only some of its places: the others are thinned out, and
    /// those before and after them follow each other. A closed segment stays closed; if it keeps
    /// fewer than 3 places, it becomes open. The ends of links move to the nearest place of their
    /// segment that is kept; a segment without such a place is no more, and neither are its links.
    ///
    /// ```
    /// use surefix::Segments;
    /// let road = Segments::new(10, &[6])?.with_links(&[(3, 6)])?;
    /// let thinned = road.keep(&[0, 2, 4, 6, 8])?;
    /// assert_eq!(thinned, Segments::new(5, &[3])?.with_links(&[(1, 3)])?);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Option`] unless `places` ascend within the route; [`Error::TooFewPlaces`] for none.
    pub fn keep(&self, places: &[usize]) -> Result<Self, Error> {
        self.check_ascending(places)?;
        if places.is_empty() {
            return Err(Error::TooFewPlaces { what: "segments", got: 0 });
        }
        Ok(self.kept(places, usize::MAX))
    }

    pub(crate) fn check_ascending(&self, places: &[usize]) -> Result<(), Error> {
        let last = self.places() - 1;
        let wrong = |got: String| {
            let expected = format!("places in ascending order, from 0 to {last}");
            Err(Error::Option { name: "places", expected, got })
        };
        if let Some(&[before, after]) = places.windows(2).find(|pair| pair[0] >= pair[1]) {
            return wrong(format!("{after} after {before}"));
        }
        places
            .last()
            .filter(|&&place| place > last)
            .map_or(Ok(()), |place| wrong(place.to_string()))
    }

    /// The segments of some of the places, which ascend. A stretch of `tunnel` places or more that
    /// is left out within a segment becomes a break, with a link across; a closed segment with such
    /// a break becomes open.
    pub(crate) fn kept(&self, places: &[usize], tunnel: usize) -> Self {
        let mut list = Vec::new();
        let mut links = Vec::new();
        let mut first = 0;
        for segment in self.iter() {
            let count = places[first..].partition_point(|&place| place < segment.end);
            let kept = &places[first..first + count];
            let end = first + count;
            let (Some(&head), Some(&tail)) = (kept.first(), kept.last()) else { continue };
            let mut start = first;
            for (index, pair) in kept.windows(2).enumerate() {
                if pair[1] - pair[0] > tunnel {
                    let at = first + index + 1;
                    list.push(Segment { start, end: at, closed: false });
                    links.push((at - 1, at));
                    start = at;
                }
            }
            // From the last kept place on to the first.
            let wraps = (head - segment.start) + (segment.end - 1 - tail) >= tunnel;
            let broken = start > first || wraps;
            let closed = segment.closed && !broken && count >= LEAST_CLOSED;
            if segment.closed && broken {
                links.push((end - 1, first));
            }
            list.push(Segment { start, end, closed });
            first = end;
        }
        let moved = self.links.iter().filter_map(|&(from, to)| {
            Some((self.nearest_kept(from, places)?, self.nearest_kept(to, places)?))
        });
        links.extend(moved);
        links.sort_unstable();
        links.dedup();
        let mut kept = Self { list: list.into(), links: links.into() };
        let leads_on = |&&(from, to): &&(usize, usize)| {
            from != to && kept.of(from).onward(from, 1) != Some(to)
        };
        kept.links = kept.links.iter().filter(leads_on).copied().collect();
        kept
    }

    /// The index in `places` of the nearest to `place` of its segment; of two as near, the first.
    fn nearest_kept(&self, place: usize, places: &[usize]) -> Option<usize> {
        let segment = self.of(place);
        let first = places.partition_point(|&kept| kept < segment.start);
        let end = places.partition_point(|&kept| kept < segment.end);
        let after = places.partition_point(|&kept| kept < place);
        // Beside it, and at the ends, which a closed segment joins.
        let near = [first, after.saturating_sub(1), after, end.saturating_sub(1)];
        let near = near.into_iter().filter(|index| (first..end).contains(index));
        near.min_by_key(|&index| (segment.apart(places[index], place), index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Breaks, closed segments and links.
    type Parts<'a> = (&'a [usize], &'a [usize], &'a [(usize, usize)]);

    fn route(places: usize, (breaks, closed, links): Parts<'_>) -> Segments {
        let route = Segments::new(places, breaks).unwrap().with_closed(closed).unwrap();
        route.with_links(links).unwrap()
    }

    #[test]
    fn joined_routes_keep_their_segments() {
        let one = route(5, (&[2], &[1], &[(1, 2)]));
        let other = route(4, (&[1], &[1], &[(0, 2)]));
        let expected = route(9, (&[2, 5, 6], &[1, 3], &[(1, 2), (5, 7)]));
        assert_eq!(one.followed_by(&other, true), expected);
        let expected = route(9, (&[5], &[1], &[(4, 6)]));
        assert_eq!(
            Segments::one(4).followed_by(&route(5, (&[1], &[1], &[(0, 2)])), false),
            expected
        );
    }

    #[test]
    fn thinned_segments_stay_closed_and_links_move() {
        let whole = route(20, (&[8, 9], &[0, 2], &[(7, 8), (3, 19), (3, 14), (14, 3)]));
        // Place 8 is a segment of its own and goes; 19 is nearest to 9 round the loop.
        let kept = whole.kept(&[0, 2, 4, 6, 9, 12, 15], usize::MAX);
        let expected = route(7, (&[4], &[0, 1], &[(1, 4), (1, 6), (6, 1)]));
        assert_eq!(kept, expected);
        assert!(!whole.kept(&[0, 1, 9, 10, 11], usize::MAX).of(0).closed, "of two places");
        assert_eq!(whole.kept(&(0..20).collect::<Vec<_>>(), 1), whole);
        // Ends that meet, and links that lead on by themselves, are no links.
        let straight = route(6, (&[], &[], &[(0, 3), (4, 1), (5, 3)]));
        assert_eq!(straight.kept(&[0, 3], usize::MAX), route(2, (&[], &[], &[(1, 0)])));
    }

    #[test]
    fn tunnels_are_breaks_with_a_link_across() {
        let open = Segments::one(30);
        let outside: Vec<usize> = (2..10).chain(14..20).chain(25..28).collect();
        assert_eq!(open.kept(&outside, 5), route(17, (&[14], &[], &[(13, 14)])));
        let ring = open.with_closed(&[0]).unwrap();
        // 2 places before and 2 after: 4 in all, and the ring goes on.
        let expected = route(17, (&[14], &[], &[(13, 14), (16, 0)]));
        assert_eq!(ring.kept(&outside, 5), expected);
        let within: Vec<usize> = (2..28).collect();
        assert_eq!(ring.kept(&within, 5), Segments::one(26).with_closed(&[0]).unwrap());
        let within: Vec<usize> = (3..28).collect();
        assert_eq!(ring.kept(&within, 5), route(25, (&[], &[], &[(24, 0)])));
    }
}
