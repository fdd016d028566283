//! The vertex-triangle stencil: its relative motion, its cubic and the directions that may separate it.

use super::cubic::Cubic;
use super::filter::Points;
use super::lanes::{Lanes, Vector};
use super::march::{Directions, Motion};
use super::separation::Relative;
use super::{INSIDE_MARGIN, TOUCHING};
use crate::StencilKind;
use crate::distance::vertex_triangle::weights;

/// The triangle's corners relative to the vertex.
pub(crate) struct VertexTriangleMotion<L>(Relative<L, 3>);

impl<L: Lanes> Motion<L, 3> for VertexTriangleMotion<L> {
    const KIND: StencilKind = StencilKind::VertexTriangle;

    #[inline(always)]
    fn new(p: &Points<L>, thickness: f64) -> Self {
        Self(Relative::new(
            [p[1] - p[0], p[2] - p[0], p[3] - p[0]],
            [p[5] - p[4], p[6] - p[4], p[7] - p[4]],
            thickness,
        ))
    }

    #[inline(always)]
    fn relative(&self) -> &Relative<L, 3> {
        &self.0
    }

    #[inline(always)]
    fn scale(&mut self, factor: L) {
        self.0.scale(factor);
    }

    #[inline(always)]
    fn cubic(&self) -> Cubic<L> {
        let Relative { d0, d1, .. } = &self.0;
        Cubic::determinant([d0[0], d1[0]], [d0[1], d1[1]], [d0[2], d1[2]])
    }

    #[inline(always)]
    fn is_inside(&self, t: L) -> L::Mask {
        let [a, b, c] = self.0.at(t);
        let n = (b - a).cross(c - a);
        let is_near = !n.dot(a).abs().greater(L::splat(TOUCHING) * n.norm_squared().sqrt());
        let w = [b.cross(c).dot(n), c.cross(a).dot(n), a.cross(b).dot(n)];
        let margin = L::splat(INSIDE_MARGIN) * (w[0] + w[1] + w[2]);
        is_near & w[0].greater(margin) & w[1].greater(margin) & w[2].greater(margin)
    }

    #[inline(always)]
    fn directions(&self, t: L, visit: &mut impl Directions<L>) {
        let zero = L::splat(0.0);
        let [a, b, c] = self.0.at(t);
        let w = weights([Vector([zero; 3]), a, b, c]);
        if visit.is_content(a.scale(w[0]) + b.scale(w[1]) + c.scale(w[2])) {
            return;
        }
        let n = (b - a).cross(c - a);
        // Across the plane; in the plane, from each side inwards.
        let _ = visit.is_content(Vector::select(n.dot(a).greater(zero), n, n.negated()))
            || visit.is_content(n.cross(b - a))
            || visit.is_content(n.cross(c - b))
            || visit.is_content(n.cross(a - c));
    }
}
