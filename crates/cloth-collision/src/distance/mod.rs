//! Closest points of the two stencils.

pub mod edge_edge;
pub mod vertex_triangle;

use crate::ccd::lanes::{Lanes, Vector};

/// Parameter in \[0, 1\] of the point of the segment `a`, `b` that is closest to `p`; 0 if the segment is a point.
#[inline(always)]
pub(crate) fn closest_on_segment<L: Lanes>(p: Vector<L>, a: Vector<L>, b: Vector<L>) -> L {
    let (zero, ab, ap) = (L::splat(0.0), b - a, p - a);
    let (along, length2) = (ap.dot(ab), ab.norm_squared());
    let is_before_end = length2.greater(along);
    let s = L::select(is_before_end, along / length2, L::splat(1.0));
    L::select(along.greater(zero) & length2.greater(zero), s, zero)
}
