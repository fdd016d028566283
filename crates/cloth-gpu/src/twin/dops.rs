//! Twin of `dops.wgsl`.

use crate::limits::{POSITION_ERROR, ROUNDING};

/// What slabs are taken to be off by together; less loses contacts.
pub const SLACK: f32 = 4.0 * POSITION_ERROR + 8.0 * ROUNDING;

/// Least and most along the six diagonals at t0, then at t1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dop {
    /// Least.
    pub low: [f32; 12],
    /// Most.
    pub high: [f32; 12],
}

/// The slabs of a vertex that is at `p` at t0 and at `q` at t1, each (x, y, z, r).
pub fn vertex_dop(p: [f32; 4], q: [f32; 4]) -> Dop {
    let diagonals =
        |p: [f32; 4]| [p[0] + p[1], p[0] + p[2], p[1] + p[2], p[0] - p[1], p[0] - p[2], p[1] - p[2]];
    let mut d = [0.0; 12];
    d[..6].copy_from_slice(&diagonals(p));
    d[6..].copy_from_slice(&diagonals(q));
    Dop { low: d, high: d }
}

impl Dop {
    /// The slabs around both.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|k| self.low[k].min(other.low[k])),
            high: std::array::from_fn(|k| self.high[k].max(other.high[k])),
        }
    }

    /// Whether what is in them may come as close as `thickness` at some time of the step; `slack`: [`SLACK`].
    pub fn may_touch(&self, other: &Self, thickness: f32, slack: f32) -> bool {
        let slack = 1.41422 * thickness + slack;
        let above = |a: &Self, b: &Self, k: usize| {
            a.low[k] - b.high[k] > slack && a.low[k + 6] - b.high[k + 6] > slack
        };
        !(0..6).any(|k| above(self, other, k) || above(other, self, k))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diagonals_tell_apart_what_boxes_do_not() {
        let at = |x: f32, y: f32| [x, y, 0.0, 0.0];
        // Two parallel edges along the diagonal of their common box.
        let edge = |p: [f32; 4], q: [f32; 4]| vertex_dop(p, p).hull(vertex_dop(q, q));
        let (a, b) = (edge(at(0.0, 0.1), at(0.9, 1.0)), edge(at(0.1, 0.0), at(1.0, 0.9)));
        assert!(!a.may_touch(&b, 0.0, SLACK) && !b.may_touch(&a, 0.0, SLACK));
        // They are 0.2 / √2 apart.
        assert!(!a.may_touch(&b, 0.1414, SLACK) && a.may_touch(&b, 0.1415, SLACK));
        // One crosses the other in the step.
        let moving = vertex_dop(at(0.0, 0.1), at(0.1, 0.0)).hull(vertex_dop(at(0.9, 1.0), at(1.0, 0.9)));
        assert!(moving.may_touch(&b, 0.0, SLACK) && moving.may_touch(&a, 0.0, SLACK));
    }
}
