//! The coplanarity cubic in Bernstein form, with an error bound.

use super::filter::determinant;
use super::lanes::Vector;
use crate::Vec3;

/// Σ b_i C(3,i) t^i (1−t)^(3−i) on \[0, 1\], known to ± `error` there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cubic {
    pub(crate) b: [f64; 4],
    pub(crate) error: f64,
}

/// Steps of Bézier clipping before the present bound is returned as it stands.
const MAX_CLIPS: usize = 64;
/// Steps of Newton's method; five are usual.
const MAX_NEWTON: usize = 16;
/// A clip that moves on by less than this fraction of the step has arrived, and a root found by Newton's method is
/// approached to it.
const ROOT_STEP: f64 = 1e-10;

impl Cubic {
    /// det(x, y, z) of three vectors that move linearly from `[0]` to `[1]`.
    #[inline]
    pub(crate) fn determinant(x: &[Vec3; 2], y: &[Vec3; 2], z: &[Vec3; 2]) -> Self {
        let (b, error) = determinant(x.map(Vector::from), y.map(Vector::from), z.map(Vector::from));
        Self { b, error }
    }

    /// A time that is not later than the first root in \[t, 1\]; None if there is certainly no root.
    pub(crate) fn first_root_bound(&self, t: f64) -> Option<f64> {
        let c = restrict(&self.b, t);
        if !(c[0].abs() > self.error) {
            return Some(t);
        }
        // The polynomial less its error bound: a true root cannot come before its first root.
        let sign = c[0].signum();
        let c = c.map(|value| value * sign - self.error);
        if c.iter().all(|&v| v > 0.0) {
            return None;
        }
        if let Some(x) = approach(&c) {
            return Some(t + x * (1.0 - t));
        }
        self.clip(t)
    }

    /// [`Cubic::first_root_bound`] without luck: clips away what lies before the hull of the control points reaches
    /// zero, again and again.
    fn clip(&self, t: f64) -> Option<f64> {
        let mut t = t;
        for _ in 0..MAX_CLIPS {
            let c = restrict(&self.b, t);
            if !(c[0].abs() > self.error) {
                return Some(t);
            }
            let sign = c[0].signum();
            let c = c.map(|value| value * sign - self.error);
            if c.iter().all(|&v| v > 0.0) {
                return None;
            }
            let mut first = 1.0f64;
            for i in 0..3 {
                for j in i + 1..4 {
                    if c[i] > 0.0 && c[j] <= 0.0 {
                        first = first.min((i as f64 + (j - i) as f64 * c[i] / (c[i] - c[j])) / 3.0);
                    }
                }
            }
            // The rounding of `first`; that of the sum is in the error bound.
            let step = first * (1.0 - t) * (1.0 - 8.0 * f64::EPSILON);
            if step < ROOT_STEP {
                return Some(t);
            }
            t += step;
            if t >= 1.0 {
                return Some(1.0 - f64::EPSILON);
            }
        }
        Some(t)
    }
}

/// A parameter shortly before a root of the polynomial with coefficients `c`, c0 > 0 ≥ c3, up to which it certainly
/// has none; None if this simple way does not find one.
#[inline]
fn approach(c: &[f64; 4]) -> Option<f64> {
    if c[3] > 0.0 {
        return None;
    }
    let slopes = [3.0 * (c[1] - c[0]), 3.0 * (c[2] - 2.0 * c[1] + c[0]), c[3] - 3.0 * (c[2] - c[1]) - c[0]];
    let (mut lo, mut hi, mut x) = (0.0, 1.0, c[0] / (c[0] - c[3]));
    for _ in 0..MAX_NEWTON {
        let value = c[0] + x * (slopes[0] + x * (slopes[1] + x * slopes[2]));
        let slope = slopes[0] + x * (2.0 * slopes[1] + x * 3.0 * slopes[2]);
        if value > 0.0 {
            lo = x;
        } else {
            hi = x;
        }
        let mut next = x - value / slope;
        if !(next > lo && next < hi) {
            next = 0.5 * (lo + hi);
        }
        let arrived = (next - x).abs() < 0.1 * ROOT_STEP;
        x = next;
        if arrived {
            break;
        }
    }
    let end = x - ROOT_STEP;
    (end > 0.0 && is_positive(c, end)).then_some(end)
}

/// Whether the coefficients on \[0, x\] are positive, or those on both halves of it.
#[inline]
fn is_positive(c: &[f64; 4], x: f64) -> bool {
    let [left, _] = split(c, x);
    if left.iter().all(|&v| v > 0.0) {
        return true;
    }
    split(&left, 0.5).iter().flatten().all(|&v| v > 0.0)
}

/// Bernstein coefficients on \[0, x\] and on \[x, 1\] (de Casteljau).
#[inline]
fn split(c: &[f64; 4], x: f64) -> [[f64; 4]; 2] {
    let mix = |p: f64, q: f64| p * (1.0 - x) + q * x;
    let (p, q, r) = (mix(c[0], c[1]), mix(c[1], c[2]), mix(c[2], c[3]));
    let (pq, qr) = (mix(p, q), mix(q, r));
    let pqr = mix(pq, qr);
    [[c[0], p, pq, pqr], [pqr, qr, r, c[3]]]
}

/// Bernstein coefficients of the same polynomial on \[t, 1\].
#[inline]
fn restrict(b: &[f64; 4], t: f64) -> [f64; 4] {
    if t == 0.0 { *b } else { split(b, t)[1] }
}
