//! Closest points of two segments.

use super::closest_on_segment;
use crate::Vec3;
use crate::ccd::lanes::{Lanes, Vector};

/// Parameters (s, t) in \[0, 1\]² of the closest points of the segments `p[0..2]` and `p[2..4]` \[m\]:
/// p0 + s (p1 − p0) and p2 + t (p3 − p2).
///
/// Where the lines' closest points lie inside both segments they are the answer; elsewhere, and for parallel or
/// zero-length segments, the best of the four ends against the other segment (the first of equals).
pub fn closest_points(p: &[Vec3; 4]) -> (f64, f64) {
    parameters(p.map(Vector::from))
}

/// [`closest_points`] in lanes.
#[inline(always)]
pub(crate) fn parameters<L: Lanes>(p: [Vector<L>; 4]) -> (L, L) {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let (u, v, r) = (p[1] - p[0], p[3] - p[2], p[0] - p[2]);
    let (is_inside, s, t) = inner_parameters(u, v, r);
    let all = !zero.greater(zero);
    let (mut best, mut nearest) = ((zero, zero), L::splat(f64::INFINITY));
    // Which lanes, and what is considered there.
    for (among, s, t) in [
        (is_inside, s, t),
        (all, zero, closest_on_segment(p[0], p[2], p[3])),
        (all, one, closest_on_segment(p[1], p[2], p[3])),
        (all, closest_on_segment(p[2], p[0], p[1]), zero),
        (all, closest_on_segment(p[3], p[0], p[1]), one),
    ] {
        let distance2 = (r + u.scale(s) - v.scale(t)).norm_squared();
        let is_nearer = among & nearest.greater(distance2);
        nearest = L::select(is_nearer, distance2, nearest);
        best = (L::select(is_nearer, s, best.0), L::select(is_nearer, t, best.1));
    }
    best
}

/// Parameters (s, t) of the closest points of the lines with vectors `u` and `v`, the first's start less the second's
/// being `r`, and where both lie in the open square (0, 1)² (nowhere for parallel lines).
///
/// r + s u − t v is parallel to n = u×v: s = (v×r)·n / n², t = (u×r)·n / n².
#[inline(always)]
fn inner_parameters<L: Lanes>(u: Vector<L>, v: Vector<L>, r: Vector<L>) -> (L::Mask, L, L) {
    let zero = L::splat(0.0);
    let n = u.cross(v);
    let n2 = n.norm_squared();
    let (s, t) = (v.cross(r).dot(n), u.cross(r).dot(n));
    let is_inside = s.greater(zero) & n2.greater(s) & t.greater(zero) & n2.greater(t);
    (is_inside, s / n2, t / n2)
}
