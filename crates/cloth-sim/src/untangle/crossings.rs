//! Where an edge passes through a triangle.

use crate::Vec3;
use cloth_collision::CollisionMesh;
use std::collections::BTreeMap;

/// Crossings of one edge with one body nearer than this part of the edge are one, found on two triangles that join there.
const SAME: f64 = 1e-9;

/// An edge that passes through a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    /// Vertices of the edge.
    pub(super) edge: [u32; 2],
    /// Where on the edge, 0 to 1.
    pub(super) at: f64,
    pub(super) triangle: u32,
    /// Weights of the triangle's corners there.
    pub(super) weights: [f64; 3],
    /// Unit normal of the triangle, by its winding.
    pub(super) normal: Vec3,
}

impl Crossing {
    /// The corners of the triangle with their weights.
    pub(super) fn corners(&self, mesh: &CollisionMesh) -> [(u32, f64); 3] {
        let corners = mesh.triangles[self.triangle as usize];
        [0, 1, 2].map(|k| (corners[k], self.weights[k]))
    }
}

/// The crossings in these pairs of triangles, and the pairs that have none: they touch.
pub(super) fn crossings(
    mesh: &CollisionMesh,
    x: &[Vec3],
    pairs: &[[u32; 2]],
) -> (Vec<Crossing>, Vec<[u32; 2]>) {
    let mut all: BTreeMap<([u32; 2], u32), Crossing> = BTreeMap::new();
    let mut touching = Vec::new();
    for &[a, b] in pairs {
        let mut any = false;
        for (one, other) in [(a, b), (b, a)] {
            let corners = mesh.triangles[one as usize];
            for k in 0..3 {
                let (p, q) = (corners[k], corners[(k + 1) % 3]);
                let edge = [p.min(q), p.max(q)];
                if let Some(crossing) = crossing(mesh, x, edge, other) {
                    any = true;
                    all.insert((edge, other), crossing);
                }
            }
        }
        if !any {
            touching.push([a, b]);
        }
    }
    let mut list: Vec<Crossing> = Vec::with_capacity(all.len());
    for crossing in all.into_values() {
        let body = |t: u32| mesh.vertex_body[mesh.triangles[t as usize][0] as usize];
        let same = |known: &Crossing| {
            known.edge == crossing.edge
                && body(known.triangle) == body(crossing.triangle)
                && (known.at - crossing.at).abs() < SAME
        };
        // Of one edge they are neighbours in the list.
        if !list.iter().rev().take_while(|known| known.edge == crossing.edge).any(same) {
            list.push(crossing);
        }
    }
    (list, touching)
}

/// The point at which an edge passes from one side of a triangle to the other.
fn crossing(mesh: &CollisionMesh, x: &[Vec3], edge: [u32; 2], triangle: u32) -> Option<Crossing> {
    let corners = mesh.triangles[triangle as usize];
    if corners.iter().any(|v| edge.contains(v)) {
        return None;
    }
    let [p, q] = edge.map(|v| x[v as usize]);
    let [a, b, c] = corners.map(|v| x[v as usize]);
    let n = (b - a).cross(&(c - a));
    let (below, above) = ((p - a).dot(&n), (q - a).dot(&n));
    if below * above >= 0.0 {
        return None;
    }
    let at = below / (below - above);
    let s = p + (q - p) * at;
    let area = n.norm_squared();
    let part = |u: Vec3, v: Vec3| (u - s).cross(&(v - s)).dot(&n) / area;
    let weights = [part(b, c), part(c, a), part(a, b)];
    if weights.iter().any(|w| w.is_nan() || *w < -SAME) {
        return None;
    }
    Some(Crossing { edge, at, triangle, weights: weights.map(|w| w.max(0.0)), normal: n.try_normalize(0.0)? })
}
