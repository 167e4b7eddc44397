#![allow(clippy::unwrap_used, clippy::panic, reason = "scratch")]
#[macro_use]
#[path = "all/options.rs"]
mod options;
#[path = "all/cases.rs"]
mod cases;
#[path = "../src/random.rs"]
mod random;
#[path = "all/shards.rs"]
mod shards;
