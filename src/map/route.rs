//! The route: how rows become places, which places follow each other, their positions and names.

use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::OnceLock;

use super::traverses::Traverses;
use crate::error::Error;
use crate::segments::Segments;

/// The route along the map's rows. The rest of the crate asks [`segments`](Self::segments) where
/// neighbours end, and [`rows`](Self::rows) which rows are places; a place may have further rows in
/// other traverses.
#[derive(Clone, Debug)]
pub(crate) struct Route {
    segments: Segments,
    pub(super) positions: Option<Positions>,
    pub(super) names: Option<Names>,
    pub(super) traverses: Traverses,
}

impl Route {
    /// A route without breaks.
    pub(super) fn unbroken(places: usize) -> Self {
        let traverses = Traverses::default();
        Self { segments: Segments::one(places), positions: None, names: None, traverses }
    }

    pub(crate) fn places(&self) -> usize {
        self.segments.places()
    }

    /// Where neighbours follow each other: gradients and diagonals do not cross from one segment to
    /// the next.
    pub(crate) fn segments(&self) -> &Segments {
        &self.segments
    }

    /// The rows of a range of places in the first traverse.
    #[expect(clippy::unused_self, reason = "the first traverse has one row for each place")]
    pub(crate) fn rows(&self, places: Range<usize>) -> Range<usize> {
        places
    }

    /// This route and then `more`, in one segment.
    pub(super) fn followed_by(&self, more: &Self) -> Self {
        Self {
            positions: self
                .positions
                .as_ref()
                .zip(more.positions.as_ref())
                .map(|(a, b)| a.followed_by(b)),
            names: self.names.as_ref().zip(more.names.as_ref()).map(|(a, b)| a.followed_by(b)),
            traverses: self.traverses.followed_by(self.places(), &more.traverses),
            ..Self::unbroken(self.places() + more.places())
        }
    }

    /// Some of the places, which must be there, with the breaks between them.
    pub(super) fn slice(&self, places: Range<usize>) -> Self {
        Self {
            segments: self.segments.slice(places.clone()),
            positions: self.positions.as_ref().map(|positions| positions.slice(places.clone())),
            names: self.names.as_ref().map(|names| names.slice(places.clone())),
            traverses: self.traverses.keep(&places),
        }
    }
}

/// Where each place is: planar metres, two or three coordinates a place.
///
/// ```
/// use surefix::{Map, Metric, Positions};
///
/// let map = Map::from_descriptors(vec![0.0_f32, 1.0, 2.0], 1, Metric::Euclidean)?;
/// let map = map.with_positions(Positions::new(vec![0.0, 0.0, 3.0, 0.0, 6.0, 0.5], 2)?)?;
/// assert_eq!(map.positions().map(|positions| positions.len()), Some(3));
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Positions {
    metres: Vec<f64>,
    axes: usize,
}

impl Positions {
    /// Positions of `axes` (2 or 3) coordinates each, place by place, in metres.
    ///
    /// # Errors
    /// [`Error::Shape`] for other axes or a count that they do not divide, [`Error::NotFinite`] for
    /// a NaN or an infinity.
    pub fn new(metres: Vec<f64>, axes: usize) -> Result<Self, Error> {
        if !matches!(axes, 2 | 3) || !metres.len().is_multiple_of(axes) {
            return Err(Error::Shape {
                what: "positions",
                expected: "2 or 3 coordinates a place, in metres".to_owned(),
                got: if matches!(axes, 2 | 3) {
                    format!("{} numbers, which {axes} does not divide", metres.len())
                } else {
                    axes.to_string()
                },
            });
        }
        if let Some(at) = metres.iter().position(|x| !x.is_finite()) {
            let (row, value) = (Some(at / axes), metres[at] as f32);
            return Err(Error::NotFinite { what: "positions", row, index: at % axes, value });
        }
        Ok(Self { metres, axes })
    }

    /// All coordinates, place by place, in metres.
    pub fn metres(&self) -> &[f64] {
        &self.metres
    }

    /// Coordinates a place: 2 or 3.
    pub fn axes(&self) -> usize {
        self.axes
    }

    /// The number of places that have a position.
    pub fn len(&self) -> usize {
        self.metres.len() / self.axes
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.metres.is_empty()
    }

    /// These and then those, which have the same number of axes.
    fn followed_by(&self, more: &Self) -> Self {
        Self { metres: [self.metres(), more.metres()].concat(), axes: self.axes }
    }

    /// Those of some places, in this order.
    pub(crate) fn of(&self, places: impl Iterator<Item = usize>) -> Self {
        let metres = places.flat_map(|place| &self.metres[place * self.axes..][..self.axes]);
        Self { metres: metres.copied().collect(), axes: self.axes }
    }

    fn slice(&self, places: Range<usize>) -> Self {
        let metres = self.metres[places.start * self.axes..places.end * self.axes].to_vec();
        Self { metres, axes: self.axes }
    }
}

/// Place names in one string, as in the file: a NUL after each, split on first use. Making a
/// million strings would take longer than opening the rest of a map.
#[derive(Clone, Debug)]
pub(super) struct Names {
    text: String,
    count: usize,
    list: OnceLock<Vec<String>>,
}

impl Names {
    /// # Errors
    /// [`Error::Option`] for a name with a NUL.
    pub(super) fn new<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> Result<Self, Error> {
        let mut text = String::new();
        let mut count = 0;
        for name in names {
            let name = name.as_ref();
            if name.contains('\0') {
                let expected = "names without NUL characters".to_owned();
                return Err(Error::Option { name: "names", expected, got: format!("{name:?}") });
            }
            text.push_str(name);
            text.push('\0');
            count += 1;
        }
        Ok(Self { text, count, list: OnceLock::new() })
    }

    /// The names in a file, or `None` if they are not UTF-8.
    pub(super) fn from_bytes(bytes: Vec<u8>) -> Option<Self> {
        let mut text = String::from_utf8(bytes).ok()?;
        if !text.is_empty() && !text.ends_with('\0') {
            text.push('\0');
        }
        let count = text.bytes().filter(|&byte| byte == 0).count();
        Some(Self { text, count, list: OnceLock::new() })
    }

    /// These and then those.
    fn followed_by(&self, more: &Self) -> Self {
        let text = [self.text.as_str(), &more.text].concat();
        Self { text, count: self.count + more.count, list: OnceLock::new() }
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// The names as they are in a file.
    pub(super) fn bytes(&self) -> &[u8] {
        self.text.as_bytes()
    }

    pub(super) fn list(&self) -> &[String] {
        self.list.get_or_init(|| self.text.split_terminator('\0').map(str::to_owned).collect())
    }

    fn slice(&self, places: Range<usize>) -> Self {
        let names = self.text.split_inclusive('\0').skip(places.start).take(places.len());
        Self { text: names.collect(), count: places.len(), list: OnceLock::new() }
    }
}
