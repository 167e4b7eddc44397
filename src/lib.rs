//! Where am I on this route, and may I trust that answer?
//!
//! surefix matches a camera's frames to those of an earlier drive along the same route, and says of
//! each match whether to trust it. It implements Carson, Ford and Milford, *Unsupervised Quality
//! Prediction for Improved Single-Frame and Weighted Sequential Visual Place Recognition* (ICRA
//! 2023, arXiv 2307.01464): no training, no ground truth, any descriptor.
//!
//! - [`Map`] is the known route: one descriptor a place, from images ([`Map::from_images`]) or from
//!   any technique ([`Map::from_descriptors`]), kept as one file.
//! - [`Localizer`] is the robot's loop: a frame in, a [`Fix`] out. It allocates nothing on its way.
//! - [`Matcher`] is the paper by itself, for distances that are computed elsewhere.
//! - [`match_descriptors`] and [`match_distances`] do whole runs at once, with the same answers.
//!
//! ```
//! use std::sync::Arc;
//! use surefix_simulate::{Conditions, Route, RouteConfig};
//! use surefix::{Config, Localizer, Map, Sad, quiet};
//!
//! // A generated road stands in for two drives of your own: `ImageFiles::find("photos/monday")`.
//! let config = RouteConfig { places: 100, width: 64, height: 32, ..RouteConfig::default() };
//! let route = Route::new(config)?;
//! let summer = route.traverse(Conditions::reference())?;
//! let winter = route.traverse(Conditions::revisit())?;
//!
//! let map = Map::from_images(&summer, Sad::default(), &mut quiet)?;
//! let mut config = Config::default();
//! config.sequence_length = 5;
//! let mut localizer = Localizer::new(Arc::new(map), config)?;
//! for frame in 0..winter.len() {
//!     let fix = localizer.push_image(&winter.frame(frame))?;
//!     if fix.trusted {
//!         println!("frame {}: at place {}, score {:.3}", fix.frame, fix.place, fix.score);
//!     }
//! }
//! # Ok::<(), surefix::Error>(())
//! ```
//!
//! Data runs one way: a [`Sad`] makes an image a vector, a [`Metric`] compares it with the map's
//! rows, the [`Matcher`] turns distances into places, and [`evaluate`] places and the truth into
//! curves.
//!
//! Comments that say "method 1.3" mean a section of `docs/method.md` in the repository: the
//! mathematics, exactly.
//!
//! # Features
//!
//! None needs a C compiler. On by default:
//!
//! - `image`: read jpeg and png files (`ImageFiles`, `read_image`, `decode_image`).
//! - `mmap`: map a large map's file into memory instead of reading it (`Map::open_mapped`).
//! - `rayon`: build maps and match batches on all cores; without it the same answers come from one.
//! - `toml`: settings in files ([`Settings`]).
//!
//! Off by default, and on in the Python wheel:
//!
//! - `image-formats`: read bmp, pnm, tiff and webp files as well.
//! - `pca`: fit principal components ([`Step::Pca`]). A map that has them works without it.

#![cfg_attr(docsrs, feature(doc_cfg))]

mod archive;
mod batch;
mod bytes;
#[cfg(test)]
mod cases;
mod config;
mod descriptor;
mod distance;
mod dtype;
mod error;
mod image;
mod interrupt;
mod localizer;
mod loops;
mod map;
mod memory;
mod method;
mod motion;
mod numbers;
mod parallel;
mod plain;
mod post;
mod preallocated;
mod random;
mod regular;
mod scan;
mod segments;
mod settings;
mod simd;
mod sums;

pub mod calibration;
pub mod evaluate;
pub mod shard;

pub use crate::image::{
    Channels, Image, ImageSource, ImageView, Levels, Progress, ReadableImages, quiet,
};
#[cfg(feature = "image")]
pub use crate::image::{ImageFiles, Order, decode_image, max_pixels, read_image, set_max_pixels};
/// What the binding for Python writes its files with.
#[doc(hidden)]
pub mod saving {
    pub use crate::archive::{AtomicFile, AtomicFolder, is_stream, write_text};
}

pub use batch::{
    Alignment, Drive, Run, align_descriptors, align_distances, drive_distances, fused_distances,
    match_descriptors, match_distances, match_fused, match_fused_distances,
};
pub use config::{Config, Floor, Gradient};
pub use descriptor::{Describer, Sad, describe_all};
pub use distance::Metric;
pub use dtype::Dtype;
pub use error::Error;
pub use interrupt::interruptible;
pub use localizer::{Input, Localizer};
pub use loops::{Graph, LoopCloser, LoopClosure, LoopConfig, Poses};
pub use map::{Extras, Map, MapTraverse, Origin, Position, Positions, Recipe, Thumbnails};
pub use method::{Aligned, Fix, Given, Matcher, Peak, Sequence, Single, Track};
pub use motion::Motion;
pub use numbers::{Values, View};
pub use post::{Post, Running, Step, standardized};
pub use segments::{Segment, Segments};
pub use settings::{MapMark, Settings};
pub use simd::Isa;

/// The README's Rust is compiled as an example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// So is that of the documentation's page for robots.
#[cfg(doctest)]
#[doc = include_str!("../docs/howto/rust.md")]
struct RealTimePage;
