//! Conservative continuous collision detection of one pair.

use crate::Vec3;

/// Time of the first contact of a vertex with a triangle.
///
/// `p`: v, a, b, c at t0, then at t1 \[m\]; each moves linearly. `None`: certainly no contact. `Some(t)`: t is not
/// later than the first time in \[0, 1\] at which the distance is ≤ `thickness` \[m\].
pub fn vertex_triangle_ccd(p: &[Vec3; 8], thickness: f64) -> Option<f64> {
    boxes_overlap(p, 1, thickness).then_some(0.0)
}

/// Time of the first contact of two edges.
///
/// `p`: a0, a1, b0, b1 at t0, then at t1 \[m\]; each moves linearly. The answer is as in [`vertex_triangle_ccd`].
pub fn edge_edge_ccd(p: &[Vec3; 8], thickness: f64) -> Option<f64> {
    boxes_overlap(p, 2, thickness).then_some(0.0)
}

fn boxes_overlap(p: &[Vec3; 8], split: usize, thickness: f64) -> bool {
    (0..3).all(|axis| {
        let range = |part: std::ops::Range<usize>| {
            part.flat_map(|k| [p[k][axis], p[k + 4][axis]])
                .fold((f64::INFINITY, f64::NEG_INFINITY), |r, x| (r.0.min(x), r.1.max(x)))
        };
        let (a, b) = (range(0..split), range(split..4));
        a.0 <= (b.1 + thickness).next_up() && b.0 <= (a.1 + thickness).next_up()
    })
}

/// The narrow phase of a query: gathers the points and asks the single-pair tests.
pub(crate) mod narrow_test {
    use crate::{Mode, Query, Vec3};

    fn gather(query: &Query<'_>, v: [u32; 4]) -> [Vec3; 8] {
        let start = if query.mode == Mode::Continuous { query.x_t0 } else { query.x_t1 };
        let (x, y) = (v.map(|k| start[k as usize]), v.map(|k| query.x_t1[k as usize]));
        [x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3]]
    }

    fn time(query: &Query<'_>, time: f64) -> f64 {
        if query.mode == Mode::Continuous { time } else { 1.0 }
    }

    pub(crate) fn vertex_triangle(query: &Query<'_>, v: [u32; 4]) -> Option<f64> {
        super::vertex_triangle_ccd(&gather(query, v), query.thickness).map(|t| time(query, t))
    }

    pub(crate) fn edge_edge(query: &Query<'_>, v: [u32; 4]) -> Option<f64> {
        super::edge_edge_ccd(&gather(query, v), query.thickness).map(|t| time(query, t))
    }
}
