//! A query becomes a column of distances: on the caller's thread, by a pool of threads, or as
//! bounds from a screen's codes.

mod chunks;
mod mailbox;
mod pool;
mod screen;

use std::ops::Range;

use crate::distance::{self, Query};
use crate::dtype::Dtype;
use crate::error::Error;
use crate::map::{Map, Recipe};
use crate::numbers::View;
use crate::post::ChainState;
pub(crate) use pool::{Pool, threads_for};
pub(crate) use screen::{EncodedQuery, MAX_SCREENED};

/// The result that a scan computes for each row.
#[derive(Clone, Copy)]
pub(crate) enum Job<'a> {
    /// The distance to a query.
    Distances(Query<'a>),
    /// The product of a query's codes with those of the map's screen.
    CodeProducts(&'a [i16]),
}

impl Job<'_> {
    /// Writes the results for some rows of a map into `out`.
    pub(crate) fn scan(self, map: &Map, rows: Range<usize>, out: &mut [f32]) {
        match (self, map.codes()) {
            (Job::Distances(query), _) => map.scan(query, rows, out),
            (Job::CodeProducts(query), Some(codes)) => codes.scan(map.isa(), query, rows, out),
            // Only a map with a screen encodes queries.
            (Job::CodeProducts(_), None) => out.fill(f32::NAN),
        }
    }

    /// Writes the results for all rows into `out`: by the pool, if there is one.
    pub(crate) fn column(self, map: &Map, pool: &mut Option<Pool>, out: &mut [f32]) {
        match pool {
            Some(pool) => pool.scan(self, out),
            None => self.scan(map, 0..map.rows(), out),
        }
    }
}

impl Map {
    /// The distances from a descriptor to every place: one number for each place, in route order.
    /// On a map with post-processing, the descriptor goes through that first, as the references
    /// did; running statistics live in a [`Localizer`](crate::Localizer). SAD distances are in
    /// units of `z`, whichever type they are stored in (method 1.7). A place that
    /// [shows nothing](Self::blank) has the mean of the others' distances; a descriptor that shows
    /// nothing has one distance to all.
    ///
    /// # Errors
    /// As for [`distances_into`](Self::distances_into).
    pub fn distances<'a>(&self, descriptor: impl Into<View<'a>>) -> Result<Vec<f32>, Error> {
        let mut out = vec![0.0; self.places()];
        self.distances_into(descriptor.into(), &mut out)?;
        Ok(out)
    }

    /// Like [`distances`](Self::distances), into memory that the caller keeps.
    ///
    /// # Errors
    /// [`Error::Length`] unless the descriptor has [`input_dim`](Self::input_dim) numbers and `out`
    /// has `places()`; [`Error::Dtype`] unless it is of the map's own type, or float32 on a map of
    /// ready descriptors; [`Error::NotFinite`] for a NaN or an infinity; [`Error::NoDirection`] for
    /// zeros under the cosine if there are at most 8, or if post-processing normalises them. `out` is then unchanged.
    pub fn distances_into(&self, descriptor: View<'_>, out: &mut [f32]) -> Result<(), Error> {
        let mut through = self.post().map(ChainState::new);
        let nothing = self.shows_nothing(descriptor);
        self.distances_of_passed(self.passed(descriptor, through.as_mut())?, nothing, out)
    }

    /// [`distances_into`](Self::distances_into), of a descriptor after post-processing, which shows
    /// `nothing` or something.
    pub(crate) fn distances_of_passed(
        &self,
        descriptor: View<'_>,
        nothing: bool,
        out: &mut [f32],
    ) -> Result<(), Error> {
        let (query, expected, got) = (self.query(descriptor)?, self.places(), out.len());
        if got != expected {
            return Err(Error::Length { what: "distances", expected, got });
        }
        if self.has_several() {
            let mut rows = vec![0.0; self.rows()];
            self.scan(query, 0..rows.len(), &mut rows);
            self.fold(nothing, &rows, out);
        } else {
            self.scan(query, 0..expected, out);
            self.quieten(nothing, out);
        }
        Ok(())
    }

    /// The descriptor after post-processing, which uses the memory in `through`; unchanged if the
    /// map has no post-processing.
    pub(crate) fn passed<'a>(
        &self,
        descriptor: View<'a>,
        through: Option<&'a mut ChainState>,
    ) -> Result<View<'a>, Error> {
        let (Some(post), Some(through)) = (self.post(), through) else { return Ok(descriptor) };
        match descriptor {
            View::F32(vector) => Ok(View::F32(post.pass(vector, through)?)),
            other => {
                let (what, map, got) = ("descriptor", Dtype::F32, other.dtype());
                Err(Error::Dtype { what, map, or_float: false, got })
            }
        }
    }

    /// A descriptor that can be compared with the map's: after post-processing, if the map has
    /// some.
    ///
    /// # Errors
    /// Those of [`distances_into`](Self::distances_into) that are about the descriptor.
    pub(crate) fn query<'a>(&self, descriptor: View<'a>) -> Result<Query<'a>, Error> {
        let (what, expected) = ("descriptor", self.dim());
        if descriptor.len() != expected {
            return Err(Error::Length { what, expected, got: descriptor.len() });
        }
        // The numbers of SAD in float32 (z) are not those in uint8 (128 + 32 z), so one is no query
        // for the other.
        if let (Recipe::Sad(_), map, got) = (self.recipe(), self.dtype(), descriptor.dtype())
            && map != got
        {
            return Err(Error::Dtype { what, map, or_float: false, got });
        }
        match Query::new(descriptor, self.no_rows()) {
            // Zeros have no direction, and are as far from all places.
            Err(Error::NoDirection { .. }) if self.shows_nothing(descriptor) => {
                Ok(Query { numbers: descriptor, length: 1.0 })
            }
            query => query,
        }
    }

    /// Writes the distances to some of the rows, which must be there, into `out`, which has a
    /// number for each.
    pub(crate) fn scan(&self, query: Query<'_>, rows: Range<usize>, out: &mut [f32]) {
        self.each_block(rows, |rows, at| distance::distances(query, rows, &mut out[at]));
    }
}
