//! From images to descriptors (method 1.7).
#![allow(
    clippy::inline_always,
    reason = "only inlined functions are compiled for the instruction set"
)]

mod describe;
mod patches;
mod sad;

pub(crate) use describe::DescriberPool;
pub use describe::describe_all;
pub use sad::{Describer, Sad};
