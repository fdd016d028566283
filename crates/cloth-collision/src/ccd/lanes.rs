//! Several pairs at once: the arithmetic of the filters over one or several lanes, bit for bit the same.

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

macro_rules! one_lane {
    ($type:ident) => {
        impl Lanes for $type {
            type Mask = bool;

            #[inline(always)]
            fn splat(x: f64) -> Self {
                x as $type
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $type::abs(self)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $type::sqrt(self)
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
    };
}
one_lane!(f64);
one_lane!(f32);

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

/// Four or eight lanes in an AVX register. Values exist only in functions compiled for AVX2, which the methods are
/// inlined into.
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx {
    use super::Lanes;
    use std::arch::x86_64 as arch;
    use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

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

    macro_rules! lanes {
        (
            $type:ident, $mask:ident, $register:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $and:ident,
            $or:ident, $splat:ident, $andnot:ident, $sqrt:ident, $min:ident, $max:ident, $compare:ident,
            $blend:ident, $movemask:ident
        ) => {
            #[derive(Debug, Clone, Copy)]
            pub(crate) struct $type(arch::$register);

            #[derive(Debug, Clone, Copy)]
            pub(crate) struct $mask(arch::$register);

            impl $mask {
                /// Bit per lane.
                #[inline(always)]
                pub(crate) fn bits(self) -> u32 {
                    // SAFETY: a mask exists only where the processor has AVX2.
                    unsafe { arch::$movemask(self.0) as u32 }
                }
            }

            binary!($type, Add, add, $add);
            binary!($type, Sub, sub, $sub);
            binary!($type, Mul, mul, $mul);
            binary!($type, Div, div, $div);
            binary!($mask, BitAnd, bitand, $and);
            binary!($mask, BitOr, bitor, $or);

            // SAFETY of the blocks below: values exist only where the processor has AVX2; `splat` is called only
            // from there.
            impl Lanes for $type {
                type Mask = $mask;

                #[inline(always)]
                fn splat(x: f64) -> Self {
                    // SAFETY: see above.
                    Self(unsafe { arch::$splat(x as _) })
                }
                #[inline(always)]
                fn abs(self) -> Self {
                    // SAFETY: see above.
                    Self(unsafe { arch::$andnot(arch::$splat(-0.0), self.0) })
                }
                #[inline(always)]
                fn sqrt(self) -> Self {
                    // SAFETY: see above.
                    Self(unsafe { arch::$sqrt(self.0) })
                }
                #[inline(always)]
                fn min(self, other: Self) -> Self {
                    // SAFETY: see above.
                    Self(unsafe { arch::$min(self.0, other.0) })
                }
                #[inline(always)]
                fn max(self, other: Self) -> Self {
                    // SAFETY: see above.
                    Self(unsafe { arch::$max(self.0, other.0) })
                }
                #[inline(always)]
                fn greater(self, other: Self) -> $mask {
                    // SAFETY: see above.
                    $mask(unsafe { arch::$compare::<{ arch::_CMP_GT_OQ }>(self.0, other.0) })
                }
                #[inline(always)]
                fn select(mask: $mask, yes: Self, no: Self) -> Self {
                    // SAFETY: see above.
                    Self(unsafe { arch::$blend(no.0, yes.0, mask.0) })
                }
            }
        };
    }
    lanes!(
        Four,
        FourMask,
        __m256d,
        _mm256_add_pd,
        _mm256_sub_pd,
        _mm256_mul_pd,
        _mm256_div_pd,
        _mm256_and_pd,
        _mm256_or_pd,
        _mm256_set1_pd,
        _mm256_andnot_pd,
        _mm256_sqrt_pd,
        _mm256_min_pd,
        _mm256_max_pd,
        _mm256_cmp_pd,
        _mm256_blendv_pd,
        _mm256_movemask_pd
    );
    lanes!(
        Eight,
        EightMask,
        __m256,
        _mm256_add_ps,
        _mm256_sub_ps,
        _mm256_mul_ps,
        _mm256_div_ps,
        _mm256_and_ps,
        _mm256_or_ps,
        _mm256_set1_ps,
        _mm256_andnot_ps,
        _mm256_sqrt_ps,
        _mm256_min_ps,
        _mm256_max_ps,
        _mm256_cmp_ps,
        _mm256_blendv_ps,
        _mm256_movemask_ps
    );

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

    impl Eight {
        /// The lanes in order.
        #[inline(always)]
        pub(crate) fn to_array(self) -> [f32; 8] {
            let mut out = [0.0; 8];
            // SAFETY: a value exists only where the processor has AVX2; 32 writable bytes.
            unsafe { arch::_mm256_storeu_ps(out.as_mut_ptr(), self.0) };
            out
        }

        /// The first three entries of eight rows, by entry.
        ///
        /// # Safety
        /// The processor has AVX2.
        #[inline(always)]
        pub(crate) unsafe fn load_transposed(rows: [&[f32; 4]; 8]) -> [Self; 3] {
            // SAFETY: 16 readable bytes in each row; AVX2 by the caller's promise.
            unsafe {
                let pair = |low: &[f32; 4], high: &[f32; 4]| {
                    arch::_mm256_set_m128(arch::_mm_loadu_ps(high.as_ptr()), arch::_mm_loadu_ps(low.as_ptr()))
                };
                let (a, b) = (pair(rows[0], rows[4]), pair(rows[1], rows[5]));
                let (c, d) = (pair(rows[2], rows[6]), pair(rows[3], rows[7]));
                let (ab_xy, ab_z) = (arch::_mm256_unpacklo_ps(a, b), arch::_mm256_unpackhi_ps(a, b));
                let (cd_xy, cd_z) = (arch::_mm256_unpacklo_ps(c, d), arch::_mm256_unpackhi_ps(c, d));
                [
                    Self(arch::_mm256_shuffle_ps::<0x44>(ab_xy, cd_xy)),
                    Self(arch::_mm256_shuffle_ps::<0xee>(ab_xy, cd_xy)),
                    Self(arch::_mm256_shuffle_ps::<0x44>(ab_z, cd_z)),
                ]
            }
        }
    }
}
