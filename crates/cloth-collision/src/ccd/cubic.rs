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

/// Steps of Bézier clipping before the present bound is returned as it stands. Convergence at a simple root is
/// quadratic (about 5 steps), at a double root it halves the distance (about 30 steps to [`ROOT_STEP`]).
const MAX_CLIPS: usize = 64;
/// A clip that moves on by less than this fraction of the step has arrived.
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
        let mut t = t;
        for _ in 0..MAX_CLIPS {
            let mut c = restrict(&self.b, t);
            if !(c[0].abs() > self.error) {
                return Some(t);
            }
            let sign = c[0].signum();
            for value in &mut c {
                *value = *value * sign - self.error;
            }
            if c.iter().all(|&v| v > 0.0) {
                return None;
            }
            // The curve lies in the hull of the points (i/3, c_i): no root before the hull reaches zero.
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

/// Bernstein coefficients of the same polynomial on \[t, 1\] (de Casteljau).
#[inline]
fn restrict(b: &[f64; 4], t: f64) -> [f64; 4] {
    let mix = |x: f64, y: f64| x * (1.0 - t) + y * t;
    let (p, q, r) = (mix(b[0], b[1]), mix(b[1], b[2]), mix(b[2], b[3]));
    let (pq, qr) = (mix(p, q), mix(q, r));
    [mix(pq, qr), qr, r, b[3]]
}
