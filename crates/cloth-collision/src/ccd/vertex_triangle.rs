//! The vertex-triangle stencil: its relative motion, its cubic and the directions that may separate it.

use super::cubic::Cubic;
use super::separation::Relative;
use super::{INSIDE_MARGIN, Motion, TOUCHING};
use crate::Vec3;
use crate::distance::vertex_triangle::closest_point;

/// The triangle's corners relative to the vertex.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VertexTriangleMotion(pub(crate) Relative<3>);

impl VertexTriangleMotion {
    pub(crate) fn new(p: &[Vec3; 8], thickness: f64) -> Self {
        Self(Relative::new(
            [p[1] - p[0], p[2] - p[0], p[3] - p[0]],
            [p[5] - p[4], p[6] - p[4], p[7] - p[4]],
            thickness,
        ))
    }
}

impl Motion<3> for VertexTriangleMotion {
    fn relative(&self) -> &Relative<3> {
        &self.0
    }

    fn scale(&mut self, factor: f64) {
        self.0.scale(factor);
    }

    fn cubic(&self) -> Cubic {
        let Relative { d0, d1, .. } = &self.0;
        let [a, b, c] = [0, 1, 2].map(|k| [d0[k], d1[k]]);
        Cubic::determinant(&a, &b, &c)
    }

    fn is_inside(&self, t: f64) -> bool {
        let [a, b, c] = self.0.at(t);
        let n = (b - a).cross(&(c - a));
        if n.dot(&a).abs() > TOUCHING * n.norm() {
            return false;
        }
        let w = [b.cross(&c).dot(&n), c.cross(&a).dot(&n), a.cross(&b).dot(&n)];
        let margin = INSIDE_MARGIN * (w[0] + w[1] + w[2]);
        w.iter().all(|&w| w > margin)
    }

    #[inline]
    fn directions(&self, t: f64, mut visit: impl FnMut(Vec3) -> bool) {
        let [a, b, c] = self.0.at(t);
        let w = closest_point(&[Vec3::zeros(), a, b, c]);
        if visit(a * w[0] + b * w[1] + c * w[2]) {
            return;
        }
        let n = (b - a).cross(&(c - a));
        // Across the plane; in the plane, from each side inwards.
        let _ = visit(if n.dot(&a) > 0.0 { n } else { -n })
            || visit(n.cross(&(b - a)))
            || visit(n.cross(&(c - b)))
            || visit(n.cross(&(a - c)));
    }
}
