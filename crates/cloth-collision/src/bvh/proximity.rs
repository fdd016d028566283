//! Pairs within a distance of each other at one state, with their closest points.

use super::Bvh;
use super::traverse::{Candidates, Sink, Streaming, traverse};
use crate::ccd::filter::{Row, filter, four_edge_edges_beyond, four_vertex_triangles_beyond, row};
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
    /// the lower vertex. Distances are compared as computed, to a few units of rounding. Sorted by kind, then vertices
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
        self.refit_still(mesh, &query, pool);
        if let Some(flatness) = &mut self.flatness {
            flatness.mark(&mut self.still, &self.tree, mesh, x, thickness, pool);
        }
        let rows: Vec<Row> = x.iter().map(row).collect();
        let sink = || Near {
            mesh,
            query: &query,
            rows: &rows,
            waiting: vec![],
            vertex_triangle: vec![],
            edge_edge: vec![],
        };
        let (visits, _) = traverse(&self.tree, &self.still, mesh, pool, || Streaming::new(sink()));

        let (mut vertex_triangle, mut edge_edge) = (vec![], vec![]);
        for Streaming { sink, .. } in visits {
            vertex_triangle.extend(sink.vertex_triangle);
            edge_edge.extend(sink.edge_edge);
        }
        // Equal closest features side by side, the one to keep first. Keys are sorted, not the stencils.
        let mut keys: Vec<([u32; 4], [u32; 2], u32)> = vertex_triangle
            .iter()
            .enumerate()
            .map(|(k, n): (_, &NearVertex)| (n.features, n.pair, k as u32))
            .collect();
        keys.sort_unstable();
        keys.dedup_by_key(|k| k.0);
        let mut kept: Vec<([u32; 2], u32)> = keys.into_iter().map(|k| (k.1, k.2)).collect();
        kept.sort_unstable();
        let mut edges: Vec<([u32; 2], u32)> =
            edge_edge.iter().enumerate().map(|(k, n): (_, &([u32; 2], Stencil))| (n.0, k as u32)).collect();
        edges.sort_unstable();
        let vertex_triangle = kept.into_iter().map(|k| vertex_triangle[k.1 as usize].stencil);
        let edge_edge = edges.into_iter().map(|k| edge_edge[k.1 as usize].1);
        Ok(vertex_triangle.chain(edge_edge).collect())
    }
}

struct NearVertex {
    /// Vertex and triangle.
    pair: [u32; 2],
    /// The vertices that span the two closest features: for two vertices both, sorted; else the vertex, then those
    /// of the triangle's closest feature, sorted, and [`NONE`].
    features: [u32; 4],
    stencil: Stencil,
}

struct Near<'a> {
    mesh: &'a CollisionMesh,
    query: &'a Query<'a>,
    rows: &'a [Row],
    waiting: Vec<Pair>,
    vertex_triangle: Vec<NearVertex>,
    edge_edge: Vec<([u32; 2], Stencil)>,
}

type Pair = ([u32; 2], [u32; 4]);

impl Near<'_> {
    fn is_wanted(&self, first: &[u32], second: &[u32]) -> bool {
        // The traversal has seen to the bodies.
        !first.iter().any(|v| second.contains(v))
            && !self.mesh.is_attached(first, second)
            && self.query.active.is_none_or(|mask| first.iter().chain(second).any(|&v| mask[v as usize]))
    }
}

impl Sink for Near<'_> {
    fn take(&mut self, candidates: &mut Candidates) {
        let (mesh, x, thickness) = (self.mesh, self.query.x_t1, self.query.thickness);
        let mut waiting = std::mem::take(&mut self.waiting);
        let row = |v: u32| &self.rows[v as usize];
        let rows = |pair: &Pair| [row(pair.1[0]), row(pair.1[1]), row(pair.1[2]), row(pair.1[3])];

        waiting.clear();
        for [v, t] in candidates.vertex_triangle.drain(..) {
            if v != NONE && t != NONE {
                let [a, b, c] = mesh.triangles[t as usize];
                if self.is_wanted(&[v], &[a, b, c]) {
                    waiting.push(([v, t], [v, a, b, c]));
                }
            }
        }
        filter(
            &waiting,
            rows,
            |r| four_vertex_triangles_beyond(r, thickness),
            |(pair, vertices)| {
                let p = vertices.map(|k| x[k as usize]);
                let w = vertex_triangle::closest_point(&p);
                let stencil =
                    Stencil::new(StencilKind::VertexTriangle, vertices, [1.0, -w[0], -w[1], -w[2]], &p);
                if stencil.distance <= thickness {
                    let features = features(vertices, &w);
                    self.vertex_triangle.push(NearVertex { pair, features, stencil });
                }
            },
        );

        waiting.clear();
        for [e, f] in candidates.edge_edge.drain(..) {
            if e != NONE && f != NONE {
                let pair = [e.min(f), e.max(f)];
                let (a, b) = (mesh.edges[pair[0] as usize], mesh.edges[pair[1] as usize]);
                if self.is_wanted(&a, &b) {
                    waiting.push((pair, [a[0], a[1], b[0], b[1]]));
                }
            }
        }
        filter(
            &waiting,
            rows,
            |r| four_edge_edges_beyond(r, thickness),
            |(pair, vertices)| {
                let p = vertices.map(|k| x[k as usize]);
                let (s, t) = edge_edge::closest_points(&p);
                if s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0 {
                    let stencil =
                        Stencil::new(StencilKind::EdgeEdge, vertices, [1.0 - s, s, t - 1.0, -t], &p);
                    if stencil.distance <= thickness {
                        self.edge_edge.push((pair, stencil));
                    }
                }
            },
        );
        self.waiting = waiting;
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
