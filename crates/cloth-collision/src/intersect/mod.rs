//! Triangles that pass through each other, decided exactly.

pub(crate) mod filter;

use crate::{Bvh, CollisionMesh, DetectError, Vec3};
use robust::{Coord, Coord3D, orient2d, orient3d};
use std::borrow::Cow;

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
    intersections(&CollisionMesh::surface(vertices.len(), triangles)?, vertices, pool)
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
    let x = &within_range(x)[..];
    Bvh::new_in(mesh, x, pool)?.intersections(mesh, x, pool)
}

/// Coordinates whose products of three neither overflow nor vanish: `x` itself, or, where its extent is beyond
/// 10^±60, `x` times a power of two (exact) that brings the extent to about 1.
fn within_range(x: &[Vec3]) -> Cow<'_, [Vec3]> {
    let extent = x.iter().fold(0.0f64, |e, p| e.max(p.amax()));
    if extent == 0.0 || !extent.is_finite() || (1e-60..1e60).contains(&extent) {
        return Cow::Borrowed(x);
    }
    // Two factors: the inverse of a subnormal extent is not a finite number.
    let half = (0.5 * extent.log2()).round();
    let factor = (-half).exp2();
    Cow::Owned(x.iter().map(|p| p * factor * factor).collect())
}

/// Whether two closed triangles have a common point (through a side of one of them; see [`intersections`]).
pub(crate) fn triangles_meet(first: &[Vec3; 3], second: &[Vec3; 3]) -> bool {
    let (over_second, over_first) = (heights(second, first), heights(first, second));
    if on_one_side(&over_second) || on_one_side(&over_first) {
        return false;
    }
    [(first, second, over_second), (second, first, over_first)].iter().any(|(one, other, heights)| {
        [(0, 1), (1, 2), (2, 0)]
            .iter()
            .any(|&(i, j)| side_meets(&[one[i], one[j]], [heights[i], heights[j]], other))
    })
}

/// Whether a closed segment and a closed triangle have a common point.
pub(crate) fn segment_meets_triangle(segment: &[Vec3; 2], triangle: &[Vec3; 3]) -> bool {
    side_meets(segment, heights(triangle, segment), triangle)
}

/// On which side of the triangle's plane each point lies.
fn heights<const N: usize>(triangle: &[Vec3; 3], points: &[Vec3; N]) -> [f64; N] {
    let mut heights = [0.0; N];
    for (height, p) in heights.iter_mut().zip(points) {
        *height = height_of(&triangle[0], &triangle[1], &triangle[2], p);
    }
    heights
}

/// A number of the exact sign of det(a−d, b−d, c−d).
#[inline]
pub(crate) fn height_of(a: &Vec3, b: &Vec3, c: &Vec3, d: &Vec3) -> f64 {
    // Shewchuk's static filter, here to be inlined: the constant is his o3derrboundA for u = 2⁻⁵³.
    const BOUND: f64 = (7.0 + 56.0 * (0.5 * f64::EPSILON)) * (0.5 * f64::EPSILON);
    let (a0, b0, c0) = (a - d, b - d, c - d);
    let products = [b0.x * c0.y, c0.x * b0.y, c0.x * a0.y, a0.x * c0.y, a0.x * b0.y, b0.x * a0.y];
    let det = a0.z * (products[0] - products[1])
        + b0.z * (products[2] - products[3])
        + c0.z * (products[4] - products[5]);
    let permanent = a0.z.abs() * (products[0].abs() + products[1].abs())
        + b0.z.abs() * (products[2].abs() + products[3].abs())
        + c0.z.abs() * (products[4].abs() + products[5].abs());
    // Below the last number products may have lost all their digits.
    if det.abs() > BOUND * permanent && permanent > 1e-290 && permanent < 1e290 {
        return det;
    }
    orient3d(coord3(*a), coord3(*b), coord3(*c), coord3(*d))
}

fn on_one_side(heights: &[f64]) -> bool {
    heights.iter().all(|&h| h > 0.0) || heights.iter().all(|&h| h < 0.0)
}

fn side_meets(segment: &[Vec3; 2], heights: [f64; 2], triangle: &[Vec3; 3]) -> bool {
    if on_one_side(&heights) {
        return false;
    }
    if heights == [0.0, 0.0] {
        return meets_in_plane(segment, triangle);
    }
    let ([p, q], [a, b, c]) = (segment, triangle);
    let turns = [height_of(p, q, a, b), height_of(p, q, b, c), height_of(p, q, c, a)];
    turns.iter().all(|&t| t >= 0.0) || turns.iter().all(|&t| t <= 0.0)
}

/// A segment in the triangle's plane, seen along an axis along which the triangle keeps an area.
fn meets_in_plane(segment: &[Vec3; 2], triangle: &[Vec3; 3]) -> bool {
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let flat = |v: &Vec3| Coord { x: v[i], y: v[j] };
        let [a, b, c] = [0, 1, 2].map(|k| flat(&triangle[k]));
        let area = orient2d(a, b, c);
        if area == 0.0 {
            continue;
        }
        let (p, q) = (flat(&segment[0]), flat(&segment[1]));
        let outside = |r, s, t| orient2d(r, s, t) * area.signum() < 0.0;
        // Beyond one side, or all of the triangle on one side of the segment: apart; two convex sets in a plane
        // are apart only along a side of either. A segment of no length is a point: only its sides count.
        let beyond_side = [(a, b), (b, c), (c, a)].iter().any(|&(r, s)| outside(r, s, p) && outside(r, s, q));
        let turns = [orient2d(p, q, a), orient2d(p, q, b), orient2d(p, q, c)];
        let beside = turns.iter().all(|&t| t > 0.0) || turns.iter().all(|&t| t < 0.0);
        return !beyond_side && !beside;
    }
    false
}

fn coord3(v: Vec3) -> Coord3D<f64> {
    Coord3D { x: v.x, y: v.y, z: v.z }
}
