//! The parts of post-processing that no one sees from outside.

use super::{ChainState, FittedStep, Post, Step};
use crate::error::Error;
use crate::random::SplitMix64;

#[test]
fn a_chain_of_a_file_gives_one_vector_as_many_do() {
    let (count, dim) = (12, 20);
    let rows = SplitMix64(1).signed(count * dim);
    let steps = [Step::Standardize, Step::Projection { dim: 12, seed: 1 }, Step::Normalize];
    let (post, done) = Post::fit(&steps, &rows, dim).unwrap();
    let again = Post::from_fitted(post.fitted_steps().to_vec(), post.output()).unwrap();
    assert_eq!(again, post);
    let mut state = ChainState::new(&post);
    for (row, expected) in rows.chunks_exact(dim).zip(done.chunks_exact(12)) {
        assert_eq!(post.pass(row, &mut state).unwrap(), expected);
    }
    let refused = post.pass(&rows[1..dim], &mut state);
    assert!(matches!(refused, Err(Error::Length { expected: 20, got: 19, .. })));
    let mut spoilt = post.fitted_steps().to_vec();
    spoilt[1] = FittedStep { matrix: vec![1.0; 13], ..spoilt[1].clone() };
    assert!(Post::from_fitted(spoilt, 12).unwrap_err().contains("post.1.matrix: expected 12 rows"));
}

#[test]
fn statistics_are_of_float32_numbers() {
    let after = |offset: f64, scale: f64| {
        let (offset, scale) = (vec![offset; 2], vec![scale; 2]);
        let step = FittedStep { step: Step::StandardizeRunning, offset, scale, matrix: Vec::new() };
        Post::from_fitted(vec![step.clone()], 2).map(|_| super::Running::after_step(&step))
    };
    let largest = f64::from(f32::MAX);
    let mut running = after(-largest, largest.recip()).unwrap();
    for number in [f32::MAX, -f32::MAX, f32::MAX, f32::MAX] {
        running.push(&[number; 2], &mut [0.0; 2]).unwrap();
        assert_eq!(super::Running::restore(&running.snapshot().unwrap()).unwrap(), running);
    }
    for (offset, scale) in [(1e39, 1.0), (-2e161, 1.0), (0.0, 1e-39), (f64::NAN, 1.0)] {
        assert!(after(offset, scale).unwrap_err().contains("post.0.*: expected finite numbers"));
    }
    for (mean, square) in [(1e39, 0.0), (0.0, 1e79), (0.0, -1.0), (0.0, f64::NAN)] {
        let running = super::Running { count: 2, mean: vec![mean], square: vec![square] };
        assert!(super::Running::restore(&running.snapshot().unwrap()).is_err(), "{running:?}");
    }
}

#[test]
fn signs_are_the_same_everywhere_and_need_memory() {
    // SplitMix64 from the seed 0 begins with 0xE220A8397B1DCDAF.
    let signs = super::fit::signs(1, 8, 0);
    assert_eq!(signs.unwrap(), [1.0, 1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0]);
    assert_eq!(super::fit::signs(1 << 45, 1 << 10, 0), None, "no memory");
    assert_eq!(super::fit::signs(usize::MAX, 2, 0), None);
}
