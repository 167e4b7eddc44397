//! Promises for queries that are not independent, and alarms (method 1.12), beside their definitions.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use surefix::Error;
use surefix::calibration::{Alarm, Calibrate, calibrate};
use surefix::evaluate::block_length;

use crate::calibration::{lines_tried, matches};
use crate::cases::cases;
use crate::random::SplitMix64;

/// Errors that last for `lasting` queries on average, by halves and quarters among them, and scores
/// that tell more or less of them.
fn drive(
    queries: usize,
    lasting: usize,
    share: f32,
    telling: f32,
    seed: u64,
) -> (Vec<f32>, Vec<f64>) {
    let mut dice = SplitMix64(seed);
    let mut error = 0.0;
    let one = |_| {
        if dice.below(lasting) == 0 {
            let kind = [1.0, 1.0, 0.5, 0.25][dice.below(4)];
            error = if dice.share() < share { kind } else { 0.0 };
        }
        (telling * error as f32 + dice.share(), error)
    };
    (0..queries).map(one).unzip()
}

/// What bettors have at the end who bet on each block of queries, the last one short or not.
fn capitals(errors: &[Option<f64>], block: usize, wrong: f64) -> [f64; 3] {
    [0.3, 0.6, 0.95].map(|stake| {
        let each = errors.chunks(block).map(|errors| {
            let lost: f64 = errors.iter().flatten().map(|error| error - wrong).sum();
            1.0 - stake / (1.0 - wrong) * lost / block as f64
        });
        each.product()
    })
}

proptest! {
    #![proptest_config(cases(250))]

    /// The blocks of each threshold, the bets, the sequence of thresholds, and how many queries more
    /// would do.
    #[test]
    fn blocks_of_queries_are_bet_upon(
        queries in 1..250_usize, lasting in 1..12_usize, share in select(vec![0.0_f32, 0.03, 0.1, 0.4, 1.0]),
        telling in select(vec![0.0_f32, 0.3, 1.0]), seed: u64,
        (most, sure) in select(vec![(0.05, 0.95), (0.3, 0.9), (0.1, 0.5), (0.5, 0.99)]),
        block in proptest::option::of(1..9_usize), left_out in vec(0..12_u8, 250),
    ) {
        let (scores, wrong) = drive(queries, lasting, share, telling, seed);
        let mut options = Calibrate::default();
        (options.wrong, options.sure, options.block) = (most, sure, block);
        let mut found = matches(&scores);
        let mut known: Vec<Option<f64>> = wrong.iter().copied().map(Some).collect();
        for (query, kind) in left_out.into_iter().take(queries).enumerate() {
            match kind {
                0 => found[query].ready = false,
                1 => found[query].accepted = false,
                2 => known[query] = None,
                _ => {}
            }
        }
        let kept = |&query: &usize| found[query].ready && found[query].accepted && known[query].is_some();
        let kept: Vec<usize> = (0..queries).filter(kept).collect();
        prop_assume!(!kept.is_empty());
        let got = calibrate(&found, &known, &options).unwrap();

        let (scores, wrong): (Vec<f32>, Vec<f64>) = kept.iter().map(|&query| (scores[query], wrong[query])).unzip();
        let count = scores.len();
        let lines = lines_tried(&scores, most, sure);
        let accepts = |line: f32| scores.iter().map(move |&score| score <= line);
        let errors = |line: f32| -> Vec<f64> {
            accepts(line).zip(&wrong).map(|(accepted, &wrong)| if accepted { wrong } else { 0.0 }).collect()
        };
        // How long all errors last, and those of the strictest threshold, from this one on, that
        // accepts five.
        let all = block_length(&wrong).unwrap_or((count as f64).sqrt().ceil() as usize);
        let own = |index: usize| {
            let enough = lines[index..].iter().map(|&line| errors(line)).find(|e| e.iter().sum::<f64>() >= 5.0);
            enough.and_then(|errors| block_length(&errors)).map_or(all, |own| own.min(all))
        };
        let length = |index: usize| ((all * own(index)) as f64).sqrt().ceil() as usize;
        let lengths: Vec<usize> = (0..lines.len()).map(|index| block.unwrap_or_else(|| length(index))).collect();

        let judged = |index: usize, few: Option<f64>| -> Vec<Option<f64>> {
            let each = accepts(lines[index]).zip(&wrong);
            each.map(|(accepted, &wrong)| accepted.then(|| few.unwrap_or(wrong))).collect()
        };
        let (enough, mut in_doubt) = (1.0 / (1.0 - sure), false);
        let mut passes = |index: usize, few: Option<f64>| {
            let capital = capitals(&judged(index, few), lengths[index], most).iter().sum::<f64>() / 3.0;
            in_doubt |= (capital / enough - 1.0).abs() < 1e-9;
            capital >= enough
        };
        let first = [1.0 / 3.0, 1.0 / 6.0, 0.0].into_iter()
            .find_map(|few| (0..lines.len()).find(|&index| passes(index, Some(few * most))));
        let begin = first.unwrap_or(lines.len());
        let passed = (begin..lines.len()).take_while(|&index| passes(index, None)).last();
        prop_assume!(!in_doubt);
        let line = passed.map(|index| lines[index]);
        prop_assert_eq!(got.score, line);
        let named = passed.or(first).unwrap_or(lines.len() - 1);
        prop_assert_eq!(got.block, Some(lengths[named]));
        prop_assert_eq!(got.queries, count);
        let accepted = line.map_or(0, |line| accepts(line).filter(|&accepted| accepted).count());
        prop_assert_eq!(got.accepted, accepted);
        prop_assert_eq!(got.errors, line.map_or(0.0, |line| errors(line).iter().sum()));

        let needed = |index: usize| {
            let best = capitals(&judged(index, None), lengths[index], most).into_iter().fold(0.0, f64::max);
            let needed = (3.0 * enough).ln() / best.ln() * count as f64;
            (best > 1.0 + 1e-9).then_some(needed)
        };
        let needed = (0..lines.len()).filter_map(needed).fold(f64::INFINITY, f64::min);
        match got.more {
            None => prop_assert!(line.is_some() || needed == f64::INFINITY, "{needed}"),
            Some(more) => {
                prop_assert!(line.is_none());
                let expected = (needed.ceil() - count as f64).max(1.0);
                prop_assert!((more as f64 - expected).abs() <= 1.0 + 1e-9 * expected, "{more}, {expected}");
            }
        }
    }

    /// Frames count by blocks, and a block by its mean; the ranks of the means are bet upon, each
    /// beginning with its share of the money.
    #[test]
    fn an_alarm_is_raised_by_the_ranks_of_blocks(
        frames in 1..120_usize, block in select(vec![1, 2, 4, 8_usize]), drift in 0..3_usize,
        drive in 0..200_usize, seed: u64, level in select(vec![0.5, 0.2, 0.01]),
    ) {
        let mut dice = SplitMix64(seed);
        // Their means are apart, and sums of eight exact.
        let mut score = |worst: usize| dice.below(worst) as f32 + dice.below(1 << 10) as f32 / 1024.0;
        let calibration: Vec<f32> = (0..frames).map(|_| score(64)).collect();
        let drive: Vec<f32> = (0..drive).map(|_| score(64 + 30 * drift)).collect();
        let means = |scores: &[f32]| -> Vec<f64> {
            let mean = |scores: &[f32]| scores.iter().map(|&score| f64::from(score)).sum::<f64>() / block as f64;
            scores.chunks_exact(block).map(mean).collect()
        };
        let alarm = Alarm::new(&calibration, block, level);
        if frames < block {
            prop_assert!(matches!(alarm, Err(Error::Shape { .. })), "{alarm:?}");
            return Ok(());
        }
        let mut alarm = alarm.unwrap();
        let mut known = means(&calibration);
        let mut all = known.clone();
        all.extend(means(&drive));
        all.sort_by(f64::total_cmp);
        prop_assume!(all.windows(2).all(|pair| pair[0] < pair[1]));
        known.sort_by(f64::total_cmp);
        // Of each block: how many of the calibration's are worse; and the pay of the three bets.
        let (mut places, mut pays): (Vec<usize>, Vec<[f64; 3]>) = (Vec::new(), Vec::new());
        for mean in means(&drive) {
            let place = known.iter().filter(|&&other| other > mean).count();
            let worse = place + places.iter().filter(|&&other| other < place).count();
            let beside = 1 + places.iter().filter(|&&other| other == place).count();
            let count = (known.len() + places.len() + 1) as f64;
            let (from, to) = (worse as f64 / count, (worse + beside) as f64 / count);
            pays.push([0.1, 0.3, 0.6].map(|power| (to.powf(power) - from.powf(power)) / (to - from)));
            places.push(place);
        }
        // What is staked with block `k` is `50 / (50 + k)` less `50 / (50 + k + 1)`, a third on each bet.
        let reserve = |blocks: usize| 50.0 / (50.0 + blocks as f64);
        let evidence = |blocks: usize| {
            let won = |bet: usize| (0..blocks).map(|from| {
                let pay: f64 = pays[from..blocks].iter().map(|pays| pays[bet]).product();
                (reserve(from) - reserve(from + 1)) / 3.0 * pay
            }).sum::<f64>();
            reserve(blocks) + won(0) + won(1) + won(2)
        };
        let mut again = Vec::new();
        let mut raised = false;
        for (frame, &score) in drive.iter().enumerate() {
            let told = alarm.push(score).unwrap();
            if !raised {
                let expected = evidence((frame + 1) / block);
                prop_assert!((alarm.evidence() / expected - 1.0).abs() < 1e-9, "frame {frame}");
                raised = alarm.evidence() >= level.powi(-2);
            }
            prop_assert_eq!((told, alarm.raised()), (raised, raised));
            again.push(alarm.evidence().to_bits());
        }
        alarm.reset();
        prop_assert_eq!((alarm.evidence(), alarm.raised()), (1.0, false));
        for (&score, before) in drive.iter().zip(again) {
            alarm.push(score).unwrap();
            prop_assert_eq!(alarm.evidence().to_bits(), before);
        }
    }
}

/// Isotonic regression, as the least of the largest means: of the queries in order, and one that is
/// wrong before them and one that is right behind.
fn falling(sorted: &[(f32, f64)]) -> Vec<(f32, f64)> {
    let mut all = vec![(sorted[0].0, 0.0)];
    all.extend(sorted);
    all.push((sorted[sorted.len() - 1].0, 1.0));
    // The queries of one score are one number, with the weight of as many.
    let groups: Vec<(f32, f64, f64)> = all
        .chunk_by(|a, b| a.0 == b.0)
        .map(|equal| (equal[0].0, equal.iter().map(|one| one.1).sum(), equal.len() as f64))
        .collect();
    let mean = |from: usize, to: usize| {
        let groups = &groups[from..=to];
        groups.iter().map(|group| group.1).sum::<f64>()
            / groups.iter().map(|group| group.2).sum::<f64>()
    };
    let largest = |from: usize, at: usize| {
        (at..groups.len()).map(|to| mean(from, to)).fold(f64::NEG_INFINITY, f64::max)
    };
    let at = |at: usize| (0..=at).map(|from| largest(from, at)).fold(f64::INFINITY, f64::min);
    groups.iter().enumerate().map(|(index, group)| (group.0, at(index))).collect()
}

proptest! {
    #![proptest_config(cases(1_000))]

    #[test]
    fn probabilities_are_those_of_isotonic_regression(
        queries in vec((0..40_u8, 0..5_u8), 1..40), tracked: bool, below in 0..2_u8,
    ) {
        // Scores of a track lie from 0 to 1, distances anywhere.
        let offset = if tracked { 0.0 } else { f32::from(below) * 30.0 };
        let queries: Vec<(f32, f64)> = queries
            .into_iter()
            .map(|(score, wrong)| (f32::from(score) / 40.0 - offset, f64::from(wrong) / 4.0))
            .collect();
        let scores: Vec<f32> = queries.iter().map(|query| query.0).collect();
        let wrong: Vec<_> = queries.iter().map(|query| Some(query.1)).collect();
        let mut options = Calibrate::default();
        options.tracked = tracked;
        let threshold = calibrate(&matches(&scores), &wrong, &options).unwrap();
        let probability = threshold.probability();

        let mut sorted: Vec<(f32, f64)> = queries.iter().map(|&(score, wrong)| (score, 1.0 - wrong)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut expected = falling(&sorted);
        let (best, worst) = (expected[0].0, expected[expected.len() - 1].0);
        // Where it is 0.
        let zero = if tracked { 1.0 } else { worst + (worst - best) };
        if zero > worst {
            expected.push((zero, 0.0));
        }
        let last = expected[expected.len() - 1];
        for pair in expected.windows(2) {
            let ((low, left), (high, right)) = (pair[0], pair[1]);
            for part in [0.0, 0.25, 0.5, 0.75] {
                let score = low + part * (high - low);
                let along = f64::from((score - low) / (high - low));
                let (got, expected) = (probability.at(score), left + along * (right - left));
                prop_assert!((got - expected).abs() < 1e-6, "{score}: {got}, expected {expected}");
            }
        }
        for beyond in [last.0, last.0 + 0.5, f32::MAX, f32::INFINITY, f32::NAN] {
            prop_assert!((probability.at(beyond) - last.1).abs() < 1e-12, "{beyond}");
        }
        for before in [best, best - 0.5, f32::NEG_INFINITY] {
            prop_assert!((probability.at(before) - expected[0].1).abs() < 1e-12, "{before}");
        }
        // It is linear between its knots, of which no two are equal.
        let knots: Vec<(f32, f64)> = probability.knots().collect();
        prop_assert!(knots.is_sorted_by(|a, b| a.0 < b.0 && a.1 >= b.1), "{knots:?}");
        prop_assert_eq!((knots[0].0, knots[knots.len() - 1].0), (best, last.0));
        for &(score, right) in &knots {
            prop_assert_eq!(probability.at(score), right);
        }
    }
}

/// Of an infinite or a constant drive, no score is known at which it would be 0.
#[test]
fn without_a_spread_nothing_falls_to_0() {
    let of = |scores: &[f32], tracked: bool| {
        let mut options = Calibrate::default();
        options.tracked = tracked;
        calibrate(&matches(scores), &vec![Some(0.0); scores.len()], &options).unwrap()
    };
    for (scores, tracked) in
        [(&[0.5_f32, 0.5][..], false), (&[1.0, 1.0], true), (&[f32::MIN, f32::MAX], false)]
    {
        let threshold = of(scores, tracked);
        assert!(threshold.probability().at(f32::INFINITY) > 0.5, "{scores:?}");
    }
    assert_eq!(of(&[0.5, 0.5], true).probability().at(1.0), 0.0);
}
