//! How new a query is: a robot that stands still sees the same again, learns nothing from it, and
//! nothing happens to it (method 1.9, 2 and 3).

use super::evidence::Says;
use super::hubness::Hubness;
use super::sums::{BLOCK, CHUNK, LANES, total};
use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;

/// With odometry, a robot that stands still learns this share of the evidence.
const LEAST_BY_WAY: f64 = 0.05;
/// By the view alone, it learns this share.
const LEAST_BY_VIEW: f64 = 0.1;

/// Views whose deviations have a product below this are constant, but for rounding.
const FLAT: f64 = 1e-12;

/// The shares of a whole step that a query is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Novelty {
    /// How much its evidence counts.
    pub(super) evidence: f64,
    /// The probability that the robot has moved at all.
    pub(super) moved: f64,
    /// How much may have happened: restart, leave and rejoin.
    pub(super) happens: f64,
    /// How far the odometry may be off, as a share of its jitter over a place.
    pub(super) jitter: f64,
}

impl Novelty {
    const WHOLE: Self = Self { evidence: 1.0, moved: 1.0, happens: 1.0, jitter: 1.0 };

    /// By the advance if it is known, else by the correlation with the view before; `fresh` if
    /// there was no query before.
    pub(super) fn new(
        advance: Option<f64>,
        correlation: Option<f64>,
        fresh: bool,
        motion: &Motion,
    ) -> Self {
        match (advance, correlation) {
            _ if fresh => Self::WHOLE,
            (Some(advance), _) => {
                let way = advance.abs().clamp(LEAST_BY_WAY, 1.0);
                let whole = Self { evidence: way, ..Self::WHOLE };
                if !motion.by_distance {
                    return whole;
                }
                Self { happens: way, jitter: advance.abs().max(LEAST_BY_WAY), ..whole }
            }
            (None, Some(correlation)) => {
                let new = ((1.0 - correlation) / (1.0 - motion.repeat)).clamp(0.0, 1.0);
                // Views change fast at first: half a new view is a whole step.
                let moved = (2.0 * new).min(1.0);
                let least = LEAST_BY_VIEW;
                let happens = moved.max(least);
                Self { evidence: new.max(least), moved, happens, ..Self::WHOLE }
            }
            (None, None) => Self::WHOLE,
        }
    }
}

/// The view before: its `z` in each place.
#[derive(Clone, Debug)]
pub(super) struct View {
    /// Empty if views are not compared.
    pub(super) z: Vec<f64>,
    /// Whether there is one.
    pub(super) known: bool,
}

/// Sums of `a b`, `a`, `b`, `a^2` and `b^2` over places.
type Moments = [f64; 5];

impl View {
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(super) fn new(places: usize, motion: &Motion) -> Result<Self, Error> {
        let count = if motion.repeat < 1.0 { places } else { 0 };
        let mut z = reserved(count)?;
        z.resize(count, 0.0);
        Ok(Self { z, known: false })
    }

    /// One place more, in which nothing was seen before; no memory is taken if it is reserved.
    pub(super) fn grow(&mut self, motion: &Motion) {
        if motion.repeat < 1.0 {
            self.z.push(0.0);
        }
    }

    /// The correlation of a query's `z` with those before, which it replaces. `None` if there are
    /// none to compare.
    #[inline(always)]
    pub(super) fn correlation(
        &mut self,
        says: Says<'_>,
        column: &[f32],
        hubness: &Hubness,
    ) -> Option<f64> {
        if self.z.is_empty() || matches!(says, Says::Nothing) {
            return None;
        }
        let mut sums: Moments = [0.0; 5];
        let mut next = [0.0; CHUNK];
        for (block, before) in self.z.chunks_mut(BLOCK).enumerate() {
            let mut of_block: Moments = [0.0; 5];
            for (chunk, before) in before.chunks_mut(CHUNK).enumerate() {
                let next = &mut next[..before.len()];
                says.z(column, &hubness.sums, block * BLOCK + chunk * CHUNK, next);
                add(&mut of_block, &moments(next, before));
                before.copy_from_slice(next);
            }
            add(&mut sums, &of_block);
        }
        let known = std::mem::replace(&mut self.known, true);
        let places = self.z.len() as f64;
        let [ab, a, b, aa, bb] = sums;
        let (a, b) = (a / places, b / places);
        let spread = ((aa / places - a * a) * (bb / places - b * b)).max(0.0).sqrt();
        (known && spread > FLAT).then(|| (ab / places - a * b) / spread)
    }
}

#[inline(always)]
fn add(sums: &mut Moments, more: &Moments) {
    for (sum, more) in sums.iter_mut().zip(more) {
        *sum += more;
    }
}

#[inline(always)]
fn moments(a: &[f64], b: &[f64]) -> Moments {
    let mut lanes = [[0.0; LANES]; 5];
    let ((groups_a, rest_a), (groups_b, rest_b)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut one = |lane: usize, a: f64, b: f64| {
        lanes[0][lane] += a * b;
        lanes[1][lane] += a;
        lanes[2][lane] += b;
        lanes[3][lane] += a * a;
        lanes[4][lane] += b * b;
    };
    let groups_b = &groups_b[..groups_a.len()];
    for at in 0..groups_a.len() {
        for lane in 0..LANES {
            one(lane, groups_a[at][lane], groups_b[at][lane]);
        }
    }
    for (lane, (&a, &b)) in rest_a.iter().zip(rest_b).enumerate() {
        one(lane, a, b);
    }
    let [ab, a, b, aa, bb] = &lanes;
    [total(ab), total(a), total(b), total(aa), total(bb)]
}
