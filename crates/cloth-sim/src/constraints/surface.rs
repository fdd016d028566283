//! Where a point is on the surface of a collider.

use crate::Vec3;
use cloth_collision::CollisionMesh;
use cloth_collision::distance::vertex_triangle;

/// Triangles walked over in one look.
const MAX_WALK: usize = 32;
/// A neighbour is nearer if its squared distance is less by more than this part: rounding is no reason to walk.
const NEARER: f64 = 1e-12;

/// The triangles around each collider vertex.
pub(crate) struct Surface {
    /// First vertex of the colliders.
    base: usize,
    offsets: Vec<u32>,
    incident: Vec<u32>,
}

/// The point of a surface that is nearest to a given one, as far as a walk found it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nearest {
    pub(crate) triangle: u32,
    /// Weights of the triangle's corners.
    pub(crate) weights: [f64; 3],
    /// From there to the given point [m].
    pub(crate) r: Vec3,
}

impl Surface {
    /// The surfaces of the bodies whose vertices start at `base`.
    pub(crate) fn new(mesh: &CollisionMesh, base: usize) -> Self {
        let mut offsets = vec![0u32; mesh.vertex_count - base + 1];
        let corners = |t: usize| mesh.triangles[t].map(|v| (v as usize).checked_sub(base));
        for t in 0..mesh.triangles.len() {
            for v in corners(t).into_iter().flatten() {
                offsets[v + 1] += 1;
            }
        }
        for v in 1..offsets.len() {
            offsets[v] += offsets[v - 1];
        }
        let mut next = offsets.clone();
        let mut incident = vec![0u32; next[next.len() - 1] as usize];
        for t in 0..mesh.triangles.len() {
            for v in corners(t).into_iter().flatten() {
                incident[next[v] as usize] = t as u32;
                next[v] += 1;
            }
        }
        Self { base, offsets, incident }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        4 * (self.offsets.len() + self.incident.len())
    }

    fn around(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize - self.base;
        &self.incident[self.offsets[v] as usize..self.offsets[v + 1] as usize]
    }

    /// The triangle with these corners.
    pub(crate) fn triangle(&self, mesh: &CollisionMesh, corners: [u32; 3]) -> Option<u32> {
        self.around(corners[0]).iter().copied().find(|&t| mesh.triangles[t as usize] == corners)
    }

    /// The surface's point that is nearest to `p`, walking from triangle `start` to nearer neighbours; `colliders` are
    /// the positions of the vertices from the first collider's on [m].
    pub(crate) fn nearest(&self, mesh: &CollisionMesh, colliders: &[Vec3], start: u32, p: &Vec3) -> Nearest {
        let look = |triangle: u32| {
            let [a, b, c] = mesh.triangles[triangle as usize].map(|v| colliders[v as usize - self.base]);
            let weights = vertex_triangle::closest_point(&[*p, a, b, c]);
            // From differences, so that a far origin costs no digits.
            let r = (p - a) * weights[0] + (p - b) * weights[1] + (p - c) * weights[2];
            Nearest { triangle, weights, r }
        };
        let mut now = look(start);
        for _ in 0..MAX_WALK {
            let corners = mesh.triangles[now.triangle as usize];
            let on = |k: &usize| now.weights[*k] > 0.0;
            let touched = (0..3).filter(on).count();
            let Some(first) = (0..3).find(on).filter(|_| touched < 3) else { break };
            let has_all = |t: &&u32| {
                let other = mesh.triangles[**t as usize];
                **t != now.triangle && (0..3).filter(on).all(|k| other.contains(&corners[k]))
            };
            let best = self
                .around(corners[first])
                .iter()
                .filter(has_all)
                .map(|&t| look(t))
                .min_by(|a, b| a.r.norm_squared().total_cmp(&b.r.norm_squared()));
            match best {
                Some(best) if best.r.norm_squared() < (1.0 - NEARER) * now.r.norm_squared() => now = best,
                _ => break,
            }
        }
        now
    }
}
