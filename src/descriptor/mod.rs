//! From images to descriptors (method 1.7), and what is done to those of others (method 2.2).
#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

#[cfg(target_arch = "x86_64")]
mod avx512;
mod describer;
#[cfg(feature = "image")]
mod files;
mod grey;
mod image;
#[cfg(test)]
mod naive;
mod passage;
mod patches;
mod post;
#[cfg(test)]
mod post_tests;
mod projection;
mod resize;
mod running;
mod running_snapshot;
mod sad;
mod source;
mod stage;
#[cfg(test)]
mod tests;
mod transpose;
mod whiten;

pub use describer::Describer;
#[cfg(feature = "image")]
pub use files::{ImageFiles, decode_image, read_image};
pub use image::{Channels, Image, ImageView};
pub(crate) use passage::Passage;
pub use post::{Post, Step, standardized};
pub use running::Running;
pub use sad::Sad;
pub use source::{ImageSource, Progress, describe_all};
pub(crate) use source::{describe_each, describe_into, go_on};
pub(crate) use stage::Stage;
