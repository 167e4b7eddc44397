//! The kernels' instruction sets, and registers that look the same on each.
#![allow(
    clippy::inline_always,
    reason = "what is inlined is compiled for the caller's instruction set"
)]

/// Intrinsics, in the methods of a [`Machine`].
macro_rules! intrinsics {
    ($call:expr) => {
        // SAFETY: a machine's value exists only if the CPU has its instructions, and a load or a
        // store stays inside the array that it is given.
        unsafe { $call }
    };
}

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod dispatch;
mod isa;
mod machine;
#[cfg(target_arch = "aarch64")]
mod neon;
pub(crate) mod scalar;

pub(crate) use dispatch::run;
pub use isa::Isa;
pub(crate) use isa::{Compiled, fetch};
pub(crate) use machine::{BLOCK, Byte, Kernel, LANES, Machine, Number};
