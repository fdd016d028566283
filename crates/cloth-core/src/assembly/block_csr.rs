//! Symmetric matrix of 3×3 blocks and its product with a vector.
//!
//! Only diagonal and upper blocks are stored (half the memory traffic of full rows, which is what bounds the product);
//! each row reads its lower blocks through the pattern, so rows stay independent and the product is parallel without
//! scattered writes. Blocks are column by column.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::Pattern;
use crate::mesh::Vec3;

/// A 3-vector in four lanes, the last one zero.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Lanes(pub(crate) [f64; 4]);

impl Lanes {
    pub(crate) const ZERO: Self = Self([0.0; 4]);

    #[inline]
    pub(crate) fn from_vec(v: &Vec3) -> Self {
        Self([v.x, v.y, v.z, 0.0])
    }

    #[inline]
    pub(crate) fn to_vec(self) -> Vec3 {
        Vec3::new(self.0[0], self.0[1], self.0[2])
    }

    #[inline]
    pub(crate) fn dot(&self, other: &Self) -> f64 {
        self.0[0] * other.0[0] + self.0[1] * other.0[1] + self.0[2] * other.0[2]
    }
}

/// Values over a [`Pattern`].
pub(crate) struct BlockMatrix {
    pub(crate) pattern: Arc<Pattern>,
    pub(crate) diagonal: Vec<[f64; 9]>,
    /// Nine values per upper block, and three more at the end so that any column can be read four wide.
    pub(crate) upper: Vec<f64>,
}

impl BlockMatrix {
    /// Zero matrix.
    pub(crate) fn new(pattern: Arc<Pattern>) -> Self {
        let (rows, blocks) = (pattern.rows, pattern.upper_count());
        Self { pattern, diagonal: vec![[0.0; 9]; rows], upper: vec![0.0; 9 * blocks + 3] }
    }

    /// Memory of values and pattern [B].
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.diagonal.as_slice()) + size_of_val(self.upper.as_slice()) + self.pattern.bytes()
    }

    /// Rows `first..` of A x into `out`. `x` has one entry per row of the matrix.
    #[inline]
    pub(crate) fn multiply_rows(&self, first: usize, x: &[Lanes], out: &mut [Lanes]) {
        assert!(x.len() == self.pattern.rows && first + out.len() <= self.pattern.rows);
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx") {
            // SAFETY: the processor has AVX, and the assertion above bounds rows.
            unsafe { self.multiply_rows_avx(first, x, out) };
            return;
        }
        self.multiply_rows_portable(first, x, out);
    }

    fn multiply_rows_portable(&self, first: usize, x: &[Lanes], out: &mut [Lanes]) {
        for (row, out) in (first..).zip(out) {
            // The order of operations is that of the AVX kernel, so both give the same bits.
            let mut direct = [0.0; 3];
            let mut columns = [[0.0; 3]; 3];
            for &[j, k] in self.pattern.lower_of(row) {
                let (block, x) = (&self.upper[9 * k as usize..][..9], &x[j as usize].0);
                for c in 0..3 {
                    for r in 0..3 {
                        columns[c][r] += block[3 * c + r] * x[r];
                    }
                }
            }
            let mut add = |block: &[f64], x: &[f64; 4]| {
                for r in 0..3 {
                    direct[r] += (block[r] * x[0] + block[3 + r] * x[1]) + block[6 + r] * x[2];
                }
            };
            add(&self.diagonal[row], &x[row].0);
            for k in self.pattern.upper_of(row) {
                add(&self.upper[9 * k..9 * k + 9], &x[self.pattern.columns[k] as usize].0);
            }
            for c in 0..3 {
                out.0[c] = direct[c] + (columns[c][0] + columns[c][1] + columns[c][2]);
            }
            out.0[3] = 0.0;
        }
    }

    /// # Safety
    /// The processor has AVX; `x` has one entry per row; rows `first..first + out.len()` exist.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx")]
    unsafe fn multiply_rows_avx(&self, first: usize, x: &[Lanes], out: &mut [Lanes]) {
        use std::arch::x86_64::{
            _mm256_add_pd, _mm256_broadcast_sd, _mm256_load_pd, _mm256_loadu_pd, _mm256_mul_pd,
            _mm256_set_pd, _mm256_setzero_pd, _mm256_store_pd,
        };
        let (upper, x) = (self.upper.as_ptr(), x.as_ptr().cast::<f64>());
        for (row, out) in (first..).zip(out) {
            let mut direct = _mm256_setzero_pd();
            let mut c0 = _mm256_setzero_pd();
            let mut c1 = _mm256_setzero_pd();
            let mut c2 = _mm256_setzero_pd();
            for &[j, k] in self.pattern.lower_of(row) {
                // SAFETY: the pattern's blocks and columns are in range by construction; `upper` is padded by three
                // values, and `Lanes` is 32-byte aligned with four values.
                unsafe {
                    let (block, x) = (upper.add(9 * k as usize), _mm256_load_pd(x.add(4 * j as usize)));
                    c0 = _mm256_add_pd(c0, _mm256_mul_pd(_mm256_loadu_pd(block), x));
                    c1 = _mm256_add_pd(c1, _mm256_mul_pd(_mm256_loadu_pd(block.add(3)), x));
                    c2 = _mm256_add_pd(c2, _mm256_mul_pd(_mm256_loadu_pd(block.add(6)), x));
                }
            }
            // SAFETY: as above; the diagonal's last column is read as values 5..9 and shifted by a set.
            unsafe {
                let d = &self.diagonal[row];
                let x = x.add(4 * row);
                let a = _mm256_mul_pd(_mm256_loadu_pd(d.as_ptr()), _mm256_broadcast_sd(&*x));
                let b = _mm256_mul_pd(_mm256_loadu_pd(d.as_ptr().add(3)), _mm256_broadcast_sd(&*x.add(1)));
                let c = _mm256_mul_pd(_mm256_set_pd(0.0, d[8], d[7], d[6]), _mm256_broadcast_sd(&*x.add(2)));
                direct = _mm256_add_pd(direct, _mm256_add_pd(_mm256_add_pd(a, b), c));
            }
            for k in self.pattern.upper_of(row) {
                // SAFETY: as above.
                unsafe {
                    let block = upper.add(9 * k);
                    let x = x.add(4 * *self.pattern.columns.get_unchecked(k) as usize);
                    let a = _mm256_mul_pd(_mm256_loadu_pd(block), _mm256_broadcast_sd(&*x));
                    let b = _mm256_mul_pd(_mm256_loadu_pd(block.add(3)), _mm256_broadcast_sd(&*x.add(1)));
                    let c = _mm256_mul_pd(_mm256_loadu_pd(block.add(6)), _mm256_broadcast_sd(&*x.add(2)));
                    direct = _mm256_add_pd(direct, _mm256_add_pd(_mm256_add_pd(a, b), c));
                }
            }
            let mut lanes = [Lanes::ZERO; 4];
            for (lanes, value) in lanes.iter_mut().zip([direct, c0, c1, c2]) {
                // SAFETY: `Lanes` is 32-byte aligned with four values.
                unsafe { _mm256_store_pd(lanes.0.as_mut_ptr(), value) };
            }
            for c in 0..3 {
                let column = &lanes[c + 1].0;
                out.0[c] = lanes[0].0[c] + (column[0] + column[1] + column[2]);
            }
            out.0[3] = 0.0;
        }
    }
}
