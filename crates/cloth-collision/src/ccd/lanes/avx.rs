//! Four doubles or eight singles in an AVX register. Values exist only in functions compiled for AVX2, which the methods
//! are inlined into.

use super::{
    Doubles, EXPONENT, Lanes, MAX_DOUBLES, MAX_SINGLES, Mask, Row, Rows, Singles, SmallRow, TWO_BIASES,
    Vector,
};
use std::arch::x86_64 as arch;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

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
        $blend:ident, $movemask:ident, $xor:ident, $zero:ident
    ) => {
        #[derive(Debug, Clone, Copy)]
        pub(crate) struct $type(arch::$register);

        #[derive(Debug, Clone, Copy)]
        pub(crate) struct $mask(arch::$register);

        impl Mask for $mask {
            #[inline(always)]
            fn bits(self) -> u32 {
                // SAFETY: a mask exists only where the processor has AVX2.
                unsafe { arch::$movemask(self.0) as u32 }
            }
        }

        impl Not for $mask {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                // SAFETY: a mask exists only where the processor has AVX2.
                unsafe {
                    let zero = arch::$zero();
                    Self(arch::$xor(self.0, arch::$compare::<{ arch::_CMP_EQ_OQ }>(zero, zero)))
                }
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
    _mm256_movemask_pd,
    _mm256_xor_pd,
    _mm256_setzero_pd
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
    _mm256_movemask_ps,
    _mm256_xor_ps,
    _mm256_setzero_ps
);

impl Four {
    /// The first three entries of four rows, by entry.
    ///
    /// # Safety
    /// The processor has AVX2.
    #[inline(always)]
    pub(crate) unsafe fn load_transposed(rows: [&Row; 4]) -> [Self; 3] {
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

// SAFETY of the blocks below: as those of `Lanes`.
impl Doubles for Four {
    const COUNT: usize = 4;

    #[inline(always)]
    fn from_array(lanes: &[f64; MAX_DOUBLES]) -> Self {
        // SAFETY: see above; 32 readable bytes.
        Self(unsafe { arch::_mm256_loadu_pd(lanes.as_ptr()) })
    }
    #[inline(always)]
    fn gather(rows: &[Rows<'_>; MAX_DOUBLES], k: usize) -> Vector<Self> {
        // SAFETY: see above.
        Vector(unsafe { Self::load_transposed([rows[0][k], rows[1][k], rows[2][k], rows[3][k]]) })
    }
    #[inline(always)]
    fn to_array(self) -> [f64; MAX_DOUBLES] {
        let mut out = [0.0; MAX_DOUBLES];
        // SAFETY: see above; 32 writable bytes.
        unsafe { arch::_mm256_storeu_pd(out.as_mut_ptr(), self.0) };
        out
    }
    #[inline(always)]
    fn inverse_exponent(self) -> Self {
        // SAFETY: see above.
        unsafe {
            let bits = arch::_mm256_castpd_si256(self.0);
            let exponent = arch::_mm256_and_si256(bits, arch::_mm256_set1_epi64x(EXPONENT));
            Self(arch::_mm256_castsi256_pd(arch::_mm256_sub_epi64(
                arch::_mm256_set1_epi64x(TWO_BIASES),
                exponent,
            )))
        }
    }
}

// SAFETY of the block below: as those of `Lanes`.
impl Singles for Eight {
    const COUNT: usize = 8;

    #[inline(always)]
    fn gather(rows: &[[&SmallRow; 4]; MAX_SINGLES], k: usize) -> [Vector<Self>; 2] {
        // SAFETY: see above; 32 readable bytes in each row.
        unsafe {
            let mut x = [arch::_mm256_setzero_ps(); 2];
            let (mut y, mut z) = (x, x);
            // Four rows at a time: both ends' coordinates, t0 in the lower half of the register.
            for half in 0..2 {
                let [a, b, c, d] = [
                    arch::_mm256_loadu_ps(rows[4 * half][k].as_ptr()),
                    arch::_mm256_loadu_ps(rows[4 * half + 1][k].as_ptr()),
                    arch::_mm256_loadu_ps(rows[4 * half + 2][k].as_ptr()),
                    arch::_mm256_loadu_ps(rows[4 * half + 3][k].as_ptr()),
                ];
                let (ab_xy, ab_z) = (arch::_mm256_unpacklo_ps(a, b), arch::_mm256_unpackhi_ps(a, b));
                let (cd_xy, cd_z) = (arch::_mm256_unpacklo_ps(c, d), arch::_mm256_unpackhi_ps(c, d));
                x[half] = arch::_mm256_shuffle_ps::<0x44>(ab_xy, cd_xy);
                y[half] = arch::_mm256_shuffle_ps::<0xee>(ab_xy, cd_xy);
                z[half] = arch::_mm256_shuffle_ps::<0x44>(ab_z, cd_z);
            }
            [
                Vector([
                    Self(arch::_mm256_permute2f128_ps::<0x20>(x[0], x[1])),
                    Self(arch::_mm256_permute2f128_ps::<0x20>(y[0], y[1])),
                    Self(arch::_mm256_permute2f128_ps::<0x20>(z[0], z[1])),
                ]),
                Vector([
                    Self(arch::_mm256_permute2f128_ps::<0x31>(x[0], x[1])),
                    Self(arch::_mm256_permute2f128_ps::<0x31>(y[0], y[1])),
                    Self(arch::_mm256_permute2f128_ps::<0x31>(z[0], z[1])),
                ]),
            ]
        }
    }
}

impl Eight {
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
