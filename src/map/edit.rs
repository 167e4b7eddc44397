//! Maps of some of a map's places.

use std::ops::Range;

use super::{Map, at_least_two};
use crate::error::Error;

/// This many places that show nothing, one after the other, are a tunnel.
pub(super) const TUNNEL: usize = 5;

impl Map {
    /// Some of the places, as a map of their own that shares the rows' memory. It has a screen if
    /// this map has one. A closed segment that is cut becomes open, and links to places that are
    /// left out are no more.
    ///
    /// ```
    /// use surefix::{Map, Metric};
    /// let map = Map::from_descriptors(vec![0_u8, 1, 2, 3, 4, 5], 2, Metric::Euclidean)?;
    /// assert_eq!(map.slice(1..3)?.distances([4_u8, 5].as_slice())?[1], 0.0);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Option`] unless `places` is a range of this map's places, [`Error::TooFewPlaces`]
    /// for less than two; [`Error::Option`] and [`Error::NotFinite`] as for
    /// [`with_screen`](Self::with_screen), if this map has a screen.
    pub fn slice(&self, places: Range<usize>) -> Result<Self, Error> {
        if places.start > places.end || places.end > self.places() {
            let expected = format!("a range within the {} places", self.places());
            return Err(Error::Option { name: "places", expected, got: format!("{places:?}") });
        }
        at_least_two(places.len())?;
        let blocks = self.blocks.slice(self.route.rows(places.clone()));
        self.screened_like(blocks, self.route.slice(places))
    }

    /// Some of the places, one by one: the others are thinned out, so that the places before and
    /// after one that is left out follow each other. Rows are shared if most lie in long runs, else
    /// copied.
    ///
    /// A closed segment stays closed; if it keeps fewer than 3 places, it becomes open. The ends of
    /// links move to the nearest place of their segment that is kept; a segment without such a
    /// place is no more, and neither are its links.
    ///
    /// ```
    /// use surefix::{Map, Metric, Segments};
    /// let map = Map::from_descriptors((0..10).collect::<Vec<u8>>(), 1, Metric::Manhattan)?;
    /// let map = map.with_segments(Segments::new(10, &[6])?.with_links(&[(3, 6)])?)?;
    /// let map = map.keep(&[0, 2, 4, 6, 8])?;
    /// assert_eq!(map.segments().links(), [(1, 3)]);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Option`] unless `places` ascend within this map, [`Error::TooFewPlaces`] for less
    /// than two; as for [`with_screen`](Self::with_screen), if this map has a screen.
    pub fn keep(&self, places: &[usize]) -> Result<Self, Error> {
        self.segments().check_ascending(places)?;
        self.keep_with(places, usize::MAX)
    }

    /// [`keep`](Self::keep) places that ascend. A stretch of `tunnel` places or more that is left
    /// out becomes a break with a link across.
    pub(super) fn keep_with(&self, places: &[usize], tunnel: usize) -> Result<Self, Error> {
        at_least_two(places.len())?;
        let runs: Vec<_> =
            places.chunk_by(|a, b| b - a == 1).map(|run| run[0]..run[0] + run.len()).collect();
        let rows: Vec<_> = runs.iter().map(|run| self.route.rows(run.clone())).collect();
        self.screened_like(self.blocks.keep(&rows), self.route.keep(places, &runs, tunnel))
    }

    /// The map with places about `metres` apart: of each segment the first, and each that is at
    /// least `metres` from the last one kept, straight. A vehicle's stops become one place. The rest
    /// is as for [`keep`](Self::keep).
    ///
    /// ```
    /// use surefix::{Map, Metric, Positions};
    /// let map = Map::from_descriptors(vec![0_u8, 1, 2, 3], 1, Metric::Manhattan)?;
    /// let map = map.with_positions(Positions::new(vec![0.0, 0.0, 0.4, 0.0, 1.1, 0.0, 1.3, 0.0], 2)?)?;
    /// assert_eq!(map.thin(1.0)?.places(), 2);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Option`] for a map without positions, or a distance that is negative or not finite;
    /// [`Error::TooFewPlaces`] if one place is left.
    pub fn thin(&self, metres: f64) -> Result<Self, Error> {
        let wrong = |expected: &str, got: String| {
            let expected = expected.to_owned();
            Err(Error::Option { name: "metres", expected, got })
        };
        if !(metres.is_finite() && metres >= 0.0) {
            return wrong("a distance of 0 or more", metres.to_string());
        }
        let Some(positions) = self.positions() else {
            return wrong("a map with positions", "one without".to_owned());
        };
        let at = |place: usize| &positions.metres()[place * positions.axes()..][..positions.axes()];
        let mut kept: Vec<usize> = Vec::new();
        for segment in self.segments().iter() {
            let mut last = None;
            for place in segment.places() {
                let near = last.is_some_and(|last| {
                    let squares = at(place).iter().zip(at(last)).map(|(a, b)| (a - b) * (a - b));
                    squares.sum::<f64>() < metres * metres
                });
                if !near {
                    kept.push(place);
                    last = Some(place);
                }
            }
        }
        self.keep_with(&kept, usize::MAX)
    }
}
