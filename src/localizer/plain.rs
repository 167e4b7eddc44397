//! Localizing by the distances to all places.

use crate::distance::Query;
use crate::error::Error;
use crate::map::Map;
use crate::matcher::{Fix, Matcher};
use crate::scan::{Job, Pool};

#[derive(Clone, Debug)]
pub(super) struct Plain {
    matcher: Matcher,
    /// The newest frame's distances.
    distances: Vec<f32>,
    /// Where those of the next frame are written, so that a frame that is refused leaves the newest
    /// ones alone.
    next: Vec<f32>,
}

impl Plain {
    pub(super) fn new(matcher: Matcher) -> Self {
        let mut distances = vec![0.0; matcher.places()];
        if let Some(newest) = matcher.newest() {
            distances.copy_from_slice(newest);
        }
        Self { matcher, next: distances.clone(), distances }
    }

    /// # Errors
    /// [`Error::NotFinite`] for distances that are not. Nothing has changed then.
    pub(super) fn push(
        &mut self,
        map: &Map,
        pool: &mut Option<Pool>,
        query: Query<'_>,
        trusted: Option<bool>,
    ) -> Result<Fix, Error> {
        Job::Distances(query).column(map, pool, &mut self.next);
        let fix = self.matcher.step(&self.next, trusted)?;
        std::mem::swap(&mut self.distances, &mut self.next);
        Ok(fix)
    }

    pub(super) fn distances(&self) -> &[f32] {
        &self.distances
    }

    pub(super) fn looked_at(&self) -> usize {
        if self.matcher.frames() == 0 { 0 } else { self.matcher.places() }
    }

    pub(super) fn gap(&mut self) {
        self.matcher.gap();
        self.distances.fill(0.0);
    }

    pub(super) fn reset(&mut self) {
        self.matcher.reset();
        self.distances.fill(0.0);
    }

    pub(super) fn matcher(&self) -> &Matcher {
        &self.matcher
    }
}
