//! Conservative continuous collision detection of one pair.
//!
//! Every vertex moves linearly. All arithmetic is on differences of coordinates (each exact to a relative 2⁻⁵³, so a far
//! origin costs nothing), scaled by a power of two. The [`filter`] rejects most pairs; through the step of the others
//! a [`march`] is driven by two certified statements:
//!
//! * [`separation`]: along a fixed direction the signed gaps are linear in time; as long as all exceed their error
//!   bound the pair is apart. This needs no general position: coplanar, parallel and degenerate motion included.
//! * [`cubic`]: thin pairs can touch only where their four points are coplanar; Bézier clipping bounds the next root
//!   from below.
//!
//! A time that neither statement gets past is a contact. So nothing is missed, touching counts, and an undecided
//! case is a contact.
//!
//! One pair or many ([`batch`]): the same code over one lane or several ([`lanes`], [`instructions`]), the same bits.

pub(crate) mod batch;
mod coarse;
mod cubic;
mod edge_edge;
pub(crate) mod filter;
pub(crate) mod instructions;
pub(crate) mod lanes;
#[cfg(test)]
mod lanes_agree;
mod march;
pub(crate) mod motions;
pub(crate) mod separation;
mod vertex_triangle;

use crate::{StencilKind, Vec3};
use edge_edge::EdgeEdgeMotion;
use filter::{apart, row};
use lanes::Vector;
use march::{NEVER, march};
use vertex_triangle::VertexTriangleMotion;

/// Unit of the error bounds: 32 · 2⁻⁵³.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Weights above this and a distance below [`TOUCHING`] say "contact" without a search for a separating direction.
/// That can only add contacts.
const INSIDE_MARGIN: f64 = 1e-6;
/// Distance, in units of the pair's extent; at a transversal root [`cubic::Cubic::first_root_bound`] comes as close.
const TOUCHING: f64 = 1e-9;

/// Time of the first contact of a vertex with a triangle.
///
/// `p`: v, a, b, c at t0, then at t1 \[m\]; each moves linearly. `None`: certainly no contact. `Some(t)`: t is not
/// later than the first time in \[0, 1\] at which the distance is ≤ `thickness` \[m\]; a pair that stays farther apart
/// than about 1e-14 of its size at all times gets `None`. A coordinate that is not finite gives `Some(0)`.
pub fn vertex_triangle_ccd(p: &[Vec3; 8], thickness: f64) -> Option<f64> {
    one(StencilKind::VertexTriangle, p, thickness)
}

/// Time of the first contact of two edges.
///
/// `p`: a0, a1, b0, b1 at t0, then at t1 \[m\]; each moves linearly. The answer is as in [`vertex_triangle_ccd`].
pub fn edge_edge_ccd(p: &[Vec3; 8], thickness: f64) -> Option<f64> {
    one(StencilKind::EdgeEdge, p, thickness)
}

fn one(kind: StencilKind, p: &[Vec3; 8], thickness: f64) -> Option<f64> {
    if !p.iter().all(|p| p.x.is_finite() && p.y.is_finite() && p.z.is_finite()) {
        return Some(0.0);
    }
    if apart::<f64>(kind, &p.map(Vector::from), thickness) {
        return None;
    }
    let rows = p.each_ref().map(row);
    let rows = |_: u32| rows.each_ref();
    let (mut pairs, mut times) = ([0], [NEVER]);
    match kind {
        StencilKind::VertexTriangle => {
            march::<f64, VertexTriangleMotion<f64>, 3>(rows, thickness, false, &mut pairs, &mut times);
        }
        StencilKind::EdgeEdge => {
            march::<f64, EdgeEdgeMotion<f64>, 4>(rows, thickness, false, &mut pairs, &mut times);
        }
    }
    (times[0] != NEVER).then_some(times[0])
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
