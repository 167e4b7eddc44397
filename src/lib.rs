//! Where am I on this route, and may I trust that answer?

#![cfg_attr(docsrs, feature(doc_cfg))]

mod batch;
mod config;
mod error;
mod localizer;
mod map;
mod matcher;
mod parallel;

pub mod descriptor;
pub mod distance;
pub mod evaluate;
pub mod simulate;

pub use batch::{Run, match_descriptors, match_distances};
pub use config::{Config, Floor, Gradient};
pub use descriptor::{Channels, Image, ImageSource, ImageView, Sad};
#[cfg(feature = "image")]
pub use descriptor::{ImageFiles, read_image};
pub use distance::{Dtype, Metric, Values, View};
pub use error::Error;
pub use localizer::Localizer;
pub use map::{Map, Positions, Recipe};
pub use matcher::{Fix, Matcher, Peak, Sequence, Single};
