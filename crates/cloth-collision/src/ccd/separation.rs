//! Separation of moving convex sets along a fixed direction.

use super::ROUNDING;
use crate::Vec3;

/// The relative motion of two convex sets: `K` differences of their corners (first − second), at t0 and at t1.
///
/// At time t the sets' distance is that of the origin from the convex hull of d0 + t (d1 − d0).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Relative<const K: usize> {
    pub(crate) d0: [Vec3; K],
    pub(crate) d1: [Vec3; K],
    /// Largest absolute coordinate of all differences.
    pub(crate) extent: f64,
    /// Distance that counts as contact, ≥ 0.
    pub(crate) thickness: f64,
}

/// Answer of [`Relative::separated_until`]: the direction separates up to and including t1.
pub(crate) const BEYOND_END: f64 = 2.0;

impl<const K: usize> Relative<K> {
    pub(crate) fn new(d0: [Vec3; K], d1: [Vec3; K], thickness: f64) -> Self {
        let extent = d0.iter().chain(&d1).fold(0.0f64, |extent, d| extent.max(d.amax()));
        Self { d0, d1, extent, thickness }
    }

    /// Multiplies all lengths by a power of two.
    pub(crate) fn scale(&mut self, factor: f64) {
        for vector in self.d0.iter_mut().chain(&mut self.d1) {
            *vector *= factor;
        }
        self.extent *= factor;
        self.thickness *= factor;
    }

    pub(crate) fn at(&self, t: f64) -> [Vec3; K] {
        std::array::from_fn(|k| self.d0[k] * (1.0 - t) + self.d1[k] * t)
    }

    /// A time t' such that all differences lie farther than the thickness on the positive side of the direction `n`
    /// during all of \[t, t'\]; `t` itself if that cannot be said of t, [`BEYOND_END`] if it holds up to 1.
    ///
    /// With g_k = n·d_k − thickness |n| (linear in time), t' is the first time at which a g_k falls to the error
    /// bound E. Derivation of E, with u = 2⁻⁵³, G = |n|₁ extent + thickness |n|, first order in u: each difference
    /// carries u per coordinate and its dot product 3u: 4u|n|₁ extent; |n| carries 4u and its product with the
    /// thickness u more, the difference u: 6uG; interpolation to t 3uG; the crossing (g0−E)/(g0−g1) 4uG. Their sum
    /// is less than 17uG; E = [`ROUNDING`] G leaves room for the higher orders and, with the extent scaled to 1,
    /// for underflow.
    #[inline]
    pub(crate) fn separated_until(&self, n: &Vec3, t: f64) -> f64 {
        let offset = if self.thickness > 0.0 { self.thickness * n.norm() } else { 0.0 };
        let bound =
            ROUNDING * ((n.x.abs() + n.y.abs() + n.z.abs()) * self.extent + offset) + f64::MIN_POSITIVE;
        let mut until = BEYOND_END;
        for k in 0..K {
            let (g0, g1) = (n.dot(&self.d0[k]) - offset, n.dot(&self.d1[k]) - offset);
            let now = g0 * (1.0 - t) + g1 * t;
            // Written so that a NaN counts as "not separated".
            if !(now > 2.0 * bound) {
                return t;
            }
            if !(g1 > bound) {
                until = until.min((g0 - bound) / (g0 - g1));
            }
        }
        until.max(t)
    }

    /// Whether a coordinate axis separates the sets during the whole step.
    ///
    /// Along an axis the only error is that of the differences, which is relative: their signs are exact, and this
    /// decides pairs that the error bounds of other directions cannot. The thickness is widened by two roundings.
    #[inline]
    pub(crate) fn separated_by_axis(&self) -> bool {
        let threshold = self.thickness * (1.0 + 4.0 * f64::EPSILON);
        (0..3).any(|axis| {
            let above = |d: &Vec3| d[axis] > threshold;
            let below = |d: &Vec3| d[axis] < -threshold;
            (self.d0.iter().all(above) && self.d1.iter().all(above))
                || (self.d0.iter().all(below) && self.d1.iter().all(below))
        })
    }
}
