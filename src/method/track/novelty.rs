//! How new a query is: a robot that stands still sees the same again, learns nothing from it, and
//! nothing happens to it (method 1.9, 2 and 3).

use super::evidence::Says;
use super::hubness::{BlockMoments, FLAT, Hubness, Spread, Standard};
use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;
use crate::sums::{BLOCK, CHUNK, LANES, total};

/// With odometry, a robot that stands still learns this share of the evidence.
const LEAST_BY_WAY: f64 = 0.05;
/// By the view alone, it learns this share.
const LEAST_BY_VIEW: f64 = 0.1;

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

/// The view before.
#[derive(Clone, Debug)]
pub(super) struct View {
    /// The corrected distances, or what several techniques said. Empty if views are not compared.
    pub(super) x: Vec<f64>,
    pub(super) blocks: Vec<BlockMoments>,
    /// Whether there is one that is not constant.
    pub(super) known: bool,
    /// Memory for the next one's blocks.
    next: Vec<BlockMoments>,
}

impl View {
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(super) fn new(places: usize, motion: &Motion) -> Result<Self, Error> {
        let count = if motion.repeat < 1.0 { places } else { 0 };
        let mut x = reserved(count)?;
        x.resize(count, 0.0);
        Ok(Self::of(x, false))
    }

    pub(super) fn of(x: Vec<f64>, known: bool) -> Self {
        let blocks: Vec<_> = x.chunks(BLOCK).map(BlockMoments::of_corrected).collect();
        let known = known && Spread::of(&blocks).squares > 0.0;
        Self { next: blocks.clone(), x, blocks, known }
    }

    /// Makes room for `places` in all.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(super) fn reserve(&mut self, places: usize, motion: &Motion) -> Result<(), Error> {
        let Self { x, blocks, next, .. } = self;
        if motion.repeat < 1.0 {
            let refused = |_| Error::Memory { places, columns: 1 };
            x.try_reserve_exact(places.saturating_sub(x.len())).map_err(refused)?;
            for blocks in [blocks, next] {
                blocks.reserve(places.div_ceil(BLOCK).saturating_sub(blocks.len()));
            }
        }
        Ok(())
    }

    /// One place more, in which nothing was seen before; no memory is taken if it is reserved.
    pub(super) fn grow(&mut self, motion: &Motion) {
        if motion.repeat < 1.0 {
            self.x.push(0.0);
            let last = (self.x.len() - 1) / BLOCK;
            self.blocks.truncate(last);
            self.blocks.push(BlockMoments::of_corrected(&self.x[last * BLOCK..]));
        }
    }

    /// The correlation of a query's view with the one before, which it replaces. `None` if there
    /// are none to compare.
    #[inline(always)]
    pub(super) fn correlation(
        &mut self,
        says: Says<'_>,
        column: &[f32],
        hubness: &Hubness,
    ) -> Option<f64> {
        let Self { x: before, blocks, known, next } = self;
        if before.is_empty() {
            return None;
        }
        next.clear();
        match says {
            Says::Nothing => return None,
            Says::Column(_) => next.extend_from_slice(&hubness.blocks),
            Says::Fused(z) => next.extend(z.chunks(BLOCK).map(BlockMoments::of_corrected)),
        }
        let (new, old) = (Spread::of(next), Spread::of(blocks));
        let mut sum = 0.0;
        let mut x = [0.0; CHUNK];
        for (block, before) in before.chunks_mut(BLOCK).enumerate() {
            let mut together = Together::new(&next[block], &blocks[block]);
            for (chunk, before) in before.chunks_mut(CHUNK).enumerate() {
                let x = &mut x[..before.len()];
                says.view(column, &hubness.sums, block * BLOCK + chunk * CHUNK, x);
                together.add(x, before);
                before.copy_from_slice(x);
            }
            sum += about_all(together.total(), [(&next[block], new), (&blocks[block], old)]);
        }
        let flat = match says {
            Says::Column(standard) => standard.inverse == 0.0,
            _ => new.squares <= FLAT * FLAT * before.len() as f64,
        };
        std::mem::swap(blocks, next);
        correlation(sum, [new, old], flat, known)
    }

    /// Takes a shard's part of a view, of these moments, in place of the one before.
    #[inline(always)]
    pub(super) fn take(
        &mut self,
        column: &[f32],
        hubs: &[f64],
        standard: Standard,
        blocks: &[BlockMoments],
    ) {
        if !self.x.is_empty() {
            Says::Column(standard).view(column, hubs, 0, &mut self.x);
            self.blocks.copy_from_slice(blocks);
            self.known = standard.inverse != 0.0;
        }
    }
}

/// Sums the product of two views of a block, each about its mean there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Together {
    means: [f64; 2],
    lanes: [f64; LANES],
}

impl Together {
    #[inline(always)]
    pub(super) fn new(a: &BlockMoments, b: &BlockMoments) -> Self {
        Self { means: [a.mean(), b.mean()], lanes: [0.0; LANES] }
    }

    /// Adds the next places; all but the last time, a multiple of [`LANES`].
    #[inline(always)]
    pub(super) fn add(&mut self, a: &[f64], b: &[f64]) {
        let Self { means, lanes } = self;
        let ((groups_a, rest_a), (groups_b, rest_b)) =
            (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
        let mut one = |lane: usize, a: f64, b: f64| lanes[lane] += (a - means[0]) * (b - means[1]);
        for (a, b) in groups_a.iter().zip(groups_b) {
            for lane in 0..LANES {
                one(lane, a[lane], b[lane]);
            }
        }
        for (lane, (&a, &b)) in rest_a.iter().zip(rest_b).enumerate() {
            one(lane, a, b);
        }
    }

    #[inline(always)]
    pub(super) fn total(&self) -> f64 {
        total(&self.lanes)
    }
}

/// The correlation of a view with the one before, by the sum of their product about their means,
/// unless one of them is flat; whether a view is `known` from now on.
pub(super) fn correlation(
    sum: f64,
    [new, old]: [Spread; 2],
    flat: bool,
    known: &mut bool,
) -> Option<f64> {
    let known = std::mem::replace(known, !flat) && !flat;
    known.then(|| sum / (new.squares.sqrt() * old.squares.sqrt()))
}

/// A block's [`Together`], about the means of all places.
#[inline(always)]
pub(super) fn about_all(together: f64, views: [(&BlockMoments, Spread); 2]) -> f64 {
    let [a, b] = views.map(|(block, all)| block.mean() - all.mean);
    together + views[0].0.places as f64 * (a * b)
}
