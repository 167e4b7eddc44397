//! Moments of columns of several blocks, beside means and sums over all places.

use super::evidence::Says;
use super::hubness::{BlockMoments, FLAT, Hubness, Spread, Standard};
use super::novelty::{Together, View, about_all, correlation};
use super::update::on;
use crate::motion::Motion;
use crate::random::SplitMix64;
use crate::sums::{BLOCK, CHUNK};

/// Numbers of two blocks and a half, block by block about another mean.
fn numbers(means: [f64; 3], seed: u64) -> Vec<f64> {
    let mut dice = SplitMix64(seed);
    let number = |at: usize| means[at / BLOCK] + dice.below(64) as f64;
    (0..2 * BLOCK + 1003).map(number).collect()
}

fn mean(numbers: &[f64]) -> f64 {
    numbers.iter().sum::<f64>() / numbers.len() as f64
}

fn moments(numbers: &[f64]) -> Vec<BlockMoments> {
    numbers.chunks(BLOCK).map(BlockMoments::of_corrected).collect()
}

fn are_near(got: f64, expected: f64, share: f64) {
    assert!((got - expected).abs() <= share * expected.abs(), "{got}, expected {expected}");
}

/// However far the numbers lie from zero.
#[test]
fn blocks_together_have_the_spread_and_the_correlation_of_all_places() {
    let far = 2_f64.powi(46);
    for means in [[0.0, 0.0, 0.0], [0.0, 300.0, -7000.0], [far, far, far + 500.0]] {
        let (one, other) = (numbers(means, 1), numbers(means.map(|mean| 2.0 * mean), 2));
        let (blocks, others) = (moments(&one), moments(&other));
        let (spread, beside) = (Spread::of(&blocks), Spread::of(&others));
        let (centre, away) = (mean(&one), mean(&other));
        let off = |numbers: &[f64], mean: f64| -> Vec<f64> {
            numbers.iter().map(|number| number - mean).collect()
        };
        let (one_off, other_off) = (off(&one, centre), off(&other, away));
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        are_near(spread.mean, centre, 1e-12);
        are_near(spread.squares, product(&one_off, &one_off), 1e-3);

        let mut sum = 0.0;
        for (block, (a, b)) in one.chunks(BLOCK).zip(other.chunks(BLOCK)).enumerate() {
            let mut together = Together::new(&blocks[block], &others[block]);
            for (a, b) in a.chunks(CHUNK).zip(b.chunks(CHUNK)) {
                together.add(a, b);
            }
            let views = [(&blocks[block], spread), (&others[block], beside)];
            sum += about_all(together.total(), views);
        }
        let expected = product(&one_off, &other_off)
            / (product(&one_off, &one_off) * product(&other_off, &other_off)).sqrt();
        let (mut known, mut unknown) = (true, false);
        let got = correlation(sum, [spread, beside], false, &mut known).unwrap();
        assert!((got - expected).abs() < 1e-3, "{got}, expected {expected}");
        assert!(known);
        assert!(correlation(sum, [spread, beside], true, &mut known).is_none());
        assert!(!known);
        assert!(correlation(sum, [spread, beside], false, &mut unknown).is_none());
        assert!(unknown);
    }
}

/// A column is flat if what is left of it after the correction is rounding.
#[test]
fn a_column_is_flat_by_its_size() {
    let share = 0.25;
    for (size, sums) in [(1.0_f32, 2.0), (1000.0, 0.0), (-8.0, 40.0), (8.0, 32.0)] {
        let column = vec![size; BLOCK + 100];
        let kept = f64::from(size) - share * (sums + f64::from(size));
        let largest = f64::from(size).abs() + (f64::from(size) - kept).abs();
        for (part, flat) in [(0.25, true), (0.75, true), (1.5, false), (4.0, false)] {
            // Half of the places have a little more, the others a little less.
            let step = part * FLAT * largest / share;
            let sums: Vec<f64> = (0..column.len())
                .map(|at| if at % 2 == 0 { sums + step } else { sums - step })
                .collect();
            let blocks = column.chunks(BLOCK).zip(sums.chunks(BLOCK));
            let blocks: Vec<_> =
                blocks.map(|(column, sums)| BlockMoments::of(column, sums, share)).collect();
            let standard = Standard::of(&blocks, share);
            assert_eq!(standard.inverse == 0.0, flat, "{size} by {part}");
            // And so is the view that the next one is compared with.
            let mut view = View::new(column.len(), &Motion::any()).unwrap();
            let mut hubness = Hubness::new(column.len()).unwrap();
            (hubness.blocks, hubness.sums) = (blocks, sums);
            view.correlation(Says::Column(standard), &column, &hubness);
            assert_eq!(view.known, !flat, "{size} by {part}");
            are_near(standard.mean, kept, 1e-9);
            if !flat {
                are_near(1.0 / standard.inverse, part * FLAT * largest, 0.02);
            }
        }
    }
}

/// Chunks are added up by blocks, to the last bit.
#[test]
fn the_belief_on_the_map_is_summed_by_blocks() {
    let mut dice = SplitMix64(9);
    let chunks: Vec<f64> = (0..999).map(|_| f64::from(dice.share()) / 3.0).collect();
    let mut expected = 0.0;
    for block in chunks.chunks(16) {
        expected += block.iter().fold(0.0, |sum, chunk| sum + chunk);
    }
    let straight = chunks.iter().sum::<f64>();
    assert!(
        on(&chunks).to_bits() == expected.to_bits() && expected.to_bits() != straight.to_bits()
    );
}

#[test]
fn a_view_grows_by_blocks() {
    let motion = Motion::any();
    let mut view = View::new(0, &motion).unwrap();
    for places in 1..=BLOCK + 900 {
        view.grow(&motion);
        let blocks: Vec<usize> = view.blocks.iter().map(|block| block.places).collect();
        let rest = places.saturating_sub(BLOCK);
        assert_eq!(blocks, if rest > 0 { vec![BLOCK, rest] } else { vec![places] });
    }
}

/// A view that is kept, as in a snapshot, is compared with if it is not constant.
#[test]
fn a_view_is_known_if_it_is_not_constant() {
    let view = numbers([1.0, 2.0, 3.0], 3);
    assert!(View::of(view.clone(), true).known && !View::of(view, false).known);
    assert!(!View::of(vec![2.5; 5000], true).known && !View::of(Vec::new(), true).known);
}
