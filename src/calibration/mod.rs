//! Whether a threshold can be trusted: what is measured on one drive, for those after it.

mod alarm;

pub use alarm::Alarm;
