//! The narrow phase of a traversal: candidates in, contacts out.

use super::traverse::{Candidates, Sink};
use crate::ccd::narrow_test;
use crate::{CollisionMesh, Contacts, Query};
use cloth_mesh::NONE;

/// The contacts of one task.
pub(super) struct Narrow<'a> {
    mesh: &'a CollisionMesh,
    query: &'a Query<'a>,
    vertex_triangle: Vec<([u32; 2], f64)>,
    edge_edge: Vec<([u32; 2], f64)>,
    candidates_vertex_triangle: u64,
    candidates_edge_edge: u64,
}

impl<'a> Narrow<'a> {
    pub(super) fn new(mesh: &'a CollisionMesh, query: &'a Query<'a>) -> Self {
        Self {
            mesh,
            query,
            vertex_triangle: vec![],
            edge_edge: vec![],
            candidates_vertex_triangle: 0,
            candidates_edge_edge: 0,
        }
    }

    fn is_active(&self, vertices: [u32; 4]) -> bool {
        self.query.active.is_none_or(|mask| vertices.iter().any(|&v| mask[v as usize]))
    }
}

impl Sink for Narrow<'_> {
    fn take(&mut self, candidates: &mut Candidates) {
        for [v, t] in candidates.vertex_triangle.drain(..) {
            if v == NONE || t == NONE || !self.mesh.vertex_triangle_admissible(v, t) {
                continue;
            }
            let [a, b, c] = self.mesh.triangles[t as usize];
            if !self.is_active([v, a, b, c]) {
                continue;
            }
            self.candidates_vertex_triangle += 1;
            if let Some(time) = narrow_test::vertex_triangle(self.query, [v, a, b, c]) {
                self.vertex_triangle.push(([v, t], time));
            }
        }
        for [e, f] in candidates.edge_edge.drain(..) {
            if e == NONE || f == NONE || !self.mesh.edge_edge_admissible(e, f) {
                continue;
            }
            let pair = [e.min(f), e.max(f)];
            let ([a0, a1], [b0, b1]) = (self.mesh.edges[pair[0] as usize], self.mesh.edges[pair[1] as usize]);
            if !self.is_active([a0, a1, b0, b1]) {
                continue;
            }
            self.candidates_edge_edge += 1;
            if let Some(time) = narrow_test::edge_edge(self.query, [a0, a1, b0, b1]) {
                self.edge_edge.push((pair, time));
            }
        }
    }
}

/// All contacts, sorted. Each pair comes from one task only.
pub(super) fn merge<'a>(sinks: impl Iterator<Item = Narrow<'a>>) -> Contacts {
    let mut out = Contacts::default();
    let (mut vertex_triangle, mut edge_edge) = (vec![], vec![]);
    for sink in sinks {
        vertex_triangle.extend(sink.vertex_triangle);
        edge_edge.extend(sink.edge_edge);
        out.stats.candidates_vertex_triangle += sink.candidates_vertex_triangle;
        out.stats.candidates_edge_edge += sink.candidates_edge_edge;
    }
    vertex_triangle.sort_unstable_by_key(|c| c.0);
    edge_edge.sort_unstable_by_key(|c| c.0);
    (out.vertex_triangle, out.time_vertex_triangle) = vertex_triangle.into_iter().unzip();
    (out.edge_edge, out.time_edge_edge) = edge_edge.into_iter().unzip();
    out
}
