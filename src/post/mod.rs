//! Post-processing of learned descriptors: steps that make a vector a better one (method 1.10).

mod chain;
mod fit;
#[cfg(feature = "pca")]
mod pca;
mod running;
mod running_snapshot;
mod step;
#[cfg(test)]
mod tests;

pub(crate) use chain::{ChainState, MAX_STEPS};
pub use chain::{Post, standardized};
pub use running::Running;
pub(crate) use step::FittedStep;
pub use step::Step;
