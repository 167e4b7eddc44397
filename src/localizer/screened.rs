//! Localizing by a map's screen: a scan of the bytes, and a look at the rows that it leaves in
//! doubt (method 1.9).

use std::collections::VecDeque;
use std::ops::Range;

use crate::distance::{Query, View, first_not_finite};
use crate::error::Error;
use crate::map::Map;
use crate::matcher::{Bounded, Exact, Fix, Matcher, Ring};
use crate::room::Roomy;
use crate::scan::{EncodedQuery, Job, MAX_SCREENED, Pool};

/// Rows of fewer numbers cost no more than what is done with their bounds.
pub(super) const SHORTEST: usize = 256;

#[derive(Clone, Debug)]
pub(super) struct Screened {
    bounded: Bounded,
    /// The newest queries, as long as their distances can be asked for.
    queries: Ring,
    /// Their lengths, for the cosine, the newest first.
    lengths: Roomy<VecDeque<f64>>,
    encoded: EncodedQuery,
    products: Vec<f32>,
    lower: Vec<f32>,
    upper: Vec<f32>,
    patience: Patience,
    looked_at: usize,
}

impl Screened {
    /// Goes on from a matcher that was told all distances.
    ///
    /// # Errors
    /// [`Error::Memory`] where there is not enough for a second window.
    pub(super) fn new(map: &Map, matcher: Matcher) -> Result<Self, Error> {
        let config = matcher.config();
        // What was restored may hold numbers of any size: until it is forgotten, nothing is added
        // to bounds.
        let reach = config.smoothing.max(config.sequence_length);
        let (rest, looked_at) = if matcher.frames() > 0 { (reach, map.places()) } else { (0, 0) };
        let bounded = Bounded::new(matcher)?;
        let (window, places) = (bounded.window(), map.places());
        let mut queries = Ring::new(window, map.dim())?;
        let mut lengths = VecDeque::new();
        lengths
            .try_reserve_exact(window + 1)
            .map_err(|_| Error::Memory { places: 1, columns: window })?;
        for _ in 0..bounded.remembered() {
            // Nobody asks for their distances, which are known.
            queries.advance();
            lengths.push_front(0.0);
        }
        Ok(Self {
            bounded,
            queries,
            lengths: Roomy(lengths),
            encoded: EncodedQuery::new(map.dim()),
            products: vec![0.0; places],
            lower: vec![0.0; places],
            upper: vec![0.0; places],
            patience: Patience::new(rest),
            looked_at,
        })
    }

    /// # Errors
    /// [`Error::NotFinite`] for distances that are not. Nothing has changed then.
    pub(super) fn push(
        &mut self,
        map: &Map,
        pool: &mut Option<Pool>,
        query: Query<'_>,
        trusted: Option<bool>,
    ) -> Result<Fix, Error> {
        let tries = self.patience.tries();
        let screened = tries && self.bounds(map, pool, query);
        if !screened {
            self.scan(map, pool, query)?;
        }
        self.remember(query);
        let Self { bounded, queries, lengths, lower, upper, .. } = self;
        let mut rows = Rows { map, pool, queries, lengths };
        let upper = screened.then_some(upper.as_slice());
        let (fix, looked_at) = bounded.push(lower, upper, trusted, &mut rows);
        self.looked_at = if screened { looked_at } else { map.places() + looked_at };
        if tries {
            self.patience.judge(self.looked_at, map.places());
        } else {
            self.patience.wait();
        }
        Ok(fix)
    }

    /// Finds the bounds of all distances, and says whether they can be used.
    fn bounds(&mut self, map: &Map, pool: &mut Option<Pool>, query: Query<'_>) -> bool {
        let Some(codes) = map.codes() else { return false };
        let Self { encoded, products, lower, upper, .. } = self;
        codes.encode(map.isa(), map.metric(), query, encoded);
        Job::CodeProducts(&encoded.codes).column(map, pool, products);
        map.bounds(encoded, products, lower, upper)
    }

    /// Finds all distances. Where some are so large that sums of them overflow, all others become
    /// known as well, and nothing is screened as long as they are remembered.
    fn scan(&mut self, map: &Map, pool: &mut Option<Pool>, query: Query<'_>) -> Result<(), Error> {
        let Self { bounded, queries, lengths, lower, patience, .. } = self;
        Job::Distances(query).column(map, pool, lower);
        if let Some((index, value)) = first_not_finite(lower) {
            return Err(Error::NotFinite { what: "distances", row: None, index, value });
        }
        if lower.iter().any(|&d| d >= MAX_SCREENED) {
            bounded.settle_window(&mut Rows { map, pool, queries, lengths });
            patience.rest(bounded.window() + 1);
        }
        Ok(())
    }

    fn remember(&mut self, query: Query<'_>) {
        if let View::F32(numbers) = query.numbers {
            self.queries.advance().copy_from_slice(numbers);
        }
        self.lengths.truncate(self.queries.len() - 1);
        self.lengths.push_front(query.length);
    }

    pub(super) fn looked_at(&self) -> usize {
        self.looked_at
    }

    /// The newest query's distances, all of them; zeros before the first, and right after a gap.
    pub(super) fn distances(&mut self, map: &Map, pool: &mut Option<Pool>) -> &[f32] {
        let Self { bounded, queries, lengths, lower, .. } = self;
        match bounded.newest(&mut Rows { map, pool, queries, lengths }) {
            Some(newest) => lower.copy_from_slice(newest),
            None => lower.fill(0.0),
        }
        lower
    }

    /// The matcher that was told all distances.
    pub(super) fn settled(&self, map: &Map) -> Matcher {
        let Self { bounded, queries, lengths, .. } = self;
        bounded.settled(&mut Rows { map, pool: &mut None, queries, lengths })
    }

    /// Whether the screen pays is a matter of the route, so that the patience goes on.
    pub(super) fn gap(&mut self) {
        self.bounded.gap();
        self.queries.clear();
        self.lengths.clear();
    }

    pub(super) fn reset(&mut self) {
        self.gap();
        self.bounded.reset();
        (self.patience, self.looked_at) = (Patience::new(0), 0);
    }

    /// The method's state, but for the distances.
    pub(super) fn matcher(&self) -> &Matcher {
        self.bounded.matcher()
    }
}

/// Whether the screen is tried. After a frame for which it did not pay, so many are scanned plainly
/// that the cost of having tried is a small part of theirs; after several such frames in a row,
/// more.
#[derive(Clone, Debug)]
struct Patience {
    /// How many frames are still to be scanned plainly.
    left: usize,
    /// How many after the next one for which the screen does not pay.
    next: usize,
}

impl Patience {
    const SHORTEST: usize = 4;
    const LONGEST: usize = 256;

    fn new(left: usize) -> Self {
        Self { left, next: Self::SHORTEST }
    }

    fn tries(&self) -> bool {
        self.left == 0
    }

    /// A frame has been scanned plainly.
    fn wait(&mut self) {
        self.left = self.left.saturating_sub(1);
    }

    /// It has tried, and looked at so many rows. One that is looked at by itself costs more than
    /// one of many.
    fn judge(&mut self, looked_at: usize, places: usize) {
        if looked_at > places / 2 {
            self.rest(self.next);
            self.next = (2 * self.next).min(Self::LONGEST);
        } else {
            self.next = Self::SHORTEST;
        }
    }

    /// Does not try for so many frames at least.
    fn rest(&mut self, frames: usize) {
        self.left = self.left.max(frames);
    }
}

/// The map's rows, and the queries that they are compared with.
struct Rows<'a> {
    map: &'a Map,
    pool: &'a mut Option<Pool>,
    queries: &'a Ring,
    lengths: &'a VecDeque<f64>,
}

impl Exact for Rows<'_> {
    fn distances(&mut self, age: usize, places: Range<usize>, out: &mut [f32]) {
        let query =
            Query { numbers: View::F32(self.queries.column(age)), length: self.lengths[age] };
        if places.len() == self.map.places() {
            Job::Distances(query).column(self.map, self.pool, out);
        } else {
            self.map.scan(query, places, out);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How often it tries in so many frames, of which each that is tried makes it look at
    /// `looked_at` rows of 1000.
    fn tries(patience: &mut Patience, frames: usize, looked_at: usize) -> usize {
        let mut tries = 0;
        for _ in 0..frames {
            if patience.tries() {
                tries += 1;
                patience.judge(looked_at, 1000);
            } else {
                patience.wait();
            }
        }
        tries
    }

    #[test]
    fn it_tries_always_where_it_pays_and_seldom_where_it_does_not() {
        let mut patience = Patience::new(0);
        assert_eq!(tries(&mut patience, 100, 500), 100);
        // 1 + 4 + 1 + 8 + 1 + 16 + 1 + 32 + 1 + 64 + 1 + 128 + 1 + 256, and from there on one in
        // 257.
        assert_eq!(tries(&mut patience, 515, 501), 7);
        assert_eq!(tries(&mut patience, 2570, 1000), 10);
        patience.rest(3);
        assert_eq!(tries(&mut patience, 4, 10), 1);
        assert_eq!(tries(&mut patience, 5, 900), 1, "one that pays makes it patient again");
        assert!(patience.tries());
    }
}
