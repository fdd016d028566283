//! Algebra of 3×3 blocks, column by column.

use crate::assembly::Lanes;

/// Inverse of the lower Cholesky factor of a symmetric block; none if it is not positive definite.
pub(super) fn inverse_factor(m: &[f64; 9]) -> Option<[f64; 9]> {
    let positive = |v: f64| (v > 0.0).then(|| v.sqrt());
    let g00 = positive(m[0])?;
    let (g10, g20) = (m[1] / g00, m[2] / g00);
    let g11 = positive(m[4] - g10 * g10)?;
    let g21 = (m[5] - g20 * g10) / g11;
    let g22 = positive(m[8] - g20 * g20 - g21 * g21)?;
    let (h00, h11, h22) = (1.0 / g00, 1.0 / g11, 1.0 / g22);
    let h10 = -g10 * h00 * h11;
    let h21 = -g21 * h11 * h22;
    let h20 = -(g20 * h00 + g21 * h10) * h22;
    Some([h00, h10, h20, 0.0, h11, h21, 0.0, 0.0, h22])
}

/// Lower triangular `l` times `m`.
#[inline]
pub(super) fn times(l: &[f64; 9], m: &[f64; 9]) -> [f64; 9] {
    let mut out = [0.0; 9];
    for c in 0..3 {
        let (a, b, d) = (m[3 * c], m[3 * c + 1], m[3 * c + 2]);
        out[3 * c] = l[0] * a;
        out[3 * c + 1] = l[1] * a + l[4] * b;
        out[3 * c + 2] = (l[2] * a + l[5] * b) + l[8] * d;
    }
    out
}

/// `m` times the transpose of lower triangular `l`.
#[inline]
pub(super) fn times_transposed(m: &[f64; 9], l: &[f64; 9]) -> [f64; 9] {
    let mut out = [0.0; 9];
    for r in 0..3 {
        let (a, b, d) = (m[r], m[3 + r], m[6 + r]);
        out[r] = a * l[0];
        out[3 + r] = a * l[1] + b * l[4];
        out[6 + r] = (a * l[2] + b * l[5]) + d * l[8];
    }
    out
}

/// Transpose of `block` times a vector.
#[inline]
pub(super) fn apply_transposed(block: &[f64; 9], v: &Lanes) -> Lanes {
    let mut out = [0.0; 4];
    for c in 0..3 {
        out[c] = (block[3 * c] * v.0[0] + block[3 * c + 1] * v.0[1]) + block[3 * c + 2] * v.0[2];
    }
    Lanes(out)
}

/// Block times vector.
#[inline]
pub(super) fn apply(block: &[f64; 9], v: &Lanes) -> Lanes {
    let mut out = [0.0; 4];
    for r in 0..3 {
        out[r] = (block[r] * v.0[0] + block[3 + r] * v.0[1]) + block[6 + r] * v.0[2];
    }
    Lanes(out)
}

pub(super) fn determinant(m: &[f64; 9]) -> f64 {
    m[0] * (m[4] * m[8] - m[5] * m[7]) - m[3] * (m[1] * m[8] - m[2] * m[7])
        + m[6] * (m[1] * m[5] - m[2] * m[4])
}

/// Inverse of a symmetric positive definite block; none if a leading minor is not positive.
pub(super) fn invert(m: &[f64; 9]) -> Option<[f64; 9]> {
    let minor = m[0] * m[4] - m[1] * m[3];
    let det = determinant(m);
    if !(m[0] > 0.0 && minor > 0.0 && det > 0.0) {
        return None;
    }
    let s = 1.0 / det;
    let (a, b, c) = (m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4]);
    let (d, e, f) = (m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5], minor);
    Some([s * a, s * b, s * c, s * b, s * d, s * e, s * c, s * e, s * f])
}
