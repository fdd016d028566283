//! Which instructions the lanes use: chosen when the program runs.

use super::lanes::Doubles;

/// What computes in lanes, whatever their number.
pub(crate) trait Kernel {
    type Answer;
    /// Implementations are `#[inline(always)]`: the arithmetic must land in the function that enables the instructions.
    fn run<D: Doubles>(self) -> Self::Answer;
}

/// A set of instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Instructions {
    /// Those of any processor, one lane.
    Plain,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Instructions {
    /// The widest that this processor has.
    #[inline]
    pub(crate) fn widest() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Plain
    }

    /// All that this processor has.
    #[cfg(test)]
    pub(crate) fn all() -> Vec<Self> {
        let mut all = vec![Self::Plain];
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            all.push(Self::Avx2);
        }
        all
    }

    /// # Panics
    /// If this processor does not have them.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Answer {
        match self {
            Self::Plain => kernel.run::<f64>(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => {
                assert!(std::arch::is_x86_feature_detected!("avx2"));
                // SAFETY: the processor has AVX2.
                unsafe { run_avx2(kernel) }
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Answer {
    kernel.run::<super::lanes::avx::Four>()
}
