//! Four lanes of f64: the instructions of the processor where it has AVX, plain arrays elsewhere. Both do the same operations
//! in the same order without fused multiply–add, so they give the same bits.

#![allow(
    clippy::inline_always,
    reason = "compiled once per instruction set: only inlined code has the caller's features"
)]

use super::Lanes;

/// Four f64 that are added and multiplied lane by lane.
///
/// # Safety
/// Implementations may need processor features: call methods only inside a function compiled for them.
pub(crate) unsafe trait Four: Copy {
    /// # Safety
    /// The processor has the implementation's features.
    unsafe fn zero() -> Self;
    /// # Safety
    /// As `zero`; four values can be read at `from`.
    unsafe fn load(from: *const f64) -> Self;
    /// # Safety
    /// As `zero`.
    unsafe fn splat(value: f64) -> Self;
    /// # Safety
    /// As `zero`.
    unsafe fn add(self, other: Self) -> Self;
    /// # Safety
    /// As `zero`.
    unsafe fn multiply(self, other: Self) -> Self;
    /// # Safety
    /// As `zero`.
    unsafe fn lanes(self) -> Lanes;
}

/// The portable implementation.
#[derive(Clone, Copy)]
pub(crate) struct Array([f64; 4]);

// SAFETY: needs no processor feature.
unsafe impl Four for Array {
    #[inline(always)]
    unsafe fn zero() -> Self {
        Self([0.0; 4])
    }

    #[inline(always)]
    unsafe fn load(from: *const f64) -> Self {
        // SAFETY: four values can be read, by contract.
        Self(unsafe { from.cast::<[f64; 4]>().read_unaligned() })
    }

    #[inline(always)]
    unsafe fn splat(value: f64) -> Self {
        Self([value; 4])
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|l| self.0[l] + other.0[l]))
    }

    #[inline(always)]
    unsafe fn multiply(self, other: Self) -> Self {
        Self(std::array::from_fn(|l| self.0[l] * other.0[l]))
    }

    #[inline(always)]
    unsafe fn lanes(self) -> Lanes {
        Lanes(self.0)
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use avx::Avx;

#[cfg(target_arch = "x86_64")]
mod avx {
    use std::arch::x86_64::{
        __m256d, _mm256_add_pd, _mm256_loadu_pd, _mm256_mul_pd, _mm256_set1_pd, _mm256_setzero_pd,
        _mm256_store_pd,
    };

    use super::{Four, Lanes};

    /// 256-bit registers.
    #[derive(Clone, Copy)]
    pub(crate) struct Avx(__m256d);

    // SAFETY: the methods need AVX, which the trait's contract asks for.
    unsafe impl Four for Avx {
        #[inline(always)]
        unsafe fn zero() -> Self {
            // SAFETY: the processor has AVX, by contract.
            Self(unsafe { _mm256_setzero_pd() })
        }

        #[inline(always)]
        unsafe fn load(from: *const f64) -> Self {
            // SAFETY: the processor has AVX and four values can be read, by contract.
            Self(unsafe { _mm256_loadu_pd(from) })
        }

        #[inline(always)]
        unsafe fn splat(value: f64) -> Self {
            // SAFETY: the processor has AVX, by contract.
            Self(unsafe { _mm256_set1_pd(value) })
        }

        #[inline(always)]
        unsafe fn add(self, other: Self) -> Self {
            // SAFETY: the processor has AVX, by contract.
            Self(unsafe { _mm256_add_pd(self.0, other.0) })
        }

        #[inline(always)]
        unsafe fn multiply(self, other: Self) -> Self {
            // SAFETY: the processor has AVX, by contract.
            Self(unsafe { _mm256_mul_pd(self.0, other.0) })
        }

        #[inline(always)]
        unsafe fn lanes(self) -> Lanes {
            let mut out = Lanes::ZERO;
            // SAFETY: the processor has AVX, by contract; `Lanes` is 32-byte aligned with four values.
            unsafe { _mm256_store_pd(out.0.as_mut_ptr(), self.0) };
            out
        }
    }
}

/// Whether the processor has AVX.
#[inline]
pub(crate) fn has_avx() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        std::arch::is_x86_feature_detected!("avx")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}
