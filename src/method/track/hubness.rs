//! The distances corrected for hubness and standardised (method 1.9, 1 and 2).

use super::sums::{BLOCK, LANES, total};
use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;

/// A column whose standard deviation is below this share of its size says nothing.
const FLAT: f64 = 1e-12;

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
}

/// From a place's distance and the sum of its distances to its `z`.
#[derive(Clone, Copy, Debug)]
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
        Ok(Self { sums, columns: 0 })
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
        known.then_some(Self { sums, columns })
    }

    /// Adds a column; `None` if it says nothing, and then nothing has changed.
    #[inline(always)]
    pub(in crate::method) fn learn(&mut self, column: &[f32], motion: &Motion) -> Option<Standard> {
        let first = *column.first()?;
        if column.iter().all(|&d| d == first) {
            return None;
        }
        let places = column.len() as f64;
        self.columns += 1;
        let (mut distance, mut sum) = (0.0, 0.0);
        for (column, sums) in column.chunks(BLOCK).zip(self.sums.chunks_mut(BLOCK)) {
            let of_block = add(column, sums);
            distance += of_block.0;
            sum += of_block.1;
        }
        // x = d - k / (k + hubness) (s / k - mean), and its mean is that of d.
        let share = 1.0 / (self.columns as f64 + motion.hubness);
        let (distance, sum) = (distance / places, share * sum / places);
        let centre = distance - sum;
        let (mut first, mut second) = (0.0, 0.0);
        for (column, sums) in column.chunks(BLOCK).zip(self.sums.chunks(BLOCK)) {
            let of_block = moments(column, sums, share, centre);
            first += of_block.0;
            second += of_block.1;
        }
        let mean = first / places;
        let std = (second / places - mean * mean).max(0.0).sqrt();
        let flat = std <= FLAT * (distance.abs() + sum.abs());
        let inverse = if flat { 0.0 } else { 1.0 / std };
        Some(Standard { share, mean: centre + mean, inverse })
    }
}

impl Standard {
    /// `z`, not yet clipped.
    #[inline(always)]
    pub(in crate::method) fn z(self, distance: f32, sum: f64) -> f64 {
        (f64::from(distance) - self.share * sum - self.mean) * self.inverse
    }
}

/// Adds the distances to the sums; the totals of both.
#[inline(always)]
fn add(column: &[f32], sums: &mut [f64]) -> (f64, f64) {
    let (mut of_distances, mut of_sums) = ([0.0; LANES], [0.0; LANES]);
    let (distances, rest) = column.as_chunks::<LANES>();
    let (sums, rest_of_sums) = sums.as_chunks_mut::<LANES>();
    let sums = &mut sums[..distances.len()];
    for at in 0..distances.len() {
        let (distances, sums) = (&distances[at], &mut sums[at]);
        for lane in 0..LANES {
            let distance = f64::from(distances[lane]);
            sums[lane] += distance;
            of_distances[lane] += distance;
            of_sums[lane] += sums[lane];
        }
    }
    for (lane, (&distance, sum)) in rest.iter().zip(rest_of_sums).enumerate() {
        *sum += f64::from(distance);
        of_distances[lane] += f64::from(distance);
        of_sums[lane] += *sum;
    }
    (total(&of_distances), total(&of_sums))
}

/// The sums of `d - share s - centre` and of its square.
#[inline(always)]
fn moments(column: &[f32], sums: &[f64], share: f64, centre: f64) -> (f64, f64) {
    let (mut first, mut second) = ([0.0; LANES], [0.0; LANES]);
    let (distances, rest) = column.as_chunks::<LANES>();
    let (sums, rest_of_sums) = sums.as_chunks::<LANES>();
    let sums = &sums[..distances.len()];
    for at in 0..distances.len() {
        let (distances, sums) = (&distances[at], &sums[at]);
        for lane in 0..LANES {
            let x = f64::from(distances[lane]) - share * sums[lane] - centre;
            first[lane] += x;
            second[lane] += x * x;
        }
    }
    for (lane, (&distance, &sum)) in rest.iter().zip(rest_of_sums).enumerate() {
        let x = f64::from(distance) - share * sum - centre;
        first[lane] += x;
        second[lane] += x * x;
    }
    (total(&first), total(&second))
}
