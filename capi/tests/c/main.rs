//! Programs in C and C++ on the built library, as their users install it (Linux).
#![cfg(target_os = "linux")]
#![allow(clippy::panic, clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod drives;
mod hardened;
mod library;
mod packages;
mod route;
