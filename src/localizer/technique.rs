//! A map with all that turns a query into its column: a camera image or a descriptor, and the
//! threads that scan.

use std::sync::Arc;

use super::automatic;
use crate::descriptor::Describer;
use crate::distance::Query;
use crate::error::Error;
use crate::image::ImageView;
use crate::map::{Map, Recipe};
use crate::numbers::{Values, View};
use crate::post::{ChainState, Running};
use crate::scan::{Job, Pool};

/// What a query is given as.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// A camera image, to be described as the map's own images were.
    Image(ImageView<'a>),
    /// A descriptor: float32, or of the map's own type; on a map with post-processing as it is
    /// before that.
    Descriptor(View<'a>),
}

/// Makes a map's queries of inputs.
#[derive(Clone, Debug)]
pub(crate) struct Queries {
    /// Describes images the map's own way, if the map has one.
    describer: Option<(Describer, Values)>,
    /// The state of the map's post-processing: scratch memory, and running statistics of the drive.
    through: Option<ChainState>,
}

impl Queries {
    pub(crate) fn new(map: &Map) -> Self {
        let describer = match map.recipe() {
            Recipe::Sad(sad) => Some((Describer::new(sad), Values::zeros(sad.dtype(), sad.dim()))),
            Recipe::Ready => None,
        };
        Self { describer, through: map.post().map(ChainState::of_drive) }
    }

    /// The numbers that the map is compared with, and whether they show nothing.
    ///
    /// # Errors
    /// [`Error::NoDescriptor`] for an image if the map was made of ready descriptors, and those of
    /// post-processing.
    pub(crate) fn numbers<'a>(
        &'a mut self,
        map: &Map,
        input: Input<'a>,
    ) -> Result<(View<'a>, bool), Error> {
        let Self { describer, through } = self;
        match input {
            Input::Image(image) => {
                let Some((describer, values)) = describer else {
                    return Err(Error::NoDescriptor);
                };
                describer.describe(image, values)?;
                Ok((values.view(), map.shows_nothing(values.view())))
            }
            Input::Descriptor(given) => {
                Ok((map.passed(given, through.as_mut())?, map.shows_nothing(given)))
            }
        }
    }

    /// Keeps the newest query, which is a descriptor, in the statistics of the drive.
    pub(crate) fn commit(&mut self) {
        if let Some(through) = &mut self.through {
            through.commit();
        }
    }

    /// Forgets the statistics of the drive.
    pub(crate) fn reset(&mut self, map: &Map) {
        if let (Some(through), Some(post)) = (&mut self.through, map.post()) {
            through.reset(post);
        }
    }

    /// The statistics of the drive.
    pub(crate) fn running(&self) -> impl Iterator<Item = &Running> {
        self.through.iter().flat_map(ChainState::running)
    }

    /// Goes on with the first of the statistics that are left; false if they do not fit.
    pub(crate) fn resume(&mut self, left: &mut impl Iterator<Item = Running>) -> bool {
        let Some(through) = &mut self.through else { return true };
        let own = left.take(through.running().len()).collect();
        through.resume(own)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Technique {
    pub(super) map: Arc<Map>,
    pub(super) queries: Queries,
    /// The newest frame's distances, or lower bounds of them.
    pub(super) column: Vec<f32>,
    /// The distances to all rows; empty if there is one for each place.
    rows: Vec<f32>,
    /// The threads that scan the map; `None` if the caller scans alone.
    pub(super) pool: Option<Pool>,
}

/// What a scan needs beside the query.
pub(super) struct Scan<'a> {
    pub(super) map: &'a Map,
    pub(super) pool: &'a mut Option<Pool>,
    pub(super) column: &'a mut [f32],
    rows: &'a mut [f32],
    /// Whether the query shows nothing.
    pub(super) nothing: bool,
}

impl Technique {
    pub(super) fn new(map: Arc<Map>) -> Self {
        let column = vec![0.0; map.places()];
        let rows = if map.has_several() { vec![0.0; map.rows()] } else { Vec::new() };
        let pool = automatic(&map);
        // Now, so that the first push need not find them.
        map.blank();
        Self { queries: Queries::new(&map), map, column, rows, pool }
    }

    /// The query that the map is compared with.
    ///
    /// # Errors
    /// Those of [`Queries::numbers`] and of [`Map::distances_into`].
    pub(super) fn query<'a>(
        &'a mut self,
        input: Input<'a>,
    ) -> Result<(Query<'a>, Scan<'a>), Error> {
        let Self { map, queries, column, rows, pool } = self;
        let (numbers, nothing) = queries.numbers(map, input)?;
        Ok((map.query(numbers)?, Scan { map, pool, column, rows, nothing }))
    }
}

impl Scan<'_> {
    /// Computes the query's column, without what says nothing.
    pub(super) fn run(&mut self, query: Query<'_>) {
        let Self { map, pool, column, rows, nothing } = self;
        if rows.is_empty() {
            Job::Distances(query).column(map, pool, column);
            map.quieten(*nothing, column);
        } else {
            Job::Distances(query).column(map, pool, rows);
            map.fold(*nothing, rows, column);
        }
    }
}
