//! How a robot moves along the route: the options of the tracker (method 1.9).

use std::fmt;
use std::ops::RangeInclusive;

use serde::de::value::MapAccessDeserializer;
use serde::de::{self, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::Error;

/// The most speeds that are accepted: `push` moves a belief for each.
const MAX_SPEEDS: usize = 64;
/// The fastest pace and speed that are accepted, in places a query: the cost grows with them.
const MAX_PACE: f64 = 1000.0;
/// The most likely that a place less, and a place more, can be: each half as likely as the speed.
pub(crate) const MAX_JITTER: f64 = 0.25;
/// The most that a place's evidence may count for: `exp(100)` times another's.
const MAX_EVIDENCE: f64 = 100.0;

/// How a robot moves, and how much one query says: the options of the tracker (method 1.9).
///
/// ```
/// use surefix::{Config, Matcher, Motion};
/// let mut config = Config::default();
/// config.motion = Some(Motion::free());
/// let mut matcher = Matcher::new(4, config)?;
/// let fix = matcher.push(&[0.9, 0.1, 0.8, 0.9])?;
/// assert_eq!(fix.track.map(|track| track.place), Some(1));
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, remote = "Self")]
#[non_exhaustive]
pub struct Motion {
    /// Speeds that the robot may have, ascending, in units of the pace.
    pub speeds: Vec<f64>,
    /// The places that the robot usually passes between two queries. 1 by default. With the fastest
    /// speed, at most 1000 places.
    pub pace: f64,
    /// The probability that the speed changes to a neighbouring one between two queries.
    pub switching: f64,
    /// The probability of one place less than the speed says, and that of one more.
    pub jitter: f64,
    /// The probability that the robot is suddenly anywhere on the route.
    pub restart: f64,
    /// The probability that the robot leaves the map between two queries.
    pub leave: f64,
    /// The probability that a robot off the map comes back.
    pub rejoin: f64,
    /// `lambda`: how much the evidence of one query weighs.
    pub evidence: f64,
    /// Evidence counts up to this many standard deviations.
    pub clip: f64,
    /// The queries after which a place's mean distance is half believed. 0 believes it at once.
    pub hubness: f64,
    /// Whether a known advance counts by its length. If so, the belief moves by its fraction, too,
    /// jitter grows with it, and restart, leave and rejoin are as much less likely as it is shorter
    /// than a place.
    /// If not, the belief moves by whole places of the way so far.
    pub by_distance: bool,
    /// The correlation from which on two queries in a row count less and less as two: the view
    /// repeats, so that the robot stands. It is asked if the advance is not known. 1 for never.
    pub repeat: f64,
}

impl Motion {
    /// A robot that goes on at its pace: a train between stations, a drive resampled by distance,
    /// or any robot with odometry.
    #[must_use]
    pub fn steady() -> Self {
        Self {
            speeds: vec![1.0],
            pace: 1.0,
            switching: 0.05,
            jitter: 0.01,
            restart: 0.01,
            leave: 0.05,
            rejoin: 0.1,
            evidence: 0.5,
            clip: 4.0,
            hubness: 10.0,
            by_distance: false,
            repeat: 1.0,
        }
    }

    /// A robot that stands, or goes at up to twice its pace.
    #[must_use]
    pub fn free() -> Self {
        Self { speeds: vec![0.0, 0.5, 1.0, 1.5, 2.0], ..Self::steady() }
    }

    /// A robot of any speed up to five times the map's: for drives of which nothing is known.
    /// Evidence weighs more than in the others and counts further, as there is less motion to rely
    /// on.
    #[must_use]
    pub fn any() -> Self {
        Self {
            speeds: vec![0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0],
            restart: 0.02,
            evidence: 0.6,
            clip: 6.0,
            by_distance: true,
            repeat: 0.9,
            ..Self::steady()
        }
    }

    /// A robot on a road without a map, along its own earlier places: it comes to one of them
    /// rarely and leaves soon, and drives there about as fast as it did.
    #[must_use]
    pub fn loops() -> Self {
        Self {
            speeds: vec![0.5, 1.0, 1.5, 2.0],
            leave: 0.1,
            rejoin: 0.01,
            hubness: 3.0,
            ..Self::any()
        }
    }

    /// The kind of this name.
    fn named(name: &str) -> Option<Self> {
        match name {
            "steady" => Some(Self::steady()),
            "free" => Some(Self::free()),
            "any" => Some(Self::any()),
            "loops" => Some(Self::loops()),
            _ => None,
        }
    }

    /// The probabilities to leave the map, to restart and to rejoin, of which `share` may happen.
    pub(crate) fn rates(&self, share: f64) -> [f64; 3] {
        [self.leave, self.restart, self.rejoin].map(|rate| rate * share)
    }

    /// Checks every option against its range.
    ///
    /// # Errors
    /// [`Error::Option`] for the first option outside its range.
    pub fn validate(&self) -> Result<(), Error> {
        let in_range = |name, range: RangeInclusive<f64>, got: f64| {
            if range.contains(&got) {
                return Ok(());
            }
            let expected = format!("a number from {} to {}", range.start(), range.end());
            Err(Error::Option { name, expected, got: got.to_string() })
        };
        let ascending = self.speeds.is_sorted_by(|a, b| a < b);
        let known = (1..=MAX_SPEEDS).contains(&self.speeds.len());
        let range = 0.0..=MAX_PACE;
        if !(known && ascending && self.speeds.iter().all(|speed| range.contains(speed))) {
            return Err(Error::Option {
                name: "motion.speeds",
                expected: format!("1 to {MAX_SPEEDS} ascending numbers from 0 to {MAX_PACE}"),
                got: format!("{:?}", self.speeds),
            });
        }
        in_range("motion.pace", 0.01..=MAX_PACE, self.pace)?;
        let fastest = self.speeds.last().copied().unwrap_or(0.0) * self.pace;
        in_range("motion.speeds x motion.pace", 0.0..=MAX_PACE, fastest)?;
        in_range("motion.switching", 0.0..=1.0, self.switching)?;
        in_range("motion.jitter", 0.0..=MAX_JITTER, self.jitter)?;
        in_range("motion.restart", 0.0..=1.0, self.restart)?;
        in_range("motion.leave", 0.0..=1.0, self.leave)?;
        in_range("motion.rejoin", 0.0..=1.0, self.rejoin)?;
        in_range("motion.evidence", 0.0..=MAX_EVIDENCE, self.evidence)?;
        in_range("motion.clip", 0.0..=MAX_EVIDENCE, self.clip)?;
        in_range("motion.hubness", 0.0..=1e9, self.hubness)?;
        in_range("motion.repeat", 0.0..=1.0, self.repeat)?;
        in_range("motion.evidence x motion.clip", 0.0..=MAX_EVIDENCE, self.evidence * self.clip)
    }
}

impl Serialize for Motion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

/// The name of a kind, or each option that is not that of [`Motion::free`].
impl<'de> Deserialize<'de> for Motion {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Motion;

            fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
                to.write_str("\"steady\", \"free\", \"any\" or the options of a motion")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<Motion, E> {
                let unknown = || E::invalid_value(de::Unexpected::Str(name), &self);
                Motion::named(name).ok_or_else(unknown)
            }

            fn visit_map<A: MapAccess<'de>>(self, options: A) -> Result<Motion, A::Error> {
                Motion::deserialize(MapAccessDeserializer::new(options))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// [`free`](Motion::free).
impl Default for Motion {
    fn default() -> Self {
        Self::free()
    }
}
