//! Triangles that pass through each other, decided exactly.

use crate::{Bvh, CollisionMesh, DetectError, Vec3};
use robust::{Coord, Coord3D, orient2d, orient3d};

/// Pairs of triangles of one mesh that pass through each other, sorted; see [`intersections`].
///
/// `triangles`: vertex indices; `vertices` \[m\].
///
/// # Errors
/// As [`intersections`] and [`CollisionMesh::single`].
pub fn self_intersections(
    triangles: &[[u32; 3]],
    vertices: &[Vec3],
    pool: &rayon::ThreadPool,
) -> Result<Vec<[u32; 2]>, DetectError> {
    intersections(&CollisionMesh::single(vertices.len(), triangles)?, vertices, pool)
}

/// Pairs of triangles (lower, higher) at `x` \[m\] that pass through each other, under the rules of bodies, sorted.
///
/// Closed sets, decided exactly for the given coordinates: two triangles without a common vertex meet if a side of one
/// and the other have a common point (touching and coplanar overlap included); two triangles with one common
/// vertex meet if the side opposite to it of one has a point in common with the other. Two triangles with a common
/// side are never reported, not even folded onto each other, and a triangle without area meets another only through its
/// sides, and none without area. A motion that starts without intersections and that continuous detection finds
/// free of contact ends without.
///
/// # Errors
/// [`DetectError::Length`], [`DetectError::NotFinite`].
///
/// Source: J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997.
pub fn intersections(
    mesh: &CollisionMesh,
    x: &[Vec3],
    pool: &rayon::ThreadPool,
) -> Result<Vec<[u32; 2]>, DetectError> {
    Bvh::new(mesh, x)?.intersections(mesh, x, pool)
}

/// Whether two triangles without a common vertex meet: a side of one and the other have a common point.
pub(crate) fn triangles_meet(first: [u32; 3], second: [u32; 3], x: &[Vec3]) -> bool {
    let sides = |t: [u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    sides(first).iter().any(|&side| side_meets(side, second, x))
        || sides(second).iter().any(|&side| side_meets(side, first, x))
}

/// Whether a closed segment and a closed triangle have a common point.
pub(crate) fn side_meets(side: [u32; 2], triangle: [u32; 3], x: &[Vec3]) -> bool {
    let target = Target { corners: triangle.map(|v| x[v as usize]) };
    target.meets(&x[side[0] as usize], &x[side[1] as usize])
}

struct Target {
    corners: [Vec3; 3],
}

impl Target {
    fn meets(&self, p: &Vec3, q: &Vec3) -> bool {
        let [a, b, c] = self.corners.map(coord3);
        let (p3, q3) = (coord3(*p), coord3(*q));
        let (above_p, above_q) = (orient3d(a, b, c, p3), orient3d(a, b, c, q3));
        if (above_p > 0.0 && above_q > 0.0) || (above_p < 0.0 && above_q < 0.0) {
            return false;
        }
        if above_p == 0.0 && above_q == 0.0 {
            return self.meets_in_plane(p, q);
        }
        let turns = [orient3d(p3, q3, a, b), orient3d(p3, q3, b, c), orient3d(p3, q3, c, a)];
        turns.iter().all(|&t| t >= 0.0) || turns.iter().all(|&t| t <= 0.0)
    }

    /// A segment in the triangle's plane, seen along an axis along which the triangle keeps an area.
    fn meets_in_plane(&self, p: &Vec3, q: &Vec3) -> bool {
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let flat = |v: &Vec3| Coord { x: v[i], y: v[j] };
            let [a, b, c] = [0, 1, 2].map(|k| flat(&self.corners[k]));
            let area = orient2d(a, b, c);
            if area == 0.0 {
                continue;
            }
            let (p, q) = (flat(p), flat(q));
            let outside = |r, s, t| orient2d(r, s, t) * area.signum() < 0.0;
            // Beyond one side, or all of the triangle on one side of the segment: apart; two convex sets in a plane
            // are apart only along a side of either. A segment of no length is a point: only its sides count.
            let beyond_side =
                [(a, b), (b, c), (c, a)].iter().any(|&(r, s)| outside(r, s, p) && outside(r, s, q));
            let turns = [orient2d(p, q, a), orient2d(p, q, b), orient2d(p, q, c)];
            let beside = turns.iter().all(|&t| t > 0.0) || turns.iter().all(|&t| t < 0.0);
            return !beyond_side && !beside;
        }
        false
    }
}

fn coord3(v: Vec3) -> Coord3D<f64> {
    Coord3D { x: v.x, y: v.y, z: v.z }
}
