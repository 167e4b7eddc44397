//! The answer to one query, and what is given with it.

use super::{Peak, Sequence, Single, Track};
use crate::error::Error;
use crate::segments::Segments;
use serde::{Deserialize, Serialize};

/// The longest advance that is accepted: longer than any route, in places.
const MAX_ADVANCE: f64 = 1e12;

/// Where the robot is, as far as one query tells, and whether to trust it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Fix {
    /// The number of this query, from 0 since the start or the last reset.
    pub frame: u64,
    /// Whether the single match is trusted (Eq. 3, or an external predictor's flag).
    pub trusted: bool,
    /// Whether the query shows nothing: an image or a descriptor without content, or distances that
    /// are all equal. It is never trusted, and says nothing of the place: `single` is then place 0
    /// at the mean distance.
    pub blank: bool,
    /// The track's place if there is motion; else the sequence's once it is ready, and before that
    /// the single match's.
    pub place: usize,
    /// The index of that place's segment: 0 on a route without breaks.
    pub segment: usize,
    /// That place, counted from its segment's first.
    pub segment_place: usize,
    /// The score of that place: `1 - confidence` of the track, the sequence's score, or the single
    /// match's distance. Less is better.
    pub score: f32,
    /// The best match of this query alone.
    pub single: Single,
    /// Where the enhanced gradient peaks (Eq. 2).
    pub gradient: Peak,
    /// The sequence's match; `None` for the first `L - 1` queries, and again after a gap, while the
    /// matcher warms up.
    pub sequence: Option<Sequence>,
    /// Where the robot is by all queries so far (method 1.9); `None` without
    /// [`Config::motion`](crate::Config::motion).
    pub track: Option<Track>,
    /// Whether it is above the threshold of a calibration; `None` without one
    /// ([`Localizer::with_threshold`](crate::Localizer::with_threshold)).
    pub accepted: Option<bool>,
    /// The probability that the place is right, by that calibration; `None` without one, and if the
    /// fix is not ready.
    pub probability: Option<f64>,
}

impl Fix {
    /// Of what the steps of the method said of a query: whether it is trusted, and blank.
    pub(super) fn of(
        frame: u64,
        [trusted, blank]: [bool; 2],
        single: Single,
        gradient: Peak,
        sequence: Option<Sequence>,
        track: Option<Track>,
        segments: &Segments,
    ) -> Self {
        let (place, score) = match (track, sequence) {
            (Some(track), _) => (track.place, (1.0 - track.confidence) as f32),
            (None, Some(sequence)) => (sequence.place, sequence.score),
            (None, None) => (single.place, single.distance),
        };
        let segment = segments.index_of(place);
        let segment_place = place - segments.of(place).start;
        let (accepted, probability) = (None, None);
        Self {
            frame,
            trusted,
            blank,
            place,
            segment,
            segment_place,
            score,
            single,
            gradient,
            sequence,
            track,
            accepted,
            probability,
        }
    }

    /// Whether place and score are those of the track or the sequence, not of one query alone.
    pub fn is_ready(&self) -> bool {
        self.track.is_some() || self.sequence.is_some()
    }

    /// The track's speed, else the sequence's slope, in places a query.
    pub fn speed(&self) -> Option<f64> {
        self.track.map(|track| track.speed).or(self.sequence.map(|sequence| sequence.speed))
    }

    /// The belief that the robot is within `tolerance` places of the track's place.
    pub fn confidence(&self) -> Option<f64> {
        self.track.map(|track| track.confidence)
    }

    /// The track's belief that the robot is off the map.
    pub fn off_map(&self) -> Option<f64> {
        self.track.map(|track| track.off_map)
    }
}

/// Facts about a query that the camera does not give.
///
/// ```
/// use surefix::{Config, Given, Matcher, Motion};
/// let mut config = Config::default();
/// config.motion = Some(Motion::steady());
/// let mut matcher = Matcher::new(4, config)?;
/// matcher.push(&[0.1, 0.8, 0.9, 0.7])?;
/// let fix = matcher.push_with(&[0.9, 0.8, 0.2, 0.9], Given::default().advance(1.8))?;
/// assert_eq!(fix.place, 2);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Given {
    /// An external predictor's flag in place of the consensus (Eq. 3). A query that shows nothing is
    /// not trusted all the same.
    pub trusted: Option<bool>,
    /// The places that the robot has moved since the query before, by odometry: 0 if it stands
    /// still, negative if it reverses.
    pub advance: Option<f64>,
}

impl Given {
    /// With an external predictor's flag.
    #[must_use]
    pub fn trusted(self, trusted: bool) -> Self {
        Self { trusted: Some(trusted), ..self }
    }

    /// With the places that the robot has moved.
    #[must_use]
    pub fn advance(self, places: f64) -> Self {
        Self { advance: Some(places), ..self }
    }

    /// # Errors
    /// [`Error::Option`] for an advance that is not finite, or longer than any route.
    pub(crate) fn check(self) -> Result<(), Error> {
        let Some(advance) = self.advance.filter(|a| !(-MAX_ADVANCE..=MAX_ADVANCE).contains(a))
        else {
            return Ok(());
        };
        let expected = format!("a number of places from -{MAX_ADVANCE:e} to {MAX_ADVANCE:e}");
        Err(Error::Option { name: "advance", expected, got: advance.to_string() })
    }
}
