//! Exact second derivatives of a hinge's energy.

use super::Hinges;
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
        let gradient = rest.gradient(&corners);
        let rate: f64 = (0..4).map(|c| gradient[c].dot(&velocity[c])).sum();
        let answer = self.answer(place.as_ref(), curvature, rate);
        let per_angle = rest.edge / rest.height;
        let stiffness = per_angle * answer.slope + self.bound(element, linear.iterates);
        let damping = per_angle * self.damping;
        let moment = rest.edge * answer.moment + neighbours;
        let torque = moment + (damping + linear.ahead * stiffness) * rate;
        let change = rest.gradient_change(&corners, &velocity);
        for c in 0..4 {
            f[c] = gradient[c] * -torque - change[c] * (linear.ahead * moment);
        }
        let scale = linear.stiffness * stiffness + linear.damping * damping;
        for b in 0..4 {
            for axis in 0..3 {
                let mut direction = [Vec3::zeros(); 4];
                direction[b][axis] = 1.0;
                let change = rest.gradient_change(&corners, &direction);
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
}
