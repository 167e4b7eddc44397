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

#[derive(Clone, Debug)]
pub(super) struct Technique {
    pub(super) map: Arc<Map>,
    /// The newest frame's distances, or lower bounds of them.
    pub(super) column: Vec<f32>,
    /// The distances to all rows; empty if there is one for each place.
    rows: Vec<f32>,
    /// The threads that scan the map; `None` if the caller scans alone.
    pub(super) pool: Option<Pool>,
    /// Describes images the map's own way, if the map has one.
    describer: Option<(Describer, Values)>,
    /// The state of the map's post-processing: scratch memory, and running statistics of the drive.
    through: Option<ChainState>,
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
        let describer = match map.recipe() {
            Recipe::Sad(sad) => Some((Describer::new(sad), Values::zeros(sad.dtype(), sad.dim()))),
            Recipe::Ready => None,
        };
        let column = vec![0.0; map.places()];
        let rows = if map.has_several() { vec![0.0; map.rows()] } else { Vec::new() };
        let pool = automatic(&map);
        let through = map.post().map(ChainState::of_drive);
        // Now, so that the first push need not find them.
        map.blank();
        Self { map, column, rows, pool, describer, through }
    }

    /// The query that the map is compared with.
    ///
    /// # Errors
    /// [`Error::NoDescriptor`] for an image if the map was made of ready descriptors, and those of
    /// [`Map::distances_into`].
    pub(super) fn query<'a>(
        &'a mut self,
        input: Input<'a>,
    ) -> Result<(Query<'a>, Scan<'a>), Error> {
        let Self { map, column, rows, pool, describer, through } = self;
        let mut nothing = matches!(input, Input::Descriptor(given) if map.shows_nothing(given));
        let numbers = match input {
            Input::Image(image) => {
                let Some((describer, values)) = describer else {
                    return Err(Error::NoDescriptor);
                };
                describer.describe(image, values)?;
                nothing = map.shows_nothing(values.view());
                values.view()
            }
            Input::Descriptor(descriptor) => map.passed(descriptor, through.as_mut())?,
        };
        Ok((map.query(numbers)?, Scan { map, pool, column, rows, nothing }))
    }

    /// Keeps the newest query in the statistics of the drive.
    pub(super) fn commit(&mut self, input: Input<'_>) {
        if let (Some(through), Input::Descriptor(_)) = (&mut self.through, input) {
            through.commit();
        }
    }

    /// Forgets the statistics of the drive.
    pub(super) fn reset(&mut self) {
        if let (Some(through), Some(post)) = (&mut self.through, self.map.post()) {
            through.reset(post);
        }
    }

    /// The statistics of the drive.
    pub(super) fn running(&self) -> impl Iterator<Item = &Running> {
        self.through.iter().flat_map(ChainState::running)
    }

    /// Goes on with the first of the statistics that are left; false if they do not fit.
    pub(super) fn resume(&mut self, left: &mut impl Iterator<Item = Running>) -> bool {
        let Some(through) = &mut self.through else { return true };
        let own = left.take(through.running().len()).collect();
        through.resume(own)
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
