//! The options of the matcher: flat, each with a default, checked in one place.

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::motion::Motion;
use crate::segments::{Segment, Segments};

/// The longest smoothing that is accepted: `push` costs this much a place at most.
const MAX_SMOOTHING: usize = 65_536;
/// The most speeds that are accepted: `push` sums a diagonal for each.
const MAX_SPEEDS: usize = 1024;
/// The most that a technique may count.
const MAX_WEIGHT: f64 = 1e6;

/// Which second difference the consensus looks at (method 1.1, Eq. 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Gradient {
    /// `(d[i+1] + d[i-1]) / 2 - d[i]`: the paper's Eq. 1.
    #[default]
    Halved,
    /// `d[i+1] + d[i-1] - 2 d[i]`: the authors' public code. It can differ only at the two ends of
    /// the route.
    Unhalved,
}

/// The `floor` of Eq. 4, towards which a trusted cell is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Floor {
    /// The smallest distance of all queries so far, applied afresh to the whole window.
    #[default]
    Running,
    /// This number, or the running minimum if that is smaller.
    Fixed(f64),
    /// The smallest distance of the whole matrix, the paper's own: for batches, which know it.
    Global,
}

/// The options of a [`Matcher`](crate::Matcher), all with defaults.
///
/// ```
/// use surefix::Config;
/// let mut config = Config::default();
/// config.sequence_length = 5;
/// assert_eq!(config.weight, 0.99);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Config {
    /// `L`, the queries of a sequence (Eq. 5). From 1 to the number of places, or of those of the
    /// longest segment if none is closed; 2 by default.
    pub sequence_length: usize,
    /// `w`, how far a trusted cell is drawn to the floor (Eq. 4). From 0 (the plain sequence) to 1;
    /// 0.99 by default.
    pub weight: f64,
    /// The most frames between the minimum and the gradient's peak of a trusted match (Eq. 3). 1 by
    /// default.
    pub tolerance: usize,
    /// The gradients that are summed along the diagonal (the paper's 3 x 3 kernel). 3 by default; 1
    /// for none, if queries arrive in any order.
    pub smoothing: usize,
    /// Which form of the gradient (Eq. 1).
    pub gradient: Gradient,
    /// The value that trusted cells are drawn towards (Eq. 4).
    pub floor: Floor,
    /// Slopes to try, in places a query: the sequence's diagonals. `[1.0]` by default, as in the
    /// paper.
    pub speeds: Vec<f64>,
    /// How the robot moves, for the tracker (method 1.9); `None`, the default, for the paper
    /// alone.
    pub motion: Option<Motion>,
    /// How much each of several techniques counts, in the order of their maps; empty, the default,
    /// if all count the same.
    pub technique_weights: Vec<f64>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            sequence_length: 2,
            weight: 0.99,
            tolerance: 1,
            smoothing: 3,
            gradient: Gradient::Halved,
            floor: Floor::Running,
            speeds: vec![1.0],
            motion: None,
            technique_weights: Vec::new(),
        }
    }
}

impl Config {
    /// Checks every option against its range, for a route of `places` places.
    ///
    /// # Errors
    /// [`Error::TooFewPlaces`] below two places, [`Error::Option`] for the first option outside its
    /// range.
    pub fn validate(&self, places: usize) -> Result<(), Error> {
        self.validate_along(&Segments::one(places))
    }

    /// Checks every option against its range, for a route of these segments. Each of the sequence's
    /// diagonals must fit a segment; a closed one has them all, for they go round it.
    ///
    /// # Errors
    /// As for [`validate`](Self::validate).
    pub fn validate_along(&self, segments: &Segments) -> Result<(), Error> {
        let places = segments.places();
        if places < 2 {
            return Err(Error::TooFewPlaces { what: "places", got: places });
        }
        let in_range = |name, range: std::ops::RangeInclusive<usize>, why: &str, got: usize| {
            if range.contains(&got) {
                return Ok(());
            }
            let expected = format!("a whole number from {} to {}{why}", range.start(), range.end());
            Err(Error::Option { name, expected, got: got.to_string() })
        };
        let closed = segments.iter().any(|segment| segment.closed);
        let longest = segments.iter().map(Segment::len).max().unwrap_or_default();
        let (longest, whose, fits) = if closed || longest == places {
            (places, " (the number of places)", "the route")
        } else {
            (longest, " (the places of the longest segment)", "a segment")
        };
        in_range("sequence_length", 1..=longest, whose, self.sequence_length)?;
        in_range("smoothing", 1..=MAX_SMOOTHING, "", self.smoothing)?;
        if !(0.0..=1.0).contains(&self.weight) {
            return Err(option("weight", "a number from 0 to 1", self.weight));
        }
        if let Floor::Fixed(floor) = self.floor
            && !(f64::from(f32::MIN)..=f64::from(f32::MAX)).contains(&floor)
        {
            return Err(option("floor", "a number that is finite in float32", floor));
        }
        if self.speeds.is_empty() {
            return Err(Error::Option {
                name: "speeds",
                expected: "at least one speed".to_owned(),
                got: "none".to_owned(),
            });
        }
        if self.speeds.len() > MAX_SPEEDS {
            return Err(Error::Option {
                name: "speeds",
                expected: format!("at most {MAX_SPEEDS} speeds"),
                got: self.speeds.len().to_string(),
            });
        }
        for &speed in &self.speeds {
            if !(speed.is_finite() && speed >= 0.0) {
                return Err(option(
                    "speeds",
                    "finite speeds of 0 or more, in places a query",
                    speed,
                ));
            }
            let reach = reach(speed, self.sequence_length - 1);
            if reach > (longest - 1) as f64 {
                let expected = format!(
                    "speeds whose diagonal fits {fits}: at most {} places back over a sequence of {}",
                    longest - 1,
                    self.sequence_length
                );
                return Err(option("speeds", &expected, speed));
            }
        }
        let weights = &self.technique_weights;
        let largest = weights.iter().copied().fold(0.0, f64::max);
        let range = 0.0..=MAX_WEIGHT;
        if !weights.is_empty() && (largest == 0.0 || !weights.iter().all(|w| range.contains(w))) {
            let expected = format!("numbers from 0 to {MAX_WEIGHT}, one of them above 0");
            let got = format!("{weights:?}");
            return Err(Error::Option { name: "technique_weights", expected, got });
        }
        self.motion.as_ref().map_or(Ok(()), Motion::validate)
    }
}

impl Config {
    /// Refuses options that only a batch has.
    ///
    /// # Errors
    /// [`Error::Option`] for `floor: Global`.
    pub(crate) fn validate_stream(&self) -> Result<(), Error> {
        if self.floor != Floor::Global {
            return Ok(());
        }
        let expected = "\"running\" or a number in a stream, which cannot know the whole matrix";
        let (name, got) = ("floor", "\"global\"".to_owned());
        Err(Error::Option { name, expected: expected.to_owned(), got })
    }

    /// How many queries' distances a matcher holds: those of the sequence and of the gradients that
    /// have a place on some diagonal. On an open segment an older one has none.
    pub(crate) fn columns(&self, segments: &Segments) -> usize {
        let reach = |segment: &Segment| {
            if segment.closed { self.smoothing } else { self.smoothing.min(segment.len()) }
        };
        segments.iter().map(reach).fold(self.sequence_length, usize::max)
    }

    /// The options that differ from those of `other`, each with both values.
    pub(crate) fn differences(&self, other: &Self) -> String {
        let values = |config: &Self| serde_json::to_value(config).unwrap_or_default();
        let (expected, got) = (values(self), values(other));
        let names = expected.as_object().into_iter().flat_map(|options| options.keys());
        let differing = names.filter(|&name| expected[name] != got[name]);
        let each =
            differing.map(|name| format!("{name}: expected {}, got {}", expected[name], got[name]));
        each.collect::<Vec<_>>().join("; ")
    }
}

/// `round(v k)`, halves upwards: how far back along the route the diagonal of slope `v` lies, `k`
/// queries ago.
pub(crate) fn reach(speed: f64, age: usize) -> f64 {
    (speed * age as f64).round()
}

fn option(name: &'static str, expected: &str, got: f64) -> Error {
    Error::Option { name, expected: expected.to_owned(), got: got.to_string() }
}
