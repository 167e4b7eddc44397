//! The paper: from distance vectors to trusted places, one query at a time (method 1.1 to 1.5).

#![allow(
    clippy::inline_always,
    reason = "what is inlined into `Isa::run` is compiled for the instruction set"
)]

mod best_first;
mod bounded;
#[cfg(test)]
mod bounded_tests;
mod consensus;
mod diagonal;
mod direct;
mod extreme;
mod gradient;
mod order;
mod ring;
mod sequence;
mod sliding;
mod snapshot;
#[cfg(test)]
mod sums_tests;
#[cfg(test)]
mod tests;
mod visit;

use consensus::{checked_minimum, consensus};
use gradient::Enhanced;
use sequence::{Anchor, Anchors, Search, Window};

pub(crate) use bounded::{Bounded, Exact};
pub use consensus::Single;
pub(crate) use consensus::minimum;
pub use gradient::Peak;
pub(crate) use ring::Ring;
pub use sequence::Sequence;
pub(crate) use snapshot::load;

use crate::config::{Config, Floor};
use crate::error::Error;
use crate::simd::{Compiled, Isa};

/// Where the robot is, as far as one query tells, and whether to believe it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// Which query this is, counted from 0 since the start or the last reset.
    pub frame: u64,
    /// Whether the single match is trusted (Eq. 3, or an external predictor's word).
    pub trusted: bool,
    /// The sequence's place once it is ready; before that, the single match's.
    pub place: usize,
    /// The sequence's score once it is ready; before that, the single match's distance. Less is
    /// better.
    pub score: f32,
    /// The best match of this query alone.
    pub single: Single,
    /// Where the enhanced gradient peaks.
    pub gradient: Peak,
    /// The sequence's match; nothing for the first `L - 1` queries, and again after a gap, while
    /// the matcher warms up.
    pub sequence: Option<Sequence>,
}

/// Turns distance vectors into fixes, one at a time: the paper's method, for any technique that
/// yields distances.
///
/// `push` allocates nothing, takes no lock and does not panic, whatever the data, and costs the
/// same for every query and, but for the shortest, for every `L`. The memory is set at
/// construction: `max(L, smoothing)` f32 numbers a place, and, where `L` is more than 8, `L / 2 +
/// 2` f64 numbers a place for the sums that slide along.
///
/// ```
/// use surefix::{Config, Matcher};
/// let mut matcher = Matcher::new(4, Config::default())?;
/// assert!(matcher.push(&[0.1, 0.8, 0.9, 0.7])?.sequence.is_none()); // warming up: L is 2
/// let fix = matcher.push(&[0.9, 0.2, 0.8, 0.9])?;
/// assert_eq!(fix.place, 1);
/// assert!(fix.trusted);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Matcher {
    config: Config,
    places: usize,
    frames: u64,
    /// The smallest distance of all queries so far.
    lowest: f32,
    /// The newest distance vectors since the last gap, raw: as many as the sequence and the
    /// smoothing need.
    columns: Ring,
    /// In a restored matcher, the gradients of queries before those of `columns`, newest first.
    earlier: Ring,
    /// The single match and the trust of each of the newest `L` queries.
    anchors: Anchors,
    search: Search,
    isa: Isa,
}

impl Matcher {
    /// A matcher for a route of `places` places.
    ///
    /// # Errors
    /// [`Error::TooFewPlaces`] below two places; [`Error::Option`] for an option outside its range,
    /// `floor: Global` among them: a stream cannot know the whole matrix; [`Error::Memory`] where
    /// there is not enough for the window.
    pub fn new(places: usize, config: Config) -> Result<Self, Error> {
        config.validate(places)?;
        if config.floor == Floor::Global {
            return Err(Error::Option {
                name: "floor",
                expected: "\"running\" or a number in a stream, which cannot know the whole matrix"
                    .to_owned(),
                got: "\"global\"".to_owned(),
            });
        }
        let length = config.sequence_length;
        // A gradient older than the route is long has no place left on the diagonal.
        let columns = length.max(config.smoothing.min(places));
        Ok(Self {
            columns: Ring::new(columns, places)?,
            earlier: Ring::new(0, places)?,
            anchors: Anchors::new(length)?,
            search: Search::new(&config.speeds, length, places)?,
            isa: Isa::best(),
            frames: 0,
            lowest: f32::INFINITY,
            places,
            config,
        })
    }

    /// The same matcher on another instruction set than the best one; the answers are the same to
    /// the last bit.
    ///
    /// # Errors
    /// [`Error::Option`] for one that this processor lacks.
    pub fn with_isa(mut self, isa: Isa) -> Result<Self, Error> {
        self.isa = isa.checked()?;
        Ok(self)
    }

    /// Takes the distances from the current query to every place, and says where the robot is.
    ///
    /// # Errors
    /// [`Error::Length`] unless there are as many distances as places, [`Error::NotFinite`] for a
    /// NaN or an infinity. The matcher is then as it was.
    pub fn push(&mut self, distances: &[f32]) -> Result<Fix, Error> {
        self.step(distances, None)
    }

    /// Like [`push`](Self::push), with an external predictor's word in place of the consensus (Eq.
    /// 3).
    ///
    /// # Errors
    /// As for [`push`](Self::push).
    pub fn push_with_trust(&mut self, distances: &[f32], trusted: bool) -> Result<Fix, Error> {
        self.step(distances, Some(trusted))
    }

    pub(crate) fn step(&mut self, distances: &[f32], external: Option<bool>) -> Result<Fix, Error> {
        self.isa.run(Step { matcher: self, distances, external })
    }

    /// The method (docs/method.md), in its order. What works on all places is compiled for the
    /// instruction set.
    #[inline(always)]
    fn method(&mut self, distances: &[f32], external: Option<bool>) -> Result<Fix, Error> {
        // The single match (Eq. 2), found by the same look that refuses a vector. Nothing is kept
        // of a refused one.
        let single = checked_minimum(distances, self.places)?;
        self.columns.advance().copy_from_slice(distances);

        // 1.1 and 1.2 The gradient (Eq. 1), its enhancement along the diagonal, and where that
        // peaks.
        let Config { gradient, smoothing, tolerance, weight, .. } = self.config;
        let Self { columns, earlier, .. } = &*self;
        let peak = Enhanced { columns, upper: None, earlier, kind: gradient, smoothing }.peak();

        // 1.3 Whether to trust the single match (Eq. 3).
        let trusted = external.unwrap_or_else(|| consensus(single, peak, tolerance));

        // 1.4 What the trusted cells of the window are drawn towards (Eq. 4).
        let frame = self.remember(Anchor { single, trusted });
        let floor = self.floor();

        // 1.5 The weighted sequence (Eqs. 5 and 6), once the window is full.
        let window =
            Window { frame, columns: &self.columns, anchors: &self.anchors, weight, floor };
        let sequence = self.search.best(window);

        let (place, score) =
            sequence.map_or((single.place, single.distance), |s| (s.place, s.score));
        Ok(Fix { frame, trusted, place, score, single, gradient: peak, sequence })
    }

    /// Counts a query, and says which one it was.
    fn remember(&mut self, anchor: Anchor) -> u64 {
        self.anchors.push(anchor);
        if anchor.single.distance < self.lowest {
            self.lowest = anchor.single.distance;
        }
        self.frames += 1;
        self.frames - 1
    }

    fn floor(&self) -> f64 {
        let running = f64::from(self.lowest);
        match self.config.floor {
            Floor::Fixed(floor) => floor.min(running),
            Floor::Running | Floor::Global => running,
        }
    }

    /// Says that the next query does not follow on the one before: frames were dropped, or the
    /// camera was away. The diagonal is broken there, so that no gradient is summed and no sequence
    /// made across (method 1.5): fixes have no sequence until `L` queries have come. Frame numbers
    /// and the running floor go on. A gap before the first query, or right after another, changes
    /// nothing. Nothing is allocated.
    ///
    /// ```
    /// use surefix::{Config, Matcher};
    /// let mut matcher = Matcher::new(4, Config::default())?;
    /// matcher.push(&[0.1, 0.8, 0.9, 0.7])?;
    /// matcher.gap();
    /// let fix = matcher.push(&[0.9, 0.8, 0.7, 0.2])?;
    /// assert_eq!((fix.frame, fix.sequence), (1, None)); // warming up again
    /// # Ok::<(), surefix::Error>(())
    /// ```
    pub fn gap(&mut self) {
        self.columns.clear();
        self.earlier.clear();
    }

    /// Forgets all queries: the next one is frame 0. Nothing is allocated.
    pub fn reset(&mut self) {
        self.gap();
        self.frames = 0;
        self.lowest = f32::INFINITY;
    }

    /// Begins at query `frame`, with the smallest distance that the queries before it had: a batch
    /// is streams that begin in the middle.
    pub(crate) fn begin_at(&mut self, frame: usize, lowest: f32) {
        self.frames = frame as u64;
        self.lowest = lowest;
    }

    /// The newest query's distances; nothing before the first, and right after a gap.
    pub(crate) fn newest(&self) -> Option<&[f32]> {
        (self.columns.len() > 0).then(|| self.columns.column(0))
    }

    /// How many queries it has taken since the start or the last reset.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// How many places the route has.
    pub fn places(&self) -> usize {
        self.places
    }

    /// The instruction set that it runs on.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Its options.
    pub fn config(&self) -> &Config {
        &self.config
    }
}

/// One query, compiled for each instruction set.
struct Step<'a> {
    matcher: &'a mut Matcher,
    distances: &'a [f32],
    external: Option<bool>,
}

impl Compiled for Step<'_> {
    type Out = Result<Fix, Error>;

    #[inline(always)]
    fn run(self) -> Self::Out {
        self.matcher.method(self.distances, self.external)
    }
}
