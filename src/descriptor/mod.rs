//! From images to descriptors (method 1.7).

#[cfg(feature = "image")]
mod files;
mod image;
mod resize;
mod sad;
mod source;
#[cfg(test)]
mod tests;

#[cfg(feature = "image")]
pub use files::{ImageFiles, read_image};
pub use image::{Channels, Image, ImageView};
pub use sad::{Describer, Sad};
pub use source::{ImageSource, Progress, describe_all};
pub(crate) use source::{describe_each, describe_into, go_on};
