//! The paper: from distance vectors to trusted places, one query at a time (method 1.1 to 1.5).
//!
//! [`Matcher::push`] runs `method`, a line a step:
//!
//! | | | file |
//! |---|---|---|
//! | Eq. 1 | gradient | `gradient.rs` |
//! | Eq. 2 | its peak, after the 3 x 3 kernel | `gradient.rs` |
//! | Eq. 3 | the trust flag | `trust.rs` |
//! | Eq. 4 | weighted trusted cells | `sequence.rs` |
//! | Eq. 5 | sums along diagonals | `sequence.rs` |
//! | Eq. 6 | their minimum | `sequence.rs` |
//! | 1.9 | the filter over all queries | `track/` |

#![allow(
    clippy::inline_always,
    reason = "functions inlined into `Isa::run` are compiled for the instruction set"
)]

mod argmin;
#[cfg(test)]
mod bounds_tests;
mod estimator;
mod fix;
mod fusion;
mod gradient;
mod layout;
mod loops;
mod sequence;
pub(crate) mod shard;
mod single;
mod snapshot;
#[cfg(test)]
mod tests;
mod track;
mod trust;
mod window;

use estimator::{Estimator, Seen};
use gradient::Enhancement;
use sequence::SequenceSearch;
use track::Tracker;
use trust::{Anchor, Anchors, consensus};
use window::Window;

pub(crate) use estimator::Memory;
pub use fix::{Fix, Given};
pub(crate) use fusion::{Fusion, MAX_TECHNIQUES};
pub use gradient::Peak;
pub(crate) use layout::Layout;
pub(crate) use loops::LoopFilter;
pub use sequence::Sequence;
pub use single::Single;
pub(crate) use single::{is_constant, minimum};
use snapshot::MAX_FRAMES;
pub(crate) use snapshot::{Owner, load};
pub use track::{Aligned, Track};
pub(crate) use track::{Aligner, Source, stretch};
pub(crate) use window::{Column, Exact, Ring};

use crate::config::{Config, Floor};
use crate::error::Error;
use crate::segments::Segments;
use crate::simd::{Compiled, Isa};

/// Turns distance vectors into fixes, one at a time: the paper's method, for any technique that
/// yields distances.
///
/// `push` allocates nothing, takes no lock and does not panic, whatever the data. Its cost is a
/// constant for each of the `n` places, and one addition for each place, query of the window and
/// speed: `n (c + L V)`. With a motion, the tracker's cost a place comes to it, for each of its own
/// speeds. Data and flags make a push at most three times as dear as the usual one of the same
/// options, in instructions: a robot that stands still, matches that are all trusted, trusted
/// matches anywhere, ties, gaps, odometry that jumps. The memory is set at construction:
/// `max(L, smoothing)` f32 numbers a place, less if no segment is closed and all are shorter.
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
    segments: Segments,
    frames: u64,
    /// The smallest distance of all queries so far that said something.
    lowest: f32,
    window: Window,
    /// The single match and the trust of each of the newest `L` queries.
    anchors: Anchors,
    sequence: SequenceSearch,
    tracker: Option<Tracker>,
    isa: Isa,
}

impl Matcher {
    /// A matcher for a route of `places` places.
    ///
    /// # Errors
    /// [`Error::TooFewPlaces`] below two places; [`Error::Option`] for an option outside its range,
    /// `floor: Global` among them: a stream cannot know the whole matrix; [`Error::Memory`] if
    /// there is not enough for the window.
    pub fn new(places: usize, config: Config) -> Result<Self, Error> {
        Self::along(Segments::one(places), config)
    }

    /// A matcher for the places of some segments.
    ///
    /// ```
    /// use surefix::{Config, Matcher, Segments};
    /// let roads = Segments::new(6, &[3])?; // places 0 to 2, and 3 to 5
    /// let mut matcher = Matcher::along(roads, Config::default())?;
    /// matcher.push(&[0.9, 0.8, 0.1, 0.9, 0.8, 0.9])?;
    /// let fix = matcher.push(&[0.9, 0.8, 0.9, 0.1, 0.8, 0.9])?;
    /// assert_ne!(fix.sequence.map(|sequence| sequence.place), Some(3)); // place 3 does not follow 2
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// As for [`new`](Self::new); a sequence must fit a segment, or one must be closed.
    pub fn along(segments: Segments, config: Config) -> Result<Self, Error> {
        let places = segments.places();
        config.validate_along(&segments)?;
        config.validate_stream()?;
        Ok(Self {
            window: Window::new(config.columns(&segments), places)?,
            anchors: Anchors::new(config.sequence_length)?,
            sequence: SequenceSearch::new(&config)?,
            tracker: {
                let motion = config.motion.as_ref();
                motion
                    .map(|motion| Tracker::new(motion, config.tolerance, &segments))
                    .transpose()?
            },
            segments,
            isa: Isa::best(),
            frames: 0,
            lowest: f32::INFINITY,
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

    /// Takes the distances from the current query to every place, and returns where the robot is.
    ///
    /// # Errors
    /// [`Error::Length`] unless there is one distance a place, [`Error::NotFinite`] for a NaN or an
    /// infinity. The matcher is then as it was.
    pub fn push(&mut self, distances: &[f32]) -> Result<Fix, Error> {
        self.push_with(distances, Given::default())
    }

    /// Like [`push`](Self::push), with what else is known about the query.
    ///
    /// # Errors
    /// As for [`push`](Self::push), and [`Error::Option`] for an advance that is not finite or longer
    /// than 1e12 places. Its words are allocated.
    pub fn push_with(&mut self, distances: &[f32], given: Given) -> Result<Fix, Error> {
        self.push_column(Column::exact(distances), given, &mut ())
    }

    /// [`push_with`](Self::push_with), of distances or of bounds. The answer is that of the
    /// distances, to the last bit.
    pub(crate) fn push_column<E: Exact>(
        &mut self,
        column: Column<'_>,
        given: Given,
        ask: &mut E,
    ) -> Result<Fix, Error> {
        given.check()?;
        self.isa.run(Push { matcher: self, column, given, ask })
    }

    /// The method (docs/method.md), in its order. All that works on every place is compiled for the
    /// instruction set.
    #[inline(always)]
    fn method<E: Exact>(
        &mut self,
        column: Column<'_>,
        given: Given,
        ask: &mut E,
    ) -> Result<Fix, Error> {
        let Self { config, segments, window, anchors, sequence, tracker, .. } = self;

        // The single match: the smallest distance. A refused column leaves everything as it was.
        let single = window.push(column, ask)?;

        // 1.1, 1.2 The gradient (Eq. 1), enhanced along the diagonal, and its peak (Eq. 2).
        let enhancement = Enhancement { gradient: config.gradient, smoothing: config.smoothing };
        let gradient = enhancement.peak(window, segments, ask);

        // 1.3 Whether to trust the single match (Eq. 3): never if the column says nothing.
        let blank = window.says_nothing(single, ask);
        let trusted = !blank
            && given
                .trusted
                .unwrap_or_else(|| consensus(single, gradient, segments, config.tolerance));

        // 1.4 The trusted cells and what they are drawn towards (Eq. 4).
        anchors.push(Anchor { single, trusted });
        let lower = !blank && single.distance < self.lowest;
        self.lowest = if lower { single.distance } else { self.lowest };
        let floor = config.floor.value(self.lowest);

        // 1.5 The weighted sequence (Eqs. 5 and 6), once the window is full.
        let seen =
            Seen { segments, anchors, floor, advance: given.advance, evidence: column.evidence };
        let sequence = sequence.estimate(window, &seen, ask);

        // 1.9 The track, by all queries so far.
        let track = match tracker {
            Some(tracker) => Some(tracker.estimate(window, &seen, ask)),
            None => None,
        };

        let frame = self.frames;
        self.frames += 1;
        Ok(Fix::of(frame, [trusted, blank], single, gradient, sequence, track, segments))
    }

    /// Declares that the next query does not follow the one before: frames were dropped, or the
    /// camera was away. The diagonal is broken there: no gradient is summed and no sequence made
    /// across (method 1.5), and fixes have no sequence until `L` queries have come. Frame numbers
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
        self.break_off();
        if let Some(tracker) = &mut self.tracker {
            tracker.clear();
        }
    }

    /// A [`gap`](Self::gap) during which the robot moved by `advance` places: the track goes on
    /// from there. Advances of further gaps and of the next query are added to it.
    ///
    /// # Errors
    /// [`Error::Option`] for an advance that is not finite. The matcher is then as it was.
    pub fn gap_with_advance(&mut self, advance: f64) -> Result<(), Error> {
        Given::default().advance(advance).check()?;
        self.break_off();
        if let Some(tracker) = &mut self.tracker {
            tracker.moved(advance);
        }
        Ok(())
    }

    /// A gap, of a known advance if there is one.
    pub(crate) fn gap_of(&mut self, advance: Option<f64>) -> Result<(), Error> {
        if let Some(advance) = advance {
            return self.gap_with_advance(advance);
        }
        self.gap();
        Ok(())
    }

    /// The columns before a gap do not lead up to the next query.
    fn break_off(&mut self) {
        self.window.clear();
        self.sequence.clear();
    }

    /// Forgets all queries: the next one is frame 0. Nothing is allocated.
    pub fn reset(&mut self) {
        self.break_off();
        if let Some(tracker) = &mut self.tracker {
            tracker.reset();
        }
        self.frames = 0;
        self.lowest = f32::INFINITY;
    }

    /// The same matcher with another floor, which is in its range.
    pub(crate) fn with_floor(mut self, floor: Floor) -> Self {
        self.config.floor = floor;
        self
    }

    /// Begins at query `frame`, with the smallest distance that the queries before it had: the
    /// pieces of a batch are streams that begin in the middle.
    pub(crate) fn begin_at(&mut self, frame: usize, lowest: f32) {
        self.frames = frame as u64;
        self.lowest = lowest;
    }

    /// How many queries a fix depends on: those of its estimators, whose trust flags depend on the
    /// queries of the smoothing before them.
    pub(crate) fn memory(&self) -> Memory {
        let tracker = self.tracker.as_ref().map_or(Memory::Queries(1), Tracker::memory);
        match self.sequence.memory().max(tracker) {
            Memory::Queries(queries) => {
                Memory::Queries(queries.saturating_add(self.config.smoothing - 1))
            }
            Memory::Whole => Memory::Whole,
        }
    }

    /// Accepts columns of bounds from now on.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough for a second window.
    pub(crate) fn accept_bounds(&mut self) -> Result<(), Error> {
        self.window.accept_bounds()
    }

    /// The columns of the newest queries.
    pub(crate) fn window(&mut self) -> &mut Window {
        &mut self.window
    }

    /// The track's belief in each place, after the newest query; `None` without
    /// [`Config::motion`]. With [`Track::off_map`], it sums to 1.
    pub fn belief(&self) -> Option<impl Iterator<Item = f64>> {
        self.tracker.as_ref().map(Tracker::belief)
    }

    /// How many queries it has taken since the start or the last reset.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// How many places the route has.
    pub fn places(&self) -> usize {
        self.segments.places()
    }

    /// How its places follow each other.
    pub fn segments(&self) -> &Segments {
        &self.segments
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

impl Floor {
    /// The floor of Eq. 4, given the smallest distance of all queries so far.
    fn value(self, lowest: f32) -> f64 {
        let running = f64::from(lowest);
        match self {
            Self::Fixed(floor) => floor.min(running),
            Self::Running | Self::Global => running,
        }
    }
}

/// One query, compiled for each instruction set.
struct Push<'a, E> {
    matcher: &'a mut Matcher,
    column: Column<'a>,
    given: Given,
    ask: &'a mut E,
}

impl<E: Exact> Compiled for Push<'_, E> {
    type Out = Result<Fix, Error>;

    #[inline(always)]
    fn run(self) -> Self::Out {
        self.matcher.method(self.column, self.given, self.ask)
    }
}
