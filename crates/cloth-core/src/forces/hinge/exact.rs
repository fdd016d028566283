//! Exact second derivatives of a hinge's energy.

use super::{COLLAPSED, Hinges, Rest};
use crate::{
    bending::BendingLaw,
    forces::{Block, Linear, corner_pairs},
    mesh::Vec3,
};

impl<L: BendingLaw> Hinges<L> {
    /// Corner forces and exact blocks of an element at a curvature; `neighbours`: their torque [N m].
    #[inline]
    pub(super) fn exact_blocks(
        &self,
        element: usize,
        x: &[Vec3],
        v: &[Vec3],
        linear: &Linear,
        (place, curvature, neighbours): (Option<L::Memory>, f64, f64),
        f: &mut [Vec3],
        blocks: &mut [Block],
    ) {
        let rest = &self.rest[element];
        let (corners, velocity) = (self.corners_of(element, x), self.corners_of(element, v));
        let gradient = Self::gradient(rest, &corners);
        let rate: f64 = (0..4).map(|c| gradient[c].dot(&velocity[c])).sum();
        let answer = self.answer(place.as_ref(), curvature, rate);
        let per_angle = rest.edge / rest.height;
        let stiffness = per_angle * answer.slope + self.bound(element, linear.iterates);
        let damping = per_angle * self.damping;
        let moment = rest.edge * answer.moment + neighbours;
        let torque = moment + (damping + linear.ahead * stiffness) * rate;
        let change = Self::gradient_change(rest, &corners, &velocity);
        for c in 0..4 {
            f[c] = gradient[c] * -torque - change[c] * (linear.ahead * moment);
        }
        let scale = linear.stiffness * stiffness + linear.damping * damping;
        for b in 0..4 {
            for axis in 0..3 {
                let mut direction = [Vec3::zeros(); 4];
                direction[b][axis] = 1.0;
                let change = Self::gradient_change(rest, &corners, &direction);
                for (p, &(row, column)) in corner_pairs(4).iter().enumerate() {
                    if column == b {
                        let entry = gradient[row] * (scale * gradient[b][axis])
                            + change[row] * (linear.stiffness * moment);
                        blocks[p][3 * axis..3 * axis + 3].copy_from_slice(entry.as_slice());
                    }
                }
            }
        }
    }

    /// dθ/dx's change along corner motions `d`: the exact second derivative of θ applied to `d`.
    fn gradient_change(rest: &Rest, x: &[Vec3; 4], d: &[Vec3; 4]) -> [Vec3; 4] {
        let (e, l0, l1) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        let (de, dl0, dl1) = (d[1] - d[0], d[2] - d[0], d[3] - d[0]);
        let (n0, n1) = (e.cross(&l0), l1.cross(&e));
        let (dn0, dn1) = (de.cross(&l0) + e.cross(&dl0), dl1.cross(&e) + l1.cross(&de));
        let e2 = e.norm_squared().max(rest.edge * rest.edge * COLLAPSED * COLLAPSED);
        let length = e2.sqrt();
        let dlength = e.dot(&de) / length;
        let flap = |n: &Vec3, dn: &Vec3, floor: f64| {
            let n2 = n.norm_squared().max(floor);
            let g = n * (-length / n2);
            let dg = -(n * dlength + dn * length) / n2 + n * (2.0 * length * n.dot(dn) / (n2 * n2));
            (g, dg)
        };
        let ((g2, dg2), (g3, dg3)) = (flap(&n0, &dn0, rest.floor[0]), flap(&n1, &dn1, rest.floor[1]));
        let ratio = |l: &Vec3, dl: &Vec3| {
            let t = l.dot(&e) / e2;
            (t, (dl.dot(&e) + l.dot(&de) - 2.0 * t * e.dot(&de)) / e2)
        };
        let ((t0, dt0), (t1, dt1)) = (ratio(&l0, &dl0), ratio(&l1, &dl1));
        let dg1 = -(g2 * dt0 + dg2 * t0 + g3 * dt1 + dg3 * t1);
        [-(dg1 + dg2 + dg3), dg1, dg2, dg3]
    }
}
