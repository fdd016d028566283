//! Closest point of a triangle to a point.

use super::closest_on_segment;
use crate::Vec3;
use crate::ccd::lanes::{Lanes, Mask, Vector};

/// Barycentric weights (≥ 0, sum 1) of the point of the triangle `p[1..4]` that is closest to `p[0]` \[m\].
///
/// Inside the triangle's prism it is the orthogonal projection, weights w_a = ((b−p)×(c−p))·n / n², n = (b−a)×(c−a);
/// elsewhere, and for a triangle without area, the best of the three sides. A weight of exactly 0 says that the
/// point lies on the opposite side.
pub fn closest_point(p: &[Vec3; 4]) -> [f64; 3] {
    weights(p.map(Vector::from))
}

/// [`closest_point`] in lanes.
#[inline(always)]
pub(crate) fn weights<L: Lanes>(p: [Vector<L>; 4]) -> [L; 3] {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let [a, b, c] = [p[1] - p[0], p[2] - p[0], p[3] - p[0]];
    let n = (b - a).cross(c - a);
    let w = [b.cross(c).dot(n), c.cross(a).dot(n), a.cross(b).dot(n)];
    let sum = w[0] + w[1] + w[2];
    let is_inside =
        w[0].greater(zero) & w[1].greater(zero) & w[2].greater(zero) & L::splat(f64::INFINITY).greater(sum);
    let inner = [w[0] / sum, w[1] / sum, w[2] / sum];
    if !(!is_inside).any() {
        return inner;
    }
    let (mut best, mut nearest) = ([one, zero, zero], L::splat(f64::INFINITY));
    for (i, j, opposite) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        let s = closest_on_segment(p[0], p[i + 1], p[j + 1]);
        let distance2 = (p[i + 1] - p[0]).mix(p[j + 1] - p[0], s).norm_squared();
        let is_nearer = nearest.greater(distance2);
        nearest = L::select(is_nearer, distance2, nearest);
        best[i] = L::select(is_nearer, one - s, best[i]);
        best[j] = L::select(is_nearer, s, best[j]);
        best[opposite] = L::select(is_nearer, zero, best[opposite]);
    }
    for k in 0..3 {
        best[k] = L::select(is_inside, inner[k], best[k]);
    }
    best
}
