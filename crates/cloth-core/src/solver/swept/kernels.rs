//! The triangular sweeps.

#![allow(
    clippy::inline_always,
    reason = "compiled once per instruction set: only inlined code has the caller's features"
)]

use super::{SIGMA, rows::Rows};
use crate::assembly::{
    Lanes,
    simd::{self, Four},
};

/// Solves (σ I + U) t = p inside domain `d`; `p` and `t` are the domain's rows.
pub(super) fn backward(rows: &Rows, upper: &[f64], d: usize, p: &[Lanes], t: &mut [Lanes]) {
    let (first, end) = (rows.domains[d], rows.domains[d + 1]);
    assert!(p.len() == end - first && t.len() == p.len() && upper.len() >= 9 * rows.columns.len() + 3);
    #[cfg(target_arch = "x86_64")]
    if simd::has_avx() {
        #[target_feature(enable = "avx")]
        unsafe fn with_avx(rows: &Rows, upper: &[f64], d: usize, p: &[Lanes], t: &mut [Lanes]) {
            // SAFETY: this function is compiled for AVX; the lengths are the caller's to check.
            unsafe { backward_with::<simd::Avx>(rows, upper, d, p, t) };
        }
        // SAFETY: the processor has AVX; lengths are asserted above.
        unsafe { with_avx(rows, upper, d, p, t) };
        return;
    }
    // SAFETY: the portable lanes need no feature; lengths are asserted above.
    unsafe { backward_with::<simd::Array>(rows, upper, d, p, t) };
}

/// s = (σ I + Uᵀ)⁻¹ w inside domain `d`, with w = p, or p + (1 − 2σ) t + C t where `t` is given; `p` and `t` are
/// all rows, `s` the domain's. Returns p·(s + t).
pub(super) fn forward(
    rows: &Rows,
    upper: &[f64],
    d: usize,
    p: &[Lanes],
    t: Option<&[Lanes]>,
    s: &mut [Lanes],
) -> f64 {
    let (first, end) = (rows.domains[d], rows.domains[d + 1]);
    assert!(s.len() == end - first && p.len() == rows.len() && upper.len() >= 9 * rows.columns.len() + 3);
    assert!(t.is_none_or(|t| t.len() == rows.len()));
    #[cfg(target_arch = "x86_64")]
    if simd::has_avx() {
        #[target_feature(enable = "avx")]
        unsafe fn with_avx(
            rows: &Rows,
            upper: &[f64],
            d: usize,
            p: &[Lanes],
            t: Option<&[Lanes]>,
            s: &mut [Lanes],
        ) -> f64 {
            // SAFETY: this function is compiled for AVX; the lengths are the caller's to check.
            unsafe { forward_with::<simd::Avx>(rows, upper, d, p, t, s) }
        }
        // SAFETY: the processor has AVX; lengths are asserted above.
        return unsafe { with_avx(rows, upper, d, p, t, s) };
    }
    // SAFETY: the portable lanes need no feature; lengths are asserted above.
    unsafe { forward_with::<simd::Array>(rows, upper, d, p, t, s) }
}

/// # Safety
/// The processor has `F`'s features; lengths as asserted by `backward`. Columns and blocks of `rows` are in range by
/// construction, those before `middle` inside the domain.
#[inline(always)]
unsafe fn backward_with<F: Four>(rows: &Rows, upper: &[f64], d: usize, p: &[Lanes], t: &mut [Lanes]) {
    let first = rows.domains[d];
    let minus = -1.0 / SIGMA;
    for i in (0..p.len()).rev() {
        let row = first + i;
        // SAFETY: by contract.
        unsafe {
            let mut sum = F::zero();
            // Farthest columns first: the nearest ones were solved last and are still on their way.
            for k in (rows.upper[row] as usize..rows.middle[row] as usize).rev() {
                let column = *rows.columns.get_unchecked(k) as usize - first;
                sum = sum.add(product::<F>(upper.as_ptr().add(9 * k), t.get_unchecked(column)));
            }
            let sum = sum.lanes();
            let out = t.get_unchecked_mut(i);
            for l in 0..3 {
                out.0[l] = (sum.0[l] - p.get_unchecked(i).0[l]) * minus;
            }
        }
    }
}

/// # Safety
/// The processor has `F`'s features; lengths as asserted by `forward`. Columns and blocks of `rows` are in range by
/// construction, those before `lower_middle` inside the domain.
#[inline(always)]
unsafe fn forward_with<F: Four>(
    rows: &Rows,
    upper: &[f64],
    d: usize,
    p: &[Lanes],
    t: Option<&[Lanes]>,
    s: &mut [Lanes],
) -> f64 {
    let first = rows.domains[d];
    let blocks = upper.as_ptr();
    let mut dot = 0.0;
    for i in 0..s.len() {
        let row = first + i;
        // SAFETY: by contract.
        unsafe {
            let mut w = *p.get_unchecked(row);
            let mut columns = [F::zero(); 3];
            let mut present = Lanes::ZERO;
            if let Some(t) = t {
                present = *t.get_unchecked(row);
                let mut across = F::zero();
                for k in rows.middle[row] as usize..rows.upper[row + 1] as usize {
                    let column = *rows.columns.get_unchecked(k) as usize;
                    across = across.add(product::<F>(blocks.add(9 * k), t.get_unchecked(column)));
                }
                let across = across.lanes();
                for l in 0..3 {
                    w.0[l] = (w.0[l] + (1.0 - 2.0 * SIGMA) * present.0[l]) + across.0[l];
                }
                // The lower blocks across domains count with the opposite sign of those inside.
                let mut opposite = [F::zero(); 3];
                for e in rows.lower_middle[row] as usize..rows.lower[row + 1] as usize {
                    let [j, k] = *rows.lower_entries.get_unchecked(e);
                    transposed::<F>(blocks.add(9 * k as usize), t.get_unchecked(j as usize), &mut opposite);
                }
                let sums = total(opposite);
                for l in 0..3 {
                    w.0[l] += sums[l];
                }
            }
            for e in rows.lower[row] as usize..rows.lower_middle[row] as usize {
                let [j, k] = *rows.lower_entries.get_unchecked(e);
                let value = s.get_unchecked(j as usize - first);
                transposed::<F>(blocks.add(9 * k as usize), value, &mut columns);
            }
            let sums = total(columns);
            let out = s.get_unchecked_mut(i);
            let p = p.get_unchecked(row);
            for l in 0..3 {
                out.0[l] = (w.0[l] - sums[l]) * (1.0 / SIGMA);
                dot += p.0[l] * (out.0[l] + present.0[l]);
            }
        }
    }
    dot
}

/// Block times vector.
///
/// # Safety
/// The processor has `F`'s features; ten values can be read at `block`.
#[inline(always)]
unsafe fn product<F: Four>(block: *const f64, x: &Lanes) -> F {
    // SAFETY: by contract; the last lane is not used.
    unsafe {
        let a = F::load(block).multiply(F::splat(x.0[0]));
        let b = F::load(block.add(3)).multiply(F::splat(x.0[1]));
        let c = F::load(block.add(6)).multiply(F::splat(x.0[2]));
        a.add(b).add(c)
    }
}

/// Adds the products of a block's columns with a vector, lane by lane.
///
/// # Safety
/// As `product`.
#[inline(always)]
unsafe fn transposed<F: Four>(block: *const f64, x: &Lanes, columns: &mut [F; 3]) {
    // SAFETY: by contract; the vector's last lane is zero.
    unsafe {
        let x = F::load(x.0.as_ptr());
        columns[0] = columns[0].add(F::load(block).multiply(x));
        columns[1] = columns[1].add(F::load(block.add(3)).multiply(x));
        columns[2] = columns[2].add(F::load(block.add(6)).multiply(x));
    }
}

/// Sum of each column's lanes.
///
/// # Safety
/// The processor has `F`'s features.
#[inline(always)]
unsafe fn total<F: Four>(columns: [F; 3]) -> [f64; 3] {
    columns.map(|column| {
        // SAFETY: by contract.
        let lanes = unsafe { column.lanes() };
        lanes.0[0] + lanes.0[1] + lanes.0[2]
    })
}
