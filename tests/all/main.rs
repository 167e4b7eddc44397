//! The library from outside, in one program: what it promises, held by properties and examples.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot be set up has failed")]

#[macro_use]
mod options;

mod bad_input;
mod belief;
mod blank;
mod bootstrap;
mod calibration;
mod cases;
mod drive;
mod evaluate;
mod evidence;
mod filter;
mod fused;
mod gaps;
// On one core the drives take minutes.
#[cfg(feature = "rayon")]
mod generated_route;
#[cfg(feature = "image")]
mod image_files;
mod instruction_sets;
mod judge;
mod loop_edges;
mod loops;
mod map_file;
#[cfg(unix)]
mod map_file_unix;
mod map_images;
mod map_long;
#[cfg(all(feature = "mmap", target_endian = "little"))]
mod map_mapped;
mod map_parts;
mod map_positions;
mod map_segments;
mod never_panics;
mod paper;
mod plain;
mod post;
mod promises;
#[path = "../../src/random.rs"]
mod random;
mod sad;
mod sad_bits;
mod screen;
mod segments;
#[cfg(feature = "toml")]
mod settings;
mod shard_snapshot;
mod shards;
mod snapshot;
mod steps;
mod stream_is_batch;
mod threads;
mod thresholds;
mod track;
mod traverses;
mod truth;
