//! Closest point of a triangle to a point.

use super::closest_on_segment;
use crate::Vec3;

/// Barycentric weights (≥ 0, sum 1) of the point of the triangle `p[1..4]` that is closest to `p[0]` \[m\].
///
/// Inside the triangle's prism it is the orthogonal projection, weights w_a = ((b−p)×(c−p))·n / n², n = (b−a)×(c−a);
/// elsewhere, and for a triangle without area, the best of the three sides. A weight of exactly 0 says that the
/// point lies on the opposite side.
pub fn closest_point(p: &[Vec3; 4]) -> [f64; 3] {
    let [a, b, c] = [p[1] - p[0], p[2] - p[0], p[3] - p[0]];
    let n = (b - a).cross(&(c - a));
    let w = [b.cross(&c).dot(&n), c.cross(&a).dot(&n), a.cross(&b).dot(&n)];
    let sum = w[0] + w[1] + w[2];
    if w[0] > 0.0 && w[1] > 0.0 && w[2] > 0.0 && sum.is_finite() {
        return w.map(|x| x / sum);
    }
    let mut best = ([1.0, 0.0, 0.0], f64::INFINITY);
    for (i, j) in [(1, 2), (2, 3), (3, 1)] {
        let s = closest_on_segment(p[0], p[i], p[j]);
        let distance2 = ((p[i] - p[0]) * (1.0 - s) + (p[j] - p[0]) * s).norm_squared();
        if distance2 < best.1 {
            let mut weights = [0.0; 3];
            weights[i - 1] = 1.0 - s;
            weights[j - 1] = s;
            best = (weights, distance2);
        }
    }
    best.0
}
