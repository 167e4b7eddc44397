//! The instruction set as a value: chosen once, and forced by tests and benches.

use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicU8, Ordering};

use crate::error::Error;

/// An instruction set that the kernels are written for.
///
/// The best one of the CPU is chosen when a map, a matcher or a describer is made; the answers do
/// not depend on it, nor on the order in which a scan reads its rows, which is learned from the
/// times that it takes. The environment variable `SUREFIX_ISA` forces another one, such as `scalar`,
/// for a whole process.
/// ```
/// use surefix::Isa;
///
/// assert!(Isa::Scalar.is_available() && Isa::best().is_available());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Isa {
    /// Plain code for the compiler's target: the oracle of the others.
    Scalar,
    /// AVX2 on x86-64, with FMA and F16C: Haswell, Zen and later.
    Avx2,
    /// AVX-512 on x86-64, with F, BW, DQ, VL and VNNI: Ice Lake, Zen 4 and later.
    Avx512,
    /// NEON on 64-bit ARM.
    Neon,
}

impl Isa {
    /// All of them, from the plainest to the widest.
    pub const ALL: [Self; 4] = [Self::Scalar, Self::Neon, Self::Avx2, Self::Avx512];

    /// The one that `SUREFIX_ISA` names if this CPU has it, else the widest one of the CPU.
    /// Detected once.
    pub fn best() -> Self {
        // Its index in `ALL`; another number until it is known. Threads may find it twice, and none
        // waits for another, which a fork would leave behind.
        static BEST: AtomicU8 = AtomicU8::new(u8::MAX);
        if let Some(&best) = Self::ALL.get(usize::from(BEST.load(Ordering::Relaxed))) {
            return best;
        }
        let asked = std::env::var("SUREFIX_ISA").ok().and_then(|name| name.parse().ok());
        let widest = Self::available().last().unwrap_or(Self::Scalar);
        let best = asked.filter(|isa: &Self| isa.is_available()).unwrap_or(widest);
        let index = Self::ALL.iter().position(|&isa| isa == best).unwrap_or(usize::MAX);
        BEST.store(u8::try_from(index).unwrap_or(u8::MAX), Ordering::Relaxed);
        best
    }

    /// Those of this CPU, from the plainest to the widest.
    pub fn available() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|isa| isa.is_available())
    }

    /// Whether this CPU has it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => {
                std::arch::is_x86_feature_detected!("avx2")
                    && std::arch::is_x86_feature_detected!("fma")
                    && std::arch::is_x86_feature_detected!("f16c")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && std::arch::is_x86_feature_detected!("avx512f")
                    && std::arch::is_x86_feature_detected!("avx512bw")
                    && std::arch::is_x86_feature_detected!("avx512dq")
                    && std::arch::is_x86_feature_detected!("avx512vl")
                    && std::arch::is_x86_feature_detected!("avx512vnni")
            }
            #[cfg(target_arch = "aarch64")]
            Self::Neon => std::arch::is_aarch64_feature_detected!("neon"),
            #[allow(unreachable_patterns, reason = "those of the other processors")]
            _ => false,
        }
    }

    /// The same instruction set, if this CPU has it.
    ///
    /// # Errors
    /// [`Error::Option`] if it lacks it.
    pub fn checked(self) -> Result<Self, Error> {
        if self.is_available() {
            return Ok(self);
        }
        let names: Vec<String> = Self::available().map(|isa| isa.to_string()).collect();
        let expected = format!("an instruction set of this processor: {}", names.join(", "));
        Err(Error::Option { name: "isa", expected, got: self.to_string() })
    }

    /// Runs `work`, compiled for this instruction set: plain code that is inlined into it uses the
    /// wider registers. Runs as [`Isa::Scalar`] if the CPU lacks the instruction set.
    #[inline]
    pub(crate) fn run<W: Compiled>(self, work: W) -> W::Out {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 if self.is_available() => x86::avx2(work),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if self.is_available() => x86::avx512(work),
            _ => work.run(),
        }
    }
}

/// Prefetches memory that will be read soon. Only a hint: any address is allowed.
#[inline(always)]
pub(crate) fn fetch<T>(ahead: *const T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: SSE is part of x86-64, and a prefetch reads nothing that the program can see.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(ahead.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = ahead;
}

/// Work that [`Isa::run`] compiles for each instruction set: a short closure, or a type whose `run`
/// is marked `#[inline(always)]`. Of a longer closure the compiler may keep a single copy, for the
/// plainest instruction set.
pub(crate) trait Compiled {
    type Out;

    fn run(self) -> Self::Out;
}

impl<R, F: FnOnce() -> R> Compiled for F {
    type Out = R;

    #[inline(always)]
    fn run(self) -> R {
        self()
    }
}

/// Functions that are compiled for one instruction set.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Compiled;

    macro_rules! compiled {
        ($name:ident, $features:literal) => {
            pub(super) fn $name<W: Compiled>(work: W) -> W::Out {
                #[target_feature(enable = $features)]
                fn inside<W: Compiled>(work: W) -> W::Out {
                    work.run()
                }
                // SAFETY: `Isa::run`, the only caller, has just asked the CPU.
                unsafe { inside(work) }
            }
        };
    }
    compiled!(avx2, "avx2");
    compiled!(avx512, "avx2,avx512f,avx512bw,avx512dq,avx512vl,avx512vnni");
}

impl fmt::Display for Isa {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Neon => "neon",
        })
    }
}

impl FromStr for Isa {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|isa| isa.to_string() == name).ok_or_else(|| Error::Option {
            name: "isa",
            expected: "\"scalar\", \"avx2\", \"avx512\" or \"neon\"".to_owned(),
            got: format!("{name:?}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_read_back_and_another_is_refused() {
        for isa in Isa::ALL {
            assert_eq!(isa.to_string().parse::<Isa>().unwrap(), isa);
        }
        let error = "sse9".parse::<Isa>().unwrap_err().to_string();
        assert!(error.contains("avx512") && error.contains("sse9"), "{error}");
    }

    #[test]
    fn the_plain_one_is_everywhere_and_what_is_chosen_is_there() {
        assert_eq!(Isa::available().next(), Some(Isa::Scalar));
        assert!(Isa::best().is_available());
        assert!(Isa::available().all(|isa| isa.checked().is_ok()));
    }

    #[test]
    fn work_runs_once_on_each_whether_it_is_there_or_not() {
        for isa in Isa::ALL {
            assert_eq!(isa.run(|| (1..=100).sum::<i32>()), 5050);
        }
    }

    #[test]
    fn one_that_is_missing_is_refused_with_those_that_are_there() {
        for isa in Isa::ALL.into_iter().filter(|isa| !isa.is_available()) {
            let error = isa.checked().unwrap_err().to_string();
            assert!(error.contains("scalar") && error.contains(&isa.to_string()), "{error}");
        }
    }
}
