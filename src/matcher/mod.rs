//! The paper: from distance vectors to trusted places, one query at a time (method 1.1 to 1.5).

mod consensus;
mod extreme;
mod gradient;
mod ring;
mod sequence;
mod snapshot;
#[cfg(test)]
mod tests;

use consensus::{check, consensus};
use gradient::{enhanced_peak, gradient, missing_gradient};
use ring::Ring;
use sequence::{Anchor, Diagonal, best_sequence};

pub use consensus::Single;
pub(crate) use consensus::minimum;
pub use gradient::Peak;
pub use sequence::Sequence;
pub(crate) use snapshot::load;

use crate::config::{Config, Floor};
use crate::error::Error;

/// Where the robot is, as far as one query tells, and whether to believe it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// Which query this is, counted from 0 since the start or the last reset.
    pub frame: u64,
    /// Whether the single match is trusted (Eq. 3, or an external predictor's word).
    pub trusted: bool,
    /// The sequence's place once it is ready; before that, the single match's.
    pub place: usize,
    /// The sequence's score once it is ready; before that, the single match's distance. Less is better.
    pub score: f32,
    /// The best match of this query alone.
    pub single: Single,
    /// Where the enhanced gradient peaks.
    pub gradient: Peak,
    /// The sequence's match; nothing for the first `L - 1` queries, while the matcher warms up.
    pub sequence: Option<Sequence>,
}

/// Turns distance vectors into fixes, one at a time: the paper's method, for any technique that yields distances.
///
/// `push` allocates nothing, takes no lock and does not panic, whatever the data. The memory is set at construction:
/// `(L + smoothing) * places` f32 numbers.
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
    /// The newest `L` distance vectors, raw.
    columns: Ring,
    /// The newest gradients: as many as the smoothing needs.
    gradients: Ring,
    /// The single match and the trust of each of the newest `L` queries: query `j` at `j % L`.
    anchors: Vec<Anchor>,
    diagonals: Vec<Diagonal>,
}

impl Matcher {
    /// A matcher for a route of `places` places.
    ///
    /// # Errors
    /// [`Error::TooFewPlaces`] below two places; [`Error::Option`] for an option outside its range, `floor: Global`
    /// among them: a stream cannot know the whole matrix; [`Error::Memory`] where there is not enough for the window.
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
        let nothing = Anchor { single: Single { place: 0, distance: 0.0 }, trusted: false };
        Ok(Self {
            columns: Ring::new(length, places)?,
            // A gradient older than the route is long has no place left on the diagonal.
            gradients: Ring::new(config.smoothing.min(places), places)?,
            anchors: vec![nothing; length],
            diagonals: config
                .speeds
                .iter()
                .map(|&speed| Diagonal::new(speed, length))
                .collect::<Result<_, _>>()?,
            frames: 0,
            lowest: f32::INFINITY,
            places,
            config,
        })
    }

    /// Takes the distances from the current query to every place, and says where the robot is.
    ///
    /// # Errors
    /// [`Error::Length`] unless there are as many distances as places, [`Error::NotFinite`] for a NaN or an infinity.
    /// The matcher is then as it was.
    pub fn push(&mut self, distances: &[f32]) -> Result<Fix, Error> {
        self.step(distances, None)
    }

    /// Like [`push`](Self::push), with an external predictor's word in place of the consensus (Eq. 3).
    ///
    /// # Errors
    /// As for [`push`](Self::push).
    pub fn push_with_trust(&mut self, distances: &[f32], trusted: bool) -> Result<Fix, Error> {
        self.step(distances, Some(trusted))
    }

    /// The method (docs/method.md), in its order.
    pub(crate) fn step(&mut self, distances: &[f32], external: Option<bool>) -> Result<Fix, Error> {
        // Nothing is kept of a vector that does not pass.
        check(distances, self.places)?;

        // 1.1 The gradient (Eq. 1).
        gradient(distances, self.config.gradient, self.gradients.advance());

        // 1.2 Its enhancement along the diagonal.
        let missing = missing_gradient(distances, self.config.gradient);
        let peak = enhanced_peak(&self.gradients, self.config.smoothing, missing);

        // 1.3 The single match, and whether to trust it (Eqs. 2 and 3).
        let single = minimum(distances);
        let trusted = external.unwrap_or_else(|| consensus(single, peak, self.config.tolerance));

        // 1.4 What the trusted cells of the window are drawn towards (Eq. 4).
        let frame = self.frames;
        self.remember(distances, Anchor { single, trusted });
        let floor = self.floor();

        // 1.5 The weighted sequence (Eqs. 5 and 6), once the window is full.
        let sequence = self.sequence(floor);

        let (place, score) = sequence.map_or((single.place, single.distance), |s| (s.place, s.score));
        Ok(Fix { frame, trusted, place, score, single, gradient: peak, sequence })
    }

    fn remember(&mut self, distances: &[f32], anchor: Anchor) {
        self.columns.advance().copy_from_slice(distances);
        self.anchors[slot(self.frames, self.config.sequence_length)] = anchor;
        self.lowest = self.lowest.min(anchor.single.distance);
        self.frames += 1;
    }

    fn floor(&self) -> f64 {
        let running = f64::from(self.lowest);
        match self.config.floor {
            Floor::Fixed(floor) => floor.min(running),
            Floor::Running | Floor::Global => running,
        }
    }

    fn sequence(&mut self, floor: f64) -> Option<Sequence> {
        let length = self.config.sequence_length;
        if self.columns.len() < length {
            return None;
        }
        let (anchors, newest) = (&self.anchors, self.frames - 1);
        let anchor = |age: usize| anchors[slot(newest - age as u64, length)];
        best_sequence(&mut self.columns, anchor, &self.diagonals, self.config.weight, floor)
    }

    /// Forgets all queries: the next one is frame 0. Nothing is allocated.
    pub fn reset(&mut self) {
        self.columns.clear();
        self.gradients.clear();
        self.frames = 0;
        self.lowest = f32::INFINITY;
    }

    /// Begins at query `frame`, with the smallest distance that the queries before it had: a batch is streams that begin
    /// in the middle.
    pub(crate) fn begin_at(&mut self, frame: usize, lowest: f32) {
        self.frames = frame as u64;
        self.lowest = lowest;
    }

    /// The newest query's distances; nothing before the first.
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

    /// Its options.
    pub fn config(&self) -> &Config {
        &self.config
    }
}

fn slot(frame: u64, length: usize) -> usize {
    (frame % length as u64) as usize
}
