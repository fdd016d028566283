//! The point of a surface nearest to a given one, found by walking from a triangle that is near.

use crate::distance::vertex_triangle;
use crate::{CollisionMesh, Vec3};

/// Triangles crossed in one walk.
const MAX_CROSSED: usize = 64;
/// A triangle is nearer than another by at least this part of the squared distance: above its rounding error, so that no walk
/// goes back and forth between triangles that share the closest point.
const NEARER: f64 = 1e-9;
/// A point with a weight below this lies on the side opposite: it is found on it from the triangle there too, and rounding
/// must not make two points of it.
const ON_SIDE: f64 = 1e-9;

/// The point of a surface that is nearest to a given one, as far as a walk found it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Its triangle.
    pub triangle: u32,
    /// Weights of the triangle's corners, ≥ 0, sum 1; exactly 0 where the point lies on the opposite side.
    pub weights: [f64; 3],
    /// From there to the given point \[m\].
    pub r: Vec3,
}

impl CollisionMesh {
    /// The triangle with these corners, in this order.
    pub fn triangle_of(&self, corners: [u32; 3]) -> Option<u32> {
        let around = self.vertex_triangles.of(corners[0]);
        around.iter().copied().find(|&t| self.triangles[t as usize] == corners)
    }

    /// The surface's point nearest to `p` \[m\] among those that are reached from the triangle `start` over its closest
    /// sides and corners, each step nearer than the one before.
    ///
    /// `x`: position of a vertex \[m\]. Triangles with the vertex `own` are not gone to (that of `p`, or `NONE`).
    pub fn nearest(&self, start: u32, p: &Vec3, x: impl Fn(u32) -> Vec3, own: u32) -> Nearest {
        let look = |triangle: u32| {
            let [a, b, c] = self.triangles[triangle as usize].map(&x);
            let mut weights =
                vertex_triangle::closest_point(&[*p, a, b, c]).map(|w| if w < ON_SIDE { 0.0 } else { w });
            let sum: f64 = weights.iter().sum();
            for w in &mut weights {
                *w /= sum;
            }
            // From differences, so that a far origin costs no digits.
            let r = (p - a) * weights[0] + (p - b) * weights[1] + (p - c) * weights[2];
            Nearest { triangle, weights, r }
        };
        let mut now = look(start);
        for _ in 0..MAX_CROSSED {
            let corners = self.triangles[now.triangle as usize];
            let on = |k: &usize| now.weights[*k] != 0.0;
            let Some(first) = (0..3).find(on).filter(|_| now.weights.contains(&0.0)) else { break };
            let mut best = now;
            for &t in self.vertex_triangles.of(corners[first]) {
                let other = &self.triangles[t as usize];
                let shares = (0..3).filter(on).all(|k| other.contains(&corners[k]));
                if t == now.triangle || !shares || other.contains(&own) {
                    continue;
                }
                let found = look(t);
                if found.r.norm_squared() < best.r.norm_squared() * (1.0 - NEARER) {
                    best = found;
                }
            }
            if best.triangle == now.triangle {
                break;
            }
            now = best;
        }
        now
    }
}
