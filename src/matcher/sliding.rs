//! The sums of long windows along the diagonals of slope 1, at a cost that does not grow with their
//! length.
//!
//! Nothing is subtracted, so that nothing drifts and a huge distance leaves no trace once it has
//! left the window. A sum is put together of three that are kept (method 1.5): the running sum of
//! the query's own block, the finished one of the block before, and the end of the block before
//! that, of which every length is prepared while the next block arrives. A query costs four
//! additions a place, whichever it is: there is no query that pays for the others.

use std::ops::Range;

use super::order::{block, row};
use super::ring::Ring;
use super::visit::Visit;
use crate::error::Error;

/// How many sums are made at a time: they stay in the first-level cache.
const BLOCK: usize = 256;

/// The kept sums, each in the order of [`diagonal_sum`](super::order::diagonal_sum).
#[derive(Clone, Debug)]
pub(super) struct Sliding {
    length: usize,
    places: usize,
    /// By the place where a diagonal enters the query's own block: the sum in that block so far.
    running: Vec<f64>,
    /// The same of the block before, which is finished.
    finished: Vec<f64>,
    /// Ends of blocks, by the place where a diagonal leaves the block. An end of the newest
    /// finished block takes the memory of one of the block before it that is used for the last
    /// time: [`Sliding::slot`].
    ends: Vec<f64>,
}

impl Sliding {
    /// For windows of `length` queries, two or more.
    pub(super) fn new(length: usize, places: usize) -> Result<Self, Error> {
        let refused = || Error::Memory { places, columns: length };
        let zeros = |columns: usize| {
            let count = columns.checked_mul(places).ok_or_else(refused)?;
            let mut numbers = Vec::new();
            numbers.try_reserve_exact(count).map_err(|_| refused())?;
            numbers.resize(count, 0.0);
            Ok(numbers)
        };
        let ends = zeros(longest_end(length))?;
        Ok(Self { length, places, running: zeros(1)?, finished: zeros(1)?, ends })
    }

    /// Takes in the newest of `columns`, that of query `frame`, and gives the sums of the diagonals
    /// that end at `start`, `start + 1`, ... to `visit(start, sums)`, from the first place that has
    /// a full window on; nothing before the first full window.
    #[inline(always)]
    pub(super) fn advance(&mut self, columns: &Ring, frame: u64, mut visit: impl Visit<f64>) {
        let (length, places, block) = (self.length, self.places, block(self.length));
        let row = row(frame, length);
        if row == 0 {
            std::mem::swap(&mut self.running, &mut self.finished);
        }
        let begins = row == 0 || columns.len() == 1;
        let ready = columns.len() >= length;
        let newest = &columns.column(0)[row..];
        let (slot, shorter) =
            (self.slot(frame), if row == 0 { None } else { self.slot(frame - 1) });
        // The next longer end of the last block: one column more, as long as that column was seen.
        let next = columns.len() > 2 * row + 1;
        let mut prepared = row;
        let mut sums = [0.0_f64; BLOCK];

        // Places where diagonals enter this block, of those that have not left the route yet. The
        // first have no full window.
        let (entered, first) = (places - row, if ready { length - 1 - row } else { places });
        for from in (0..entered).step_by(BLOCK) {
            let to = entered.min(from + BLOCK);
            let whole = first.clamp(from, to);
            add(&mut self.running[from..whole], &newest[from..whole], begins);
            if whole < to {
                let sums = &mut sums[..to - whole];
                let (running, newest) = (&mut self.running[whole..to], &newest[whole..to]);
                let finished = &self.finished[whole - block..to - block];
                let end =
                    slot.map(|slot| &self.ends[slot * places..][whole - block - 1..to - block - 1]);
                let to_beat = visit.to_beat(whole + row..to + row);
                if add_up(running, newest, begins, finished, end, to_beat) {
                    put_together(running, finished, end, sums);
                    visit.visit(whole + row, sums);
                }
            }
            if let Some(slot) = slot
                && next
            {
                // What has just been used makes room. After the last place, those follow that the
                // next queries will need.
                let to = if to == entered { places } else { to }.saturating_sub(block + 1);
                if prepared < to {
                    let terms = &columns.column(2 * row + 1)[prepared - row..to - row];
                    self.prepare(slot, shorter, terms, prepared..to);
                    prepared = to;
                }
            }
        }
    }

    /// The next longer ends of the last block, into `slot`, for diagonals that leave it at
    /// `places`: those of the query before this one, in the slot `shorter`, and a term more.
    #[inline(always)]
    fn prepare(
        &mut self,
        slot: usize,
        shorter: Option<usize>,
        terms: &[f32],
        places: Range<usize>,
    ) {
        let height = self.places;
        let Some(shorter) = shorter else {
            let longer = &mut self.ends[slot * height..][places];
            longer.iter_mut().zip(terms).for_each(|(end, &term)| *end = f64::from(term));
            return;
        };
        let (low, high) = self.ends.split_at_mut(slot.max(shorter) * height);
        let (longer, shorter) = if shorter < slot {
            (&mut high[places.clone()], &low[shorter * height..][places])
        } else {
            (&mut low[slot * height..][places.clone()], &high[places])
        };
        let parts = shorter.iter().zip(terms);
        longer
            .iter_mut()
            .zip(parts)
            .for_each(|(end, (shorter, &term))| *end = shorter + f64::from(term));
    }

    /// Which memory a query uses for the last time, the end of the block before the last, and fills
    /// anew, with an end of the last block. The ends are used from the longest to the shortest and
    /// prepared from the shortest to the longest, so that the order of the slots turns with each
    /// block. The last query of a block needs none where `L` is even.
    fn slot(&self, frame: u64) -> Option<usize> {
        let (slots, row) = (longest_end(self.length), row(frame, self.length));
        if row >= slots {
            return None;
        }
        let turned = (frame / block(self.length) as u64) % 2 == 1;
        Some(if turned { slots - 1 - row } else { row })
    }
}

/// Goes on with the running sums, or begins with new ones.
#[inline(always)]
fn add(running: &mut [f64], newest: &[f32], begins: bool) {
    let both = running.iter_mut().zip(newest);
    if begins {
        both.for_each(|(sum, &term)| *sum = f64::from(term));
    } else {
        both.for_each(|(sum, &term)| *sum += f64::from(term));
    }
}

/// The same, and says whether a sum of the window may be below `least`; where nothing is to be
/// beaten, it may. All slices are equally long.
#[inline(always)]
fn add_up(
    running: &mut [f64],
    newest: &[f32],
    begins: bool,
    finished: &[f64],
    end: Option<&[f64]>,
    least: Option<f64>,
) -> bool {
    let Some(least) = least else {
        add(running, newest, begins);
        return true;
    };
    let count = running.len();
    let (newest, finished) = (&newest[..count], &finished[..count]);
    let mut any = false;
    match (begins, end.map(|end| &end[..count])) {
        (false, Some(end)) => {
            for at in 0..count {
                running[at] += f64::from(newest[at]);
                any |= running[at] + finished[at] + end[at] < least;
            }
        }
        (false, None) => {
            for at in 0..count {
                running[at] += f64::from(newest[at]);
                any |= running[at] + finished[at] < least;
            }
        }
        (true, _) => {
            add(running, newest, begins);
            any = true;
        }
    }
    any
}

/// The sums of the window.
#[inline(always)]
fn put_together(running: &[f64], finished: &[f64], end: Option<&[f64]>, sums: &mut [f64]) {
    let parts = sums.iter_mut().zip(running.iter().zip(finished));
    match end {
        Some(end) => {
            parts.zip(end).for_each(|((sum, (own, before)), end)| *sum = own + before + end)
        }
        None => parts.for_each(|(sum, (own, before))| *sum = own + before),
    }
}

/// How much of a block is left in the window at most once two newer ones have begun.
fn longest_end(length: usize) -> usize {
    length - block(length) - 1
}
