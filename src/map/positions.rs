//! Where the places are.

use crate::error::Error;

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
#[derive(Clone, Debug, PartialEq)]
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

    /// How many places have a position.
    pub fn len(&self) -> usize {
        self.metres.len() / self.axes
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.metres.is_empty()
    }

    /// These, and then those, which have as many axes.
    pub(super) fn followed_by(&self, more: &Self) -> Self {
        Self { metres: [self.metres(), more.metres()].concat(), axes: self.axes }
    }
}
