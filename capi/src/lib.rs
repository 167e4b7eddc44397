//! The C interface of surefix. `include/surefix.h` is made from these files, and
//! `include/surefix.hpp` wraps it for C++.
//!
//! A caller in C cannot be made to keep Rust's rules. So each function checks what can be checked
//! (NULL, alignment, lengths, numbers of enums), takes pointers only for the length of the call,
//! and answers a second thread instead of sharing a localizer with it. The rest, that a pointer
//! which is not NULL is good for the length that is said, is the contract of the header.
#![allow(unsafe_code, reason = "pointers of a caller in C")]
#![allow(
    clippy::doc_markdown,
    clippy::missing_safety_doc,
    reason = "the header has these comments as they stand, and is the contract"
)]

// In the order of the header.
pub mod door;

pub mod map;

pub mod options;

pub mod image;

pub mod fix;

pub mod localizer;

#[cfg(test)]
mod tests;

use std::ffi::c_char;

/// The version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn surefix_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}
