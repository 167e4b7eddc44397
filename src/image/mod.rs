//! Images, borrowed, owned and from files, made grey and small.
#![allow(
    clippy::inline_always,
    reason = "only inlined functions are compiled for the instruction set"
)]

#[cfg(target_arch = "x86_64")]
mod avx512;
mod axis;
#[cfg(feature = "image")]
mod decode;
#[cfg(feature = "image")]
mod doubts;
#[cfg(feature = "image")]
mod drives;
#[cfg(feature = "image")]
mod files;
mod grey;
mod levels;
#[cfg(feature = "image")]
mod limit;
#[cfg(feature = "image")]
mod order;
#[cfg(feature = "image")]
mod orientation;
mod readable;
mod resize;
#[cfg(feature = "image")]
mod several;
mod source;
mod view;

#[cfg(feature = "image")]
pub use decode::{decode_image, read_image};
#[cfg(feature = "image")]
pub use files::ImageFiles;
pub use levels::Levels;
#[cfg(feature = "image")]
pub use limit::{max_pixels, set_max_pixels};
#[cfg(feature = "image")]
pub use order::Order;
pub use readable::ReadableImages;
pub(crate) use resize::Resize;
pub(crate) use source::go_on;
pub use source::{ImageSource, Progress, quiet};
pub use view::{Channels, Image, ImageView};
