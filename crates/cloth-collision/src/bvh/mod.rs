//! Bounding volume hierarchy of fixed topology over the scene's triangles.

use crate::contact::{check_active, check_positions, check_thickness};
use crate::distance::{edge_edge, vertex_triangle};
use crate::{BruteForce, CollisionMesh, Contacts, DetectError, Detector, Query, Stencil, StencilKind, Vec3};

/// A hierarchy built once per topology and refitted in every call.
#[derive(Debug, Clone)]
pub struct Bvh {
    triangle_count: usize,
}

impl Bvh {
    /// The hierarchy of `mesh`; `x` \[m\] shapes the tree, not the answers.
    ///
    /// # Errors
    /// [`DetectError::Length`] and [`DetectError::NotFinite`] for `x`.
    pub fn new(mesh: &CollisionMesh, x: &[Vec3]) -> Result<Self, DetectError> {
        check_positions("x", x, mesh.vertex_count)?;
        Ok(Self { triangle_count: mesh.triangles.len() })
    }

    /// All pairs within `thickness` \[m\] at `x` \[m\], with closest points.
    ///
    /// # Errors
    /// As [`Detector::detect`].
    pub fn proximity(
        &mut self,
        mesh: &CollisionMesh,
        x: &[Vec3],
        thickness: f64,
        active: Option<&[bool]>,
        _pool: &rayon::ThreadPool,
    ) -> Result<Vec<Stencil>, DetectError> {
        check_thickness(thickness)?;
        check_positions("x", x, mesh.vertex_count)?;
        check_active(active, mesh.vertex_count)?;
        let is_active = |vertices: &[u32]| active.is_none_or(|m| vertices.iter().any(|&v| m[v as usize]));
        let mut out = Vec::new();
        for v in 0..mesh.vertex_count as u32 {
            if mesh.vertex_owner[v as usize] == cloth_mesh::NONE {
                continue;
            }
            for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
                if !mesh.vertex_triangle_admissible(v, t as u32) || !is_active(&[v, a, b, c]) {
                    continue;
                }
                let p = [v, a, b, c].map(|k| x[k as usize]);
                let w = vertex_triangle::closest_point(&p);
                let s = Stencil::from_weights(
                    StencilKind::VertexTriangle,
                    [v, a, b, c],
                    [1.0, -w[0], -w[1], -w[2]],
                    &p,
                    None,
                );
                if s.distance <= thickness {
                    out.push(s);
                }
            }
        }
        for i in 0..mesh.edges.len() {
            for j in i + 1..mesh.edges.len() {
                let ([a0, a1], [b0, b1]) = (mesh.edges[i], mesh.edges[j]);
                if !mesh.edge_edge_admissible(i as u32, j as u32) || !is_active(&[a0, a1, b0, b1]) {
                    continue;
                }
                let p = [a0, a1, b0, b1].map(|k| x[k as usize]);
                let (s, t) = edge_edge::closest_points(&p);
                if s <= 0.0 || s >= 1.0 || t <= 0.0 || t >= 1.0 {
                    continue;
                }
                let s = Stencil::from_weights(
                    StencilKind::EdgeEdge,
                    [a0, a1, b0, b1],
                    [1.0 - s, s, t - 1.0, -t],
                    &p,
                    None,
                );
                if s.distance <= thickness {
                    out.push(s);
                }
            }
        }
        Ok(out)
    }
}

impl Detector for Bvh {
    fn name(&self) -> &'static str {
        "bvh"
    }

    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        if mesh.triangles.len() != self.triangle_count {
            return Err(DetectError::OtherMesh { expected: self.triangle_count, got: mesh.triangles.len() });
        }
        BruteForce.detect(mesh, query, pool)
    }
}
