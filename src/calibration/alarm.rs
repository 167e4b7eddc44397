//! An alarm for scores that are no longer those of the calibration drive.
//!
//! The obvious test compares each new score with the calibration's distribution. It raises false
//! alarms: that distribution is known from few independent numbers, and over a long drive the error
//! adds up. Here a new score is ranked among the calibration's *and* the drive's earlier ones. If
//! nothing has changed, all orders are equally likely, so every rank is as likely as any other,
//! whatever the ranks before it: a game of dice, in which no strategy of betting wins.

use crate::error::Error;
use crate::random::SplitMix64;
use serde::{Deserialize, Serialize};

/// Bet `k` pays the derivative of `p^k` at rank `p`, 0 the worst: the smaller, the bolder.
const BETS: [f64; 3] = [0.1, 0.3, 0.6];
/// The number of blocks after which half of the money is staked.
const HALF_STAKED: f64 = 50.0;

/// A block's mean, and a random number that decides between equal ones.
type Ranked = (f64, u64);

/// Notices that scores have become worse than those of a calibration drive, so that what was
/// measured there (a threshold, a probability) holds no longer. It needs no truth.
///
/// A score is better the smaller it is, as everywhere: a fix's [`score`](crate::Fix::score), for
/// one. Frames are averaged in blocks, as neighbours are not independent, and each block's mean is
/// bet upon once: a conformal test martingale (Vovk, Gammerman and Shafer, *Algorithmic Learning in
/// a Random World*, 2005), whose money mixes over when the change came.
///
/// On a drive that is like the calibration's, the alarm is raised with probability `level` at most:
/// on average over calibration drives, not for each of them. Were blocks independent, it would be
/// `level` squared however long the drive, by Ville's inequality. The other half of the logarithm
/// pays for what is left of dependence: means of neighbouring blocks of two correlation times are
/// correlated by a third. In simulations at level 0.01, up to 0.8 % of drives of 5,000 frames raised
/// a false alarm, and 1.5 % of 50,000 frames; with blocks of one correlation time 8 % of 5,000.
///
/// Scores that become better raise none, and neither does a robot that is sure and wrong: only what
/// the scores show is noticed. The fewer blocks the calibration has, the longer it takes: at level
/// 0.01, a drive whose scores are all worse than any of the calibration's raises the alarm after 7
/// blocks if the calibration has 30, after 23 if it has 8, and after 100 if it has 4.
///
/// Not part of a [`Localizer`](crate::Localizer)'s snapshot: a restored robot begins a new one.
///
/// ```
/// use surefix::calibration::Alarm;
///
/// let calibration: Vec<f32> = (0..300).map(|frame| (frame * 7 % 11) as f32 / 100.0).collect();
/// let mut alarm = Alarm::new(&calibration, 10, 0.01)?;
/// for &score in &calibration {
///     assert!(!alarm.push(score)?);
/// }
/// let mut frames = 1;
/// while !alarm.push(0.9)? {
///     frames += 1;
/// }
/// assert_eq!(frames, 70);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Alarm {
    /// The calibration's blocks, the worst first.
    calibration: Vec<Ranked>,
    /// How many of the drive's blocks lie before each of them, and after the last.
    between: Vec<u64>,
    block: usize,
    limit: f64,
    /// As it was after the calibration.
    seed: SplitMix64,
    random: SplitMix64,
    /// The block that is not complete.
    sum: f64,
    frames: usize,
    /// The complete ones.
    blocks: u64,
    stakes: [f64; BETS.len()],
    raised: bool,
}

impl Alarm {
    /// For drives like the one that had these scores, one a frame.
    ///
    /// `block` is how many frames are averaged: at least twice the correlation time of the scores,
    /// after which their autocorrelation is below `1 / e`; three times it for drives of more than
    /// 1,000 blocks. A last block that is not complete is left out.
    ///
    /// # Errors
    /// [`Error::Option`] if `block` is 0, or `level` not between 0 and 1; [`Error::NotFinite`] for
    /// a score; [`Error::Shape`] if there are fewer scores than a block.
    pub fn new(scores: &[f32], block: usize, level: f64) -> Result<Self, Error> {
        Self::checked(block, level)?;
        for (index, &score) in scores.iter().enumerate() {
            check("alarm: calibration scores", index, score)?;
        }
        if scores.len() < block {
            return Err(Error::Shape {
                what: "alarm: calibration scores",
                expected: format!("at least a block of {block}"),
                got: scores.len().to_string(),
            });
        }
        let sum = |scores: &[f32]| scores.iter().fold(0.0, |sum, &score| sum + f64::from(score));
        let means = scores.chunks_exact(block).map(|scores| sum(scores) / block as f64);
        Ok(Self::of_means(means, block, level))
    }

    /// # Errors
    /// [`Error::Option`].
    pub(super) fn checked(block: usize, level: f64) -> Result<(), Error> {
        if block == 0 {
            let expected = "a whole number of 1 or more".to_owned();
            return Err(Error::Option { name: "block", expected, got: block.to_string() });
        }
        if !(level > 0.0 && level < 1.0) {
            let expected = "a number between 0 and 1".to_owned();
            return Err(Error::Option { name: "level", expected, got: level.to_string() });
        }
        Ok(())
    }

    /// Of the means of blocks, with options within their ranges.
    pub(super) fn of_means(means: impl Iterator<Item = f64>, block: usize, level: f64) -> Self {
        let mut random = SplitMix64(0);
        let mut calibration: Vec<Ranked> = means.map(|mean| (mean, random.next())).collect();
        calibration.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
        Self {
            between: vec![0; calibration.len() + 1],
            calibration,
            block,
            limit: level.powi(-2),
            seed: random.clone(),
            random,
            sum: 0.0,
            frames: 0,
            blocks: 0,
            stakes: [0.0; BETS.len()],
            raised: false,
        }
    }

    /// The next frame's score; whether the alarm is raised. Once raised, it stays so until
    /// [`reset`](Self::reset). Allocates nothing.
    ///
    /// # Errors
    /// [`Error::NotFinite`], whose index is the frame's within its block; nothing has changed then.
    pub fn push(&mut self, score: f32) -> Result<bool, Error> {
        check("alarm: score", self.frames, score)?;
        if self.raised {
            return Ok(true);
        }
        self.sum += f64::from(score);
        self.frames += 1;
        if self.frames == self.block {
            let mean = self.sum / self.block as f64;
            (self.sum, self.frames) = (0.0, 0);
            let ranked = (mean, self.random.next());
            self.bet(self.calibration.partition_point(|other| *other > ranked));
            self.raised = self.evidence() >= self.limit;
        }
        Ok(self.raised)
    }

    /// Whether the alarm has been raised.
    pub fn raised(&self) -> bool {
        self.raised
    }

    /// What has become of an initial 1 by betting that scores are worse: the martingale. The alarm
    /// is raised at `1 / level^2`.
    pub fn evidence(&self) -> f64 {
        reserve(self.blocks) + self.stakes.iter().sum::<f64>()
    }

    /// Forgets the drive, for a new one.
    pub fn reset(&mut self) {
        self.between.fill(0);
        self.random = self.seed.clone();
        (self.sum, self.frames, self.blocks) = (0.0, 0, 0);
        self.stakes = [0.0; BETS.len()];
        self.raised = false;
    }

    /// Bets on a block that came to lie between two of the calibration's.
    ///
    /// The drive's blocks that lie there too are not told apart: the block's rank is any from
    /// `first` to `last` of `count`, each as likely, and the bet pays its mean over them. It is not
    /// less than by a rank drawn at random, and as fair: a place between two of the calibration's
    /// has probability `(last - first) / count`.
    fn bet(&mut self, place: usize) {
        let fresh = (reserve(self.blocks) - reserve(self.blocks + 1)) / BETS.len() as f64;
        let worse = place as u64 + self.between[..place].iter().sum::<u64>();
        let count = (self.calibration.len() as u64 + self.blocks + 1) as f64;
        let (first, last) = (worse as f64, (worse + self.between[place] + 1) as f64);
        for (stake, power) in self.stakes.iter_mut().zip(BETS) {
            *stake += fresh;
            *stake *= pay(power, first / count, last / count);
        }
        self.between[place] += 1;
        self.blocks += 1;
    }
}

/// The money that is not staked after this number of blocks. As it never ends, a change is noticed
/// however late it comes: the evidence that it takes grows with the logarithm of the drive.
fn reserve(blocks: u64) -> f64 {
    HALF_STAKED / (HALF_STAKED + blocks as f64)
}

/// The mean of a bet over ranks; over all, from 0 to 1, it is 1.
fn pay(power: f64, from: f64, to: f64) -> f64 {
    (to.powf(power) - from.powf(power)) / (to - from)
}

fn check(what: &'static str, index: usize, value: f32) -> Result<(), Error> {
    if value.is_finite() {
        return Ok(());
    }
    Err(Error::NotFinite { what, row: None, index, value })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::cases::cases;

    proptest! {
        #![proptest_config(cases(300))]

        /// Whatever has come, the next block leaves the evidence as it is on average, if it is as
        /// likely to lie between any two of those that came.
        #[test]
        fn no_bet_wins_on_average(
            calibration in vec(0..20_u8, 1..40),
            drive in vec(0..25_u8, 0..60),
        ) {
            let calibration: Vec<f32> = calibration.into_iter().map(f32::from).collect();
            let mut alarm = Alarm::new(&calibration, 1, 1e-150).unwrap();
            for score in drive {
                alarm.push(f32::from(score)).unwrap();
            }
            let count = (calibration.len() as u64 + alarm.blocks + 1) as f64;
            let mean: f64 = (0..alarm.between.len())
                .map(|place| {
                    let mut next = alarm.clone();
                    next.bet(place);
                    (alarm.between[place] + 1) as f64 / count * next.evidence()
                })
                .sum();
            let evidence = alarm.evidence();
            prop_assert!((mean / evidence - 1.0).abs() < 1e-9, "{evidence} becomes {mean}");
        }

        #[test]
        fn any_scores_at_all_are_ranked_or_refused(
            calibration in vec(any::<u32>().prop_map(f32::from_bits), 0..40),
            drive in vec(any::<u32>().prop_map(f32::from_bits), 0..60),
            block in 0..4_usize,
        ) {
            let Ok(mut alarm) = Alarm::new(&calibration, block, 0.01) else { return Ok(()) };
            for score in drive {
                let before = alarm.evidence();
                prop_assert_eq!(alarm.push(score).is_ok(), score.is_finite());
                let evidence = alarm.evidence();
                prop_assert!(evidence.is_finite() && evidence > 0.0);
                prop_assert!(score.is_finite() || evidence == before);
            }
        }
    }

    /// Scores of a state that lasts `time` frames: mostly 0, and anything from 0 to 1 while the
    /// robot is lost, a tenth of the time or, from frame `change` on, three tenths.
    fn drive(random: &mut SplitMix64, frames: usize, time: f32, change: usize) -> Vec<f32> {
        let stays = (-1.0 / time).exp();
        let mut lost = random.share() < 0.1;
        (0..frames)
            .map(|frame| {
                let share = if frame < change { 0.1 } else { 0.3 };
                if frame == change || random.share() > stays {
                    lost = random.share() < share;
                }
                let score = random.share();
                if lost {
                    score
                } else if score < 0.6 {
                    0.0
                } else {
                    score / 10.0
                }
            })
            .collect()
    }

    /// The share of 10,000 pairs of drives on which the alarm is raised.
    fn raised(places: usize, frames: usize, time: f32, change: usize) -> f64 {
        const DRIVES: u64 = 10_000;
        let block = (2.0 * time) as usize;
        let raised = (0..DRIVES).filter(|&seed| {
            let mut random = SplitMix64(seed);
            let calibration = drive(&mut random, places, time, usize::MAX);
            let mut alarm = Alarm::new(&calibration, block, 0.01).unwrap();
            for score in drive(&mut random, frames, time, change) {
                alarm.push(score).unwrap();
            }
            alarm.raised()
        });
        raised.count() as f64 / DRIVES as f64
    }

    #[test]
    fn false_alarms_are_as_rare_as_promised_on_dependent_drives() {
        for (places, frames, time) in
            [(300, 1000, 1.0), (300, 3000, 10.0), (1150, 3000, 10.0), (1150, 3000, 50.0)]
        {
            let share = raised(places, frames, time, usize::MAX);
            assert!(share <= 0.01, "{share} of drives, {places} places, correlation time {time}");
        }
    }

    #[test]
    fn three_times_as_many_errors_are_noticed() {
        assert!(raised(1150, 1300, 1.0, 300) > 0.9);
    }
}
