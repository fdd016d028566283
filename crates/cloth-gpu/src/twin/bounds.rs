//! Twin of `triangle_bounds.wgsl`, with the functions of `boxes.wgsl`.

use crate::layout::{Bounds, SceneParams};

/// Low and high corners at t0, then at t1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovingBox(pub [[f32; 3]; 4]);

/// The number before `x`, as if there were no subnormal ones about zero.
pub fn below(x: f32) -> f32 {
    if x == 0.0 {
        return -f32::MIN_POSITIVE;
    }
    let bits = x.to_bits();
    f32::from_bits(if x > 0.0 { bits - 1 } else { bits + 1 })
}

/// The box around a vertex that is at `p` at t0 and at `q` at t1, each (x, y, z, r).
pub fn vertex_box(p: [f32; 4], q: [f32; 4]) -> MovingBox {
    let low = |p: [f32; 4]| [0, 1, 2].map(|k| below(p[k] - p[3]));
    let high = |p: [f32; 4]| [0, 1, 2].map(|k| -below(-p[k] - p[3]));
    MovingBox([low(p), high(p), low(q), high(q)])
}

impl MovingBox {
    /// The box around both.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        let mut out = self;
        for k in 0..3 {
            for (corner, pick) in [f32::min, f32::max, f32::min, f32::max].into_iter().enumerate() {
                out.0[corner][k] = pick(self.0[corner][k], other.0[corner][k]);
            }
        }
        out
    }

    /// Whether the boxes may touch at some time of the step.
    pub fn may_touch(&self, other: &Self) -> bool {
        let ([a0, b0, a1, b1], [c0, d0, c1, d1]) = (&self.0, &other.0);
        !(0..3).any(|k| (a0[k] > d0[k] && a1[k] > d1[k]) || (b0[k] < c0[k] && b1[k] < c1[k]))
    }
}

impl From<&Bounds> for MovingBox {
    fn from(b: &Bounds) -> Self {
        Self([b.low_0, b.high_0, b.low_1, b.high_1])
    }
}

/// Whether the vertex is active.
pub fn is_active(params: &SceneParams, active: &[u32], vertex: u32) -> bool {
    params.all_active != 0 || active[vertex as usize / 32] >> (vertex % 32) & 1 != 0
}

/// Boxes and spheres (centre, radius) of the triangles, and the largest radius.
pub fn triangle_bounds(
    params: &SceneParams,
    triangles: &[[u32; 4]],
    positions: &[[f32; 4]],
    active: &[u32],
) -> (Vec<Bounds>, Vec<[f32; 4]>, f32) {
    let mut bounds = vec![];
    let mut spheres = vec![];
    for &[a, b, c, body] in triangles {
        let ends = |v: u32| (positions[v as usize], positions[(params.second + v) as usize]);
        let corner = |v: u32| vertex_box(ends(v).0, ends(v).1);
        let whole = corner(a).hull(corner(b)).hull(corner(c));
        let is_active = [a, b, c].iter().any(|&v| is_active(params, active, v)).into();
        let MovingBox([low_0, high_0, low_1, high_1]) = whole;
        bounds.push(Bounds { low_0, is_active, high_0, body, low_1, high_1, ..Default::default() });

        let centre = [0, 1, 2].map(|k| 0.5 * (low_0[k].min(low_1[k]) + high_0[k].max(high_1[k])));
        let length =
            |p: [f32; 4]| (0..3).map(|k| (p[k] - centre[k]) * (p[k] - centre[k])).sum::<f32>().sqrt();
        let (mut distance, mut reach) = (0.0f32, 0.0f32);
        for v in [a, b, c] {
            let (p, q) = ends(v);
            distance = distance.max(length(p)).max(length(q));
            reach = reach.max(p[3]).max(q[3]);
        }
        let radius = (distance + 1.7321 * reach) * 1.00001;
        spheres.push([centre[0], centre[1], centre[2], radius]);
    }
    let largest = spheres.iter().fold(0.0, |r: f32, s| r.max(s[3]));
    (bounds, spheres, largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn below_is_the_number_before() {
        for x in [1.0f32, -1.0, 0.1, 3e38, -3e38, 1e-30, f32::MIN_POSITIVE] {
            assert_eq!(below(x), x.next_down());
        }
        assert!(below(0.0) < 0.0 && below(-0.0) < 0.0);
    }

    #[test]
    fn boxes_that_pass_each_other_may_touch() {
        let at = |x: f32| [x, 0.0, 0.0, 0.25];
        let (left, right) = (vertex_box(at(0.0), at(2.0)), vertex_box(at(1.0), at(1.0)));
        assert!(left.may_touch(&right) && right.may_touch(&left));
        let (before, behind) = (vertex_box(at(0.0), at(2.0)), vertex_box(at(1.0), at(3.0)));
        assert!(!before.may_touch(&behind) && !behind.may_touch(&before));
        // Closed: sides that meet, touch.
        assert!(vertex_box(at(0.0), at(0.0)).may_touch(&vertex_box(at(0.5), at(0.5))));
    }
}
