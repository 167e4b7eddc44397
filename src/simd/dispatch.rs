//! The choice of the registers that a kernel runs on.

use super::isa::Isa;
use super::machine::{Kernel, Machine as _};

/// Runs the kernel on an instruction set. One that this processor lacks runs as [`Isa::Scalar`].
pub(crate) fn run(isa: Isa, kernel: impl Kernel) {
    match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => match super::avx512::Avx512::new() {
            Some(machine) => machine.run(kernel),
            None => kernel.scalar(),
        },
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => match super::avx2::Avx2::new() {
            Some(machine) => machine.run(kernel),
            None => kernel.scalar(),
        },
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => match super::neon::Neon::new() {
            Some(machine) => machine.run(kernel),
            None => kernel.scalar(),
        },
        _ => kernel.scalar(),
    }
}
