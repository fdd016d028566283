//! Which instructions the lanes use: chosen when the program runs.

use super::lanes::{Doubles, Singles};

/// What computes in lanes, whatever their number.
pub(crate) trait Kernel {
    type Answer;
    /// Implementations are `#[inline(always)]`: the arithmetic must land in the function that enables the instructions.
    fn run<D: Doubles, S: Singles>(self) -> Self::Answer;
}

/// A set of instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Instructions {
    /// Those of any processor, one lane.
    Plain,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// Only those of its foundation (F).
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Instructions {
    /// All that there are.
    #[cfg(test)]
    pub(crate) const KNOWN: &[Self] = &[
        Self::Plain,
        #[cfg(target_arch = "x86_64")]
        Self::Avx2,
        #[cfg(target_arch = "x86_64")]
        Self::Avx512,
    ];

    /// Whether this processor has them.
    #[inline]
    pub(crate) fn are_there(self) -> bool {
        match self {
            Self::Plain => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => std::arch::is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => std::arch::is_x86_feature_detected!("avx512f"),
        }
    }

    /// The widest that this processor has.
    #[inline]
    pub(crate) fn widest() -> Self {
        #[cfg(target_arch = "x86_64")]
        for wide in [Self::Avx512, Self::Avx2] {
            if wide.are_there() {
                return wide;
            }
        }
        Self::Plain
    }

    /// # Panics
    /// If this processor does not have them.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Answer {
        assert!(self.are_there(), "no {self:?} in this processor");
        match self {
            Self::Plain => kernel.run::<f64, f32>(),
            // SAFETY: the processor has AVX2.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { run_avx2(kernel) },
            // SAFETY: the processor has AVX-512 F.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { run_avx512(kernel) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Answer {
    use super::lanes::avx::{Eight, Four};
    kernel.run::<Four, Eight>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn run_avx512<K: Kernel>(kernel: K) -> K::Answer {
    use super::lanes::avx512::{Eight, Sixteen};
    kernel.run::<Eight, Sixteen>()
}
