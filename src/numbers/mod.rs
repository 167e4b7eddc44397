//! Descriptors' numbers, owned and borrowed.

mod view;

pub use view::{Values, View};
pub(crate) use view::{each_type, first_not_finite};
