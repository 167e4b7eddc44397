//! Localizing by a map's screen: a scan of the codes gives bounds of all distances, and the few
//! rows that decide the answer are computed (method 2.1).

use std::collections::VecDeque;
use std::ops::Range;

use super::technique::Scan;
use crate::distance::Query;
use crate::error::Error;
use crate::map::Map;
use crate::method::{Column, Exact, Fix, Given, Matcher, Ring};
use crate::numbers::{View, first_not_finite};
use crate::preallocated::Preallocated;
use crate::scan::{EncodedQuery, Job, MAX_SCREENED, Pool};

/// Below this many numbers, a row costs no more than the work on its bounds.
pub(super) const SHORTEST: usize = 256;

/// A screened localizer's state beside its matcher.
#[derive(Clone, Debug)]
pub(super) struct Screening {
    /// The newest queries, for as long as their distances can be asked for.
    queries: Ring,
    /// Their lengths, for the cosine, the newest first.
    lengths: Preallocated<VecDeque<f64>>,
    encoded: EncodedQuery,
    products: Vec<f32>,
    upper: Vec<f32>,
    backoff: Backoff,
    /// How many rows were computed for the newest query.
    looked_at: usize,
}

impl Screening {
    /// For `matcher`, which accepts bounds from now on. It may have been restored.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough for a second window.
    pub(super) fn new(map: &Map, matcher: &mut Matcher) -> Result<Self, Error> {
        matcher.accept_bounds()?;
        let (window, remembered) = (matcher.window().capacity(), matcher.window().len());
        // Restored distances may be of any size: until they are forgotten, nothing is added to
        // bounds.
        let restored = matcher.frames() > 0;
        let (rest, looked_at) = if restored { (window, map.places()) } else { (0, 0) };
        let mut queries = Ring::new(window, map.dim())?;
        let mut lengths = VecDeque::new();
        let refused = |_| Error::Memory { places: 1, columns: window };
        lengths.try_reserve_exact(window + 1).map_err(refused)?;
        for _ in 0..remembered {
            // Their distances are known, so that these queries are never used.
            queries.advance();
            lengths.push_front(0.0);
        }
        Ok(Self {
            queries,
            lengths: Preallocated(lengths),
            encoded: EncodedQuery::new(map.dim()),
            products: vec![0.0; map.places()],
            upper: vec![0.0; map.places()],
            backoff: Backoff::new(rest),
            looked_at,
        })
    }

    /// Localizes by bounds, or, during back-off and if the query shows nothing, by all distances.
    /// The scan's column is scratch memory.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for distances that are not. Nothing has changed then.
    pub(super) fn push(
        &mut self,
        matcher: &mut Matcher,
        query: Query<'_>,
        scan: Scan<'_>,
        given: Given,
    ) -> Result<Fix, Error> {
        let Scan { map, pool, column: lower, nothing, .. } = scan;
        let tries = !nothing && self.backoff.tries();
        let screened = tries && self.bounds(map, pool, query, lower);
        if !screened {
            self.scan(matcher, map, pool, query, lower)?;
            map.quieten(nothing, lower);
        }
        self.remember(query);
        let Self { queries, lengths, upper, .. } = self;
        let column = if screened { Column::bounds(lower, upper) } else { Column::exact(lower) };
        let fix = matcher.push_column(column, given, &mut Rows { map, pool, queries, lengths })?;
        let scanned = if screened { 0 } else { map.places() };
        self.looked_at = scanned + matcher.window().asked();
        if tries {
            self.backoff.judge(self.looked_at, map.places());
        } else {
            self.backoff.wait();
        }
        Ok(fix)
    }

    /// Computes the bounds of all distances. False if they cannot be used.
    fn bounds(
        &mut self,
        map: &Map,
        pool: &mut Option<Pool>,
        query: Query<'_>,
        lower: &mut [f32],
    ) -> bool {
        let Some(codes) = map.codes() else { return false };
        let Self { encoded, products, upper, .. } = self;
        codes.encode(map.isa(), map.metric(), query, encoded);
        Job::CodeProducts(&encoded.codes).column(map, pool, products);
        map.bounds(encoded, products, lower, upper)
    }

    /// Computes all distances. If some are so large that sums of them can overflow, the whole
    /// window is resolved as well, and nothing is screened as long as they are in it.
    fn scan(
        &mut self,
        matcher: &mut Matcher,
        map: &Map,
        pool: &mut Option<Pool>,
        query: Query<'_>,
        lower: &mut [f32],
    ) -> Result<(), Error> {
        Job::Distances(query).column(map, pool, lower);
        if let Some((index, value)) = first_not_finite(lower) {
            return Err(Error::NotFinite { what: "distances", row: None, index, value });
        }
        if lower.iter().any(|&d| d >= MAX_SCREENED) {
            self.resolve(matcher, map, pool);
            self.backoff.rest(matcher.window().capacity() + 1);
        }
        Ok(())
    }

    /// Computes all distances of the window that are not yet known.
    pub(super) fn resolve(&self, matcher: &mut Matcher, map: &Map, pool: &mut Option<Pool>) {
        let Self { queries, lengths, .. } = self;
        matcher.window().resolve(&mut Rows { map, pool, queries, lengths });
    }

    /// The newest query's distances, all of them; `None` before the first, and right after a gap.
    pub(super) fn newest<'a>(
        &self,
        matcher: &'a mut Matcher,
        map: &Map,
        pool: &mut Option<Pool>,
    ) -> Option<&'a [f32]> {
        let Self { queries, lengths, .. } = self;
        matcher.window().newest(&mut Rows { map, pool, queries, lengths })
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

    /// Whether the screen pays is a fact about the route: the back-off goes on.
    pub(super) fn gap(&mut self) {
        self.queries.clear();
        self.lengths.clear();
    }

    pub(super) fn reset(&mut self) {
        self.gap();
        (self.backoff, self.looked_at) = (Backoff::new(0), 0);
    }
}

/// Back-off: after a frame for which screening did not pay, the next 4, 8, ... 256 are scanned in
/// full, so that failed attempts cost a few per cent.
#[derive(Clone, Debug)]
struct Backoff {
    /// How many frames are still to be scanned in full.
    left: usize,
    /// How many after the next failed attempt.
    next: usize,
}

impl Backoff {
    const SHORTEST: usize = 4;
    const LONGEST: usize = 256;

    fn new(left: usize) -> Self {
        Self { left, next: Self::SHORTEST }
    }

    fn tries(&self) -> bool {
        self.left == 0
    }

    /// Counts a frame that was scanned in full.
    fn wait(&mut self) {
        self.left = self.left.saturating_sub(1);
    }

    /// Judges an attempt by the rows that it computed: single rows cost more than all in order.
    fn judge(&mut self, looked_at: usize, places: usize) {
        if looked_at > places / 2 {
            self.rest(self.next);
            self.next = (2 * self.next).min(Self::LONGEST);
        } else {
            self.next = Self::SHORTEST;
        }
    }

    /// Scans at least this many frames in full.
    fn rest(&mut self, frames: usize) {
        self.left = self.left.max(frames);
    }
}

/// The map's rows, and the newest queries to compare with them.
struct Rows<'a> {
    map: &'a Map,
    pool: &'a mut Option<Pool>,
    queries: &'a Ring,
    lengths: &'a VecDeque<f64>,
}

impl Exact for Rows<'_> {
    const BOUNDS: bool = true;

    fn distances(&mut self, age: usize, places: Range<usize>, out: &mut [f32]) {
        let numbers = View::F32(self.queries.column(age));
        let query = Query { numbers, length: self.lengths[age] };
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

    /// How many of `frames` it tries, if each attempt computes `looked_at` rows of 1000.
    fn tries(backoff: &mut Backoff, frames: usize, looked_at: usize) -> usize {
        let mut tries = 0;
        for _ in 0..frames {
            if backoff.tries() {
                tries += 1;
                backoff.judge(looked_at, 1000);
            } else {
                backoff.wait();
            }
        }
        tries
    }

    #[test]
    fn it_tries_always_if_that_pays_and_seldom_if_not() {
        let mut backoff = Backoff::new(0);
        assert_eq!(tries(&mut backoff, 100, 500), 100);
        // 1 + 4 + 1 + 8 + 1 + 16 + 1 + 32 + 1 + 64 + 1 + 128 + 1 + 256, then one in 257.
        assert_eq!(tries(&mut backoff, 515, 501), 7);
        assert_eq!(tries(&mut backoff, 2570, 1000), 10);
        backoff.rest(3);
        assert_eq!(tries(&mut backoff, 4, 10), 1);
        assert_eq!(tries(&mut backoff, 5, 900), 1, "one that pays makes the back-off short again");
        assert!(backoff.tries());
    }
}
