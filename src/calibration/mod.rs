//! Trust with a number on it (method 1.12): thresholds with a promise, and probabilities.

mod alarm;
mod binomial;
mod blocks;
mod calibrate;
mod probability;
mod quantiles;
mod threshold;

pub use alarm::Alarm;
pub use calibrate::{Calibrate, calibrate, wrong_by_truth};
pub use probability::Probability;
pub use quantiles::Quantiles;
pub use threshold::Threshold;
