//! For how many queries errors last: the block length of intervals and of promises.

use crate::interrupt::stopped;

/// Pairs of neighbouring lags that are summed at most.
const MOST_PAIRS: usize = 5_000;

/// The integrated autocorrelation time of a series, `1 + 2 sum over k of rho(k)`: how many values
/// in a row say as much as one independent value. The sum ends before the first pair of
/// neighbouring lags that is not positive (Geyer 1992, the initial positive sequence). 1 if values
/// are independent, about `2 tau` if their correlation falls as `exp(-k / tau)`; `None` if all are
/// equal.
///
/// ```
/// use surefix::evaluate::correlation_time;
/// let long: Vec<f64> = (0..1000).map(|query| f64::from(query / 50 % 2)).collect();
/// assert!(correlation_time(&long).is_some_and(|time| time > 20.0));
/// assert_eq!(correlation_time(&[1.0, 1.0]), None);
/// ```
pub fn correlation_time(values: &[f64]) -> Option<f64> {
    let count = values.len();
    let mean = values.iter().sum::<f64>() / count as f64;
    let off: Vec<f64> = values.iter().map(|value| value - mean).collect();
    let covariance = |lag: usize| off.iter().zip(&off[lag..]).map(|(a, b)| a * b).sum::<f64>();
    let variance = covariance(0);
    if values.iter().all(|value| *value == values[0]) || variance <= 0.0 {
        return None;
    }
    let pairs = (0..(count / 2).min(MOST_PAIRS))
        .map(|pair| (covariance(2 * pair) + covariance(2 * pair + 1)) / variance);
    // The answer of stopped work is thrown away.
    let pairs = pairs.take_while(|&pair| pair > 0.0 && !stopped());
    Some((2.0 * pairs.sum::<f64>() - 1.0).max(1.0))
}

/// The queries a block, by how long its errors last: an upper bound of their
/// [correlation time](correlation_time) `t`, as few errors tell it badly,
/// `t (1 + 1.64 sqrt(10 t / m + t / (2 r)))` for `m` queries, of which the rarer of right and wrong
/// are `r`. `None` if all values are equal, so that nothing is known.
///
/// Promises made with blocks of `t` broke two to three times as often as they said in simulated
/// drives, as `t` is an estimate.
pub fn block_length(errors: &[f64]) -> Option<usize> {
    let time = correlation_time(errors)?;
    let count = errors.len() as f64;
    let (low, high) = errors
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
    let share = errors.iter().map(|x| (x - low) / (high - low)).sum::<f64>() / count;
    let rarer = count * share.min(1.0 - share);
    let bound = time * (1.0 + 1.64 * (10.0 * time / count + time / (2.0 * rarer)).sqrt());
    Some((bound.ceil() as usize).clamp(1, errors.len()))
}
