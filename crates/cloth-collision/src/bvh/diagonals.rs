//! What the leaves reach along the diagonals of the coordinate planes: a tilted patch of cloth fills little of its box, and
//! two of them, one close above the other, are often apart along a diagonal where their boxes overlap.
//!
//! With its box these are a polytope of 18 faces per leaf. Source: J. T. Klosowski, M. Held, J. S. B. Mitchell, H. Sowizral,
//! K. Zikan, "Efficient Collision Detection Using Bounding Volume Hierarchies of k-DOPs", 1998.

use crate::bounds::MovingBox;

/// Entries per end: x + y, y + z, z + x, one without use, x − y, y − z, z − x, another one.
const ENTRIES: usize = 8;

/// Reach along the diagonals, at both ends of the step (two `ENDS`) or at rest (one), in single precision, rounded outward.
///
/// As for [`MovingBox`]: two leaves are apart during the whole step if along one diagonal the same one lies above the other
/// at all ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Diagonals<const ENDS: usize> {
    /// `[end][entry]`
    pub(super) lo: [[f32; ENTRIES]; ENDS],
    pub(super) hi: [[f32; ENTRIES]; ENDS],
}

impl<const ENDS: usize> Diagonals<ENDS> {
    /// The reach of what lies in these boxes, of which there is one at least.
    #[inline]
    pub(super) fn around<'a>(boxes: impl Iterator<Item = &'a MovingBox<ENDS>>) -> Self {
        let mut out = Self { lo: [[f32::INFINITY; ENTRIES]; ENDS], hi: [[f32::NEG_INFINITY; ENTRIES]; ENDS] };
        for bounds in boxes {
            for end in 0..ENDS {
                let ([x, y, z], [right, top, front]) = (bounds.lo[end], bounds.hi[end]);
                let (lo, next_lo) = ([x, y, z, 0.0], [y, z, x, 0.0]);
                let (hi, next_hi) = ([right, top, front, 0.0], [top, front, right, 0.0]);
                for k in 0..ENTRIES / 2 {
                    // Not `f32::min`: no sum is NaN, and its care for that costs.
                    let least =
                        |known: &mut f32, value: f32| *known = if value < *known { value } else { *known };
                    let most =
                        |known: &mut f32, value: f32| *known = if value > *known { value } else { *known };
                    least(&mut out.lo[end][k], lo[k] + next_lo[k]);
                    least(&mut out.lo[end][k + ENTRIES / 2], lo[k] - next_hi[k]);
                    most(&mut out.hi[end][k], hi[k] + next_hi[k]);
                    most(&mut out.hi[end][k + ENTRIES / 2], hi[k] - next_lo[k]);
                }
            }
        }
        for end in 0..ENDS {
            for k in 0..ENTRIES {
                out.lo[end][k] = below(out.lo[end][k]);
                out.hi[end][k] = -below(-out.hi[end][k]);
            }
        }
        out
    }

    /// Whether the leaves certainly do not touch during the step.
    #[inline(always)]
    #[allow(
        clippy::needless_bitwise_bool,
        reason = "a branch per comparison costs more than the comparisons"
    )]
    pub(super) fn are_apart(&self, other: &Self) -> bool {
        let mut apart = false;
        for k in 0..ENTRIES {
            let (mut above, mut below) = (true, true);
            for end in 0..ENDS {
                above &= self.lo[end][k] > other.hi[end][k];
                below &= self.hi[end][k] < other.lo[end][k];
            }
            apart |= above | below;
        }
        apart
    }

    /// Whether what lies in the box lies within the reach.
    pub(super) fn hold(&self, bounds: &MovingBox<ENDS>) -> bool {
        let own = Self::around(std::iter::once(bounds));
        (0..ENDS)
            .all(|e| (0..ENTRIES).all(|k| self.lo[e][k] <= own.lo[e][k] && self.hi[e][k] >= own.hi[e][k]))
    }
}

/// A number below a sum of two that was rounded to the nearest (off by 2⁻²⁴ of it at most). An infinite sum stays as it is: in
/// truth it is larger than all that are not.
#[inline]
fn below(sum: f32) -> f32 {
    const ROUNDING: f32 = 1.0 / (1 << 23) as f32;
    let below = sum - sum.abs() * ROUNDING - f32::MIN_POSITIVE;
    if sum == f32::INFINITY { sum } else { below }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    fn random() -> impl FnMut() -> f64 {
        let mut state = 5_u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        }
    }

    fn along(p: &Vec3) -> [f64; 6] {
        [p.x + p.y, p.y + p.z, p.z + p.x, p.x - p.y, p.y - p.z, p.z - p.x]
    }

    /// Points of a thin tilted patch around `middle`, at both ends of a step.
    fn patch(random: &mut impl FnMut() -> f64, middle: Vec3) -> [Vec<Vec3>; 2] {
        let (u, v) = (Vec3::new(random(), random(), random()), Vec3::new(random(), random(), random()));
        let start: Vec<Vec3> = (0..9).map(|_| middle + u * random() + v * random()).collect();
        let step = Vec3::new(random(), random(), random()) * 0.1;
        let end = start.iter().map(|p| p + step).collect();
        [start, end]
    }

    fn fitted([start, end]: &[Vec<Vec3>; 2]) -> Diagonals<2> {
        let of_vertex = |v| MovingBox::of_vertex(&[start, end], v, &Vec3::zeros(), 0.0);
        let boxes: Vec<_> = (0..start.len()).map(of_vertex).collect();
        Diagonals::around(boxes.iter())
    }

    /// Whether one lies above the other along a diagonal at both ends, in double precision.
    fn lie_apart(a: &[Vec<Vec3>; 2], b: &[Vec<Vec3>; 2]) -> bool {
        let least =
            |points: &[Vec3], k: usize| points.iter().map(|p| along(p)[k]).fold(f64::INFINITY, f64::min);
        let most =
            |points: &[Vec3], k: usize| -points.iter().map(|p| -along(p)[k]).fold(f64::INFINITY, f64::min);
        let above =
            |a: &[Vec<Vec3>; 2], b: &[Vec<Vec3>; 2], k| (0..2).all(|e| least(&a[e], k) > most(&b[e], k));
        (0..6).any(|k| above(a, b, k) || above(b, a, k))
    }

    #[test]
    fn leaves_are_apart_only_where_their_vertices_are() {
        let mut random = random();
        let (mut apart, mut missed) = (0, 0);
        for _ in 0..3000 {
            let a = patch(&mut random, Vec3::zeros());
            let middle = Vec3::new(random(), random(), random()) * 0.7;
            let b = patch(&mut random, middle);
            let (found, truth) = (fitted(&a).are_apart(&fitted(&b)), lie_apart(&a, &b));
            assert_eq!(found, fitted(&b).are_apart(&fitted(&a)));
            assert!(truth || !found, "said to be apart");
            apart += usize::from(found);
            missed += usize::from(truth && !found);
        }
        assert!(apart > 300 && missed < 3, "{apart} apart, {missed} missed");
    }

    #[test]
    fn leaves_that_touch_are_not_apart_and_would_be_without_the_rounding() {
        let mut random = random();
        let mut lost = 0;
        for _ in 0..3000 {
            // The highest vertex of one along a diagonal is the lowest vertex of the other.
            let middle = Vec3::new(random(), random(), random()) * 100.0;
            let a = patch(&mut random, middle);
            let k = (random().abs() * 12.0) as usize;
            let top = *a[0].iter().max_by(|p, q| along(p)[k].total_cmp(&along(q)[k])).unwrap();
            let mut b = patch(&mut random, top);
            b[0].retain(|p| along(p)[k] >= along(&top)[k]);
            b[0].push(top);
            b[1] = b[0].clone();
            let a = [a[0].clone(), a[0].clone()];
            let (mut x, mut y) = (fitted(&a), fitted(&b));
            assert!(!x.are_apart(&y) && !y.are_apart(&x));
            // A reach that ends a little inside.
            for d in [&mut x, &mut y] {
                for k in 0..ENTRIES {
                    for end in 0..2 {
                        d.lo[end][k] += 1e-4;
                        d.hi[end][k] -= 1e-4;
                    }
                }
            }
            lost += usize::from(x.are_apart(&y));
        }
        assert!(lost > 1000, "{lost} of 3000 would be lost");
    }

    #[test]
    fn nothing_is_apart_from_what_reaches_to_infinity() {
        let mut random = random();
        let near = fitted(&patch(&mut random, Vec3::zeros()));
        for size in [1e38, 3e38, 1e39, 1e300] {
            let far = vec![Vec3::repeat(-size), Vec3::repeat(size), Vec3::new(size, -size, 0.0)];
            let far = fitted(&[far.clone(), far]);
            assert!(!far.are_apart(&near) && !near.are_apart(&far), "{size}");
        }
    }

    #[test]
    fn a_vertex_beyond_the_reach_is_seen() {
        let mut random = random();
        let [start, end] = patch(&mut random, Vec3::zeros());
        let diagonals = fitted(&[start.clone(), end.clone()]);
        let of_vertex = |v| MovingBox::of_vertex(&[&start, &end], v, &Vec3::zeros(), 0.0);
        assert!((0..start.len()).all(|v| diagonals.hold(&of_vertex(v))));
        for entry in [0, 1, 2, 4, 5, 6] {
            let mut short = diagonals;
            short.hi[1][entry] -= 1e-3;
            assert!(!(0..start.len()).all(|v| short.hold(&of_vertex(v))), "entry {entry}");
        }
    }
}
