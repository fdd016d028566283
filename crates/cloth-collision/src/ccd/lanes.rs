//! Several pairs at once: the arithmetic of the filters over one or four lanes, bit for bit the same.

use crate::Vec3;
use std::ops::{Add, BitAnd, BitOr, Mul, Sub};

/// Numbers in lanes. Only operations that IEEE 754 rounds correctly, so that a lane gives what one number gives.
pub(crate) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + std::ops::Div<Output = Self>
{
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;
    fn splat(x: f64) -> Self;
    fn abs(self) -> Self;
    fn sqrt(self) -> Self;
    /// The smaller one; `other` if a lane is not a number.
    fn min(self, other: Self) -> Self;
    /// The larger one; `other` if a lane is not a number.
    fn max(self, other: Self) -> Self;
    /// False where a lane is not a number.
    fn greater(self, other: Self) -> Self::Mask;
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
}

impl Lanes for f64 {
    type Mask = bool;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn greater(self, other: Self) -> bool {
        self > other
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

/// Three coordinates in lanes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vector<L>(pub(crate) [L; 3]);

impl<L: Lanes> Vector<L> {
    #[inline(always)]
    pub(crate) fn dot(self, o: Self) -> L {
        self.0[0] * o.0[0] + self.0[1] * o.0[1] + self.0[2] * o.0[2]
    }
    #[inline(always)]
    pub(crate) fn cross(self, o: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, o.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }
    #[inline(always)]
    pub(crate) fn scale(self, s: L) -> Self {
        Self([self.0[0] * s, self.0[1] * s, self.0[2] * s])
    }
    /// Largest absolute coordinate.
    #[inline(always)]
    pub(crate) fn largest(self) -> L {
        self.0[0].abs().max(self.0[1].abs()).max(self.0[2].abs())
    }
    /// Sum of the absolute coordinates.
    #[inline(always)]
    pub(crate) fn sum_of_sizes(self) -> L {
        self.0[0].abs() + self.0[1].abs() + self.0[2].abs()
    }
    #[inline(always)]
    pub(crate) fn select(mask: L::Mask, yes: Self, no: Self) -> Self {
        Self([
            L::select(mask, yes.0[0], no.0[0]),
            L::select(mask, yes.0[1], no.0[1]),
            L::select(mask, yes.0[2], no.0[2]),
        ])
    }
}

impl<L: Lanes> Add for Vector<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self([self.0[0] + o.0[0], self.0[1] + o.0[1], self.0[2] + o.0[2]])
    }
}

impl<L: Lanes> Sub for Vector<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self([self.0[0] - o.0[0], self.0[1] - o.0[1], self.0[2] - o.0[2]])
    }
}

impl From<Vec3> for Vector<f64> {
    #[inline(always)]
    fn from(v: Vec3) -> Self {
        Self([v.x, v.y, v.z])
    }
}

/// Four lanes in an AVX register. Values exist only in functions compiled for AVX2, which the methods are inlined
/// into.
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx {
    use super::Lanes;
    use std::arch::x86_64 as arch;
    use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Four(arch::__m256d);

    #[derive(Debug, Clone, Copy)]
    pub(crate) struct FourMask(arch::__m256d);

    impl Four {
        /// The first three entries of four rows, by entry.
        ///
        /// # Safety
        /// The processor has AVX2.
        #[inline(always)]
        pub(crate) unsafe fn load_transposed(rows: [&[f64; 4]; 4]) -> [Self; 3] {
            // SAFETY: 32 readable bytes in each row; AVX2 by the caller's promise.
            unsafe {
                let [a, b, c, d] = [
                    arch::_mm256_loadu_pd(rows[0].as_ptr()),
                    arch::_mm256_loadu_pd(rows[1].as_ptr()),
                    arch::_mm256_loadu_pd(rows[2].as_ptr()),
                    arch::_mm256_loadu_pd(rows[3].as_ptr()),
                ];
                let (ab_xz, ab_y) = (arch::_mm256_unpacklo_pd(a, b), arch::_mm256_unpackhi_pd(a, b));
                let (cd_xz, cd_y) = (arch::_mm256_unpacklo_pd(c, d), arch::_mm256_unpackhi_pd(c, d));
                [
                    Self(arch::_mm256_permute2f128_pd::<0x20>(ab_xz, cd_xz)),
                    Self(arch::_mm256_permute2f128_pd::<0x20>(ab_y, cd_y)),
                    Self(arch::_mm256_permute2f128_pd::<0x31>(ab_xz, cd_xz)),
                ]
            }
        }
    }

    impl FourMask {
        /// Bit per lane.
        #[inline(always)]
        pub(crate) fn bits(self) -> u32 {
            // SAFETY: a mask exists only where the processor has AVX2.
            unsafe { arch::_mm256_movemask_pd(self.0) as u32 }
        }
    }

    macro_rules! binary {
        ($type:ident, $trait:ident, $method:ident, $intrinsic:ident) => {
            impl $trait for $type {
                type Output = Self;
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    // SAFETY: a value exists only where the processor has AVX2.
                    Self(unsafe { arch::$intrinsic(self.0, other.0) })
                }
            }
        };
    }
    binary!(Four, Add, add, _mm256_add_pd);
    binary!(Four, Sub, sub, _mm256_sub_pd);
    binary!(Four, Mul, mul, _mm256_mul_pd);
    binary!(Four, Div, div, _mm256_div_pd);
    binary!(FourMask, BitAnd, bitand, _mm256_and_pd);
    binary!(FourMask, BitOr, bitor, _mm256_or_pd);

    // SAFETY of the blocks below: values exist only where the processor has AVX2; `splat` is called only from there.
    impl Lanes for Four {
        type Mask = FourMask;

        #[inline(always)]
        fn splat(x: f64) -> Self {
            // SAFETY: see above.
            Self(unsafe { arch::_mm256_set1_pd(x) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see above.
            Self(unsafe { arch::_mm256_andnot_pd(arch::_mm256_set1_pd(-0.0), self.0) })
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: see above.
            Self(unsafe { arch::_mm256_sqrt_pd(self.0) })
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe { arch::_mm256_min_pd(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe { arch::_mm256_max_pd(self.0, other.0) })
        }
        #[inline(always)]
        fn greater(self, other: Self) -> FourMask {
            // SAFETY: see above.
            FourMask(unsafe { arch::_mm256_cmp_pd::<{ arch::_CMP_GT_OQ }>(self.0, other.0) })
        }
        #[inline(always)]
        fn select(mask: FourMask, yes: Self, no: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe { arch::_mm256_blendv_pd(no.0, yes.0, mask.0) })
        }
    }
}
