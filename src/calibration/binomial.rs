//! The exact test for queries that are independent of each other.

/// The probability of at most `errors` errors in `count` independent queries, each of which is
/// wrong with probability `wrong`, above 0 and below 1.
pub(super) fn at_most(errors: usize, count: usize, wrong: f64) -> f64 {
    if errors >= count {
        return 1.0;
    }
    // In logarithms, from 0 errors on: each term is a multiple of the one before.
    let odds = (wrong / (1.0 - wrong)).ln();
    let mut term = count as f64 * (-wrong).ln_1p();
    let mut terms = Vec::with_capacity(errors + 1);
    terms.push(term);
    for k in 1..=errors {
        term += ((count - k + 1) as f64 / k as f64).ln() + odds;
        terms.push(term);
    }
    let largest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = terms.iter().map(|term| (term - largest).exp()).sum();
    (largest + sum.ln()).exp().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::at_most;

    /// By the definition, for few queries.
    fn slow(errors: usize, count: usize, wrong: f64) -> f64 {
        let choose = |k: usize| (1..=k).fold(1.0, |c, i| c * (count - k + i) as f64 / i as f64);
        let term =
            |k: usize| choose(k) * wrong.powi(k as i32) * (1.0 - wrong).powi((count - k) as i32);
        (0..=errors).map(term).sum()
    }

    #[test]
    fn it_is_the_sum_of_its_terms() {
        for (errors, count) in [(0, 1), (0, 20), (3, 20), (19, 20), (7, 60)] {
            for wrong in [0.01, 0.3, 0.9] {
                let (expected, got) = (slow(errors, count, wrong), at_most(errors, count, wrong));
                assert!((expected - got).abs() < 1e-12, "{errors} of {count} at {wrong}");
            }
        }
    }

    #[test]
    fn it_stays_a_number_for_long_drives() {
        assert_eq!(at_most(5, 5, 0.1), 1.0);
        assert!(at_most(0, 10_000_000, 0.5) == 0.0);
        let even = at_most(500_000, 1_000_000, 0.5);
        assert!((even - 0.5).abs() < 1e-3, "{even}");
    }
}
