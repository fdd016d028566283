//! Pairs within a distance of each other at one state, with their closest points.

use super::Bvh;
use super::traverse::{Candidates, Sink, Streaming};
use crate::distance::{edge_edge, vertex_triangle};
use crate::{CollisionMesh, DetectError, Mode, Query, Stencil, StencilKind, Vec3};
use cloth_mesh::NONE;

impl Bvh {
    /// All pairs within `thickness` \[m\] of each other at `x` \[m\], with closest points; at least one vertex active.
    ///
    /// Each meeting of surfaces is reported once: an edge-edge stencil only where the closest points lie inside both
    /// edges (elsewhere an end vertex is the closest, and its vertex-triangle stencil stands for the pair); of the
    /// vertex-triangle stencils of one vertex whose closest point is the same inner point of an edge, or the same
    /// vertex, the one of the lowest triangle; of two stencils of the same two vertices the one that starts with
    /// the lower vertex. A pair is within the thickness if its computed distance is. Sorted by kind, then vertices
    /// of the vertex-triangle stencils (vertex, triangle index) and edge indices of the edge-edge stencils.
    ///
    /// Normals point from the second point to the first; where the distance vanishes, along the plane's normal
    /// ((b−a)×(c−a), (a1−a0)×(b1−b0)).
    ///
    /// # Errors
    /// As [`crate::Detector::detect`].
    pub fn proximity(
        &mut self,
        mesh: &CollisionMesh,
        x: &[Vec3],
        thickness: f64,
        active: Option<&[bool]>,
        pool: &rayon::ThreadPool,
    ) -> Result<Vec<Stencil>, DetectError> {
        let query = Query { x_t0: x, x_t1: x, thickness, mode: Mode::Discrete, active };
        query.check(mesh)?;
        self.check_mesh(mesh)?;
        self.refit(mesh, &query, pool);
        let sink = || Near { mesh, query: &query, vertex_triangle: vec![], edge_edge: vec![] };
        let (visits, _) = self.traverse(mesh, pool, || Streaming::new(sink()));

        let (mut vertex_triangle, mut edge_edge) = (vec![], vec![]);
        for Streaming { sink, .. } in visits {
            vertex_triangle.extend(sink.vertex_triangle);
            edge_edge.extend(sink.edge_edge);
        }
        // Equal closest features side by side, the one to keep first.
        vertex_triangle.sort_unstable_by_key(|n: &NearVertex| (n.features, n.vertex, n.triangle));
        vertex_triangle.dedup_by_key(|n| n.features);
        vertex_triangle.sort_unstable_by_key(|n| (n.vertex, n.triangle));
        edge_edge.sort_unstable_by_key(|n: &([u32; 2], Stencil)| n.0);
        Ok(vertex_triangle.into_iter().map(|n| n.stencil).chain(edge_edge.into_iter().map(|n| n.1)).collect())
    }
}

struct NearVertex {
    vertex: u32,
    triangle: u32,
    /// The vertices that span the two closest features: for two vertices both, sorted; else the vertex, then those
    /// of the triangle's closest feature, sorted, and [`NONE`].
    features: [u32; 4],
    stencil: Stencil,
}

struct Near<'a> {
    mesh: &'a CollisionMesh,
    query: &'a Query<'a>,
    vertex_triangle: Vec<NearVertex>,
    edge_edge: Vec<([u32; 2], Stencil)>,
}

impl Near<'_> {
    fn is_active(&self, vertices: [u32; 4]) -> bool {
        self.query.active.is_none_or(|mask| vertices.iter().any(|&v| mask[v as usize]))
    }
}

impl Sink for Near<'_> {
    fn take(&mut self, candidates: &mut Candidates) {
        let x = self.query.x_t1;
        for [v, t] in candidates.vertex_triangle.drain(..) {
            if v == NONE || t == NONE || !self.mesh.vertex_triangle_admissible(v, t) {
                continue;
            }
            let [a, b, c] = self.mesh.triangles[t as usize];
            let vertices = [v, a, b, c];
            let p = vertices.map(|k| x[k as usize]);
            let w = vertex_triangle::closest_point(&p);
            let r = (p[0] - p[1]) * w[0] + (p[0] - p[2]) * w[1] + (p[0] - p[3]) * w[2];
            if r.norm() > self.query.thickness || !self.is_active(vertices) {
                continue;
            }
            let weights = [1.0, -w[0], -w[1], -w[2]];
            let stencil = Stencil::new(StencilKind::VertexTriangle, vertices, weights, &p);
            self.vertex_triangle.push(NearVertex {
                vertex: v,
                triangle: t,
                features: features(vertices, &w),
                stencil,
            });
        }
        for [e, f] in candidates.edge_edge.drain(..) {
            if e == NONE || f == NONE || !self.mesh.edge_edge_admissible(e, f) {
                continue;
            }
            let pair = [e.min(f), e.max(f)];
            let ([a0, a1], [b0, b1]) = (self.mesh.edges[pair[0] as usize], self.mesh.edges[pair[1] as usize]);
            let vertices = [a0, a1, b0, b1];
            let p = vertices.map(|k| x[k as usize]);
            let Some((s, t)) = edge_edge::closest_inner_points(&p) else { continue };
            let r = (p[0] - p[2]) + (p[1] - p[0]) * s - (p[3] - p[2]) * t;
            if r.norm() > self.query.thickness || !self.is_active(vertices) {
                continue;
            }
            let weights = [1.0 - s, s, t - 1.0, -t];
            self.edge_edge.push((pair, Stencil::new(StencilKind::EdgeEdge, vertices, weights, &p)));
        }
    }
}

fn features([v, a, b, c]: [u32; 4], w: &[f64; 3]) -> [u32; 4] {
    // NONE is the largest index: sorting puts it last.
    let mut of_triangle = [a, b, c];
    for k in 0..3 {
        if w[k] == 0.0 {
            of_triangle[k] = NONE;
        }
    }
    of_triangle.sort_unstable();
    if of_triangle[1] == NONE {
        return [v.min(of_triangle[0]), v.max(of_triangle[0]), NONE, NONE];
    }
    [v, of_triangle[0], of_triangle[1], of_triangle[2]]
}
