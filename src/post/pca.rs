//! Principal components, and whitening by them.

use nalgebra::{DMatrix, SymmetricEigen};

use crate::distance::wide_products;
use crate::error::Error;
use crate::interrupt::apart;
use crate::parallel::each;
use crate::simd::Isa;

/// A component whose variance is less than this part of the largest is rounding alone.
const LEAST: f64 = 1e-10;

/// The first `wanted` principal components of rows with this mean, as rows of a matrix, each
/// divided by the standard deviation along it (with `n - 1`) if they are to `whiten`. Of a
/// component and its opposite, the one whose largest coefficient is positive.
///
/// The components are those of the smaller of two matrices, that of the dimensions' covariances and
/// that of the rows' products with each other, which have the same ones.
///
/// # Errors
/// [`Error::Option`] for none, or more than the rows span.
pub(super) fn principal(
    rows: &[f32],
    mean: &[f64],
    wanted: usize,
    whiten: bool,
) -> Result<Vec<f32>, Error> {
    let dim = mean.len();
    let count = rows.len() / dim;
    let refused = |most: usize| Error::Option {
        name: "pca dim",
        expected: format!("from 1 to {most}, what {count} references of {dim} numbers span"),
        got: wanted.to_string(),
    };
    let most = (count - 1).min(dim);
    if wanted == 0 || wanted > most {
        return Err(refused(most));
    }
    let centre = |(index, &x): (usize, &f32)| (f64::from(x) - mean[index % dim]) as f32;
    let centred: Vec<f32> = rows.iter().enumerate().map(centre).collect();
    let by_rows = count <= dim;
    let turned;
    let (sides, side, length) = if by_rows {
        (&centred, count, dim)
    } else {
        turned = transposed(&centred, dim);
        (&turned, dim, count)
    };
    let products = each(
        0..side,
        || (),
        |(), at| {
            let mut products = vec![0.0; side];
            wide_products(
                Isa::best(),
                &sides[at * length..(at + 1) * length],
                sides,
                &mut products,
            );
            Ok(products)
        },
    )?;
    let products = DMatrix::from_fn(side, side, |row, column| products[row][column]);
    let eigen = apart(|| SymmetricEigen::new(products))?;
    let mut order: Vec<usize> = (0..side).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let value = |at: usize| eigen.eigenvalues[order[at]];
    let spanned = (0..most).take_while(|&at| value(at) > LEAST * value(0)).count();
    if wanted > spanned {
        return Err(refused(spanned));
    }
    let components = each(
        0..wanted,
        || (),
        |(), at| {
            let vector = eigen.eigenvectors.column(order[at]);
            let mut component: Vec<f64> = if by_rows {
                let mut sum = vec![0.0; dim];
                for (weight, row) in vector.iter().zip(centred.chunks_exact(dim)) {
                    sum.iter_mut().zip(row).for_each(|(sum, &x)| *sum += weight * f64::from(x));
                }
                sum
            } else {
                vector.iter().copied().collect()
            };
            let length = component.iter().map(|x| x * x).sum::<f64>().sqrt();
            let largest = component
                .iter()
                .fold(0.0_f64, |most, &x| if x.abs() > most.abs() { x } else { most });
            let deviation = (value(at) / (count - 1) as f64).sqrt();
            let unit = largest.signum() / length / if whiten { deviation } else { 1.0 };
            for x in &mut component {
                *x *= unit;
            }
            Ok(component)
        },
    )?;
    Ok(components.concat().into_iter().map(|x| x as f32).collect())
}

/// Columns as rows.
fn transposed(rows: &[f32], dim: usize) -> Vec<f32> {
    let count = rows.len() / dim;
    let mut turned = vec![0.0; rows.len()];
    for (at, row) in rows.chunks_exact(dim).enumerate() {
        row.iter().enumerate().for_each(|(index, &x)| turned[index * count + at] = x);
    }
    turned
}
