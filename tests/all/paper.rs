//! The matcher is docs/method.md: whole matrices, written as the paper writes them, give the same
//! fixes.

use crate::cases::{all_bits, any_fix, cases, columns, kind, known, route, stream, tells};
use proptest::prelude::*;
use surefix::{Config, Fix, Floor, Gradient, Peak, Sequence, Single};

/// The first index whose number no other one beats.
fn first_best<T: Copy>(numbers: &[T], beats: impl Fn(T, T) -> bool) -> usize {
    (0..numbers.len())
        .rev()
        .fold(numbers.len() - 1, |best, i| if beats(numbers[best], numbers[i]) { best } else { i })
}

/// Eq. 1.
fn gradient(d: &[f32], i: usize, kind: Gradient) -> f32 {
    let last = d.len() - 1;
    match (i, kind) {
        (0, _) => d[1] - d[0],
        (i, _) if i == last => d[last - 1] - d[last],
        (i, Gradient::Halved) => 0.5 * (d[i + 1] + d[i - 1]) - d[i],
        (i, _) => (d[i + 1] + d[i - 1]) - 2.0 * d[i],
    }
}

/// Everything from the whole matrix, `d[query][place]`.
fn paper(d: &[Vec<f32>], config: &Config, external: Option<&[bool]>) -> Vec<Fix> {
    let (n, m) = (d[0].len(), d.len());
    let length = config.sequence_length;
    let telling = |columns: &[Vec<f32>]| -> Vec<f32> {
        columns.iter().filter(|column| tells(column)).flatten().copied().collect()
    };
    let least = |columns: &[Vec<f32>]| telling(columns).into_iter().fold(f32::INFINITY, f32::min);

    // The enhanced gradient, its peak, the minimum and the consensus.
    let enhanced = |i: usize, j: usize| -> f32 {
        let ends = (d[j][1] - d[j][0]) + (d[j][n - 2] - d[j][n - 1]);
        let mean = if config.gradient == Gradient::Halved { ends / (2 * n) as f32 } else { 0.0 };
        let term = |k: usize| {
            if k <= i && k <= j { gradient(&d[j - k], i - k, config.gradient) } else { mean }
        };
        (1..config.smoothing).fold(term(0), |sum, k| sum + term(k))
    };
    let peaks: Vec<Peak> = (0..m)
        .map(|j| {
            let all: Vec<f32> = (0..n).map(|i| enhanced(i, j)).collect();
            let place = first_best(&all, |a, b| a > b);
            Peak { place, value: all[place] }
        })
        .collect();
    let singles: Vec<usize> = d.iter().map(|column| first_best(column, |a, b| a < b)).collect();
    let agrees = |j: usize| peaks[j].place.abs_diff(singles[j]) <= config.tolerance;
    let trusted: Vec<bool> =
        (0..m).map(|j| tells(&d[j]) && external.map_or_else(|| agrees(j), |w| w[j])).collect();

    // The weighted matrix as it is when query `now` comes, and the best diagonal of each speed.
    let sequence = |now: usize| -> Option<Sequence> {
        let running = f64::from(least(&d[..=now]));
        let floor = match config.floor {
            Floor::Running => running,
            Floor::Fixed(floor) => running.min(floor),
            _ => f64::from(least(d)),
        };
        let weighted = |i: usize, j: usize| -> f64 {
            let raw = f64::from(d[j][i]);
            let anchored = trusted[j] && singles[j] == i;
            if anchored { f64::from((raw - config.weight * (raw - floor)) as f32) } else { raw }
        };
        let back = |speed: f64, k: usize| (speed * k as f64).round() as usize;
        let mut candidates = Vec::new();
        for &speed in &config.speeds {
            for i in back(speed, length - 1)..n {
                let queries = now + 1 - length..=now;
                let sum = queries.fold(0.0, |sum, j| sum + weighted(i - back(speed, now - j), j));
                candidates.push((sum, i, speed));
            }
        }
        let (sum, place, speed) =
            candidates[first_best(&candidates, |a, b| a.0 < b.0 || (a.0 == b.0 && a.1 < b.1))];
        let lies_on = |k: &usize| trusted[now - k] && singles[now - k] + back(speed, *k) == place;
        let anchors = (0..length).filter(lies_on).count();
        Some(Sequence { place, score: ((0.0 + sum) / length as f64) as f32, anchors, speed })
    };

    let fix = |j: usize| {
        let single = Single { place: singles[j], distance: d[j][singles[j]] };
        let sequence = (j + 1 >= length).then(|| sequence(j)).flatten();
        let (place, score) =
            sequence.map_or((single.place, single.distance), |s| (s.place, s.score));
        let mut fix = any_fix();
        (fix.frame, fix.trusted, fix.place, fix.score) = (j as u64, trusted[j], place, score);
        (fix.single, fix.gradient, fix.sequence) = (single, peaks[j], sequence);
        (fix.blank, fix.segment_place) = (!tells(&d[j]), place);
        fix
    };
    (0..m).map(fix).collect()
}

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn the_stream_is_the_paper(
        (n, config) in route(2..64), m in 1..40_usize, kind in kind(), seed: u64, external: bool,
    ) {
        let d = columns(kind, n, m, seed);
        let words: Vec<bool> = (0..m).map(|j| (seed >> (j % 64)) & 1 == 1).collect();
        let (config, external) = (config! { config => motion: None }, external.then_some(words.as_slice()));
        let (expected, got) = (paper(&d, &config, external), stream(n, &config, &d, known(external, &[])));
        prop_assert_eq!(&expected, &got);
        prop_assert_eq!(all_bits(&expected), all_bits(&got));
    }
}

#[test]
fn without_weight_it_is_the_plain_sequence_whatever_is_trusted() {
    let d = columns(crate::cases::Kind::Smooth, 40, 60, 3);
    let config = config! { weight: 0.0, sequence_length: 4 };
    let (all, none) = (vec![true; 60], vec![false; 60]);
    let scores = |words: &[bool]| -> Vec<_> {
        stream(40, &config, &d, known(Some(words), &[]))
            .iter()
            .map(|fix| (fix.place, fix.score))
            .collect()
    };
    assert_eq!(scores(&all), scores(&none));
}

#[test]
fn a_whole_trusted_diagonal_with_full_weight_scores_the_floor() {
    // A perfect drive: place j is nearest at query j.
    let d: Vec<Vec<f32>> =
        (0..10_u8).map(|j| (0..10_u8).map(|i| 1.0 + f32::from(i.abs_diff(j))).collect()).collect();
    let config = config! { weight: 1.0, floor: Floor::Fixed(0.25), sequence_length: 3 };
    let fixes = stream(10, &config, &d, known(None, &[]));
    for fix in &fixes[2..] {
        let sequence = fix.sequence.expect("the window is full");
        assert_eq!(
            (sequence.place, sequence.score, sequence.anchors),
            (fix.frame as usize, 0.25, 3)
        );
    }
}

/// Two sums one bit apart, whose means round to the same f64: the smaller sum wins between two
/// speeds as it does along one.
#[test]
fn the_smaller_sum_wins_between_speeds_too() {
    let (bit, two_bits) = (2_f32.powi(-52), 2_f32.powi(-51));
    let mut d = vec![vec![9.0; 10]; 5];
    // The diagonal of speed 0 at place 2 sums to 1.25 and three bits, that of speed 1 to place 8 to
    // 1.25 and two.
    for (age, standing, driving) in
        [(0, 1.25, 1.25), (1, two_bits, two_bits), (2, bit, 0.0), (3, 0.0, 0.0), (4, 0.0, 0.0)]
    {
        d[4 - age][2] = standing;
        d[4 - age][8 - age] = driving;
    }
    let config = config! { sequence_length: 5, weight: 0.0, speeds: vec![0.0, 1.0] };
    let sequence =
        stream(10, &config, &d, known(None, &[]))[4].sequence.expect("the window is full");
    assert_eq!((sequence.place, sequence.speed), (8, 1.0));
}
