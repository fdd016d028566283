//! Closest points of two segments.

use super::closest_on_segment;
use crate::Vec3;

/// Parameters (s, t) in \[0, 1\]² of the closest points of the segments `p[0..2]` and `p[2..4]` \[m\]:
/// p0 + s (p1 − p0) and p2 + t (p3 − p2).
///
/// Where the lines' closest points lie inside both segments they are the answer; elsewhere, and for parallel or
/// zero-length segments, the best of the four ends against the other segment (the first of equals).
pub fn closest_points(p: &[Vec3; 4]) -> (f64, f64) {
    let (u, v, r) = (p[1] - p[0], p[3] - p[2], p[0] - p[2]);
    let mut best = ((0.0, 0.0), f64::INFINITY);
    let mut consider = |s: f64, t: f64| {
        let distance2 = (r + u * s - v * t).norm_squared();
        if distance2 < best.1 {
            best = ((s, t), distance2);
        }
    };
    if let Some((s, t)) = closest_inner_points(p) {
        consider(s, t);
    }
    consider(0.0, closest_on_segment(p[0], p[2], p[3]));
    consider(1.0, closest_on_segment(p[1], p[2], p[3]));
    consider(closest_on_segment(p[2], p[0], p[1]), 0.0);
    consider(closest_on_segment(p[3], p[0], p[1]), 1.0);
    best.0
}

/// Parameters (s, t) in the open square (0, 1)² of the lines' closest points; None if they lie elsewhere or the lines
/// are parallel.
///
/// r + s u − t v is parallel to n = u×v: s = (v×r)·n / n², t = (u×r)·n / n².
fn closest_inner_points(p: &[Vec3; 4]) -> Option<(f64, f64)> {
    let (u, v, r) = (p[1] - p[0], p[3] - p[2], p[0] - p[2]);
    let n = u.cross(&v);
    let n2 = n.norm_squared();
    let (s, t) = (v.cross(&r).dot(&n), u.cross(&r).dot(&n));
    (s > 0.0 && s < n2 && t > 0.0 && t < n2).then(|| (s / n2, t / n2))
}
