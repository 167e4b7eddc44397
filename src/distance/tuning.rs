//! The order in which a scan reads its rows: it decides the speed, and nothing of the answers.
//!
//! The fastest order depends on the processor, which is asked once who made it. On AMD's Zen, two
//! rows side by side keep its own prefetch from following either. So rows of f32 beyond the cache
//! are read one after the other there, and prefetched further ahead: that takes 0.85 of the time.
//! In the cache two are faster, since the sums of one row wait for each other. Rows of f16 cost
//! their conversion: with four rows, that of the query is shared.

#[cfg(target_arch = "x86_64")]
use std::sync::atomic::{AtomicU8, Ordering};

/// Bytes of rows that surely lie in a Zen's last cache, beside other data.
const CACHED: usize = 16 << 20;

/// How a scan reads rows of floats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Reading {
    /// Rows that are read side by side: 1, 2 or 4.
    pub(super) rows: usize,
    /// Memory is prefetched this many bytes before it is read: by itself the CPU stops at the end
    /// of a page.
    pub(super) ahead: usize,
}

/// How a scan reads rows of each type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tuning {
    pub(super) f32s: Reading,
    /// Of f16, and of bytes that are compared as floats.
    pub(super) narrow: Reading,
    /// How far bytes that are compared as such are prefetched ahead.
    pub(super) bytes: usize,
}

impl Tuning {
    const USUAL: Self = Self {
        f32s: Reading { rows: 2, ahead: 2560 },
        narrow: Reading { rows: 1, ahead: 4096 },
        bytes: 2048,
    };
    const ZEN: Self = Self { narrow: Reading { rows: 4, ahead: 4096 }, ..Self::USUAL };
    const ZEN_BEYOND_THE_CACHE: Self =
        Self { f32s: Reading { rows: 1, ahead: 12_288 }, bytes: 8192, ..Self::ZEN };

    /// All that are chosen from.
    #[cfg(test)]
    pub(crate) const ALL: [Self; 3] = [Self::USUAL, Self::ZEN, Self::ZEN_BEYOND_THE_CACHE];

    /// For a map of this many bytes of rows, on this processor.
    pub(crate) fn of(bytes: usize) -> Self {
        match is_zen() {
            false => Self::USUAL,
            true if bytes <= CACHED => Self::ZEN,
            true => Self::ZEN_BEYOND_THE_CACHE,
        }
    }
}

/// Whether the processor is AMD's: those with AVX2 are of the Zen family, but for one before it.
#[cfg(target_arch = "x86_64")]
fn is_zen() -> bool {
    // Under a hypervisor the question takes microseconds. Threads may ask twice, and none waits for
    // another, which a fork would leave behind.
    const UNKNOWN: u8 = 2;
    static ANSWER: AtomicU8 = AtomicU8::new(UNKNOWN);
    match ANSWER.load(Ordering::Relaxed) {
        UNKNOWN => {
            let zen = vendor() == *b"AuthenticAMD";
            ANSWER.store(u8::from(zen), Ordering::Relaxed);
            zen
        }
        answer => answer == 1,
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn is_zen() -> bool {
    false
}

/// The processor's maker, as it names itself.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, unused_unsafe, reason = "the intrinsic is safe in newer versions of Rust")]
fn vendor() -> [u8; 12] {
    // SAFETY: every x86-64 has this instruction.
    let said = unsafe { std::arch::x86_64::__cpuid(0) };
    let [a, b, c] = [said.ebx, said.edx, said.ecx].map(u32::to_le_bytes);
    std::array::from_fn(|at| [a, b, c][at / 4][at % 4])
}
