//! Closest points of the two stencils.

pub mod edge_edge;
pub mod vertex_triangle;

use crate::Vec3;

/// Parameter in \[0, 1\] of the point of the segment `a`, `b` that is closest to `p`; 0 if the segment is a point.
pub(crate) fn closest_on_segment(p: Vec3, a: Vec3, b: Vec3) -> f64 {
    let (ab, ap) = (b - a, p - a);
    let (along, length2) = (ap.dot(&ab), ab.norm_squared());
    if along <= 0.0 || length2 <= 0.0 {
        0.0
    } else if along >= length2 {
        1.0
    } else {
        along / length2
    }
}
