//! `start = "untangle"`: a start state whose surfaces pass through each other a little is repaired, or refused.
//!
//! Where an edge of one surface pierces a triangle of another (or of the same one), the edge is cut. What the cuts
//! separate from the larger rest of its surface is on the wrong side (a region): each of its vertices goes back through
//! the surface at the point nearest to it, to the gap beyond; the triangle there gives way by as much where it can
//! move. Cuts that separate nothing, as of two borders that cross, move along the gradient by which the line of
//! intersection grows shorter. Pairs that only touch are set apart. Every pass begins with an exact search; the last one has found
//! nothing.
//!
//! No vertex goes farther than the reach from where it was: what needs more is no small penetration, and which of two
//! sides is meant cannot be told. Then the start is refused and nothing has changed.
//!
//! Sources: D. Baraff, A. Witkin and M. Kass, "Untangling Cloth", 2003 (regions); P. Volino and N. Magnenat-Thalmann,
//! "Resolving Surface Collisions through Intersection Contour Minimization", 2006 (the gradient).

mod crossings;
mod regions;

use crate::Vec3;
use cloth_collision::{CollisionMesh, DetectError, intersections};
use crossings::{Crossing, crossings};
use serde::{Deserialize, Serialize};

/// Passes after which what is left is not resolved.
const MAX_PASSES: usize = 300;
/// Passes that leave no fewer pairs than the best one before.
const PATIENCE: usize = 40;

/// What was done to a start state with intersections.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Untangled {
    /// Pairs of triangles that passed through each other.
    pub pairs: usize,
    /// Passes over what was left.
    pub passes: usize,
    /// Vertices that were moved (global indices), ascending, and how far [m].
    pub moved: Vec<(u32, f64)>,
    /// The largest of these [m].
    pub largest: f64,
}

/// What to keep to.
pub(crate) struct Limits<'a> {
    /// Vertices that may be moved.
    pub(crate) free: &'a [bool],
    /// Distance at which surfaces are left [m].
    pub(crate) gap: f64,
    /// Farthest that a vertex goes [m].
    pub(crate) reach: f64,
    /// Farthest that it goes along the gradient in one pass [m].
    pub(crate) pace: f64,
}

/// What is left of a start state that is not untangled.
#[derive(Debug)]
pub(crate) struct Tangled {
    /// Pairs at the start.
    pub(crate) before: usize,
    /// Pairs that are left in the best of the tries.
    pub(crate) left: Vec<[u32; 2]>,
}

/// Moves the free vertices of `x` [m] until no two triangles meet.
///
/// `x` is changed only where that succeeds.
pub(crate) fn untangle(
    mesh: &CollisionMesh,
    x: &mut [Vec3],
    limits: &Limits<'_>,
    pool: &rayon::ThreadPool,
) -> Result<Result<Untangled, Tangled>, DetectError> {
    let mut now = x.to_vec();
    let mut left = intersections(mesh, &now, pool)?;
    let before = left.len();
    let (mut best, mut since) = (left.clone(), 0);
    let mut passes = 0;
    while !left.is_empty() {
        passes += 1;
        since += 1;
        if passes > MAX_PASSES || since > PATIENCE {
            return Ok(Err(Tangled { before, left: best }));
        }
        let moves = moves(mesh, &now, &left, limits);
        for (i, shift) in moves.into_iter().enumerate() {
            let way = now[i] + shift - x[i];
            if way.norm() > limits.reach {
                return Ok(Err(Tangled { before, left: best }));
            }
            now[i] += shift;
        }
        left = intersections(mesh, &now, pool)?;
        if left.len() < best.len() {
            (best, since) = (left.clone(), 0);
        }
    }
    let moved: Vec<(u32, f64)> = (0u32..)
        .zip(now.iter().zip(x.iter()))
        .filter(|(_, (now, was))| now != was)
        .map(|(i, (now, was))| (i, (now - was).norm()))
        .collect();
    x.copy_from_slice(&now);
    let largest = moved.iter().map(|m| m.1).fold(0.0, f64::max);
    Ok(Ok(Untangled { pairs: before, passes, moved, largest }))
}

/// How far each vertex goes in one pass [m].
fn moves(mesh: &CollisionMesh, x: &[Vec3], pairs: &[[u32; 2]], limits: &Limits<'_>) -> Vec<Vec3> {
    let (found, touching) = crossings(mesh, x, pairs);
    let mut moves = Moves::new(x.len(), limits.free);
    let inside = regions::find(mesh, x, &found);
    for region in &inside {
        regions::leave(mesh, x, region, limits.gap, &mut moves);
    }
    let in_region = |c: &Crossing| inside.iter().any(|r| r.explains(mesh, c));
    for crossing in found.iter().filter(|c| !in_region(c)) {
        shorten(mesh, x, crossing, limits.pace, &mut moves);
    }
    for &[a, b] in &touching {
        set_apart(mesh, x, a, b, limits.gap, &mut moves);
    }
    moves.mean()
}

/// Moves of one pass, summed.
struct Moves<'a> {
    free: &'a [bool],
    sum: Vec<Vec3>,
    count: Vec<u32>,
}

impl<'a> Moves<'a> {
    fn new(count: usize, free: &'a [bool]) -> Self {
        Self { free, sum: vec![Vec3::zeros(); count], count: vec![0; count] }
    }

    /// Moves the point Σ w x of the first vertices by `shift` against that of the second ones, with the least squares of moves.
    fn relative(&mut self, first: &[(u32, f64)], second: &[(u32, f64)], shift: Vec3) {
        let share = |list: &[(u32, f64)]| -> f64 {
            list.iter().filter(|(v, _)| self.free[*v as usize]).map(|(_, w)| w * w).sum()
        };
        let sum = share(first) + share(second);
        if sum == 0.0 {
            return;
        }
        for (list, sign) in [(first, 1.0), (second, -1.0)] {
            for &(v, w) in list.iter().filter(|(v, w)| self.free[*v as usize] && *w > 0.0) {
                self.sum[v as usize] += shift * (sign * w / sum);
                self.count[v as usize] += 1;
            }
        }
    }

    fn mean(self) -> Vec<Vec3> {
        let mean = |(sum, count): (Vec3, u32)| if count == 0 { sum } else { sum / f64::from(count) };
        self.sum.into_iter().zip(self.count).map(mean).collect()
    }
}

/// Moves an edge and the triangle that it pierces so that the line in which the surfaces meet grows shorter.
fn shorten(mesh: &CollisionMesh, x: &[Vec3], crossing: &Crossing, pace: f64, moves: &mut Moves<'_>) {
    let [p, q] = crossing.edge.map(|v| x[v as usize]);
    let along = q - p;
    let length = along.norm();
    let n = crossing.normal;
    let sine = along.dot(&n) / length.max(f64::MIN_POSITIVE);
    if sine == 0.0 {
        return;
    }
    let e = along / length;
    let mut gradient = Vec3::zeros();
    for &t in mesh.vertex_triangles.of(crossing.edge[0]) {
        let triangle = &mesh.triangles[t as usize];
        let Some(&third) = triangle.iter().find(|v| !crossing.edge.contains(v)) else { continue };
        if !triangle.contains(&crossing.edge[1]) {
            continue;
        }
        // Into the triangle from its edge.
        let inner = x[third as usize] - p;
        let inner = inner - e * inner.dot(&e);
        let line = inner.cross(&e).cross(&n);
        let line = if line.dot(&inner) < 0.0 { -line } else { line };
        if let Some(r) = line.try_normalize(0.0) {
            gradient += r - n * (2.0 * e.dot(&r) / sine);
        }
    }
    // Across a smooth surface the sum nearly vanishes: then back through the triangle the shorter way.
    let shorter = if crossing.at < 0.5 { n * sine.signum() } else { -n * sine.signum() };
    let direction = gradient.try_normalize(1e-6).unwrap_or(shorter);
    let edge = [(crossing.edge[0], 1.0 - crossing.at), (crossing.edge[1], crossing.at)];
    moves.relative(&edge, &crossing.corners(mesh), direction * pace);
}

/// Sets two triangles apart that touch but do not pass through each other.
fn set_apart(mesh: &CollisionMesh, x: &[Vec3], a: u32, b: u32, gap: f64, moves: &mut Moves<'_>) {
    let (first, second) = (mesh.triangles[a as usize], mesh.triangles[b as usize]);
    let own =
        |list: [u32; 3], other: [u32; 3]| list.map(|v| (v, if other.contains(&v) { 0.0 } else { 1.0 / 3.0 }));
    let points = |list: [u32; 3]| list.map(|v| x[v as usize]);
    let (p, q) = (points(first), points(second));
    let Some(n) = (q[1] - q[0]).cross(&(q[2] - q[0])).try_normalize(0.0) else { return };
    let height: f64 = p.iter().map(|p| (p - q[0]).dot(&n)).sum();
    // In one plane: the earlier one stays above.
    let n = if height < 0.0 { -n } else { n };
    moves.relative(&own(first, second), &own(second, first), n * (0.5 * gap));
}
