//! The reference map: one descriptor a place, in route order, and all that is needed to use them.

mod append;
mod beside;
mod build;
mod file;
mod layout;
mod learned;
mod names;
mod parts;
mod positions;
mod screen;
#[cfg(test)]
mod screen_tests;
mod storage;

use std::hash::Hasher as _;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

use crate::descriptor::Sad;
use crate::distance::{self, Metric, Query, Rows, norm};
use crate::dtype::Dtype;
use crate::error::Error;
use crate::numbers::{Values, View, each_type};
use crate::post::{ChainState, Post};
use crate::simd::Isa;
use names::Names;
pub use positions::Positions;
pub(crate) use screen::{Aim, FAR, Screen};
use storage::Storage;

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

/// A known route: `places` descriptors of `dim` numbers, how to compare them, and how they were
/// made.
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
    /// Copies of a map share its rows.
    rows: Arc<Storage>,
    places: usize,
    dim: usize,
    metric: Metric,
    recipe: Recipe,
    screen: Option<Arc<Screen>>,
    /// Each row's length, for the cosine; else empty.
    norms: Vec<f64>,
    names: Option<Names>,
    positions: Option<Positions>,
    /// What the rows, and the queries, go through.
    post: Option<Arc<Post>>,
    /// The recipe of the descriptor that somebody else computes, as JSON.
    learned: Option<Arc<str>>,
    fingerprint: OnceLock<u64>,
    isa: Isa,
}

impl Map {
    /// A map of ready descriptors: rows of `dim` numbers, one after the other, in route order.
    ///
    /// # Errors
    /// [`Error::Shape`] where `dim` does not divide the numbers, [`Error::TooFewPlaces`] below two
    /// rows, [`Error::NotFinite`] for a NaN or an infinity, [`Error::NoDirection`] for a row of
    /// zeros under the cosine.
    pub fn from_descriptors(
        rows: impl Into<Values>,
        dim: usize,
        metric: Metric,
    ) -> Result<Self, Error> {
        Self::assemble(Storage::from(rows.into()), dim, metric, Recipe::Ready)
    }

    /// A map of rows that are all looked at: none of their numbers is a NaN or an infinity.
    fn assemble(rows: Storage, dim: usize, metric: Metric, recipe: Recipe) -> Result<Self, Error> {
        let places = count_places(rows.view().len(), dim)?;
        rows.view().check_finite("descriptors", dim)?;
        let norms = lengths(rows.view(), dim, metric)?;
        Ok(Self::of_parts(rows, places, dim, metric, recipe, norms))
    }

    /// A map of parts that have been checked.
    fn of_parts(
        rows: Storage,
        places: usize,
        dim: usize,
        metric: Metric,
        recipe: Recipe,
        norms: Vec<f64>,
    ) -> Self {
        Self {
            rows: Arc::new(rows),
            places,
            dim,
            metric,
            recipe,
            screen: None,
            norms,
            names: None,
            positions: None,
            post: None,
            learned: None,
            fingerprint: OnceLock::new(),
            isa: Isa::best(),
        }
    }

    /// The same map with a name for each place, such as its image's file name.
    ///
    /// # Errors
    /// [`Error::Length`] unless there are as many names as places, [`Error::Option`] for a name
    /// with a NUL.
    pub fn with_names(self, names: Vec<String>) -> Result<Self, Error> {
        self.named(Names::new(names)?)
    }

    fn named(mut self, names: Names) -> Result<Self, Error> {
        if names.len() != self.places {
            return Err(Error::Length { what: "names", expected: self.places, got: names.len() });
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
            return Err(Error::Length {
                what: "positions",
                expected: self.places,
                got: positions.len(),
            });
        }
        self.positions = Some(positions);
        Ok(self)
    }

    /// The same map, whose distances are computed with the given instruction set instead of
    /// [`Isa::best`]. It decides the speed; the distances are the same, to the last bit.
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
        self.rows.view().dtype()
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

    /// A name for each place, where the map has names. The list is made when it is first asked for.
    pub fn names(&self) -> Option<&[String]> {
        self.names.as_ref().map(Names::list)
    }

    /// A position for each place, where the map has positions.
    pub fn positions(&self) -> Option<&Positions> {
        self.positions.as_ref()
    }

    /// The distances from a descriptor to every place: one number a place, in route order. On a map
    /// with post-processing, the descriptor goes through that first, as the references did:
    /// statistics of a drive are a [`Localizer`](crate::Localizer)'s. SAD distances are in units of
    /// `z`, whatever the type that they are stored in (method 1.7).
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
    /// [`Error::Length`] for a descriptor that has not [`input_dim`](Self::input_dim) numbers or an
    /// `out` that has not `places()`; [`Error::Dtype`] unless it is of the map's own type, or
    /// float32 on a map of ready descriptors; [`Error::NotFinite`] for a NaN or an infinity;
    /// [`Error::NoDirection`] for zeros under the cosine, or where post-processing normalises them.
    /// `out` is then unchanged.
    pub fn distances_into(&self, descriptor: View<'_>, out: &mut [f32]) -> Result<(), Error> {
        let mut through = self.post.as_deref().map(ChainState::new);
        self.distances_of_passed(self.passed(descriptor, through.as_mut())?, out)
    }

    /// [`distances_into`](Self::distances_into), of a descriptor after post-processing.
    pub(crate) fn distances_of_passed(
        &self,
        descriptor: View<'_>,
        out: &mut [f32],
    ) -> Result<(), Error> {
        let query = self.query(descriptor)?;
        if out.len() != self.places {
            return Err(Error::Length { what: "distances", expected: self.places, got: out.len() });
        }
        self.scan(query, 0..self.places, out);
        Ok(())
    }

    /// A descriptor that can be compared with the map's: processed already, where the map has
    /// post-processing.
    ///
    /// # Errors
    /// Those of [`distances_into`](Self::distances_into) that are about the descriptor.
    pub(crate) fn query<'a>(&self, descriptor: View<'a>) -> Result<Query<'a>, Error> {
        let what = "descriptor";
        if descriptor.len() != self.dim {
            return Err(Error::Length { what, expected: self.dim, got: descriptor.len() });
        }
        // The numbers of SAD in float32 (z) are not those in uint8 (128 + 32 z): one is no query
        // for the other.
        if let (Recipe::Sad(_), map, got) = (self.recipe, self.dtype(), descriptor.dtype())
            && map != got
        {
            return Err(Error::Dtype { what, map, or_float: false, got });
        }
        Query::new(descriptor, self.as_rows())
    }

    /// Writes the distances to some of the places, which must be there, into `out`, which has a
    /// number for each.
    pub(crate) fn scan(&self, query: Query<'_>, places: Range<usize>, out: &mut [f32]) {
        let mut rows = self.as_rows();
        let numbers = places.start * self.dim..places.end * self.dim;
        rows.values = each_type!(View, rows.values, v => View::from(&v[numbers]));
        if !rows.norms.is_empty() {
            rows.norms = &rows.norms[places];
        }
        distance::distances(query, rows, out);
    }

    /// The screen, to be scanned.
    pub(crate) fn screened(&self) -> Option<&Arc<Screen>> {
        self.screen.as_ref()
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

    /// A hash of all that decides a distance: a snapshot knows its map by it. Computed once, when
    /// first asked for.
    pub(crate) fn fingerprint(&self) -> u64 {
        *self.fingerprint.get_or_init(|| {
            let mut hash = XxHash3_64::with_seed(0);
            let kind = format!("{} {} {} {:?}", self.dtype(), self.metric, self.dim, self.recipe);
            hash.write(kind.as_bytes());
            hash.write(self.rows.view().bytes());
            if let Some(post) = &self.post {
                learned::hash(post, &mut hash);
            }
            hash.finish()
        })
    }
}

/// How many places numbers in rows of `dim` are of.
fn count_places(numbers: usize, dim: usize) -> Result<usize, Error> {
    let what = "map";
    if dim == 0 || !numbers.is_multiple_of(dim) {
        let expected = "rows of at least one number, all of one length".to_owned();
        return Err(Error::Shape {
            what,
            expected,
            got: format!("{numbers} numbers in rows of {dim}"),
        });
    }
    let places = numbers / dim;
    if places < 2 {
        return Err(Error::TooFewPlaces { what, got: places });
    }
    Ok(places)
}

/// Each row's length where the metric needs it, else nothing.
fn lengths(rows: View<'_>, dim: usize, metric: Metric) -> Result<Vec<f64>, Error> {
    let norms: Vec<f64> = match metric {
        Metric::Cosine => {
            (0..rows.len() / dim).filter_map(|i| rows.row(i, dim)).map(norm).collect()
        }
        Metric::Manhattan | Metric::Euclidean => Vec::new(),
    };
    match norms.iter().position(|&norm| norm == 0.0) {
        Some(row) => Err(Error::NoDirection { what: "descriptors", row: Some(row) }),
        None => Ok(norms),
    }
}
