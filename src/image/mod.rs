//! Images, borrowed, owned and from files, made grey and small.
#![allow(
    clippy::inline_always,
    reason = "only inlined functions are compiled for the instruction set"
)]

#[cfg(target_arch = "x86_64")]
mod avx512;
mod axis;
#[cfg(feature = "image")]
mod files;
mod grey;
mod resize;
mod source;
mod view;

#[cfg(feature = "image")]
pub use files::{ImageFiles, decode_image, read_image};
pub(crate) use resize::Resize;
pub(crate) use source::go_on;
pub use source::{ImageSource, Progress, quiet};
pub use view::{Channels, Image, ImageView};
