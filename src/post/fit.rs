//! Fitting a step on the references.

#[cfg(feature = "pca")]
use super::pca::principal;
use super::step::{FittedStep, Step};
use crate::error::Error;
use crate::interrupt::check;
use crate::numbers::View;
use crate::random::SplitMix64;

/// The most dimensions that a projection gives.
const MOST: usize = 1 << 20;

/// Refuses references that no step can be fitted on.
///
/// # Errors
/// As for [`Post::fit`](super::Post::fit).
pub(super) fn check_references(rows: &[f32], dim: usize) -> Result<(), Error> {
    if dim == 0 || !rows.len().is_multiple_of(dim) {
        let expected = "rows of at least one number, all of one length".to_owned();
        let got = format!("{} numbers in rows of {dim}", rows.len());
        return Err(Error::Shape { what: "references", expected, got });
    }
    if rows.len() < 2 * dim {
        return Err(Error::TooFewPlaces { what: "references", got: rows.len() / dim });
    }
    View::from(rows).check_finite("references", dim)
}

/// Fits a step on rows of `dim` numbers.
pub(super) fn fit(step: Step, rows: &[f32], dim: usize) -> Result<FittedStep, Error> {
    let mut fitted = FittedStep::new(step);
    match step {
        Step::Standardize | Step::StandardizeRunning => {
            let deviation;
            (fitted.offset, deviation) = moments(rows, dim)?;
            let unit = |&s: &f64| if s > 0.0 { s.recip() } else { 0.0 };
            fitted.scale = deviation.iter().map(unit).collect();
        }
        Step::Pca { dim: wanted, whiten } => {
            (fitted.offset, _) = moments(rows, dim)?;
            fitted.matrix = principal(rows, &fitted.offset, wanted, whiten)?;
        }
        Step::Projection { dim: wanted, seed } => {
            let refused = |expected: String| {
                let (name, got) = ("projection dim", wanted.to_string());
                Error::Option { name, expected, got }
            };
            if !(1..=MOST).contains(&wanted) {
                return Err(refused(format!("from 1 to {MOST}")));
            }
            let signs = signs(wanted, dim, seed);
            fitted.matrix = signs.ok_or_else(|| {
                refused(format!("so few that {dim} signs for each, of 4 bytes, fit into memory"))
            })?;
        }
        Step::Normalize => {}
    }
    Ok(fitted)
}

/// Principal components can be applied without the feature, but not fitted.
#[cfg(not(feature = "pca"))]
fn principal(_: &[f32], _: &[f64], wanted: usize, _: bool) -> Result<Vec<f32>, Error> {
    let expected = "a build with the cargo feature `pca`, which fits them".to_owned();
    Err(Error::Option { name: "pca", expected, got: format!("{wanted} components to fit") })
}

/// The mean of each dimension over the rows, and its population standard deviation: exactly 0 if
/// all are the same.
///
/// # Errors
/// [`Error::Interrupted`] if the work is to stop.
pub(super) fn moments(rows: &[f32], dim: usize) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let count = (rows.len() / dim) as f64;
    let mut mean = vec![0.0; dim];
    for row in rows.chunks_exact(dim) {
        check()?;
        mean.iter_mut().zip(row).for_each(|(mean, &x)| *mean += f64::from(x));
    }
    for mean in &mut mean {
        *mean /= count;
    }
    let mut square = vec![0.0; dim];
    let mut differs = vec![false; dim];
    for row in rows.chunks_exact(dim) {
        check()?;
        for (((square, differs), mean), (&x, &first)) in
            square.iter_mut().zip(&mut differs).zip(&mean).zip(row.iter().zip(rows))
        {
            *square += (f64::from(x) - mean).powi(2);
            *differs |= x != first;
        }
    }
    let deviation = square.iter().zip(&differs);
    let deviation =
        deviation.map(|(square, &differs)| if differs { (square / count).sqrt() } else { 0.0 });
    Ok((mean, deviation.collect()))
}

/// `rows` rows of `dim` signs, 1 or -1, drawn by `SplitMix64` from `seed`: 64 a draw, the lowest
/// bit first. `None` if there is no memory for them.
pub(super) fn signs(rows: usize, dim: usize, seed: u64) -> Option<Vec<f32>> {
    let count = rows.checked_mul(dim)?;
    let mut signs = Vec::new();
    signs.try_reserve_exact(count).ok()?;
    let mut random = SplitMix64(seed);
    let mut bits = 0_u64;
    signs.extend((0..count).map(|index| {
        if index % 64 == 0 {
            bits = random.next();
        }
        let sign = if bits & 1 == 1 { 1.0 } else { -1.0 };
        bits >>= 1;
        sign
    }));
    Some(signs)
}
