//! The edge-edge stencil: its relative motion, its cubic and the directions that may separate it.

use super::cubic::Cubic;
use super::separation::Relative;
use super::{INSIDE_MARGIN, Motion, TOUCHING};
use crate::Vec3;
use crate::distance::edge_edge::closest_points;

/// The ends of edge a relative to those of edge b (a0−b0, a0−b1, a1−b0, a1−b1), and both edges' vectors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EdgeEdgeMotion {
    pub(crate) relative: Relative<4>,
    pub(crate) u: [Vec3; 2],
    pub(crate) v: [Vec3; 2],
}

impl EdgeEdgeMotion {
    pub(crate) fn new(p: &[Vec3; 8], thickness: f64) -> Self {
        let differences =
            |k: usize| [p[k] - p[k + 2], p[k] - p[k + 3], p[k + 1] - p[k + 2], p[k + 1] - p[k + 3]];
        Self {
            relative: Relative::new(differences(0), differences(4), thickness),
            u: [p[1] - p[0], p[5] - p[4]],
            v: [p[3] - p[2], p[7] - p[6]],
        }
    }

    fn edges_at(&self, t: f64) -> (Vec3, Vec3) {
        (self.u[0] * (1.0 - t) + self.u[1] * t, self.v[0] * (1.0 - t) + self.v[1] * t)
    }
}

impl Motion<4> for EdgeEdgeMotion {
    fn relative(&self) -> &Relative<4> {
        &self.relative
    }

    fn scale(&mut self, factor: f64) {
        self.relative.scale(factor);
        for vector in self.u.iter_mut().chain(&mut self.v) {
            *vector *= factor;
        }
    }

    fn cubic(&self) -> Cubic {
        Cubic::determinant(&[self.relative.d0[0], self.relative.d1[0]], &self.u, &self.v)
    }

    fn is_inside(&self, t: f64) -> bool {
        let (u, v) = self.edges_at(t);
        let r = self.relative.at(t)[0];
        let n = u.cross(&v);
        let n2 = n.norm_squared();
        if n2 <= INSIDE_MARGIN * u.norm_squared() * v.norm_squared()
            || n.dot(&r).powi(2) > TOUCHING * TOUCHING * n2
        {
            return false;
        }
        let (s, q) = (v.cross(&r).dot(&n) / n2, u.cross(&r).dot(&n) / n2);
        let inside = INSIDE_MARGIN..1.0 - INSIDE_MARGIN;
        inside.contains(&s) && inside.contains(&q)
    }

    #[inline]
    fn directions(&self, t: f64, mut visit: impl FnMut(Vec3) -> bool) {
        let (u, v) = self.edges_at(t);
        let d = self.relative.at(t);
        // Edge a as 0, u and edge b as −d00, v − d00.
        let (s, q) = closest_points(&[Vec3::zeros(), u, -d[0], v - d[0]]);
        let mix = |x: Vec3, y: Vec3, w: f64| x * (1.0 - w) + y * w;
        if visit(mix(mix(d[0], d[1], q), mix(d[2], d[3], q), s)) {
            return;
        }
        let n = u.cross(&v);
        let (across_u, across_v) = (n.cross(&u), n.cross(&v));
        // Across both edges; in their common plane, across each edge, to both sides.
        let _ = visit(if n.dot(&d[0]) > 0.0 { n } else { -n })
            || visit(across_u)
            || visit(-across_u)
            || visit(across_v)
            || visit(-across_v);
    }
}
