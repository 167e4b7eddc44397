//! Recall at K: is a true place among the K nearest?

use std::cmp::Ordering;

use ndarray::ArrayView2;

use super::truth::{Truth, Verdict};
use crate::error::Error;
use crate::numbers::first_not_finite;
use crate::parallel::each;

/// For each `K` of `ks`: the share of the queries that have a true place which have one among their
/// `K` nearest places. Ties go to the lowest place; 0 if no query has a true place.
///
/// ```
/// use ndarray::array;
/// use surefix::evaluate::{Truth, recall_at};
///
/// // Two places and two queries: the second query's true place is only its second nearest.
/// let distances = array![[0.1, 0.2], [0.9, 0.3]];
/// let truth = Truth::places(vec![Some(0), Some(1)], 0);
/// assert_eq!(recall_at(&distances.view(), &truth, &[1, 2])?, [0.5, 1.0]);
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// [`Error::Length`] if the truth has another number of queries than the matrix (places by
/// queries) has columns, or of another route (see [`Truth::check_places`]); [`Error::Option`] for a
/// K of 0; [`Error::NotFinite`] (row: query, index: place) for a NaN or an infinity.
pub fn recall_at(
    distances: &ArrayView2<'_, f32>,
    truth: &Truth,
    ks: &[usize],
) -> Result<Vec<f64>, Error> {
    let (places, queries) = distances.dim();
    if truth.len() != queries {
        return Err(Error::Length { what: "truth", expected: queries, got: truth.len() });
    }
    truth.check_places(places)?;
    if ks.contains(&0) {
        return Err(Error::Option {
            name: "ks",
            expected: "numbers from 1".to_owned(),
            got: "0".to_owned(),
        });
    }
    // The places before the nearest true one; `None` if the query has none.
    let rank = |query: usize| -> Result<Option<usize>, Error> {
        let column = distances.column(query).to_vec();
        if let Some((index, value)) = first_not_finite(&column) {
            return Err(Error::NotFinite {
                what: "distances (row: query)",
                row: Some(query),
                index,
                value,
            });
        }
        if !truth.exists(query) {
            return Ok(None);
        }
        let correct = (0..places).filter(|&place| truth.judge(query, place) == Verdict::Correct);
        let nearest = correct.min_by(|&a, &b| {
            column[a].partial_cmp(&column[b]).unwrap_or(Ordering::Equal).then(a.cmp(&b))
        });
        Ok(nearest.map(|true_place| {
            let here = column[true_place];
            let comes_before =
                |(place, &d): (usize, &f32)| d < here || (d == here && place < true_place);
            column.iter().enumerate().filter(|&one| comes_before(one)).count()
        }))
    };
    let ranks = each(0..queries, || (), |(), query| rank(query))?;
    let known = (0..queries).filter(|&query| truth.exists(query)).count().max(1);
    let share =
        |&k: &usize| ranks.iter().flatten().filter(|&&rank| rank < k).count() as f64 / known as f64;
    Ok(ks.iter().map(share).collect())
}
