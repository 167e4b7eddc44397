//! The loosest threshold that keeps a promise (method 1.12): Learn then Test, in a fixed sequence.

use super::probability::Probability;
use super::quantiles::Quantiles;
use super::threshold::{Means, Threshold, sorted};
use super::{binomial, blocks};
use crate::error::Error;
use crate::evaluate::{Match, Truth, Verdict, block_length};
use crate::interrupt::{check, stopped};

/// From one threshold to the next, how many times as many queries are accepted.
const STEP: f64 = 1.1;
/// The least number of errors that tells for how long errors last.
const ENOUGH: f64 = 5.0;
/// How many errors the first threshold may have, as shares of those promised.
const FEW: [f64; 3] = [1.0 / 3.0, 1.0 / 6.0, 0.0];

/// What to promise, and how to test it. Flat, with defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Calibrate {
    /// At most this share of the accepted is wrong. 0.05 by default.
    pub wrong: f64,
    /// With at least this probability, over drives like this one. 0.95 by default.
    pub sure: f64,
    /// Consecutive queries a block; by default for how long errors last ([`block_length`]), or the
    /// root of their number if there are none.
    pub block: Option<usize>,
    /// Queries are independent of each other, such as one of each of many drives: the exact
    /// binomial test, and no blocks.
    pub independent: bool,
    /// Whether scores are `1 - confidence` of the track.
    pub tracked: bool,
    /// How many metres the drive was, if they are known: to say how many more would do.
    pub metres: Option<f64>,
}

impl Default for Calibrate {
    fn default() -> Self {
        Self {
            wrong: 0.05,
            sure: 0.95,
            block: None,
            independent: false,
            tracked: false,
            metres: None,
        }
    }
}

impl Calibrate {
    fn check(&self) -> Result<(), Error> {
        for (name, value) in [("wrong", self.wrong), ("sure", self.sure)] {
            if !(value > 0.0 && value < 1.0) {
                let expected = "a share between 0 and 1".to_owned();
                return Err(Error::Option { name, expected, got: value.to_string() });
            }
        }
        if let Some(metres) = self.metres
            && !(metres >= 0.0 && metres.is_finite())
        {
            let expected = "metres, 0 or more".to_owned();
            return Err(Error::Option { name: "metres", expected, got: metres.to_string() });
        }
        if self.block == Some(0) || (self.block.is_some() && self.independent) {
            let expected = "at least 1 query, and none if they are independent".to_owned();
            let got = self.block.unwrap_or_default().to_string();
            return Err(Error::Option { name: "block", expected, got });
        }
        Ok(())
    }

    /// The queries a block for each threshold, strict to lax: the geometric mean of how long errors
    /// last, of all fixes and of those that it accepts. If the accepted ones are too few to tell,
    /// those of a laxer one; without any errors, the root of the number of queries.
    ///
    /// A tracker that is lost errs for long, but fixes that it is sure of do not: with all errors
    /// alone, next to nothing could be promised. With the accepted alone, if scores tell nothing and
    /// errors last 30 queries, a promise of 5 % broke in 16 % of simulated drives; so in 5 %.
    fn blocks(&self, lines: &[f32], scores: &[f32], wrong: &[f64]) -> Vec<usize> {
        if let Some(block) = self.block {
            return vec![block; lines.len()];
        }
        let unknown = (wrong.len() as f64).sqrt().ceil() as usize;
        let all = block_length(wrong).unwrap_or(unknown);
        let mut own = all;
        let mut blocks: Vec<usize> = Vec::with_capacity(lines.len());
        for &line in lines.iter().rev().take_while(|_| !stopped()) {
            let each = scores.iter().zip(wrong);
            let accepted: Vec<f64> =
                each.map(|(&score, &wrong)| if score <= line { wrong } else { 0.0 }).collect();
            if accepted.iter().sum::<f64>() >= ENOUGH {
                own = block_length(&accepted).unwrap_or(own).min(all);
            }
            blocks.push(((all * own) as f64).sqrt().ceil() as usize);
        }
        blocks.reverse();
        blocks
    }

    /// Whether a threshold passes that accepts the queries which have an error here.
    fn passes(&self, errors: impl Iterator<Item = Option<f64>> + Clone, block: usize) -> bool {
        if !self.independent {
            return blocks::capital(errors, block, self.wrong) >= 1.0 / (1.0 - self.sure);
        }
        let (accepted, wrong) = (errors.clone().flatten().count(), errors.flatten().sum());
        self.passes_binomial(accepted as f64, wrong)
    }

    fn passes_binomial(&self, accepted: f64, wrong: f64) -> bool {
        let (accepted, wrong) = (accepted.ceil() as usize, wrong.ceil() as usize);
        binomial::at_most(wrong, accepted, self.wrong) <= 1.0 - self.sure
    }

    /// How many queries would pass, if they are like these; `None` if no number would.
    fn needed(
        &self,
        errors: impl Iterator<Item = Option<f64>> + Clone,
        queries: usize,
        block: usize,
    ) -> Option<usize> {
        if !self.independent {
            let enough = 1.0 / (1.0 - self.sure);
            return blocks::queries_for(enough, errors, queries, block, self.wrong);
        }
        let (accepted, wrong) =
            (errors.clone().flatten().count() as f64, errors.flatten().sum::<f64>());
        let times = std::iter::successors(Some(1.0), |times| Some(times * STEP)).take(100);
        let mut enough =
            times.filter(|times| self.passes_binomial(times * accepted, times * wrong));
        enough.next().map(|times| (times * queries as f64).ceil() as usize)
    }
}

/// How wrong each match is: 1 if the truth says so, else 0; `None` for a query that it ignores.
///
/// # Errors
/// [`Error::Length`] if the truth has another number of queries.
pub fn wrong_by_truth(matches: &[Match], truth: &Truth) -> Result<Vec<Option<f64>>, Error> {
    if truth.len() != matches.len() {
        return Err(Error::Length { what: "truth", expected: matches.len(), got: truth.len() });
    }
    let judge = |(query, found): (usize, &Match)| match truth.judge(query, found.place) {
        Verdict::Correct => Some(0.0),
        Verdict::Wrong => Some(1.0),
        Verdict::Ignored => None,
    };
    Ok(matches.iter().enumerate().map(judge).collect())
}

/// The loosest threshold of which the drive shows that at most [`Calibrate::wrong`] of the accepted
/// are wrong, with probability [`Calibrate::sure`].
///
/// `wrong` says how wrong each match is, from 0 to 1: by a truth ([`wrong_by_truth`]) or an
/// alignment ([`Alignment::wrong`](crate::Alignment::wrong)). Queries without, and matches that are
/// not ready, are left out.
///
/// Thresholds are tested from strict to lax, each accepting 1.1 times as many queries as the one
/// before, until one fails (Angelopoulos et al. 2021, *Learn then Test*, fixed sequence). A test
/// bets on blocks of consecutive queries (Waudby-Smith and Ramdas 2024), as frames are not
/// independent. The first threshold is one that passes if a third as many are wrong as promised.
///
/// ```
/// use surefix::calibration::{Calibrate, calibrate};
/// use surefix::evaluate::Match;
///
/// // 1000 matches; those of a score above 0.8 are wrong.
/// let score = |query: usize| (query * 617 % 1000) as f32 / 1000.0;
/// let found = |query| Match { place: 0, score: score(query), ready: true, accepted: true };
/// let matches: Vec<Match> = (0..1000).map(found).collect();
/// let wrong: Vec<_> = (0..1000).map(|query| Some(f64::from(score(query) > 0.8))).collect();
/// let threshold = calibrate(&matches, &wrong, &Calibrate::default())?;
/// assert!(threshold.score.is_some_and(|score| score > 0.75 && score < 0.85));
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// [`Error::Option`] for an option outside its range, [`Error::Length`] unless there is one of
/// `wrong` a match, [`Error::NotFinite`] for a score that is a NaN, [`Error::Shape`] if no query
/// has a fix and a truth, or if one is wrong by less than 0 or more than 1.
pub fn calibrate(
    matches: &[Match],
    wrong: &[Option<f64>],
    options: &Calibrate,
) -> Result<Threshold, Error> {
    options.check()?;
    if wrong.len() != matches.len() {
        return Err(Error::Length { what: "wrong", expected: matches.len(), got: wrong.len() });
    }
    let known = matches.iter().zip(wrong).filter(|(found, _)| found.ready && found.accepted);
    let (scores, wrong): (Vec<f32>, Vec<f64>) =
        known.filter_map(|(found, &wrong)| wrong.map(|wrong| (found.score, wrong))).unzip();
    let strict = sorted(&scores)?;
    if let Some(query) = wrong.iter().position(|wrong| !(0.0..=1.0).contains(wrong)) {
        let (expected, got) = ("from 0 to 1".to_owned(), wrong[query].to_string());
        return Err(Error::Shape { what: "wrong", expected, got });
    }
    let queries = scores.len();
    let accepted_at = |score: f32| {
        let each = scores.iter().zip(&wrong);
        each.map(move |(&given, &wrong)| (given <= score).then_some(wrong))
    };
    let lines: Vec<f32> = grid(options, queries).map(|count| strict[count - 1]).collect();
    let blocks = options.blocks(&lines, &scores, &wrong);
    check()?;
    let tried = || lines.iter().copied().zip(blocks.iter().copied());
    // Without labels but for the blocks: the first is the strictest that passes if a third of the
    // promised are wrong, or, on a short drive, a sixth or none. Of a stricter one, few errors by
    // chance end it all.
    let first = FEW.into_iter().find_map(|few| {
        let wrong = few * options.wrong;
        let at = |score| accepted_at(score).map(move |error| error.map(|_| wrong));
        tried().position(|(score, block)| stopped() || options.passes(at(score), block))
    });
    check()?;
    let tested = tried().skip(first.unwrap_or(lines.len()));
    let passing =
        tested.clone().take_while(|&(score, block)| options.passes(accepted_at(score), block));
    let passed = passing.take_while(|_| !stopped()).last();
    check()?;
    let score = passed.map(|(score, _)| score);
    let block = passed.or_else(|| tested.clone().next()).or_else(|| tried().next_back());
    let more = || {
        let needed =
            tried().filter_map(|(score, block)| options.needed(accepted_at(score), queries, block));
        needed.min().map(|needed| needed.saturating_sub(queries).max(1))
    };
    let more = if score.is_some() { None } else { more() };
    let accepted =
        scores.iter().zip(&wrong).filter(|(given, _)| score.is_some_and(|t| **given <= t));
    Ok(Threshold {
        score,
        tracked: options.tracked,
        wrong: options.wrong,
        sure: options.sure,
        queries,
        accepted: accepted.clone().count(),
        errors: accepted.fold(0.0, |sum, (_, wrong)| sum + wrong),
        block: block.map(|(_, block)| block).filter(|_| !options.independent),
        more,
        metres: options.metres,
        carried: false,
        probability: Probability::fit(
            scores.iter().zip(&wrong).map(|(&score, wrong)| (score, 1.0 - wrong)),
            options.tracked,
        ),
        scores: Quantiles::new(&strict),
        means: Means::new(&scores),
    })
}

/// How many queries each threshold accepts: `n0 1.1^k`, up to all.
fn grid(options: &Calibrate, queries: usize) -> impl Iterator<Item = usize> + Clone {
    let first = ((1.0 - options.sure).ln() / (-options.wrong).ln_1p()).ceil().max(1.0);
    let counts = std::iter::successors(Some(first), |count| Some(count * STEP));
    let below = counts.map(|count| count as usize).take_while(move |&count| count < queries);
    below.chain(std::iter::once(queries))
}
