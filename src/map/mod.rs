//! The reference map: one descriptor a place, in route order, and all that is needed to use them.

mod file;

use std::hash::Hasher as _;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

use crate::descriptor::{ImageSource, Progress, Sad, describe_all};
use crate::distance::{self, Dtype, Metric, Rows, Values, View, norm};
use crate::error::Error;
use crate::isa::Isa;

/// How the map's descriptors were made, so that a query can be described the same way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
#[non_exhaustive]
pub enum Recipe {
    /// Somebody else made them: queries come as descriptors.
    #[default]
    Ready,
    /// The SAD descriptor: queries come as images, or as its descriptors.
    Sad(Sad),
}

/// A known route: `places` descriptors of `dim` numbers, how to compare them, and how they were made.
///
/// ```
/// use surefix::{Map, Metric};
/// let map = Map::from_descriptors(vec![0.0_f32, 1.0, 1.0, 0.0, 1.0, 1.0], 2, Metric::Euclidean)?;
/// assert_eq!(map.places(), 3);
/// assert_eq!(map.distances([0.0_f32, 1.0].as_slice())?[0], 0.0);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Map {
    rows: Values,
    places: usize,
    dim: usize,
    metric: Metric,
    recipe: Recipe,
    /// Each row's length, for the cosine; else empty.
    norms: Vec<f64>,
    names: Option<Vec<String>>,
    positions: Option<Positions>,
    fingerprint: OnceLock<u64>,
    isa: Isa,
}

/// Where each place is: planar metres, two or three coordinates a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Positions {
    metres: Vec<f64>,
    axes: usize,
}

impl Positions {
    /// Positions of `axes` (2 or 3) coordinates each, place by place, in metres.
    ///
    /// # Errors
    /// [`Error::Shape`] for other axes or a count that they do not divide, [`Error::NotFinite`] for a NaN or an infinity.
    pub fn new(metres: Vec<f64>, axes: usize) -> Result<Self, Error> {
        if !matches!(axes, 2 | 3) || !metres.len().is_multiple_of(axes) {
            return Err(Error::Shape {
                what: "positions",
                expected: "2 or 3 coordinates a place, in metres".to_owned(),
                got: format!("{} numbers for {axes} coordinates", metres.len()),
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
}

impl Map {
    /// A map of ready descriptors: rows of `dim` numbers, one after the other, in route order.
    ///
    /// # Errors
    /// [`Error::Shape`] where `dim` does not divide the numbers, [`Error::TooFewPlaces`] below two rows,
    /// [`Error::NotFinite`] for a NaN or an infinity, [`Error::NoDirection`] for a row of zeros under the cosine.
    pub fn from_descriptors(rows: impl Into<Values>, dim: usize, metric: Metric) -> Result<Self, Error> {
        Self::assemble(rows.into(), dim, metric, Recipe::Ready)
    }

    /// A map of the SAD descriptors of a traverse's images, described on all cores (feature `rayon`).
    /// Places are named as the images are. `progress` hears of images done and to do; `Break` from it stops the work.
    ///
    /// # Errors
    /// [`Error::Image`] or [`Error::Io`] for an image that cannot be read, [`Error::ImageSize`] for one of another
    /// size, [`Error::TooFewPlaces`] below two images, [`Error::Interrupted`] where `progress` breaks.
    pub fn from_images(
        images: &(impl ImageSource + ?Sized),
        sad: Sad,
        progress: Progress<'_>,
    ) -> Result<Self, Error> {
        if images.len() < 2 {
            return Err(Error::TooFewPlaces { what: "map", got: images.len() });
        }
        let rows = describe_all(&sad, images, progress)?;
        let names = (0..images.len()).map(|index| images.name(index)).collect();
        Self::assemble(rows, sad.dim(), Metric::Manhattan, Recipe::Sad(sad))?.with_names(names)
    }

    fn assemble(rows: Values, dim: usize, metric: Metric, recipe: Recipe) -> Result<Self, Error> {
        let what = "map";
        if dim == 0 || !rows.len().is_multiple_of(dim) {
            let expected = "rows of at least one number, all of one length".to_owned();
            let got = format!("{} numbers in rows of {dim}", rows.len());
            return Err(Error::Shape { what, expected, got });
        }
        let places = rows.len() / dim;
        if places < 2 {
            return Err(Error::TooFewPlaces { what, got: places });
        }
        rows.view().check_finite("descriptors", dim)?;
        let norms: Vec<f64> = match metric {
            Metric::Cosine => (0..places).filter_map(|i| rows.view().row(i, dim)).map(norm).collect(),
            Metric::Manhattan | Metric::Euclidean => Vec::new(),
        };
        if let Some(row) = norms.iter().position(|&norm| norm == 0.0) {
            return Err(Error::NoDirection { what: "descriptors", row: Some(row) });
        }
        let (fingerprint, isa) = (OnceLock::new(), Isa::best());
        Ok(Self { rows, places, dim, metric, recipe, norms, names: None, positions: None, fingerprint, isa })
    }

    /// The same map with a name for each place, such as its image's file name.
    ///
    /// # Errors
    /// [`Error::Length`] unless there are as many names as places, [`Error::Option`] for a name with a NUL.
    pub fn with_names(mut self, names: Vec<String>) -> Result<Self, Error> {
        if names.len() != self.places {
            return Err(Error::Length { what: "names", expected: self.places, got: names.len() });
        }
        if let Some(bad) = names.iter().find(|name| name.contains('\0')) {
            let expected = "names without NUL characters".to_owned();
            return Err(Error::Option { name: "names", expected, got: format!("{bad:?}") });
        }
        self.names = Some(names);
        Ok(self)
    }

    /// The same map with a position for each place.
    ///
    /// # Errors
    /// [`Error::Length`] unless there are as many positions as places.
    pub fn with_positions(mut self, positions: Positions) -> Result<Self, Error> {
        if positions.len() != self.places {
            return Err(Error::Length { what: "positions", expected: self.places, got: positions.len() });
        }
        self.positions = Some(positions);
        Ok(self)
    }

    /// The same map, whose distances are computed with the given instruction set instead of [`Isa::best`].
    /// It decides the speed; the distances are the same, to the last bit.
    ///
    /// ```
    /// use surefix::{Isa, Map, Metric};
    /// let map = Map::from_descriptors(vec![0_u8, 9, 1, 7], 2, Metric::Manhattan)?;
    /// let plain = map.clone().with_isa(Isa::Scalar)?;
    /// assert_eq!(plain.distances([3_u8, 3].as_slice())?, map.distances([3_u8, 3].as_slice())?);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Option`] for an instruction set that this processor lacks.
    pub fn with_isa(mut self, isa: Isa) -> Result<Self, Error> {
        self.isa = isa.checked()?;
        Ok(self)
    }

    /// The instruction set that distances are computed with.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// How many places the route has.
    pub fn places(&self) -> usize {
        self.places
    }

    /// How many numbers a descriptor has.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// The type of the descriptors' numbers.
    pub fn dtype(&self) -> Dtype {
        self.rows.dtype()
    }

    /// How descriptors are compared.
    pub fn metric(&self) -> Metric {
        self.metric
    }

    /// How the descriptors were made.
    pub fn recipe(&self) -> Recipe {
        self.recipe
    }

    /// All descriptors, place by place.
    pub fn descriptors(&self) -> View<'_> {
        self.rows.view()
    }

    /// A name for each place, where the map has names.
    pub fn names(&self) -> Option<&[String]> {
        self.names.as_deref()
    }

    /// A position for each place, where the map has positions.
    pub fn positions(&self) -> Option<&Positions> {
        self.positions.as_ref()
    }

    /// The distances from a descriptor to every place: one number a place, in route order.
    /// SAD distances are in units of `z`, whatever the type that they are stored in (method 1.7).
    ///
    /// # Errors
    /// As for [`distances_into`](Self::distances_into).
    pub fn distances<'a>(&self, descriptor: impl Into<View<'a>>) -> Result<Vec<f32>, Error> {
        let mut out = vec![0.0; self.places];
        self.distances_into(descriptor.into(), &mut out)?;
        Ok(out)
    }

    /// Like [`distances`](Self::distances), into memory that the caller keeps.
    ///
    /// # Errors
    /// [`Error::Length`] for a descriptor that has not `dim()` numbers or an `out` that has not `places()`;
    /// [`Error::Dtype`] unless it is of the map's own type, or float32 on a map of ready descriptors; [`Error::NotFinite`] for a NaN or an infinity;
    /// [`Error::NoDirection`] for zeros under the cosine. `out` is then unchanged.
    pub fn distances_into(&self, descriptor: View<'_>, out: &mut [f32]) -> Result<(), Error> {
        if descriptor.len() != self.dim {
            return Err(Error::Length { what: "descriptor", expected: self.dim, got: descriptor.len() });
        }
        if out.len() != self.places {
            return Err(Error::Length { what: "distances", expected: self.places, got: out.len() });
        }
        // The numbers of SAD in float32 (z) are not those in uint8 (128 + 32 z): one is no query for the other.
        if let (Recipe::Sad(_), map, got) = (self.recipe, self.dtype(), descriptor.dtype())
            && map != got
        {
            return Err(Error::Dtype { what: "descriptor", map, or_float: false, got });
        }
        distance::distances(descriptor, self.as_rows(), out)
    }

    fn as_rows(&self) -> Rows<'_> {
        let unit = match self.recipe {
            Recipe::Sad(sad) => sad.unit(),
            Recipe::Ready => 1.0,
        };
        Rows {
            values: self.rows.view(),
            dim: self.dim,
            metric: self.metric,
            unit,
            norms: &self.norms,
            isa: self.isa,
        }
    }

    /// A hash of all that decides a distance: a snapshot knows its map by it. Computed once, when first asked for.
    pub(crate) fn fingerprint(&self) -> u64 {
        *self.fingerprint.get_or_init(|| {
            let mut hash = XxHash3_64::with_seed(0);
            let kind = format!("{} {} {} {:?}", self.dtype(), self.metric, self.dim, self.recipe);
            hash.write(kind.as_bytes());
            hash.write(self.rows.view().bytes());
            hash.finish()
        })
    }
}
