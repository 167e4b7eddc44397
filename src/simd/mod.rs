//! The kernels' instruction sets, and registers that look the same on each.
//!
//! What works on registers here and in `distance` is loops over indices: `zip`, `map` on arrays and
//! closures are functions, which a build without link-time optimisation may compile by themselves,
//! for the plainest instruction set.
#![allow(
    clippy::inline_always,
    clippy::wildcard_imports,
    unsafe_code,
    reason = "inlined for the caller's instruction set; intrinsics have prefixes"
)]

/// A machine's type: its value proves that the CPU has the instruction set of that name.
macro_rules! instruction_set {
    ($name:ident, $features:literal) => {
        #[derive(Clone, Copy)]
        pub(super) struct $name(());

        impl $name {
            /// `None` if the CPU lacks it.
            pub(super) fn new() -> Option<Self> {
                Isa::$name.is_available().then_some(Self(()))
            }
        }

        #[target_feature(enable = $features)]
        fn inside<K: Kernel>(machine: $name, kernel: K) {
            kernel.simd(machine);
        }
    };
}

/// Intrinsics, in the methods of a [`Machine`].
macro_rules! intrinsics {
    ($call:expr) => {
        // SAFETY: a machine's value exists only if the CPU has its instructions, and a load or a
        // store stays inside the array that it is given.
        unsafe { $call }
    };
}

/// An array with the intrinsics of each part, written out.
macro_rules! parts {
    ([$($at:literal)*] |$part:ident| $call:expr) => {
        [$({
            let $part: usize = $at;
            intrinsics!($call)
        }),*]
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
