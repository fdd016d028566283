//! Contours of the tree's blocks, found once, and whether one is simple where it lies now.

use crate::bvh::build::Tree;
use crate::{CollisionMesh, Vec3};
use cloth_mesh::NONE;

/// The closed loops that bound the triangles below each block above the leaves.
#[derive(Debug, Clone, Default)]
pub(crate) struct Contours {
    /// Loops of each such block; empty where there is none, or where the triangles do not bound closed loops that pass each
    /// vertex once and have them to their left.
    of_block: Vec<Vec<Vec<u32>>>,
}

impl Contours {
    pub(crate) fn new(tree: &Tree, mesh: &CollisionMesh) -> Self {
        // Directed sides that the sides of other triangles of the block do not cancel.
        let mut open: Vec<Vec<[u32; 2]>> = Vec::with_capacity(tree.block_count());
        for ids in &tree.triangle_ids {
            let body = mesh.vertex_body[mesh.triangles[ids[0] as usize][0] as usize];
            if !mesh.bodies_meet(body, body) {
                open.push(vec![]);
                continue;
            }
            let triangles = ids.iter().filter(|&&t| t != NONE).map(|&t| mesh.triangles[t as usize]);
            open.push(uncancelled(triangles.flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]).collect()));
        }
        let mut of_block = Vec::with_capacity(tree.inner.len());
        for inner in &tree.inner {
            let children = inner.first as usize..(inner.first + inner.count) as usize;
            let sides = uncancelled(children.flat_map(|child| open[child].iter().copied()).collect());
            of_block.push(loops(&sides));
            open.push(sides);
        }
        Self { of_block }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        let of_loops = |loops: &Vec<Vec<u32>>| {
            loops.capacity() * size_of::<Vec<u32>>()
                + loops.iter().map(|l| l.capacity() * size_of::<u32>()).sum::<usize>()
        };
        self.of_block.capacity() * size_of::<Vec<Vec<u32>>>()
            + self.of_block.iter().map(of_loops).sum::<usize>()
    }

    /// Loops of block `k` of those above the leaves.
    pub(crate) fn of_inner(&self, k: usize) -> &[Vec<u32>] {
        &self.of_block[k]
    }
}

/// Takes out pairs of opposite sides.
fn uncancelled(mut sides: Vec<[u32; 2]>) -> Vec<[u32; 2]> {
    // Sides of one edge side by side, the ones along it first.
    sides.sort_unstable_by_key(|&[a, b]| (a.min(b), a.max(b), a > b));
    let mut left = Vec::with_capacity(sides.len() / 2);
    for run in sides.chunk_by(|p, q| p == q || (p[0], p[1]) == (q[1], q[0])) {
        let along = run.iter().filter(|[a, b]| a < b).count();
        let (first, last) = (run[0], run[run.len() - 1]);
        let against = run.len() - along;
        let (side, count) = if along > against { (first, along - against) } else { (last, against - along) };
        left.extend(std::iter::repeat_n(side, count));
    }
    left
}

/// The loops of sides that leave each vertex once and come to it once; nothing otherwise.
fn loops(sides: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut sides = sides.to_vec();
    sides.sort_unstable();
    let mut ends: Vec<u32> = sides.iter().map(|s| s[1]).collect();
    ends.sort_unstable();
    let is_repeated = |pair: &[u32; 2]| pair[0] == pair[1];
    let starts_twice = sides.windows(2).any(|w| w[0][0] == w[1][0]);
    if starts_twice || ends.windows(2).any(|w| is_repeated(&[w[0], w[1]])) {
        return vec![];
    }
    let mut is_passed = vec![false; sides.len()];
    let mut loops = vec![];
    for first in 0..sides.len() {
        let (mut around, mut k) = (vec![], first);
        while !is_passed[k] {
            is_passed[k] = true;
            around.push(sides[k][0]);
            // Every vertex that a side comes to is left by one: the numbers of both are equal at each.
            let Ok(next) = sides.binary_search_by_key(&sides[k][1], |s| s[0]) else { return vec![] };
            k = next;
        }
        if !around.is_empty() {
            loops.push(around);
        }
    }
    loops
}

/// A side of a contour in the plane.
#[derive(Debug, Clone, Copy)]
struct Side {
    ends: [u32; 2],
    p: [[f64; 2]; 2],
    lo: [f64; 2],
    hi: [f64; 2],
}

/// Whether the loops, seen along `axis`, are simple, apart from each other, exactly one of them has its inside to its left, and no
/// vertex comes closer than `clearance` \[m\] to a side that it is not an end of.
pub(crate) fn is_simple(
    loops: &[Vec<u32>],
    axis: &Vec3,
    position: impl Fn(u32) -> Vec3,
    clearance: f64,
) -> bool {
    let across = if axis.x.abs() < 0.6 { Vec3::x() } else { Vec3::y() };
    let u = (across - axis * axis.dot(&across)).normalize();
    let w = axis.cross(&u);
    let (mut sides, mut outer, mut extent) = (vec![], 0, 0.0f64);
    for around in loops {
        let points: Vec<[f64; 2]> = around
            .iter()
            .map(|&v| {
                let x = position(v);
                extent = extent.max(x.x.abs()).max(x.y.abs()).max(x.z.abs());
                [u.dot(&x), w.dot(&x)]
            })
            .collect();
        let mut area = 0.0;
        for k in 0..points.len() {
            let next = (k + 1) % points.len();
            let (p, q, r) = (points[k], points[next], points[0]);
            area += (p[0] - r[0]) * (q[1] - r[1]) - (p[1] - r[1]) * (q[0] - r[0]);
            sides.push(Side {
                ends: [around[k], around[next]],
                p: [p, q],
                lo: [p[0].min(q[0]), p[1].min(q[1])],
                hi: [p[0].max(q[0]), p[1].max(q[1])],
            });
        }
        // A loop with the clearance inside or around it has an area far above the rounding.
        outer += usize::from(area > 0.0);
    }
    let clearance = clearance * (1.0 + 1e-9) + 1e-12 * extent;
    if outer != 1 {
        return false;
    }
    // In the order of their left ends, only those that are near each other that way are compared.
    sides.sort_unstable_by(|a, b| a.lo[0].total_cmp(&b.lo[0]));
    for (k, a) in sides.iter().enumerate() {
        for b in &sides[k + 1..] {
            if b.lo[0] > a.hi[0] + clearance {
                break;
            }
            let is_apart = b.lo[1] > a.hi[1] + clearance || a.lo[1] > b.hi[1] + clearance;
            if !is_apart && !are_clear(a, b, clearance) {
                return false;
            }
        }
    }
    true
}

/// Two sides do not cross, and no end is closer than `clearance` to the other side unless it is an end of that.
fn are_clear(a: &Side, b: &Side, clearance: f64) -> bool {
    for (s, t) in [(a, b), (b, a)] {
        for k in 0..2 {
            if !t.ends.contains(&s.ends[k]) && !(squared_distance(&s.p[k], &t.p) > clearance * clearance) {
                return false;
            }
        }
    }
    let shares_end = a.ends.iter().any(|v| b.ends.contains(v));
    let side =
        |p: &[f64; 2], [q, r]: &[[f64; 2]; 2]| (r[0] - q[0]) * (p[1] - q[1]) - (r[1] - q[1]) * (p[0] - q[0]);
    // The ends are clear of the lines' parts in question: the signs are those of exact arithmetic where they matter.
    let crosses = (side(&a.p[0], &b.p) > 0.0) != (side(&a.p[1], &b.p) > 0.0)
        && (side(&b.p[0], &a.p) > 0.0) != (side(&b.p[1], &a.p) > 0.0);
    shares_end || !crosses
}

fn squared_distance(p: &[f64; 2], [a, b]: &[[f64; 2]; 2]) -> f64 {
    let (d, r) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = d[0] * d[0] + d[1] * d[1];
    let t = if length > 0.0 { ((r[0] * d[0] + r[1] * d[1]) / length).clamp(0.0, 1.0) } else { 0.0 };
    let rest = [r[0] - t * d[0], r[1] - t * d[1]];
    rest[0] * rest[0] + rest[1] * rest[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simple(points: &[[f64; 2]], clearance: f64) -> bool {
        let around: Vec<u32> = (0..points.len() as u32).collect();
        let position = |v: u32| Vec3::new(points[v as usize][0], points[v as usize][1], f64::from(v));
        is_simple(&[around], &Vec3::z(), position, clearance)
    }

    #[test]
    fn a_square_is_simple_up_to_its_clearance_and_a_bow_is_not() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert!(simple(&square, 0.99));
        assert!(!simple(&square, 1.0));
        let bow = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.2]];
        assert!(!simple(&bow, 1e-6));
        let mut turned = square;
        turned.reverse();
        assert!(!simple(&turned, 0.1), "its inside is to the right");
        // An adjacent side that folds back onto the last one.
        assert!(!simple(&[[0.0, 0.0], [1.0, 0.0], [0.5, 0.0], [0.5, 1.0]], 0.0));
    }

    #[test]
    fn loops_inside_one_another_and_beside_one_another() {
        let square = |x: f64, y: f64, half: f64| {
            [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
        };
        let simple = |a: [[f64; 2]; 4], b: [[f64; 2]; 4]| {
            let points = [a, b].concat();
            let position = |v: u32| Vec3::new(points[v as usize][0], points[v as usize][1], 0.0);
            is_simple(&[vec![0, 1, 2, 3], vec![4, 5, 6, 7]], &Vec3::z(), position, 0.01)
        };
        let mut hole = square(0.0, 0.0, 0.5);
        hole.reverse();
        assert!(simple(square(0.0, 0.0, 1.0), hole));
        assert!(!simple(square(0.0, 0.0, 1.0), square(3.0, 0.0, 0.5)), "two surfaces");
        assert!(!simple(square(0.0, 0.0, 1.0), square(0.0, 0.0, 0.5)), "covered twice");
    }

    #[test]
    fn sides_cancel_and_form_loops() {
        let two = uncancelled(vec![[0, 1], [1, 2], [2, 0], [1, 3], [3, 2], [2, 1]]);
        assert_eq!(two.len(), 4);
        assert_eq!(loops(&two), vec![vec![0, 1, 3, 2]]);
        // Two triangles with one common vertex, and two that run the same way along their common edge.
        assert!(loops(&uncancelled(vec![[0, 1], [1, 2], [2, 0], [0, 3], [3, 4], [4, 0]])).is_empty());
        assert!(loops(&uncancelled(vec![[0, 1], [1, 2], [2, 0], [1, 2], [2, 3], [3, 1]])).is_empty());
    }
}
