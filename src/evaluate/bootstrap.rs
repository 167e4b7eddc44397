//! How sure a figure is: the block bootstrap.
//!
//! Neighbouring frames see the same scenery, so they are not independent, and queries are drawn in
//! blocks of consecutive ones (Künsch 1989; circular blocks, Politis and Romano 1992).

use super::correlation::block_length;
use super::curve::{Curve, area};
use crate::error::Error;
use crate::parallel::each;
use crate::random::SplitMix64;

/// More samples than any interval needs; their figures are kept until the last one is there.
const MOST_SAMPLES: usize = 100_000_000;

/// How to draw. Flat, with defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bootstrap {
    /// Times that the queries are drawn anew. 1000 by default.
    pub samples: usize,
    /// Consecutive queries a block; by default for how long errors last ([`block_length`]).
    pub block: Option<usize>,
    /// The share of the samples inside the interval. 0.95 by default.
    pub level: f64,
    /// Another seed draws other blocks.
    pub seed: u64,
}

impl Default for Bootstrap {
    fn default() -> Self {
        Self { samples: 1000, block: None, level: 0.95, seed: 0 }
    }
}

/// A percentile interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
}

impl Bootstrap {
    fn check(&self) -> Result<(), Error> {
        let bad = |name, expected: &str, got: String| {
            Err(Error::Option { name, expected: expected.to_owned(), got })
        };
        if !(1..=MOST_SAMPLES).contains(&self.samples) {
            return bad("samples", &format!("from 1 to {MOST_SAMPLES}"), self.samples.to_string());
        }
        if self.block == Some(0) {
            return bad("block", "at least 1 query", "0".to_owned());
        }
        if !(self.level > 0.0 && self.level < 1.0) {
            return bad("level", "a share between 0 and 1", self.level.to_string());
        }
        Ok(())
    }

    /// The percentile interval of `figure`, which is told how often each of `queries` queries was
    /// drawn. `errors` says which matches are wrong, in order.
    fn interval(
        &self,
        queries: usize,
        errors: &[f64],
        figure: impl Fn(&[usize]) -> f64 + Sync,
    ) -> Result<Interval, Error> {
        self.check()?;
        if queries == 0 {
            return Ok(Interval { low: 0.0, high: 0.0 });
        }
        let block = self.block.or_else(|| block_length(errors)).unwrap_or(1).clamp(1, queries);
        let mut figures = each(
            0..self.samples,
            || vec![0; queries],
            |times, sample| {
                times.fill(0);
                let seed = self.seed ^ (sample as u64).wrapping_mul(0xA076_1D64_78BD_642F);
                let mut random = SplitMix64(seed);
                for drawn in (0..queries).step_by(block) {
                    let start = random.below(queries);
                    for offset in 0..block.min(queries - drawn) {
                        times[(start + offset) % queries] += 1;
                    }
                }
                Ok(figure(times))
            },
        )?;
        figures.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let place = share * (figures.len() - 1) as f64;
            let (below, above) = (figures[place.floor() as usize], figures[place.ceil() as usize]);
            below + place.fract() * (above - below)
        };
        let outside = (1.0 - self.level) / 2.0;
        Ok(Interval { low: at(outside), high: at(1.0 - outside) })
    }
}

impl Curve {
    /// An interval for [`auc`](Self::auc) on other drives like this one.
    ///
    /// # Errors
    /// [`Error::Option`] for an option of the bootstrap outside its range.
    pub fn auc_interval(&self, upto: f64, bootstrap: &Bootstrap) -> Result<Interval, Error> {
        let figure = |times: &[usize]| area(&self.redrawn(times), upto);
        bootstrap.interval(self.queries, &self.errors(), figure)
    }

    /// An interval for the difference of two areas on the same queries, this one's less the
    /// other's: each sample draws the same queries for both. If it holds 0, the drive does not tell
    /// which is better.
    ///
    /// # Errors
    /// [`Error::Length`] if the other has another number of queries, [`Error::Option`] for an
    /// option of the bootstrap outside its range.
    pub fn auc_difference_interval(
        &self,
        other: &Self,
        upto: f64,
        bootstrap: &Bootstrap,
    ) -> Result<Interval, Error> {
        if self.queries != other.queries {
            return Err(Error::Length {
                what: "the other curve's queries",
                expected: self.queries,
                got: other.queries,
            });
        }
        let difference =
            |times: &[usize]| area(&self.redrawn(times), upto) - area(&other.redrawn(times), upto);
        // Whichever errs for longer.
        let errors = [self.errors(), other.errors()];
        let longest =
            errors.iter().max_by_key(|errors| block_length(errors)).map_or(&[][..], |e| e);
        bootstrap.interval(self.queries, longest, difference)
    }
}
