//! Separation of moving convex sets along a fixed direction.

use super::ROUNDING;
use super::lanes::{Lanes, Mask, Vector};

/// The relative motion of two convex sets: `K` differences of their corners (first − second), at t0 and at t1.
///
/// At time t the sets' distance is that of the origin from the convex hull of d0 + t (d1 − d0).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Relative<L, const K: usize> {
    pub(crate) d0: [Vector<L>; K],
    pub(crate) d1: [Vector<L>; K],
    /// Largest absolute coordinate of all differences.
    pub(crate) extent: L,
    /// Distance that counts as contact, ≥ 0.
    pub(crate) thickness: L,
    /// Whether the thickness is more than 0 in any lane.
    pub(crate) is_thick: bool,
}

/// The thickness is widened by two roundings: pairs all of whose differences of coordinates are beyond that are apart.
pub(crate) const WIDENED: f64 = 1.0 + 4.0 * f64::EPSILON;

/// Answer of [`Relative::separated_until`]: the direction separates up to and including t1.
pub(crate) const BEYOND_END: f64 = 2.0;

impl<L: Lanes, const K: usize> Relative<L, K> {
    #[inline(always)]
    pub(crate) fn new(d0: [Vector<L>; K], d1: [Vector<L>; K], thickness: f64) -> Self {
        let mut extent = L::splat(0.0);
        for k in 0..K {
            extent = d0[k].largest().max(d1[k].largest()).max(extent);
        }
        Self { d0, d1, extent, thickness: L::splat(thickness), is_thick: thickness > 0.0 }
    }

    /// Multiplies all lengths by a power of two.
    #[inline(always)]
    pub(crate) fn scale(&mut self, factor: L) {
        for k in 0..K {
            self.d0[k] = self.d0[k].scale(factor);
            self.d1[k] = self.d1[k].scale(factor);
        }
        self.extent = self.extent * factor;
        self.thickness = self.thickness * factor;
    }

    #[inline(always)]
    pub(crate) fn at(&self, t: L) -> [Vector<L>; K] {
        let mut d = self.d0;
        for k in 0..K {
            d[k] = d[k].mix(self.d1[k], t);
        }
        d
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
    #[inline(always)]
    pub(crate) fn separated_until(&self, n: Vector<L>, t: L) -> L {
        let zero = L::splat(0.0);
        let offset = if self.is_thick { self.thickness * n.norm_squared().sqrt() } else { zero };
        let bound =
            L::splat(ROUNDING) * (n.sum_of_sizes() * self.extent + offset) + L::splat(f64::MIN_POSITIVE);
        let twice = L::splat(2.0) * bound;
        let mut until = L::splat(BEYOND_END);
        let mut is_apart = !zero.greater(zero);
        for k in 0..K {
            let (g0, g1) = (n.dot(self.d0[k]) - offset, n.dot(self.d1[k]) - offset);
            let now = g0 * (L::splat(1.0) - t) + g1 * t;
            is_apart = is_apart & now.greater(twice);
            let falls = !g1.greater(bound);
            if falls.any() {
                until = L::select(falls, ((g0 - bound) / (g0 - g1)).min(until), until);
            }
        }
        L::select(is_apart, until.max(t), t)
    }

    /// Where a coordinate axis separates the sets during the whole step.
    ///
    /// Along an axis the only error is that of the differences, which is relative: their signs are exact, and this
    /// decides pairs that the error bounds of other directions cannot.
    #[inline(always)]
    pub(crate) fn separated_by_axis(&self) -> L::Mask {
        let threshold = self.thickness * L::splat(WIDENED);
        let below = L::splat(0.0) - threshold;
        let mut is_apart = threshold.greater(threshold);
        for axis in 0..3 {
            let (mut lo, mut hi) = (self.d0[0].0[axis], self.d0[0].0[axis]);
            for k in 0..K {
                lo = self.d0[k].0[axis].min(self.d1[k].0[axis]).min(lo);
                hi = self.d0[k].0[axis].max(self.d1[k].0[axis]).max(hi);
            }
            is_apart = is_apart | lo.greater(threshold) | below.greater(hi);
        }
        is_apart
    }
}
