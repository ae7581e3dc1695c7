//! Compiling code once per instruction set, and choosing the widest that the processor has.

#[cfg(target_arch = "x86_64")]
use pulp::x86::{V2, V3, V4};

use super::InstructionSet;

/// Code for any instruction set.
pub(crate) trait Kernel {
    /// Must be `#[inline(always)]`.
    fn run<S: InstructionSet>(self, simd: S);
}

/// The instruction sets that code is compiled for.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Level {
    #[cfg(target_arch = "x86_64")]
    Avx512(V4),
    #[cfg(target_arch = "x86_64")]
    Avx2(V3),
    #[cfg(target_arch = "x86_64")]
    Sse(V2),
    #[cfg(target_arch = "aarch64")]
    Neon(pulp::aarch64::Neon),
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    Portable(pulp::Scalar128b),
}

impl Level {
    /// Those of this processor, widest first.
    pub fn available() -> Vec<Level> {
        let levels = [
            #[cfg(target_arch = "x86_64")]
            V4::try_new().map(Level::Avx512),
            #[cfg(target_arch = "x86_64")]
            V3::try_new().map(Level::Avx2),
            #[cfg(target_arch = "x86_64")]
            V2::try_new().map(Level::Sse),
            #[cfg(target_arch = "aarch64")]
            pulp::aarch64::Neon::try_new().map(Level::Neon),
            #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
            Some(Level::Portable(pulp::Scalar128b)),
        ];
        levels.into_iter().flatten().collect()
    }

    /// Its usual name.
    pub fn name(self) -> &'static str {
        match self {
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(_) => "AVX-512",
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(_) => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Level::Sse(_) => "SSE4.2",
            #[cfg(target_arch = "aarch64")]
            Level::Neon(_) => "NEON",
            #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
            Level::Portable(_) => "none",
        }
    }

    /// Runs code that was compiled for this instruction set.
    #[inline(always)]
    pub fn run(self, kernel: impl Kernel) {
        match self {
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(simd) => simd.vectorize(Inlined(kernel, simd)),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => simd.vectorize(Inlined(kernel, simd)),
            #[cfg(target_arch = "x86_64")]
            Level::Sse(simd) => simd.vectorize(Inlined(kernel, simd)),
            #[cfg(target_arch = "aarch64")]
            Level::Neon(simd) => simd.vectorize(Inlined(kernel, simd)),
            #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
            Level::Portable(simd) => pulp::Simd::vectorize(simd, Inlined(kernel, simd)),
        }
    }
}

impl Default for Level {
    fn default() -> Level {
        Level::available()[0]
    }
}

/// A kernel for one instruction set. A closure would do, but a closure is not always inlined.
struct Inlined<K, S>(K, S);

impl<K: Kernel, S: InstructionSet> pulp::NullaryFnOnce for Inlined<K, S> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        self.0.run(self.1);
    }
}
