//! Twin of `dops.wgsl`.

use crate::limits::{POSITION_ERROR, ROUNDING};
use crate::twin::bounds::MovingBox;

/// What slabs are widened by on either side beside half the thickness; less loses contacts.
pub const SLACK: f32 = 2.0 * POSITION_ERROR + 8.0 * ROUNDING;

/// Slabs across the diagonals x + y, x + z, y + z, and across x − y, x − z, y − z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dop([MovingBox; 2]);

/// The slabs of a vertex that is at `p` at t0 and at `q` at t1, each (x, y, z, r); `slack`: [`SLACK`].
pub fn vertex_dop(p: [f32; 4], q: [f32; 4], thickness: f32, slack: f32) -> Dop {
    let margin = 0.7072 * thickness + slack;
    let sums = |p: [f32; 4]| [p[0] + p[1], p[0] + p[2], p[1] + p[2]];
    let differences = |p: [f32; 4]| [p[0] - p[1], p[0] - p[2], p[1] - p[2]];
    let slab = |p: [f32; 3], q: [f32; 3]| {
        MovingBox([
            p.map(|x| x - margin),
            p.map(|x| x + margin),
            q.map(|x| x - margin),
            q.map(|x| x + margin),
        ])
    };
    Dop([slab(sums(p), sums(q)), slab(differences(p), differences(q))])
}

impl Dop {
    /// The slabs around both.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        Self([self.0[0].hull(other.0[0]), self.0[1].hull(other.0[1])])
    }

    /// Whether what is in them may come as close as the thickness at some time of the step.
    pub fn may_touch(&self, other: &Self) -> bool {
        (0..2).all(|k| self.0[k].may_touch(&other.0[k]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diagonals_tell_apart_what_boxes_do_not() {
        let at = |x: f32, y: f32| [x, y, 0.0, 0.0];
        // Two parallel edges along the diagonal of their common box, 0.2 / √2 apart.
        let touch = |thickness: f32, moves: bool| {
            let vertex = |p, q| vertex_dop(p, q, thickness, SLACK);
            let edge = |p, q| vertex(p, p).hull(vertex(q, q));
            let (mut a, b) = (edge(at(0.0, 0.1), at(0.9, 1.0)), edge(at(0.1, 0.0), at(1.0, 0.9)));
            if moves {
                a = vertex(at(0.0, 0.1), at(0.1, 0.0)).hull(vertex(at(0.9, 1.0), at(1.0, 0.9)));
            }
            assert_eq!(a.may_touch(&b), b.may_touch(&a));
            a.may_touch(&b)
        };
        assert!(!touch(0.0, false) && !touch(0.141, false) && touch(0.1415, false));
        // One crosses the other in the step.
        assert!(touch(0.0, true));
    }
}
