//! Eight doubles or sixteen singles in an AVX-512 register. Values exist only in functions compiled for AVX-512 F, which
//! the methods are inlined into.

use super::{
    Doubles, EXPONENT, Lanes, MAX_DOUBLES, MAX_SINGLES, Mask, Rows, Singles, SmallRow, TWO_BIASES, Vector,
};
use std::arch::x86_64 as arch;
use std::ops::{Add, Div, Mul, Sub};

impl Mask for u8 {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
}

impl Mask for u16 {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
}

macro_rules! binary {
    ($type:ident, $trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: a value exists only where the processor has AVX-512 F.
                Self(unsafe { arch::$intrinsic(self.0, other.0) })
            }
        }
    };
}

macro_rules! lanes {
    (
        $type:ident, $mask:ident, $register:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $splat:ident,
        $abs:ident, $sqrt:ident, $min:ident, $max:ident, $compare:ident, $blend:ident
    ) => {
        #[derive(Debug, Clone, Copy)]
        pub(crate) struct $type(arch::$register);

        binary!($type, Add, add, $add);
        binary!($type, Sub, sub, $sub);
        binary!($type, Mul, mul, $mul);
        binary!($type, Div, div, $div);

        // SAFETY of the blocks below: values exist only where the processor has AVX-512 F; `splat` is called only from
        // there.
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
                Self(unsafe { arch::$abs(self.0) })
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
                unsafe { arch::$compare::<{ arch::_CMP_GT_OQ }>(self.0, other.0) }
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                // SAFETY: see above.
                Self(unsafe { arch::$blend(mask, no.0, yes.0) })
            }
        }
    };
}
lanes!(
    Eight,
    u8,
    __m512d,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_set1_pd,
    _mm512_abs_pd,
    _mm512_sqrt_pd,
    _mm512_min_pd,
    _mm512_max_pd,
    _mm512_cmp_pd_mask,
    _mm512_mask_blend_pd
);
lanes!(
    Sixteen,
    u16,
    __m512,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_mul_ps,
    _mm512_div_ps,
    _mm512_set1_ps,
    _mm512_abs_ps,
    _mm512_sqrt_ps,
    _mm512_min_ps,
    _mm512_max_ps,
    _mm512_cmp_ps_mask,
    _mm512_mask_blend_ps
);

// SAFETY of the blocks below: as those of `Lanes`.
impl Doubles for Eight {
    const COUNT: usize = 8;

    #[inline(always)]
    fn from_array(lanes: &[f64; MAX_DOUBLES]) -> Self {
        // SAFETY: see above; 64 readable bytes.
        Self(unsafe { arch::_mm512_loadu_pd(lanes.as_ptr()) })
    }
    #[inline(always)]
    fn gather(rows: &[Rows<'_>; MAX_DOUBLES], k: usize) -> Vector<Self> {
        // SAFETY: see above; 32 readable bytes in each row.
        unsafe {
            let mut quads = [arch::_mm512_setzero_pd(); 4];
            for row in 0..4 {
                let low = arch::_mm256_loadu_pd(rows[row][k].as_ptr());
                let high = arch::_mm256_loadu_pd(rows[row + 4][k].as_ptr());
                quads[row] = arch::_mm512_insertf64x4::<1>(arch::_mm512_castpd256_pd512(low), high);
            }
            let [a, b, c, d] = quads;
            let (ab_xz, ab_y) = (arch::_mm512_unpacklo_pd(a, b), arch::_mm512_unpackhi_pd(a, b));
            let (cd_xz, cd_y) = (arch::_mm512_unpacklo_pd(c, d), arch::_mm512_unpackhi_pd(c, d));
            // Entries 0 to 7 are those of the first register, 8 to 15 those of the second.
            let even = arch::_mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13);
            let odd = arch::_mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
            Vector([
                Self(arch::_mm512_permutex2var_pd(ab_xz, even, cd_xz)),
                Self(arch::_mm512_permutex2var_pd(ab_y, even, cd_y)),
                Self(arch::_mm512_permutex2var_pd(ab_xz, odd, cd_xz)),
            ])
        }
    }
    #[inline(always)]
    fn to_array(self) -> [f64; MAX_DOUBLES] {
        let mut out = [0.0; MAX_DOUBLES];
        // SAFETY: see above; 64 writable bytes.
        unsafe { arch::_mm512_storeu_pd(out.as_mut_ptr(), self.0) };
        out
    }
    #[inline(always)]
    fn inverse_exponent(self) -> Self {
        // SAFETY: see above.
        unsafe {
            let bits = arch::_mm512_castpd_si512(self.0);
            let exponent = arch::_mm512_and_si512(bits, arch::_mm512_set1_epi64(EXPONENT));
            let inverse = arch::_mm512_sub_epi64(arch::_mm512_set1_epi64(TWO_BIASES), exponent);
            Self(arch::_mm512_castsi512_pd(inverse))
        }
    }
}

// SAFETY of the block below: as those of `Lanes`.
impl Singles for Sixteen {
    const COUNT: usize = 16;

    #[inline(always)]
    fn compress(set: u32, entries: &[u32; MAX_SINGLES], out: &mut [u32; MAX_SINGLES]) {
        // SAFETY: see above; 64 bytes to read and to write.
        unsafe {
            let entries = arch::_mm512_loadu_si512(entries.as_ptr().cast());
            let kept = arch::_mm512_maskz_compress_epi32(set as u16, entries);
            arch::_mm512_storeu_si512(out.as_mut_ptr().cast(), kept);
        }
    }

    #[inline(always)]
    fn gather(rows: &[[&SmallRow; 4]; MAX_SINGLES], k: usize) -> [Vector<Self>; 2] {
        // SAFETY: see above; 32 readable bytes in each row.
        unsafe {
            let mut x = [arch::_mm512_setzero_ps(); 2];
            let (mut y, mut z) = (x, x);
            // Rows 0 to 3 and 8 to 11, then 4 to 7 and 12 to 15: quarters of x are lanes 0 to 3 at t0, the same at t1,
            // lanes 8 to 11 at t0, the same at t1.
            for half in 0..2 {
                let mut pairs = [arch::_mm512_setzero_pd(); 4];
                for row in 0..4 {
                    let low = arch::_mm256_loadu_pd(rows[4 * half + row][k].as_ptr().cast());
                    let high = arch::_mm256_loadu_pd(rows[4 * half + row + 8][k].as_ptr().cast());
                    pairs[row] = arch::_mm512_insertf64x4::<1>(arch::_mm512_castpd256_pd512(low), high);
                }
                let (a, b) = (arch::_mm512_castpd_ps(pairs[0]), arch::_mm512_castpd_ps(pairs[1]));
                let (c, d) = (arch::_mm512_castpd_ps(pairs[2]), arch::_mm512_castpd_ps(pairs[3]));
                let (ab_xy, ab_z) = (arch::_mm512_unpacklo_ps(a, b), arch::_mm512_unpackhi_ps(a, b));
                let (cd_xy, cd_z) = (arch::_mm512_unpacklo_ps(c, d), arch::_mm512_unpackhi_ps(c, d));
                x[half] = arch::_mm512_shuffle_ps::<0x44>(ab_xy, cd_xy);
                y[half] = arch::_mm512_shuffle_ps::<0xee>(ab_xy, cd_xy);
                z[half] = arch::_mm512_shuffle_ps::<0x44>(ab_z, cd_z);
            }
            // Entries 0 to 15 are those of the first register, 16 to 31 those of the second.
            let t0 = arch::_mm512_setr_epi32(0, 1, 2, 3, 16, 17, 18, 19, 8, 9, 10, 11, 24, 25, 26, 27);
            let t1 = arch::_mm512_setr_epi32(4, 5, 6, 7, 20, 21, 22, 23, 12, 13, 14, 15, 28, 29, 30, 31);
            [
                Vector([
                    Self(arch::_mm512_permutex2var_ps(x[0], t0, x[1])),
                    Self(arch::_mm512_permutex2var_ps(y[0], t0, y[1])),
                    Self(arch::_mm512_permutex2var_ps(z[0], t0, z[1])),
                ]),
                Vector([
                    Self(arch::_mm512_permutex2var_ps(x[0], t1, x[1])),
                    Self(arch::_mm512_permutex2var_ps(y[0], t1, y[1])),
                    Self(arch::_mm512_permutex2var_ps(z[0], t1, z[1])),
                ]),
            ]
        }
    }
}
