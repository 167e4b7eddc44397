//! How good the answers are: exact precision-recall curves and figures of them (method 1.8).

mod bootstrap;
mod correlation;
mod curve;
mod recall_at;
mod trust;
mod truth;

pub use bootstrap::{Bootstrap, Interval};
pub use correlation::{block_length, correlation_time};
pub use curve::{BestF1, Curve, Match, Point, Recall, evaluate};
pub use recall_at::recall_at;
pub use trust::{TrustTable, evaluate_trust};
pub use truth::{Truth, Verdict};
