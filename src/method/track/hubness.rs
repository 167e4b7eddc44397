//! The distances corrected for hubness and standardised (method 1.9, 1 and 2).

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;
use crate::sums::{BLOCK, LANES, sum, sum_of, total};

/// A column whose standard deviation is below this share of its size says nothing.
pub(super) const FLAT: f64 = 1e-12;

/// More columns than any camera has sent.
const MAX_COLUMNS: u64 = 1 << 60;

/// The running mean of each place's distances. Some places are near everything (hubs): their
/// small distances say little.
#[derive(Clone, Debug)]
pub(crate) struct Hubness {
    /// `s`: the sum of each place's distances.
    pub(in crate::method) sums: Vec<f64>,
    /// `k`: how many columns were summed.
    pub(in crate::method) columns: u64,
    /// What the newest column came to.
    pub(super) blocks: Vec<BlockMoments>,
}

/// What a column comes to in a block of places.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::method) struct BlockMoments {
    pub(in crate::method) places: usize,
    /// The sum of the distances.
    pub(in crate::method) distance: f64,
    /// The sum of the corrected distances `x`.
    pub(in crate::method) x: f64,
    /// The sum of the squares of `x` about its mean in the block.
    pub(in crate::method) squares: f64,
}

/// From a place's distance and the sum of its distances to its `z`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(in crate::method) struct Standard {
    /// `1 / (k + hubness)`.
    pub(in crate::method) share: f64,
    /// The mean of what is standardised.
    pub(in crate::method) mean: f64,
    /// `1 / std`.
    pub(in crate::method) inverse: f64,
}

impl Hubness {
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(in crate::method) fn new(places: usize) -> Result<Self, Error> {
        let mut sums = reserved(places)?;
        sums.resize(places, 0.0);
        Ok(Self::of(0, sums))
    }

    fn of(columns: u64, sums: Vec<f64>) -> Self {
        let blocks = vec![BlockMoments::default(); sums.len().div_ceil(BLOCK)];
        Self { sums, columns, blocks }
    }

    pub(in crate::method) fn clear(&mut self) {
        self.sums.fill(0.0);
        self.columns = 0;
    }

    /// That of known statistics, as many sums as places; `None` if no columns can have given them.
    pub(in crate::method) fn resumed(columns: u64, sums: Vec<f64>) -> Option<Self> {
        // A little more, for the rounding of the sums.
        let most = 1.001 * columns as f64 * f64::from(f32::MAX);
        let known = columns <= MAX_COLUMNS && sums.iter().all(|sum| sum.abs() <= most);
        known.then(|| Self::of(columns, sums))
    }

    /// `1 / (k + hubness)` of the next column.
    pub(in crate::method) fn next_share(&self, motion: &Motion) -> f64 {
        1.0 / ((self.columns + 1) as f64 + motion.hubness)
    }

    /// Adds a column; `None` if it says nothing, and then nothing has changed.
    #[inline(always)]
    pub(in crate::method) fn learn(&mut self, column: &[f32], motion: &Motion) -> Option<Standard> {
        let first = *column.first()?;
        if column.iter().all(|&d| d == first) {
            return None;
        }
        let share = self.next_share(motion);
        self.columns += 1;
        let Self { sums, blocks, .. } = self;
        let parts = column.chunks(BLOCK).zip(sums.chunks_mut(BLOCK));
        for (block, (column, sums)) in blocks.iter_mut().zip(parts) {
            *block = BlockMoments::of(column, sums, share);
            add(column, sums);
        }
        Some(Standard::of(blocks, share))
    }
}

impl Standard {
    /// Of the whole route's blocks, in order.
    #[inline(always)]
    pub(in crate::method) fn of(blocks: &[BlockMoments], share: f64) -> Self {
        let places = blocks.iter().map(|block| block.places).sum::<usize>() as f64;
        let distance = blocks.iter().map(|block| block.distance).sum::<f64>() / places;
        let Spread { mean, squares } = Spread::of(blocks);
        let std = (squares / places).sqrt();
        // The second is the mean of what was taken off.
        let flat = std <= FLAT * (distance.abs() + (distance - mean).abs());
        let inverse = if flat { 0.0 } else { 1.0 / std };
        Self { share, mean, inverse }
    }

    /// `z`, not yet clipped.
    #[inline(always)]
    pub(in crate::method) fn z(self, distance: f32, sum: f64) -> f64 {
        (corrected(distance, sum, self.share) - self.mean) * self.inverse
    }
}

/// The mean of `x` in all places, and the sum of its squares about it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spread {
    pub(super) mean: f64,
    pub(super) squares: f64,
}

impl Spread {
    /// Of the whole route's blocks, in order.
    #[inline(always)]
    pub(super) fn of(blocks: &[BlockMoments]) -> Self {
        let places = blocks.iter().map(|block| block.places).sum::<usize>() as f64;
        let mean = blocks.iter().map(|block| block.x).sum::<f64>() / places;
        let about = |block: &BlockMoments| {
            let off = block.mean() - mean;
            block.squares + block.places as f64 * (off * off)
        };
        Self { mean, squares: blocks.iter().map(about).sum() }
    }
}

impl BlockMoments {
    /// Of a block's part of a column, and of the sums before it. They are left as they are.
    #[inline(always)]
    pub(in crate::method) fn of(column: &[f32], sums: &[f64], share: f64) -> Self {
        let (mut distance, mut x) = ([0.0; LANES], [0.0; LANES]);
        each(column, sums, |lane, d, sum| {
            distance[lane] += f64::from(d);
            x[lane] += corrected(d, sum + f64::from(d), share);
        });
        let places = column.len();
        let (distance, x) = (total(&distance), total(&x));
        let (mean, mut squares) = (x / places as f64, [0.0; LANES]);
        each(column, sums, |lane, d, sum| {
            let off = corrected(d, sum + f64::from(d), share) - mean;
            squares[lane] += off * off;
        });
        Self { places, distance, x, squares: total(&squares) }
    }

    /// Of a block of `x`: the same but for the distances.
    #[inline(always)]
    pub(super) fn of_corrected(numbers: &[f64]) -> Self {
        let places = numbers.len();
        let x = sum(numbers);
        let mean = x / places as f64;
        let squares = sum_of(numbers, |x| (x - mean) * (x - mean));
        Self { places, distance: 0.0, x, squares }
    }

    /// The mean of `x` in the block.
    #[inline(always)]
    pub(super) fn mean(&self) -> f64 {
        self.x / self.places as f64
    }
}

/// `x`, given the sum with this distance in it.
#[inline(always)]
pub(super) fn corrected(distance: f32, sum: f64, share: f64) -> f64 {
    f64::from(distance) - share * sum
}

/// Adds the distances to the sums.
#[inline(always)]
pub(in crate::method) fn add(column: &[f32], sums: &mut [f64]) {
    for (sum, &distance) in sums.iter_mut().zip(column) {
        *sum += f64::from(distance);
    }
}

/// Calls `visit` with a lane and what is in it, place by place.
#[inline(always)]
fn each(column: &[f32], sums: &[f64], mut visit: impl FnMut(usize, f32, f64)) {
    let (distances, rest) = column.as_chunks::<LANES>();
    let (sums, rest_of_sums) = sums.as_chunks::<LANES>();
    let sums = &sums[..distances.len()];
    for at in 0..distances.len() {
        let (distances, sums) = (&distances[at], &sums[at]);
        for lane in 0..LANES {
            visit(lane, distances[lane], sums[lane]);
        }
    }
    for (lane, (&distance, &sum)) in rest.iter().zip(rest_of_sums).enumerate() {
        visit(lane, distance, sum);
    }
}
