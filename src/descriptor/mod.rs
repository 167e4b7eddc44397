//! From images to descriptors (method 1.7).
#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

mod describe;
#[cfg(test)]
mod naive;
mod patches;
mod sad;
#[cfg(test)]
mod tests;

pub use describe::describe_all;
pub(crate) use describe::{describe_each, describe_into};
pub use sad::{Describer, Sad};
