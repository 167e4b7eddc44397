//! Several traverses of one route: a place has a row of each drive that saw it, and the distances
//! to its rows become one (method 1.14).
//!
//! The rows of the first traverse are those of the map's places, in order. Each further traverse
//! has a row for some of the places. A scan goes through all rows, the first traverse's before the
//! second's, and so on; `fold.rs` makes a distance for each place of those to the rows.

use std::ops::Range;
use std::sync::Arc;

use once_cell::race::OnceBox;

use super::blank::Census;
use super::block::Blocks;
use super::fold::Quiet;
use super::join::{About, check};
use super::recipe::Kind;
use super::{Map, Storage, lengths};
use crate::error::Error;
use crate::numbers::{Values, View};

/// The longest label, in bytes.
pub(super) const LONGEST_LABEL: usize = 1 << 10;
/// The most further traverses of a map: its file has a few tensors for each.
pub(super) const MOST: usize = 64;

/// One of a map's traverses: the drive's label, and the places that it has rows for.
#[derive(Clone, Copy, Debug)]
pub struct MapTraverse<'a> {
    label: &'a str,
    /// `None` for all.
    places: Option<&'a [u32]>,
    rows: usize,
}

impl<'a> MapTraverse<'a> {
    /// Its name, such as the drive's folder; may be empty.
    pub fn label(&self) -> &'a str {
        self.label
    }

    /// How many rows it has: one for each place that it covers.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The places that it covers, in order.
    pub fn places(&self) -> impl ExactSizeIterator<Item = usize> + use<'a> {
        let Self { places, rows, .. } = *self;
        (0..rows).map(move |row| places.map_or(row, |places| places[row] as usize))
    }
}

/// A traverse after the first: a row for some of the places.
#[derive(Clone, Debug)]
pub(super) struct Further {
    pub(super) label: Arc<str>,
    /// The place of each row, ascending.
    pub(super) places: Arc<[u32]>,
    pub(super) blocks: Blocks,
    /// The rows that show nothing, once they are known.
    pub(super) blank: OnceBox<Arc<[usize]>>,
}

/// A route's traverses.
#[derive(Clone, Debug, Default)]
pub(crate) struct Traverses {
    /// The label of the first.
    pub(super) first: Arc<str>,
    pub(super) further: Vec<Further>,
    pub(super) quiet: OnceBox<Quiet>,
}

impl Traverses {
    pub(super) fn new(first: Arc<str>, further: Vec<Further>) -> Self {
        Self { first, further, quiet: OnceBox::new() }
    }

    /// How many rows the further traverses have.
    pub(super) fn further_rows(&self) -> usize {
        self.further.iter().map(|traverse| traverse.places.len()).sum()
    }

    /// Those of some places, which ascend.
    pub(super) fn keep(&self, places: &(impl Iterator<Item = usize> + Clone)) -> Self {
        let further = self.further.iter().filter_map(|traverse| traverse.keep(places.clone()));
        Self::new(self.first.clone(), further.collect())
    }

    /// # Errors
    /// [`Error::Append`] if there are more than a file can hold.
    pub(super) fn check_count(&self) -> Result<(), Error> {
        let (most, count) = (MOST + 1, self.further.len() + 1);
        if count <= most {
            return Ok(());
        }
        let expected = format!("at most {most} traverses in all, those of one label counted once");
        Err(Error::Append { map: "the maps".to_owned(), expected, got: count.to_string() })
    }

    /// These, of `places` places, and then those. Traverses of one label, if it is not empty,
    /// become one.
    pub(super) fn followed_by(&self, places: usize, more: &Self) -> Self {
        let mut further = self.further.clone();
        for traverse in &more.further {
            let own = further[..self.further.len()]
                .iter_mut()
                .find(|own| !own.label.is_empty() && own.label == traverse.label)
                // Of two with one label in `more`, one only.
                .filter(|own| own.places.last().is_none_or(|&last| (last as usize) < places));
            let moved = traverse.places.iter().map(|&place| place + places as u32);
            if let Some(own) = own {
                own.places = own.places.iter().copied().chain(moved).collect();
                own.blocks = own.blocks.followed_by(&traverse.blocks);
                own.blank = OnceBox::new();
            } else {
                further.push(Further { places: moved.collect(), ..traverse.clone() });
            }
        }
        Self::new(self.first.clone(), further)
    }
}

impl Further {
    fn keep(&self, places: impl Iterator<Item = usize>) -> Option<Self> {
        let (mut kept, mut runs) = (Vec::new(), Vec::<Range<usize>>::new());
        let mut rows = self.places.iter().enumerate().peekable();
        for (new, place) in places.enumerate() {
            while rows.next_if(|&(_, &own)| (own as usize) < place).is_some() {}
            let Some((row, _)) = rows.next_if(|&(_, &own)| own as usize == place) else { continue };
            kept.push(new as u32);
            match runs.last_mut() {
                Some(run) if run.end == row => run.end += 1,
                _ => runs.push(row..row + 1),
            }
        }
        if runs.is_empty() {
            return None;
        }
        let blocks = self.blocks.keep(&runs);
        let blank = OnceBox::new();
        Some(Self { label: self.label.clone(), places: kept.into(), blocks, blank })
    }

    pub(super) fn blank(&self, kind: &Kind) -> &[usize] {
        self.blank.get_or_init(|| {
            let mut census = Census::new(kind);
            self.blocks.iter().for_each(|block| census.add(block.rows()));
            Box::new(census.places().into())
        })
    }
}

impl Map {
    /// This map with one more drive of its road: a place then has several rows, and its distance is
    /// the least of theirs (method 1.14). `rows` is a map of the drive; `places` has for each of
    /// its rows the place that it shows, `None` for one that is left out, such as those whose
    /// [alignment](crate::align_descriptors) is not sure. Rows are shared with both maps; those of
    /// the drive are copied if they lie in short pieces. A snapshot that was taken on this map is
    /// refused on the new one.
    ///
    /// ```
    /// use surefix::{Map, Metric};
    /// let summer = Map::from_descriptors(vec![0_u8, 10, 20, 30], 1, Metric::Manhattan)?;
    /// let winter = Map::from_descriptors(vec![12_u8, 22, 92], 1, Metric::Manhattan)?;
    /// let map = summer.add_traverse(&winter, &[Some(1), Some(2), None], "winter")?;
    /// let covered: Vec<_> = map.traverses().map(|traverse| traverse.rows()).collect();
    /// assert_eq!((map.places(), covered), (4, vec![4, 2]));
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Append`] unless the descriptors of both are of one length, type, metric and recipe
    /// and went through the same post-processing; [`Error::Length`] unless there is an entry in
    /// `places` for each row; [`Error::Option`] for a place that there is not or that comes twice,
    /// if no row has a place, if `rows` has several traverses itself, for a label of more than 1024
    /// bytes, or at more than 65 traverses; as for [`with_screen`](Self::with_screen), if this map
    /// has a screen.
    pub fn add_traverse(
        &self,
        rows: &Self,
        places: &[Option<usize>],
        label: &str,
    ) -> Result<Self, Error> {
        self.check_traverse(rows)?;
        let own = &self.route.traverses;
        refuse_label(label)?;
        let wrong = |name, expected: &str, got: String| {
            Err(Error::Option { name, expected: expected.to_owned(), got })
        };
        if own.further.len() >= MOST {
            return wrong("traverse", "at most 65 traverses", "one more".to_owned());
        }
        let (expected, got) = (rows.places(), places.len());
        if expected != got {
            return Err(Error::Length { what: "places, one for each row", expected, got });
        }
        let mut order: Vec<(usize, usize)> = Vec::with_capacity(got);
        for (row, place) in places.iter().enumerate() {
            if let Some(place) = *place {
                if place >= self.places() || u32::try_from(place).is_err() {
                    let expected = format!("places from 0 to {}", self.places() - 1);
                    return wrong("places", &expected, format!("{place} at row {row}"));
                }
                order.push((place, row));
            }
        }
        order.sort_unstable();
        if let Some(twice) = order.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return wrong("places", "each place at most once", format!("{} twice", twice[0].0));
        }
        if order.is_empty() {
            return wrong("places", "a place for at least one row", "none".to_owned());
        }
        let runs = order.chunk_by(|a, b| a.1 + 1 == b.1);
        let runs: Vec<_> = runs.map(|run| run[0].1..run[0].1 + run.len()).collect();
        let blocks = rows.blocks.keep(&runs);
        let mut further = own.further.clone();
        further.push(Further {
            label: label.into(),
            places: order.iter().map(|&(place, _)| place as u32).collect(),
            blocks,
            blank: OnceBox::new(),
        });
        self.with_traverses(Traverses::new(own.first.clone(), further))
    }

    /// Whether the rows of a map can be a traverse of this one.
    ///
    /// # Errors
    /// Those of [`add_traverse`](Self::add_traverse) about `rows`.
    pub fn check_traverse(&self, rows: &Self) -> Result<(), Error> {
        check("traverse", About::kind(&self.kind), About::kind(&rows.kind))?;
        if rows.has_several() {
            let expected = "a map of one drive".to_owned();
            return Err(Error::Option { name: "traverse", expected, got: "one of several".into() });
        }
        Ok(())
    }

    /// The map's traverses: the first, whose rows are its places, and those that were
    /// [added](Self::add_traverse).
    pub fn traverses(&self) -> impl ExactSizeIterator<Item = MapTraverse<'_>> {
        let Traverses { first, further, .. } = &self.route.traverses;
        let count = 1 + further.len();
        (0..count).map(move |index| match index.checked_sub(1) {
            None => MapTraverse { label: first, places: None, rows: self.places() },
            Some(at) => {
                let Further { label, places, .. } = &further[at];
                MapTraverse { label, places: Some(places), rows: places.len() }
            }
        })
    }

    /// The map without one of its traverses. If it is the first, the next one that covers all
    /// places takes its part.
    ///
    /// # Errors
    /// [`Error::Option`] for a traverse that there is not, the only one, or the first if no other
    /// covers all places; as for [`with_screen`](Self::with_screen), if this map has a screen.
    pub fn without_traverse(&self, index: usize) -> Result<Self, Error> {
        let Traverses { first, further, .. } = &self.route.traverses;
        let refused = |expected: String| {
            Err(Error::Option { name: "traverse", expected, got: index.to_string() })
        };
        if further.is_empty() {
            return refused("a map of several traverses".to_owned());
        }
        if index > further.len() {
            return refused(format!("one from 0 to {}", further.len()));
        }
        let mut left = further.clone();
        if index > 0 {
            left.remove(index - 1);
            return self.with_traverses(Traverses::new(first.clone(), left));
        }
        let whole = further.iter().position(|traverse| traverse.places.len() == self.places());
        let Some(whole) = whole else {
            return refused("a traverse without which all places have a row".to_owned());
        };
        let Further { label, blocks, blank, .. } = left.remove(whole);
        let mut route = (*self.route).clone();
        route.traverses = Traverses::new(label, left);
        let mut map = Self::joining(blocks, route, self.kind.clone(), self.isa);
        map.blank = blank;
        map.like_screen_of(self)
    }

    /// The map with a label for its first traverse.
    ///
    /// # Errors
    /// [`Error::Option`] for a label of more than 1024 bytes.
    pub fn with_label(mut self, label: &str) -> Result<Self, Error> {
        refuse_label(label)?;
        Arc::make_mut(&mut self.route).traverses.first = label.into();
        Ok(self)
    }

    /// A map of a drive's descriptors, given as this map's queries are: before post-processing, if
    /// there is any, which is applied with the references' statistics. It has this map's metric,
    /// recipe and post-processing, so that it can be [added](Self::add_traverse) to it.
    ///
    /// # Errors
    /// As for [`from_descriptors`](Self::from_descriptors); [`Error::Dtype`] for numbers of another
    /// type than the map's, and those of [`Post::apply`](crate::Post::apply).
    pub fn of_same_kind(&self, descriptors: View<'_>) -> Result<Self, Error> {
        let (dim, dtype) = (self.input_dim(), self.dtype());
        if descriptors.dtype() != dtype {
            let (what, got) = ("descriptors", descriptors.dtype());
            return Err(Error::Dtype { what, map: dtype, or_float: false, got });
        }
        super::count_places(descriptors.len(), dim)?;
        descriptors.check_finite("descriptors", dim)?;
        let rows = match (self.post(), descriptors) {
            (Some(post), View::F32(rows)) => Values::F32(post.apply(rows)?),
            _ => descriptors.try_to_values()?,
        };
        let rows = Storage::from(rows);
        let norms = lengths(rows.view(), self.dim(), self.metric())?;
        Ok(Self::of(rows, &norms, self.kind.clone()))
    }

    fn with_traverses(&self, traverses: Traverses) -> Result<Self, Error> {
        let mut route = (*self.route).clone();
        route.traverses = traverses;
        let mut map = Self::joining(self.blocks.clone(), route, self.kind.clone(), self.isa);
        map.blank = self.blank.clone();
        map.like_screen_of(self)
    }

    fn like_screen_of(self, other: &Self) -> Result<Self, Error> {
        match other.screen() {
            Some(dtype) => self.with_screen(dtype),
            None => Ok(self),
        }
    }

    /// How many rows the map has, those of all its traverses.
    pub(crate) fn rows(&self) -> usize {
        self.places() + self.route.traverses.further_rows()
    }

    /// Whether places may have several rows.
    pub(crate) fn has_several(&self) -> bool {
        !self.route.traverses.further.is_empty()
    }
}

fn refuse_label(label: &str) -> Result<(), Error> {
    let (expected, got) = match label.len() {
        _ if label.contains('\0') => ("a label without NUL".to_owned(), format!("{label:?}")),
        length if length > LONGEST_LABEL => {
            (format!("at most {LONGEST_LABEL} bytes"), length.to_string())
        }
        _ => return Ok(()),
    };
    Err(Error::Option { name: "label", expected, got })
}
