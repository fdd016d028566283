//! The dihedral angle between two triangles that share an edge, and its derivatives.
//!
//! Corners 0, 1 are the shared edge, 2 and 3 the opposite vertices; e = x_1 − x_0, l_0 = x_2 − x_0, l_1 = x_3 − x_0,
//! n_0 = e × l_0, n_1 = l_1 × e. θ = atan2((n_0 × n_1)·ê, n_0·n_1) ∈ [−π, π] is zero when flat and ±π when folded flat.
//!
//! With t_i = l_i·e/|e|²: dθ/dx_2 = −|e| n_0/|n_0|², dθ/dx_3 = −|e| n_1/|n_1|²,
//! dθ/dx_0 = −(1 − t_0) dθ/dx_2 − (1 − t_1) dθ/dx_3, dθ/dx_1 = −t_0 dθ/dx_2 − t_1 dθ/dx_3: they sum to zero.
//!
//! A triangle flatter than 10⁻⁴ of its rest area has its gradient scaled down to zero with its normal, so that it stays
//! finite; there it is no longer the exact one.

#![allow(clippy::inline_always, reason = "measured: a call per hinge costs a third of the kernel")]

use crate::mesh::Vec3;

/// Area relative to rest under which a triangle's normal no longer gives a full gradient.
const COLLAPSED: f64 = 1e-4;

/// Rest data of one hinge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rest {
    /// Length of the shared edge [m].
    pub(crate) edge: f64,
    /// Mean height of the two triangles over it [m].
    pub(crate) height: f64,
    /// Angle in the undeformed state [rad].
    pub(crate) angle: f64,
    /// Least |n|² that gives a full gradient, per triangle [m⁴].
    floor: [f64; 2],
}

impl Rest {
    /// From the edge's rest length [m], the two rest areas [m²] and the rest angle [rad].
    pub(crate) fn new(edge: f64, areas: [f64; 2], angle: f64) -> Self {
        let floor = areas.map(|a| (2.0 * COLLAPSED * a).powi(2));
        Self { edge, height: (areas[0] + areas[1]) / edge, angle, floor }
    }

    /// dθ/dx of the corners.
    #[inline(always)]
    pub(crate) fn gradient(&self, x: &[Vec3; 4]) -> [Vec3; 4] {
        let (e, l0, l1) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        let (n0, n1) = (e.cross(&l0), l1.cross(&e));
        let e2 = e.norm_squared();
        self.gradient_of([e, l0, l1, n0, n1], e2, e2.sqrt())
    }

    #[inline(always)]
    fn gradient_of(&self, [e, l0, l1, n0, n1]: [Vec3; 5], e2: f64, length: f64) -> [Vec3; 4] {
        let g2 = n0 * (-length / n0.norm_squared().max(self.floor[0]));
        let g3 = n1 * (-length / n1.norm_squared().max(self.floor[1]));
        let inverse = 1.0 / e2.max(self.edge * self.edge * COLLAPSED * COLLAPSED);
        let (t0, t1) = (l0.dot(&e) * inverse, l1.dot(&e) * inverse);
        let g1 = -(g2 * t0 + g3 * t1);
        let g0 = -(g1 + g2 + g3);
        [g0, g1, g2, g3]
    }

    /// The angle with its gradient.
    #[inline(always)]
    pub(crate) fn angle(&self, x: &[Vec3; 4]) -> Angle {
        let (e, l0, l1) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        let (n0, n1) = (e.cross(&l0), l1.cross(&e));
        let e2 = e.norm_squared();
        let length = e2.sqrt();
        let value = (-length * n0.dot(&l1)).atan2(n0.dot(&n1));
        Angle { value, gradient: self.gradient_of([e, l0, l1, n0, n1], e2, length) }
    }

    /// dθ/dx's change along corner motions `d`: the exact second derivative of θ applied to `d`.
    pub(crate) fn gradient_change(&self, x: &[Vec3; 4], d: &[Vec3; 4]) -> [Vec3; 4] {
        let (e, l0, l1) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        let (de, dl0, dl1) = (d[1] - d[0], d[2] - d[0], d[3] - d[0]);
        let (n0, n1) = (e.cross(&l0), l1.cross(&e));
        let (dn0, dn1) = (de.cross(&l0) + e.cross(&dl0), dl1.cross(&e) + l1.cross(&de));
        let e2 = e.norm_squared().max(self.edge * self.edge * COLLAPSED * COLLAPSED);
        let length = e2.sqrt();
        let dlength = e.dot(&de) / length;
        let flap = |n: &Vec3, dn: &Vec3, floor: f64| {
            let n2 = n.norm_squared().max(floor);
            let g = n * (-length / n2);
            let dg = -(n * dlength + dn * length) / n2 + n * (2.0 * length * n.dot(dn) / (n2 * n2));
            (g, dg)
        };
        let ((g2, dg2), (g3, dg3)) = (flap(&n0, &dn0, self.floor[0]), flap(&n1, &dn1, self.floor[1]));
        let ratio = |l: &Vec3, dl: &Vec3| {
            let t = l.dot(&e) / e2;
            (t, (dl.dot(&e) + l.dot(&de) - 2.0 * t * e.dot(&de)) / e2)
        };
        let ((t0, dt0), (t1, dt1)) = (ratio(&l0, &dl0), ratio(&l1, &dl1));
        let dg1 = -(g2 * dt0 + dg2 * t0 + g3 * dt1 + dg3 * t1);
        [-(dg1 + dg2 + dg3), dg1, dg2, dg3]
    }
}

/// Angle and its gradient at one state.
#[derive(Clone, Copy)]
pub(crate) struct Angle {
    /// [rad]
    pub(crate) value: f64,
    /// dθ/dx of the corners [rad/m].
    pub(crate) gradient: [Vec3; 4],
}

/// Signed dihedral angle [rad] of corners (e0, e1, opposite, opposite).
#[inline]
pub(crate) fn dihedral_angle(x: &[Vec3; 4]) -> f64 {
    let (e, l0, l1) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
    let (n0, n1) = (e.cross(&l0), l1.cross(&e));
    // (n_0 × n_1)·ê = −|e| n_0·l_1, exact in sign even when folded flat.
    (-e.norm() * n0.dot(&l1)).atan2(n0.dot(&n1))
}
