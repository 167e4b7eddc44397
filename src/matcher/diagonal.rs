//! The sums along all diagonals of one slope (method 1.5, Eq. 6).

use super::direct::{BLOCK, direct_sums, none_below};
use super::order::Runs;
use super::ring::Ring;
use super::sliding::Sliding;
use super::visit::Visit;
use crate::config::reach;
use crate::error::Error;

/// The longest window whose sums are made afresh for each query: as fast as keeping sums, in less
/// memory.
const DIRECT: usize = 8;

/// A slope, and how many places back it lies `k` queries ago: `round(v k)`.
#[derive(Clone, Debug)]
pub(super) struct Diagonal {
    pub(super) speed: f64,
    pub(super) back: Vec<usize>,
    /// Where one place a query is driven, and the window is long.
    sliding: Option<Sliding>,
}

impl Diagonal {
    pub(super) fn new(speed: f64, length: usize, places: usize) -> Result<Self, Error> {
        let mut back = Vec::new();
        back.try_reserve_exact(length).map_err(|_| Error::Memory { places: 1, columns: length })?;
        back.extend((0..length).map(|age| reach(speed, age) as usize));
        let slides = speed == 1.0 && length > DIRECT;
        let sliding = if slides { Some(Sliding::new(length, places)?) } else { None };
        Ok(Self { speed, back, sliding })
    }

    /// The same with sums that slide, however short the window, or with none that do.
    #[cfg(test)]
    pub(super) fn forced(mut self, slides: bool, places: usize) -> Self {
        self.sliding = slides.then(|| Sliding::new(self.back.len(), places).unwrap());
        self
    }

    /// The first place whose diagonal lies on the route.
    pub(super) fn first(&self) -> usize {
        self.back.last().copied().unwrap_or(0)
    }

    /// Takes in the newest of `columns`, that of query `frame`, and gives the sums of the diagonals
    /// that end at `start`, `start + 1`, ... to `visit(start, sums)`, in the order of places and
    /// without a gap from [`first`](Self::first) to the last place; nothing before the first full
    /// window.
    #[inline(always)]
    pub(super) fn sums(&mut self, columns: &Ring, frame: u64, mut visit: impl Visit<f64>) {
        if let Some(sliding) = &mut self.sliding {
            return sliding.advance(columns, frame, visit);
        }
        let length = self.back.len();
        if columns.len() < length {
            return;
        }
        let (places, runs) = (columns.height(), Runs::at(frame, length));
        let mut sums = [0.0_f64; BLOCK];
        for start in (self.first()..places).step_by(BLOCK) {
            let sums = &mut sums[..BLOCK.min(places - start)];
            let to_beat = visit.to_beat(start..start + sums.len());
            if to_beat.is_some_and(|least| {
                none_below(columns, &self.back, start..start + sums.len(), least)
            }) {
                continue;
            }
            direct_sums(columns, runs, |age| self.back[age], start, sums);
            visit.visit(start, sums);
        }
    }

    /// Takes in the newest of `columns` and gives nothing.
    pub(super) fn catch_up(&mut self, columns: &Ring, frame: u64) {
        if let Some(sliding) = &mut self.sliding {
            sliding.advance(columns, frame, |_: usize, _: &mut [f64]| {});
        }
    }
}
