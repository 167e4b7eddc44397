//! A threshold on the score of a fix, and what is known of it.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::alarm::Alarm;
use super::probability::Probability;
use super::quantiles::Quantiles;
use crate::error::Error;
use crate::evaluate::block_length;
use crate::method::Fix;
use crate::numbers::first_not_finite;

/// A threshold from a calibration drive, by [`calibrate`](super::calibrate): the fixes that it
/// accepts, with what promise, and how probable it is that a fix is right.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Threshold {
    /// A fix of this score or a better one is accepted; `None` if nothing can be promised, so that
    /// none is.
    pub score: Option<f32>,
    /// Whether scores are `1 - confidence` of the track, not distances.
    pub tracked: bool,
    /// The promise: at most this share of the accepted is wrong ...
    pub wrong: f64,
    /// ... with this probability.
    pub sure: f64,
    /// The queries of the calibration drive that have a fix and a truth.
    pub queries: usize,
    /// How many of them are accepted.
    pub accepted: usize,
    /// How many of the accepted are wrong; by an alignment, the sum of how wrong each is.
    pub errors: f64,
    /// Consecutive queries a block, for how long errors last; `None` if they were taken as
    /// independent.
    pub block: Option<usize>,
    /// If nothing can be promised: how many queries more would do, if they are like these. `None`
    /// if no number would.
    pub more: Option<usize>,
    /// How many metres the calibration drive was, if they are known.
    pub metres: Option<f64>,
    /// Whether it was carried over to other conditions, for which nothing is promised.
    pub carried: bool,
    pub(super) probability: Probability,
    /// The scores of the calibration drive.
    pub(super) scores: Quantiles,
    /// Their means in blocks, in the order of the drive.
    pub(super) means: Means,
}

/// The means of scores in blocks of consecutive queries.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Means {
    pub(super) block: usize,
    pub(super) scores: Vec<f64>,
}

impl Means {
    /// The latest of a long drive.
    const MOST: usize = 1000;

    /// Of scores in order, in blocks that are as long as they are alike. A last block that is not
    /// complete is left out.
    pub(super) fn new(scores: &[f32]) -> Self {
        let scores: Vec<f64> = scores.iter().copied().map(f64::from).collect();
        let block = block_length(&scores).unwrap_or(1);
        let blocks = scores.chunks_exact(block);
        let latest = blocks.skip((scores.len() / block).saturating_sub(Self::MOST));
        let scores = latest.map(|scores| scores.iter().sum::<f64>() / block as f64).collect();
        Self { block, scores }
    }
}

impl Threshold {
    /// Whether a fix is accepted: it is ready, of the kind that was calibrated, and its score is at
    /// least as good.
    pub fn accepts(&self, fix: &Fix) -> bool {
        self.judges(fix) && self.score.is_some_and(|score| fix.score <= score)
    }

    /// The probability that a fix is right, by the calibration drive; `None` for one that is not
    /// ready or of another kind.
    pub fn probability_of(&self, fix: &Fix) -> Option<f64> {
        self.judges(fix).then(|| self.probability.at(fix.score))
    }

    /// If nothing can be promised: how many metres more would do, if the length of the drive is
    /// known.
    pub fn more_metres(&self) -> Option<f64> {
        let each = self.metres? / self.queries as f64;
        self.more.map(|more| each * more as f64)
    }

    fn judges(&self, fix: &Fix) -> bool {
        fix.is_ready() && fix.track.is_some() == self.tracked
    }

    /// From a score to the probability that it is right.
    pub fn probability(&self) -> &Probability {
        &self.probability
    }

    /// Refuses what no calibration makes, as of a damaged file.
    ///
    /// # Errors
    /// [`Error::Settings`], which names the number.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let share = |x: f64| x > 0.0 && x < 1.0;
        let counts = self.queries >= 1 && self.accepted <= self.queries;
        let errors = (0.0..=self.accepted as f64).contains(&self.errors);
        let metres = self.metres.is_none_or(|metres| metres >= 0.0 && metres.is_finite());
        let score = self.score.is_none_or(|score| {
            score.is_finite() && (!self.tracked || (0.0..=1.0).contains(&score))
        });
        let Means { block, scores } = &self.means;
        let means = *block >= 1 && scores.iter().all(|mean| mean.is_finite());
        let checks = [
            (score, "threshold.score: expected a number, from 0 to 1 if tracked"),
            (share(self.wrong), "threshold.wrong: expected a share between 0 and 1"),
            (share(self.sure), "threshold.sure: expected a share between 0 and 1"),
            (counts, "threshold.queries: expected at least 1, and as many as are accepted"),
            (errors, "threshold.errors: expected from 0 to those that are accepted"),
            (self.block != Some(0), "threshold.block: expected at least 1 query"),
            (metres, "threshold.metres: expected a number, 0 or more"),
            (means, "threshold.means: expected numbers, and a block of at least 1"),
        ];
        let wrong =
            checks.into_iter().find(|(holds, _)| !holds).map_or(Ok(()), |(_, why)| Err(why));
        wrong
            .and_then(|()| self.probability.check())
            .and_then(|()| self.scores.check())
            .map_err(|reason| Error::Settings { reason: reason.to_owned() })
    }

    /// An alarm for scores that are worse than those of the calibration drive; false with
    /// probability `level` at most.
    ///
    /// # Errors
    /// [`Error::Option`] for a level that is not between 0 and 1, and for a block of 0 in a file.
    pub fn alarm(&self, level: f64) -> Result<Alarm, Error> {
        let Means { block, scores } = &self.means;
        Alarm::checked(*block, level)?;
        Ok(Alarm::of_means(scores.iter().copied(), *block, level))
    }

    /// The scores of the calibration drive, in short.
    pub fn scores(&self) -> &Quantiles {
        &self.scores
    }

    /// The threshold for other conditions, by the scores of a drive in them and without its truth:
    /// it accepts the same share (method 1.12). That is a guess, for which nothing is promised.
    ///
    /// # Errors
    /// [`Error::Shape`] without a score; [`Error::NotFinite`] for a NaN or an infinity.
    pub fn carried_to(&self, scores: &[f32]) -> Result<Self, Error> {
        let sorted = sorted(scores)?;
        let rank = self.accepted as f64 / self.queries as f64 * sorted.len() as f64;
        // Rounding must not cost a query of the share.
        let accepted = (rank - 1e-9).ceil() as usize;
        let mut carried = self.clone();
        carried.score = self.score.and_then(|_| sorted.get(accepted.wrapping_sub(1)).copied());
        let known = self.scores.scores().last().copied().unwrap_or(f32::INFINITY);
        let of_score = |score: f32| self.scores.carried(score, &sorted);
        let ends = [sorted[0], sorted[sorted.len() - 1]];
        carried.probability = self.probability.carried(known, of_score, ends, self.tracked);
        carried.scores = Quantiles::new(&sorted);
        carried.means = Means::new(scores);
        carried.carried = true;
        Ok(carried)
    }
}

/// The scores in ascending order.
///
/// # Errors
/// [`Error::Shape`] if there is none; [`Error::NotFinite`] for a NaN or an infinity.
pub(super) fn sorted(scores: &[f32]) -> Result<Vec<f32>, Error> {
    if let Some((index, value)) = first_not_finite(scores) {
        return Err(Error::NotFinite { what: "scores", row: None, index, value });
    }
    if scores.is_empty() {
        let expected = "at least one that has a fix and a truth".to_owned();
        return Err(Error::Shape { what: "queries", expected, got: "none".to_owned() });
    }
    let mut sorted = scores.to_vec();
    sorted.sort_by(f32::total_cmp);
    Ok(sorted)
}

impl fmt::Display for Threshold {
    /// The promise, or why there is none.
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (wrong, sure) = (percent(self.wrong), percent(self.sure));
        let Some(score) = self.score else {
            let queries = self.queries;
            write!(to, "nothing can be promised: ")?;
            let Some(more) = self.more else {
                write!(to, "the {queries} queries have no threshold at which surely at most ")?;
                return write!(
                    to,
                    "{wrong} % are wrong, and more like these would not change that"
                );
            };
            write!(to, "{queries} queries are too few to tell whether at most {wrong} % of the ")?;
            write!(to, "accepted are wrong")?;
            if let Some(block) = self.block.filter(|&block| block > 1) {
                write!(to, ", as errors last: {block} queries count as one")?;
            }
            write!(to, "; {more} more like these")?;
            match self.more_metres() {
                Some(metres) if metres >= 1000.0 => write!(to, ", {:.1} km,", metres / 1000.0)?,
                Some(metres) => write!(to, ", {metres:.0} m,")?,
                None => {}
            }
            return write!(to, " would do");
        };
        if self.tracked {
            write!(to, "accept a confidence of at least {:.4}: ", 1.0 - f64::from(score))?;
        } else {
            write!(to, "accept a score of at most {score}: ")?;
        }
        if self.carried {
            return write!(to, "the share of the calibration drive; nothing is promised here");
        }
        let Self { accepted, queries, errors, .. } = self;
        write!(to, "at most {wrong} % of the accepted are wrong, with {sure} % probability; ")?;
        write!(to, "here {errors:.1} of {accepted}, of {queries} queries")?;
        match self.block {
            Some(block) if block > 1 => write!(to, " in blocks of {block}"),
            _ => Ok(()),
        }
    }
}

/// A share in percent, without digits that say nothing.
fn percent(share: f64) -> f64 {
    (share * 1e6).round() / 1e4
}
