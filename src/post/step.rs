//! One step of post-processing: as it is asked for, and fitted.

use serde::{Deserialize, Serialize};

use crate::distance::{norm, products};
use crate::simd::Isa;

/// One step of post-processing. In a chain, each works on the result of the one before.
///
/// As JSON: `{"step": "standardize"}`, `{"step": "standardize_running"}`, `{"step": "pca", "dim":
/// 512, "whiten": true}`, `{"step": "normalize"}`, `{"step": "projection", "dim": 512, "seed": 0}`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "step", rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Step {
    /// Each dimension less its mean over the references, in units of its population standard
    /// deviation; 0 if all references have the same number.
    Standardize,
    /// The references as by [`Standardize`](Self::Standardize); each query of a drive by the mean
    /// and the deviation of the drive's queries so far, which begin with the references' own as if
    /// those were one query ([`Running::after`](super::Running::after)). A
    /// [`Localizer`](crate::Localizer) keeps these, in its snapshots too.
    StandardizeRunning,
    /// The coordinates along the `dim` directions in which the references differ most (principal
    /// component analysis).
    Pca {
        /// Their number, at most that of the dimensions that the references span.
        dim: usize,
        /// Whether each is divided by its standard deviation over the references (with `n - 1`).
        whiten: bool,
    },
    /// To the length 1.
    Normalize,
    /// The products with `dim` vectors of random signs, divided by `sqrt(dim)`: distances stay
    /// about what they are (Achlioptas, 2003).
    Projection {
        /// Their number.
        dim: usize,
        /// Which signs.
        seed: u64,
    },
}

/// A fitted step: `matrix (x - offset) scale`, or the division by the length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct FittedStep {
    pub(crate) step: Step,
    /// Is subtracted, a number a dimension; or empty.
    pub(crate) offset: Vec<f64>,
    /// Is multiplied with, a number a dimension; or empty.
    pub(crate) scale: Vec<f64>,
    /// Rows that are multiplied with; or empty.
    pub(crate) matrix: Vec<f32>,
}

impl FittedStep {
    /// Without any numbers yet.
    pub(crate) fn new(step: Step) -> Self {
        Self { step, offset: Vec::new(), scale: Vec::new(), matrix: Vec::new() }
    }

    /// The name of its result, for errors.
    pub(super) fn name(&self) -> &'static str {
        match self.step {
            Step::Standardize | Step::StandardizeRunning => "descriptor, standardized",
            Step::Pca { .. } => "descriptor, as principal components",
            Step::Projection { .. } => "descriptor, projected",
            Step::Normalize => "descriptor, normalized",
        }
    }

    /// The numbers of a vector after this, of `input` before.
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

    /// Applies the step as to references; `None` if it is to divide by a length of 0.
    pub(super) fn apply(&self, vector: &[f32], out: &mut Vec<f32>) -> Option<()> {
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
                let length = norm(vector.into());
                if length == 0.0 {
                    return None;
                }
                out.extend(vector.iter().map(|&x| (f64::from(x) / length) as f32));
            }
        }
        Some(())
    }
}
