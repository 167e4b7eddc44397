//! The test for queries that are not independent: bets on blocks of consecutive ones (method 1.12).

/// The stakes, as shares of the most that can be lost.
const STAKES: [f64; 3] = [0.3, 0.6, 0.95];

/// The capital of a bettor who has 1 for each stake and bets it, block by block, that fewer than
/// `wrong` of the accepted are wrong; as logarithms.
///
/// `errors` has a number a query: none if it is not accepted, else how wrong it is, from 0 to 1.
/// The last block may be shorter: what it lacks is not accepted.
fn capitals(
    errors: impl Iterator<Item = Option<f64>>,
    block: usize,
    wrong: f64,
) -> [f64; STAKES.len()] {
    let mut capitals = [0.0; STAKES.len()];
    let mut bet = |sum: f64| {
        for (capital, stake) in capitals.iter_mut().zip(STAKES) {
            *capital += (-stake / (1.0 - wrong) * sum / block as f64).ln_1p();
        }
    };
    let (mut sum, mut taken) = (0.0, 0);
    for error in errors {
        sum += error.map_or(0.0, |error| error - wrong);
        taken += 1;
        if taken == block {
            bet(sum);
            (sum, taken) = (0.0, 0);
        }
    }
    bet(sum);
    capitals
}

/// The mean capital at the end. If no fewer than `wrong` are wrong, it reaches `c` with a
/// probability of at most `1 / c` (Ville's inequality), as far as blocks are independent.
pub(super) fn capital(errors: impl Iterator<Item = Option<f64>>, block: usize, wrong: f64) -> f64 {
    let capitals = capitals(errors, block, wrong);
    capitals.iter().map(|capital| capital.exp()).sum::<f64>() / STAKES.len() as f64
}

/// After how many queries like these the capital would be `enough`; `None` if it does not grow.
pub(super) fn queries_for(
    enough: f64,
    errors: impl Iterator<Item = Option<f64>>,
    queries: usize,
    block: usize,
    wrong: f64,
) -> Option<usize> {
    let best = capitals(errors, block, wrong).into_iter().fold(0.0, f64::max);
    let needed = (enough * STAKES.len() as f64).ln() / best * queries as f64;
    (needed < 1e15).then_some(needed.ceil() as usize)
}

#[cfg(test)]
mod tests {
    use super::{capital, queries_for};

    #[test]
    fn bets_on_blocks_of_one_are_bets_on_queries() {
        let errors = [Some(0.0), None, Some(1.0), Some(0.25)];
        let stakes = [0.3, 0.6, 0.95].map(|stake| stake / 0.9);
        let capitals =
            stakes.map(|stake| (1.0 + stake * 0.1) * (1.0 - stake * 0.9) * (1.0 - stake * 0.15));
        let expected = capitals.iter().sum::<f64>() / 3.0;
        assert!((capital(errors.into_iter(), 1, 0.1) - expected).abs() < 1e-12);
    }

    #[test]
    fn the_mean_capital_of_a_fair_game_is_1() {
        // Every sequence of two blocks of two, each error as probable as `wrong` says.
        let wrong: f64 = 0.2;
        let mean: f64 = (0..16_u32)
            .map(|bits| {
                let errors = (0..4).map(|query| Some(f64::from(bits >> query & 1)));
                let probability = wrong.powi(bits.count_ones() as i32)
                    * (1.0 - wrong).powi(4 - bits.count_ones() as i32);
                probability * capital(errors, 2, wrong)
            })
            .sum();
        assert!((mean - 1.0).abs() < 1e-12, "{mean}");
    }

    #[test]
    fn a_drive_that_is_too_short_says_how_long_would_do() {
        let right = |queries: usize| std::iter::repeat_n(Some(0.0), queries);
        assert!(capital(right(30), 1, 0.05) < 20.0);
        let needed = queries_for(20.0, right(30), 30, 1, 0.05).unwrap();
        assert!(capital(right(needed), 1, 0.05) >= 20.0, "{needed}");
        let wrong = std::iter::repeat_n(Some(1.0), 30);
        assert_eq!(queries_for(20.0, wrong, 30, 1, 0.05), None);
        // Next to as many errors as promised: more queries than there will ever be.
        let hardly = std::iter::repeat_n(Some(0.5_f64.next_down()), 30);
        assert_eq!(queries_for(20.0, hardly, 30, 1, 0.5), None);
    }
}
