//! The reference map: one descriptor for each place, in route order, and how to make and compare
//! descriptors.

mod blank;
mod block;
mod codes;
mod contents;
mod edit;
mod extras;
mod file;
mod fold;
mod grow;
mod growing;
mod join;
mod positions;
mod recipe;
mod route;
mod storage;
mod thumbnails;
mod traverses;
mod traverses_file;

use std::hash::Hasher as _;
use std::ops::Range;
use std::sync::Arc;

use once_cell::race::OnceBox;
use twox_hash::XxHash3_64;

use crate::descriptor::Sad;
use crate::distance::{Metric, Rows};
use crate::dtype::Dtype;
use crate::error::Error;
use crate::image::{ImageSource, Progress};
use crate::numbers::{Values, View};
use crate::segments::Segments;
use crate::simd::Isa;
use block::{Blocks, lengths};
pub(crate) use codes::Codes;
pub use extras::Extras;
pub(crate) use fold::{Means, RowSums};
pub(crate) use growing::GrowingMap;
pub use positions::{Origin, Position, Positions};
use recipe::Kind;
pub use recipe::Recipe;
use route::{Names, Route};
pub(crate) use storage::Storage;
pub use thumbnails::Thumbnails;
pub use traverses::MapTraverse;

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
    /// Copies of a map share its blocks.
    blocks: Blocks,
    route: Arc<Route>,
    kind: Kind,
    /// The rows' codes, if the map has a screen.
    codes: Option<Arc<Codes>>,
    fingerprint: OnceBox<u64>,
    /// That of its file, if it is as it was there and the file has one.
    checksum: Option<u64>,
    /// The places that show nothing, once they are known.
    blank: OnceBox<Arc<[usize]>>,
    isa: Isa,
}

impl Map {
    /// A map of ready descriptors: rows of `dim` numbers, one after the other, in route order.
    ///
    /// # Errors
    /// [`Error::Shape`] if `dim` does not divide the count of numbers, [`Error::TooFewPlaces`]
    /// below two rows, [`Error::NotFinite`] for a NaN or an infinity, [`Error::NoDirection`] for a
    /// row of up to 8 zeros under the cosine.
    pub fn from_descriptors(
        rows: impl Into<Values>,
        dim: usize,
        metric: Metric,
    ) -> Result<Self, Error> {
        Self::checked(Storage::from(rows.into()), dim, metric, Recipe::Ready)
    }

    /// A map of the SAD descriptors of a traverse's images, described on all cores (feature
    /// `rayon`). Places get the images' names. If the images are deep, and `sad` has no levels, the
    /// map measures them ([`Levels`](crate::Levels)). `progress` is told how many images are done and how
    /// many there are; `Break` from it stops the work.
    ///
    /// # Errors
    /// [`Error::Image`] or [`Error::Io`] for an image that cannot be read, [`Error::ImageSize`] for
    /// one of another size, [`Error::TooFewPlaces`] below two images, [`Error::Interrupted`] if
    /// `progress` breaks.
    pub fn from_images(
        images: &(impl ImageSource + ?Sized),
        sad: Sad,
        progress: Progress<'_>,
    ) -> Result<Self, Error> {
        Self::from_images_with(images, sad, Extras::default(), progress)
    }

    /// A map of rows whose numbers have not been checked.
    fn checked(rows: Storage, dim: usize, metric: Metric, recipe: Recipe) -> Result<Self, Error> {
        count_places(rows.view().len(), dim)?;
        rows.view().check_finite("descriptors", dim)?;
        let norms = lengths(rows.view(), dim, metric)?;
        let dtype = rows.view().dtype();
        let kind = Kind { dim, dtype, metric, recipe, post: None, learned: None, image_size: None };
        Ok(Self::of(rows, &norms, kind))
    }

    /// A map of rows that have been checked.
    fn of(rows: Storage, norms: &[f64], kind: Kind) -> Self {
        let blocks = Blocks::of(rows, kind.dim, norms);
        let route = Route::unbroken(blocks.rows());
        Self::joining(blocks, route, kind, Isa::best())
    }

    fn joining(blocks: Blocks, route: Route, kind: Kind, isa: Isa) -> Self {
        let route = Arc::new(route);
        let (fingerprint, blank) = (OnceBox::new(), OnceBox::new());
        Self { blocks, route, kind, codes: None, fingerprint, checksum: None, blank, isa }
    }

    /// A map of the same kind, with a screen if this one has a screen.
    fn screened_like(&self, blocks: Blocks, route: Route) -> Result<Self, Error> {
        let map = Self::joining(blocks, route, self.kind.clone(), self.isa);
        match self.screen() {
            Some(dtype) => map.with_screen(dtype),
            None => Ok(map),
        }
    }

    /// The same map with a name for each place, such as its image's file name.
    ///
    /// # Errors
    /// [`Error::Length`] unless there is a name for each place, [`Error::Option`] for a name with a
    /// NUL.
    pub fn with_names(self, names: Vec<String>) -> Result<Self, Error> {
        self.named(Names::new(names)?)
    }

    fn named(mut self, names: Names) -> Result<Self, Error> {
        self.one_for_each_place("names", names.len())?;
        self.route_mut().names = Some(names);
        Ok(self)
    }

    /// The same map with a position for each place.
    ///
    /// # Errors
    /// [`Error::Length`] unless there is a position for each place.
    pub fn with_positions(mut self, positions: Positions) -> Result<Self, Error> {
        self.one_for_each_place("positions", positions.len())?;
        self.route_mut().positions = Some(positions);
        Ok(self)
    }

    /// The same map, whose places follow each other as `segments` say (method 1.14).
    ///
    /// ```
    /// use surefix::{Map, Metric, Segments};
    /// let map = Map::from_descriptors(vec![0_u8, 1, 2, 3, 4], 1, Metric::Manhattan)?;
    /// let map = map.with_segments(Segments::new(5, &[2])?.with_closed(&[1])?)?;
    /// assert_eq!(map.segments().len(), 2);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Length`] unless they have this map's number of places.
    pub fn with_segments(mut self, segments: Segments) -> Result<Self, Error> {
        self.one_for_each_place("segments: places", segments.places())?;
        self.route_mut().segments = segments;
        self.changed();
        Ok(self)
    }

    /// How the places follow each other.
    pub fn segments(&self) -> &Segments {
        &self.route.segments
    }

    /// It is not what was hashed.
    pub(super) fn changed(&mut self) {
        self.fingerprint = OnceBox::new();
        self.checksum = None;
    }

    /// The checksum of its file, if it is as it was there and the file has one.
    pub(crate) fn checksum(&self) -> Option<u64> {
        self.checksum
    }

    fn route_mut(&mut self) -> &mut Route {
        Arc::make_mut(&mut self.route)
    }

    fn one_for_each_place(&self, what: &'static str, got: usize) -> Result<(), Error> {
        let expected = self.places();
        if got == expected { Ok(()) } else { Err(Error::Length { what, expected, got }) }
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
    /// [`Error::Option`] for an instruction set that the processor lacks.
    pub fn with_isa(mut self, isa: Isa) -> Result<Self, Error> {
        self.isa = isa.checked()?;
        Ok(self)
    }

    /// The instruction set that distances are computed with.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// The number of places on the route.
    pub fn places(&self) -> usize {
        self.route.places()
    }

    /// The length of a descriptor.
    pub fn dim(&self) -> usize {
        self.kind.dim
    }

    /// The type of the descriptors' numbers.
    pub fn dtype(&self) -> Dtype {
        self.kind.dtype
    }

    /// How descriptors are compared.
    pub fn metric(&self) -> Metric {
        self.kind.metric
    }

    /// How the descriptors were made.
    pub fn recipe(&self) -> Recipe {
        self.kind.recipe
    }

    /// All descriptors, place by place; of several traverses, the first's. The rows of a map that was
    /// [`extended`](Self::extended) lie
    /// in several pieces: the first call on it copies them into one, which it keeps.
    pub fn descriptors(&self) -> View<'_> {
        self.blocks.in_one_piece()
    }

    /// A name for each place, if the map has names. The list is made on first use.
    pub fn names(&self) -> Option<&[String]> {
        self.route.names.as_ref().map(Names::list)
    }

    /// A position for each place, if the map has positions.
    pub fn positions(&self) -> Option<&Positions> {
        self.route.positions.as_ref()
    }

    pub(crate) fn route(&self) -> &Route {
        &self.route
    }

    pub(crate) fn blocks(&self) -> &Blocks {
        &self.blocks
    }

    /// The rows' codes, if the map has a screen.
    pub(crate) fn codes(&self) -> Option<&Arc<Codes>> {
        self.codes.as_ref()
    }

    pub(crate) fn with_codes(mut self, codes: Codes) -> Self {
        self.codes = Some(codes.into());
        self
    }

    /// Calls `work` with the rows of each block that has some of `rows`, which count through all
    /// traverses, and the range of their distances.
    pub(crate) fn each_block(
        &self,
        rows: Range<usize>,
        mut work: impl FnMut(Rows<'_>, Range<usize>),
    ) {
        let (dim, all) = (self.kind.dim, self.rows());
        let (mut start, mut done) = (0, 0);
        for blocks in self.all_blocks() {
            let end = start + blocks.rows();
            let own = rows.start.clamp(start, end) - start..rows.end.clamp(start, end) - start;
            let count = own.len();
            if count > 0 {
                blocks.each(own, |block, within, out| {
                    let values = block::part(block.rows(), within.start * dim..within.end * dim);
                    let norms = block.norms().get(within).unwrap_or_default();
                    let rows = self.kind.rows(values, norms, self.isa, all);
                    work(rows, done + out.start..done + out.end);
                });
            }
            (start, done) = (end, done + count);
        }
    }

    /// The blocks of all traverses.
    pub(super) fn all_blocks(&self) -> impl Iterator<Item = &Blocks> {
        let further = self.route.traverses.further.iter().map(|traverse| &traverse.blocks);
        std::iter::once(&self.blocks).chain(further)
    }

    /// No rows, to check a query against.
    pub(crate) fn no_rows(&self) -> Rows<'_> {
        let values = block::part(self.blocks.first(), 0..0);
        self.kind.rows(values, &[], self.isa, 0)
    }

    /// A hash of everything that decides a distance: a snapshot identifies its map by it. Computed
    /// on first use.
    pub(crate) fn fingerprint(&self) -> u64 {
        *self.fingerprint.get_or_init(|| {
            let mut hash = XxHash3_64::with_seed(0);
            let Kind { dtype, metric, dim, recipe, .. } = &self.kind;
            hash.write(format!("{dtype} {metric} {dim} {recipe:?}").as_bytes());
            for blocks in self.all_blocks() {
                blocks.iter().for_each(|block| hash.write(block.rows().bytes()));
            }
            for traverse in &self.route.traverses.further {
                hash.write(bytemuck::must_cast_slice(&traverse.places));
            }
            if let Some(post) = self.post() {
                recipe::hash(post, &mut hash);
            }
            // Snapshots of maps before segments stay valid.
            if *self.segments() != Segments::one(self.places()) {
                hash.write(format!("{:?}", self.segments()).as_bytes());
            }
            Box::new(hash.finish())
        })
    }
}

/// The number of places in a count of numbers in rows of `dim`.
fn count_places(numbers: usize, dim: usize) -> Result<usize, Error> {
    if dim == 0 || !numbers.is_multiple_of(dim) {
        let expected = "rows of at least one number, all of one length".to_owned();
        let got = format!("{numbers} numbers in rows of {dim}");
        return Err(Error::Shape { what: "map", expected, got });
    }
    at_least_two(numbers / dim)
}

fn at_least_two(places: usize) -> Result<usize, Error> {
    if places < 2 { Err(Error::TooFewPlaces { what: "map", got: places }) } else { Ok(places) }
}
