//! Triangles that pass through each other: exact predicates behind a floating-point filter.

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
/// sides, and none without area. A state that continuous detection has found free of contact has no intersection.
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

/// Whether the two triangles meet in the sense of [`intersections`].
pub(crate) fn triangles_meet(first: [u32; 3], second: [u32; 3], x: &[Vec3]) -> bool {
    let shared = first.iter().filter(|v| second.contains(v)).count();
    if shared >= 2 {
        return false;
    }
    sides_meet(first, second, shared, x) || sides_meet(second, first, shared, x)
}

/// Whether a side of `first` that has no vertex in common with `second` meets it.
fn sides_meet(first: [u32; 3], second: [u32; 3], shared: usize, x: &[Vec3]) -> bool {
    let target = Target::new(second.map(|v| x[v as usize]));
    let p = first.map(|v| x[v as usize]);
    if shared == 0 {
        let heights = p.map(|p| target.height(&p));
        if target.all_on_one_side(&heights) {
            return false;
        }
    }
    (0..3).any(|k| {
        let (i, j) = (k, (k + 1) % 3);
        !(shared == 1 && (second.contains(&first[i]) || second.contains(&first[j])))
            && target.meets(&p[i], &p[j])
    })
}

/// A triangle prepared for tests against segments.
struct Target {
    corners: [Vec3; 3],
    sides: [Vec3; 3],
    normal: Vec3,
}

/// Relative error bound of the filter's dot products, in units of |n|₁ max|d|: 2⁻⁵³ for each difference, 3·2⁻⁵³ for the
/// dot product, and room for higher orders. The direction n itself is taken as it is: any direction may separate.
const FILTER_ERROR: f64 = 8.0 * f64::EPSILON;

impl Target {
    fn new(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        let sides = [b - a, c - b, a - c];
        Self { corners, sides, normal: sides[0].cross(&-sides[2]) }
    }

    /// Smallest and largest n·(p − corner), widened by their errors.
    fn height(&self, p: &Vec3) -> [f64; 2] {
        self.range(&self.normal, p)
    }

    fn range(&self, n: &Vec3, p: &Vec3) -> [f64; 2] {
        let (mut lo, mut hi, mut size) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
        for corner in &self.corners {
            let d = p - corner;
            let g = n.dot(&d);
            lo = lo.min(g);
            hi = hi.max(g);
            size = size.max(d.amax());
        }
        let error = FILTER_ERROR * (n.x.abs() + n.y.abs() + n.z.abs()) * size + f64::MIN_POSITIVE;
        [lo - error, hi + error]
    }

    fn all_on_one_side(&self, heights: &[[f64; 2]]) -> bool {
        heights.iter().all(|h| h[0] > 0.0) || heights.iter().all(|h| h[1] < 0.0)
    }

    /// Whether the closed segment and the closed triangle have a common point.
    fn meets(&self, p: &Vec3, q: &Vec3) -> bool {
        if self.all_on_one_side(&[self.height(p), self.height(q)]) {
            return false;
        }
        for side in &self.sides {
            // Points out of the triangle, in its plane: a segment beyond all corners along it is apart.
            let outward = side.cross(&self.normal);
            if self.range(&outward, p)[0] > 0.0 && self.range(&outward, q)[0] > 0.0 {
                return false;
            }
        }
        self.meets_exactly(p, q)
    }

    fn meets_exactly(&self, p: &Vec3, q: &Vec3) -> bool {
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
