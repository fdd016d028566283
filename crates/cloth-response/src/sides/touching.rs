//! The side of a pair that is met touching.

use super::Sides;
use crate::Vec3;
use crate::motion::Motion;
use cloth_collision::{CollisionMesh, Stencil, StencilKind, plane, side};

/// A relative velocity along the normal of less than this part of the vertices' speeds is none.
const SPEED_ROUNDING: f64 = 1e-9;

/// The side of a pair with nothing remembered whose points lie in a plane; ±1. See the head of this file.
pub(super) fn first_side(
    stencil: &Stencil,
    normal: Vec3,
    past: &Sides,
    mesh: &CollisionMesh,
    motion: &Motion<'_>,
) -> i8 {
    let vote = votes(stencil, normal, past, motion.x_t0);
    if vote != 0 {
        return vote;
    }
    let around = cloth_around(stencil, mesh, motion.x_t0);
    if around != 0 {
        return around;
    }
    let (mut u, mut speed) = (0.0, 0.0);
    for (v, weight) in stencil.vertices.iter().zip(&stencil.weights) {
        let velocity = &motion.buffers.velocity[*v as usize];
        u += weight * normal.dot(velocity);
        speed += weight.abs() * velocity.norm();
    }
    if u.abs() > SPEED_ROUNDING * speed {
        return if u > 0.0 { -1 } else { 1 };
    }
    let axis = normal.iamax();
    let [first, second] =
        [0, 3].map(|k| (mesh.vertex_body[stencil.vertices[k] as usize], stencil.vertices[k]));
    if (normal[axis] > 0.0) == (first > second) { 1 } else { -1 }
}

/// The side that the remembered pairs of the same vertices with features beside say; 0 where there are none.
pub(super) fn votes(stencil: &Stencil, normal: Vec3, past: &Sides, x: &[Vec3]) -> i8 {
    let [a, b, c, d] = stencil.vertices;
    // Of the pairs of vertex `v` with triangles that have one of `corners`: the unit normal to v's side.
    let of_vertex = |v: u32, corners: &[u32]| -> Vec3 {
        let kind = StencilKind::VertexTriangle;
        let first = past.list.partition_point(|s| (s.kind, s.vertices[0]) < (kind, v));
        let group = past.list[first..].iter().take_while(|s| (s.kind, s.vertices[0]) == (kind, v));
        group
            .filter(|s| s.vertices[1..].iter().any(|k| corners.contains(k)))
            .filter_map(|s| plane(kind, &s.vertices.map(|v| x[v as usize])).map(|n| n * f64::from(s.sign())))
            .sum()
    };
    let direction = match stencil.kind {
        StencilKind::VertexTriangle => of_vertex(a, &[b, c, d]),
        StencilKind::EdgeEdge => {
            let first = of_vertex(a, &[c, d]) + of_vertex(b, &[c, d]);
            first - of_vertex(c, &[a, b]) - of_vertex(d, &[a, b])
        }
    };
    let along = normal.dot(&direction);
    i8::from(along > 0.0) - i8::from(along < 0.0)
}

/// The side of the triangle on which the vertices around the vertex are, if all that are not in its plane are
/// on one; else 0.
fn cloth_around(stencil: &Stencil, mesh: &CollisionMesh, x: &[Vec3]) -> i8 {
    if stencil.kind == StencilKind::EdgeEdge {
        return 0;
    }
    let [v, a, b, c] = stencil.vertices;
    let mut all = 0;
    for &t in mesh.vertex_triangles.of(v) {
        for w in mesh.triangles[t as usize] {
            let own = side(stencil.kind, &[w, a, b, c].map(|k| x[k as usize]));
            if own * all < 0 {
                return 0;
            }
            if own != 0 {
                all = own;
            }
        }
    }
    all
}
