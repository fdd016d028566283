//! The triangular sweeps.

#![allow(
    clippy::inline_always,
    reason = "compiled once per instruction set: only inlined code has the caller's features"
)]

use super::{SIGMA, coarse::Coarse, rows::Rows};
use crate::assembly::{
    Lanes,
    simd::{self, Four},
};

/// Defines a function that calls a generic kernel with the widest lanes of the processor.
macro_rules! for_processor {
    ($name:ident = $kernel:ident($($arg:ident: $type:ty),*) -> $out:ty) => {
        /// # Safety
        /// That of the kernel, but for the processor's features.
        unsafe fn $name($($arg: $type),*) -> $out {
            #[cfg(target_arch = "x86_64")]
            if simd::has_avx() {
                #[target_feature(enable = "avx")]
                unsafe fn with_avx($($arg: $type),*) -> $out {
                    // SAFETY: this function is compiled for AVX; the rest is the caller's.
                    unsafe { $kernel::<simd::Avx>($($arg),*) }
                }
                // SAFETY: the processor has AVX; the rest is the caller's.
                return unsafe { with_avx($($arg),*) };
            }
            // SAFETY: the portable lanes need no feature; the rest is the caller's.
            unsafe { $kernel::<simd::Array>($($arg),*) }
        }
    };
}

for_processor!(backward_any = backward_with(rows: &Rows, upper: &[f64], d: usize, p: &[Lanes], t: &mut [Lanes]) -> ());
for_processor!(forward_any = forward_with(rows: &Rows, upper: &[f64], d: usize, p: &[Lanes], t: Option<&[Lanes]>, s: &mut [Lanes]) -> f64);
for_processor!(prolong_any = prolong_with(coarse: &Coarse, first: usize, r: &[Lanes], beta: f64, p: &mut [Lanes]) -> ());
for_processor!(restrict_any = restrict_with(coarse: &Coarse, first: usize, lowest: usize, r: &[Lanes], sums: &mut [[Lanes; 3]]) -> ());
for_processor!(residual_any = residual_with(rows: &Rows, upper: &[f64], d: usize, scale: &[[f64; 9]], r: &[Lanes]) -> f64);

/// Solves (σ I + U) t = p inside domain `d`; `p` and `t` are the domain's rows.
pub(super) fn backward(rows: &Rows, upper: &[f64], d: usize, p: &[Lanes], t: &mut [Lanes]) {
    let (first, end) = (rows.domains[d], rows.domains[d + 1]);
    assert!(p.len() == end - first && t.len() == p.len() && upper.len() >= 9 * rows.columns.len() + 3);
    // SAFETY: lengths are asserted; columns and blocks are in range by the pattern's construction.
    unsafe { backward_any(rows, upper, d, p, t) };
}

/// s = (σ I + Uᵀ)⁻¹ w inside domain `d`, with w = p, or p + (1 − 2σ) t + C t where `t` is given; `p` and `t` are all rows,
/// `s` the domain's. Returns p·(s + t).
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
    // SAFETY: lengths are asserted; columns and blocks are in range by the pattern's construction.
    unsafe { forward_any(rows, upper, d, p, t, s) }
}

/// p = r + Tᵀ W y + β p for the rows from `first`; `r` and `p` are those rows.
pub(super) fn prolong(coarse: &Coarse, first: usize, r: &[Lanes], beta: f64, p: &mut [Lanes]) {
    assert!(r.len() == p.len() && first + p.len() < coarse.offsets.len());
    // SAFETY: lengths are asserted; entries and aggregates are in range by construction of the coarse space.
    unsafe { prolong_any(coarse, first, r, beta, p) };
}

/// Adds (Tᵀ W)ᵀ r of the rows of domain `d` to `sums`, lane by lane; `sums` starts at the domain's lowest aggregate.
pub(super) fn restrict(coarse: &Coarse, rows: &Rows, d: usize, r: &[Lanes], sums: &mut [[Lanes; 3]]) {
    let [low, high] = coarse.reach[d];
    assert!(sums.len() == (high - low) as usize && r.len() == rows.domains[d + 1] - rows.domains[d]);
    // SAFETY: lengths are asserted; the domain's entries lie in its reach by construction of the coarse space.
    unsafe { restrict_any(coarse, rows.domains[d], low as usize, r, sums) };
}

/// Square of the norm of G T r over the rows of domain `d`; `scale` and `r` are all rows.
pub(super) fn residual(rows: &Rows, upper: &[f64], d: usize, scale: &[[f64; 9]], r: &[Lanes]) -> f64 {
    assert!(r.len() == rows.len() && scale.len() == r.len() && upper.len() >= 9 * rows.columns.len() + 3);
    // SAFETY: lengths are asserted; columns and blocks are in range by the pattern's construction.
    unsafe { residual_any(rows, upper, d, scale, r) }
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

/// # Safety
/// The processor has `F`'s features; lengths as asserted by `prolong`; entries of `coarse` are in range.
#[inline(always)]
unsafe fn prolong_with<F: Four>(coarse: &Coarse, first: usize, r: &[Lanes], beta: f64, p: &mut [Lanes]) {
    let blocks = coarse.values.as_ptr().cast::<f64>();
    for i in 0..p.len() {
        // SAFETY: by contract; `values` is padded by one block.
        unsafe {
            let mut z = F::load(r.get_unchecked(i).0.as_ptr());
            let start = *coarse.offsets.get_unchecked(first + i) as usize;
            for e in start..*coarse.offsets.get_unchecked(first + i + 1) as usize {
                let y = coarse.solution.get_unchecked(*coarse.columns.get_unchecked(e) as usize);
                z = z.add(product::<F>(blocks.add(9 * e), y));
            }
            let p = p.get_unchecked_mut(i);
            let mut sum = z.add(F::load(p.0.as_ptr()).multiply(F::splat(beta))).lanes();
            sum.0[3] = 0.0;
            *p = sum;
        }
    }
}

/// # Safety
/// The processor has `F`'s features; lengths as asserted by `restrict`; entries of `coarse` are in range.
#[inline(always)]
unsafe fn restrict_with<F: Four>(
    coarse: &Coarse,
    first: usize,
    lowest: usize,
    r: &[Lanes],
    sums: &mut [[Lanes; 3]],
) {
    let blocks = coarse.values.as_ptr().cast::<f64>();
    for i in 0..r.len() {
        // SAFETY: by contract; `values` is padded by one block.
        unsafe {
            let start = *coarse.offsets.get_unchecked(first + i) as usize;
            for e in start..*coarse.offsets.get_unchecked(first + i + 1) as usize {
                let sum = sums.get_unchecked_mut(*coarse.columns.get_unchecked(e) as usize - lowest);
                let mut columns = [0, 1, 2].map(|c| F::load(sum[c].0.as_ptr()));
                transposed::<F>(blocks.add(9 * e), r.get_unchecked(i), &mut columns);
                for c in 0..3 {
                    sum[c] = columns[c].lanes();
                }
            }
        }
    }
}

/// # Safety
/// The processor has `F`'s features; lengths as asserted by `residual`; columns and blocks of `rows` are in range.
#[inline(always)]
unsafe fn residual_with<F: Four>(
    rows: &Rows,
    upper: &[f64],
    d: usize,
    scale: &[[f64; 9]],
    r: &[Lanes],
) -> f64 {
    let mut squares = 0.0;
    for row in rows.domains[d]..rows.domains[d + 1] {
        // SAFETY: by contract.
        unsafe {
            let mut columns = [F::zero(); 3];
            for e in rows.lower[row] as usize..rows.lower_middle[row] as usize {
                let [j, k] = *rows.lower_entries.get_unchecked(e);
                transposed::<F>(
                    upper.as_ptr().add(9 * k as usize),
                    r.get_unchecked(j as usize),
                    &mut columns,
                );
            }
            let sums = total(columns);
            let r = r.get_unchecked(row);
            // G⁻¹ is lower triangular: solve for G y.
            let h = scale.get_unchecked(row);
            if h[0] > 0.0 {
                let a = (SIGMA * r.0[0] + sums[0]) / h[0];
                let b = ((SIGMA * r.0[1] + sums[1]) - h[1] * a) / h[4];
                let c = ((SIGMA * r.0[2] + sums[2]) - h[2] * a - h[5] * b) / h[8];
                squares += a * a + b * b + c * c;
            }
        }
    }
    squares
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
