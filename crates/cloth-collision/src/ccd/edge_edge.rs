//! The edge-edge stencil: its relative motion, its cubic and the directions that may separate it.

use super::cubic::Cubic;
use super::filter::Points;
use super::lanes::{Lanes, Vector};
use super::march::{Directions, Motion};
use super::separation::Relative;
use super::{INSIDE_MARGIN, TOUCHING};
use crate::StencilKind;
use crate::distance::edge_edge::parameters;

/// The ends of edge a relative to those of edge b (a0−b0, a0−b1, a1−b0, a1−b1), and both edges' vectors.
pub(crate) struct EdgeEdgeMotion<L> {
    relative: Relative<L, 4>,
    u: [Vector<L>; 2],
    v: [Vector<L>; 2],
}

impl<L: Lanes> EdgeEdgeMotion<L> {
    #[inline(always)]
    fn edges_at(&self, t: L) -> (Vector<L>, Vector<L>) {
        (self.u[0].mix(self.u[1], t), self.v[0].mix(self.v[1], t))
    }
}

/// The ends of edge a relative to those of edge b, at the time of points `k` to `k` + 3.
#[inline(always)]
fn differences<L: Lanes>(p: &Points<L>, k: usize) -> [Vector<L>; 4] {
    [p[k] - p[k + 2], p[k] - p[k + 3], p[k + 1] - p[k + 2], p[k + 1] - p[k + 3]]
}

impl<L: Lanes> Motion<L, 4> for EdgeEdgeMotion<L> {
    const KIND: StencilKind = StencilKind::EdgeEdge;

    #[inline(always)]
    fn new(p: &Points<L>, thickness: f64) -> Self {
        Self {
            relative: Relative::new(differences(p, 0), differences(p, 4), thickness),
            u: [p[1] - p[0], p[5] - p[4]],
            v: [p[3] - p[2], p[7] - p[6]],
        }
    }

    #[inline(always)]
    fn relative(&self) -> &Relative<L, 4> {
        &self.relative
    }

    #[inline(always)]
    fn scale(&mut self, factor: L) {
        self.relative.scale(factor);
        for end in 0..2 {
            self.u[end] = self.u[end].scale(factor);
            self.v[end] = self.v[end].scale(factor);
        }
    }

    #[inline(always)]
    fn cubic(&self) -> Cubic<L> {
        Cubic::determinant([self.relative.d0[0], self.relative.d1[0]], self.u, self.v)
    }

    #[inline(always)]
    fn is_inside(&self, t: L) -> L::Mask {
        let (u, v) = self.edges_at(t);
        let r = self.relative.d0[0].mix(self.relative.d1[0], t);
        let n = u.cross(v);
        let n2 = n.norm_squared();
        let height = n.dot(r);
        let is_plane = n2.greater(L::splat(INSIDE_MARGIN) * u.norm_squared() * v.norm_squared());
        let is_near = !(height * height).greater(L::splat(TOUCHING * TOUCHING) * n2);
        let (s, q) = (v.cross(r).dot(n) / n2, u.cross(r).dot(n) / n2);
        let (least, most) = (L::splat(INSIDE_MARGIN), L::splat(1.0 - INSIDE_MARGIN));
        let (lowest, highest) = (s.min(q), s.max(q));
        is_plane & is_near & lowest.greater(least) & most.greater(highest)
    }

    #[inline(always)]
    fn directions(&self, t: L, visit: &mut impl Directions<L>) {
        let (u, v) = self.edges_at(t);
        let d = self.relative.at(t);
        // Edge a as 0, u and edge b as −d00, v − d00.
        let (s, q) = parameters([Vector([L::splat(0.0); 3]), u, d[0].negated(), v - d[0]]);
        if visit.is_content(d[0].mix(d[1], q).mix(d[2].mix(d[3], q), s)) {
            return;
        }
        let n = u.cross(v);
        let (across_u, across_v) = (n.cross(u), n.cross(v));
        let is_above = n.dot(d[0]).greater(L::splat(0.0));
        // Across both edges; in their common plane, across each edge, to both sides.
        let _ = visit.is_content(Vector::select(is_above, n, n.negated()))
            || visit.is_content(across_u)
            || visit.is_content(across_u.negated())
            || visit.is_content(across_v)
            || visit.is_content(across_v.negated());
    }
}
