//! One step of post-processing that has been fitted: what it keeps, and what it does to a vector.

use super::post::Step;
use super::projection;
use super::whiten::principal;
use crate::distance::products;
use crate::error::Error;
use crate::isa::Isa;

/// The most numbers that a projection gives.
const MOST: usize = 1 << 20;

/// A step that knows what it does: all are `matrix (x - offset) scale`, or the division by the
/// length.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stage {
    pub(crate) step: Step,
    /// What is subtracted, a number a dimension; or nothing.
    pub(crate) offset: Vec<f64>,
    /// What is multiplied with, a number a dimension; or nothing.
    pub(crate) scale: Vec<f64>,
    /// Rows that are multiplied with; or nothing.
    pub(crate) matrix: Vec<f32>,
}

impl Stage {
    /// Without any numbers yet.
    pub(crate) fn new(step: Step) -> Self {
        Self { step, offset: Vec::new(), scale: Vec::new(), matrix: Vec::new() }
    }

    pub(super) fn fit(step: Step, rows: &[f32], dim: usize) -> Result<Self, Error> {
        let mut stage = Self::new(step);
        match step {
            Step::Standardize | Step::StandardizeRunning => {
                let (mean, deviation) = moments(rows, dim);
                stage.scale =
                    deviation.iter().map(|&s| if s > 0.0 { s.recip() } else { 0.0 }).collect();
                stage.offset = mean;
            }
            Step::Pca { dim: wanted, whiten } => {
                (stage.offset, stage.matrix) = principal(rows, dim, wanted, whiten)?;
            }
            Step::Projection { dim: wanted, seed } => {
                let refused = |expected: String| {
                    let (name, got) = ("projection dim", wanted.to_string());
                    Error::Option { name, expected, got }
                };
                if !(1..=MOST).contains(&wanted) {
                    return Err(refused(format!("from 1 to {MOST}")));
                }
                let signs = projection::signs(wanted, dim, seed);
                stage.matrix = signs.ok_or_else(|| {
                    refused(format!(
                        "so few that {dim} signs for each, of 4 bytes, fit into memory"
                    ))
                })?;
            }
            Step::Normalize => {}
        }
        Ok(stage)
    }

    /// What a vector is after this, for errors.
    pub(super) fn name(&self) -> &'static str {
        match self.step {
            Step::Standardize | Step::StandardizeRunning => "descriptor, standardized",
            Step::Pca { .. } => "descriptor, as principal components",
            Step::Projection { .. } => "descriptor, projected",
            Step::Normalize => "descriptor, normalized",
        }
    }

    /// How many numbers a vector has after this, of `input` before.
    pub(crate) fn output(&self, input: usize) -> usize {
        match self.step {
            Step::Pca { dim, .. } | Step::Projection { dim, .. } => dim,
            Step::Standardize | Step::StandardizeRunning | Step::Normalize => input,
        }
    }

    /// The variance of each dimension over the references, of a standardisation.
    pub(super) fn variances(&self) -> impl Iterator<Item = f64> {
        self.scale.iter().map(|&s| if s == 0.0 { 0.0 } else { (s * s).recip() })
    }

    /// Does the step, as to references; nothing for zeros that have no direction.
    pub(super) fn pass(&self, vector: &[f32], out: &mut Vec<f32>) -> Option<()> {
        out.clear();
        let dim = vector.len();
        match self.step {
            Step::Standardize | Step::StandardizeRunning => {
                let parts = vector.iter().zip(self.offset.iter().zip(&self.scale));
                out.extend(
                    parts.map(|(&x, (&offset, &scale))| ((f64::from(x) - offset) * scale) as f32),
                );
            }
            Step::Pca { dim: wanted, .. } => {
                // The centred vector first, and then the products behind it.
                out.extend(
                    vector.iter().zip(&self.offset).map(|(&x, &mean)| (f64::from(x) - mean) as f32),
                );
                out.resize(dim + wanted, 0.0);
                let (centred, coordinates) = out.split_at_mut(dim);
                products(Isa::best(), centred, &self.matrix, coordinates);
                out.drain(..dim);
            }
            Step::Projection { dim: wanted, .. } => {
                out.resize(wanted, 0.0);
                products(Isa::best(), vector, &self.matrix, out);
                let unit = (wanted as f64).sqrt().recip();
                for x in out.iter_mut() {
                    *x = (f64::from(*x) * unit) as f32;
                }
            }
            Step::Normalize => {
                let length = crate::distance::norm(vector.into());
                if length == 0.0 {
                    return None;
                }
                out.extend(vector.iter().map(|&x| (f64::from(x) / length) as f32));
            }
        }
        Some(())
    }
}

/// The mean of each dimension over the rows, and its population standard deviation: exactly 0 where
/// all are the same.
pub(super) fn moments(rows: &[f32], dim: usize) -> (Vec<f64>, Vec<f64>) {
    let count = (rows.len() / dim) as f64;
    let mut mean = vec![0.0; dim];
    for row in rows.chunks_exact(dim) {
        mean.iter_mut().zip(row).for_each(|(mean, &x)| *mean += f64::from(x));
    }
    for mean in &mut mean {
        *mean /= count;
    }
    let mut square = vec![0.0; dim];
    let mut differs = vec![false; dim];
    for row in rows.chunks_exact(dim) {
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
    (mean, deviation.collect())
}
