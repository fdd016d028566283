//! The narrow phase alone, for broad phases elsewhere.

use crate::bvh::narrow::{Narrow, Scene, merge};
use crate::bvh::traverse::{Candidates, Sink};
use crate::{CollisionMesh, Contacts, DetectError, Query};
use rayon::prelude::*;

/// Candidates per task; fixed, though nothing here depends on it.
const CHUNK: usize = 1 << 14;

/// Decides candidate pairs that another broad phase has found, piece by piece, with the code of [`crate::Bvh`]: a pair gets the
/// same answer and the same time.
pub struct NarrowPhase<'a> {
    mesh: &'a CollisionMesh,
    scene: Scene<'a>,
    all_meet: bool,
    out: Contacts,
}

impl<'a> NarrowPhase<'a> {
    /// Nothing decided yet.
    ///
    /// # Errors
    /// What [`Query::check`] refuses.
    pub fn new(mesh: &'a CollisionMesh, query: &'a Query<'a>) -> Result<Self, DetectError> {
        query.check(mesh)?;
        let bodies = 0..mesh.bodies.len() as u32;
        let all_meet = bodies.clone().all(|a| bodies.clone().all(|b| mesh.bodies_meet(a, b)));
        Ok(Self { mesh, scene: Scene::new(mesh, query), all_meet, out: Contacts::default() })
    }

    /// Decides candidates: (vertex, triangle) and (edge, edge) in any order. Pairs that are not admissible or have no active
    /// vertex are passed over; pairs that come again count again but are contacts once.
    ///
    /// # Panics
    /// If there is no such vertex, edge or triangle.
    pub fn decide(&mut self, vertex_triangle: &[[u32; 2]], edge_edge: &[[u32; 2]], pool: &rayon::ThreadPool) {
        let Self { mesh, scene, all_meet, out } = self;
        let meets = |a: u32, b: u32| {
            *all_meet || mesh.bodies_meet(mesh.vertex_body[a as usize], mesh.vertex_body[b as usize])
        };
        let of_vertex = |&[v, t]: &[u32; 2]| meets(v, mesh.triangles[t as usize][0]);
        let of_edge = |&[e, f]: &[u32; 2]| meets(mesh.edges[e as usize][0], mesh.edges[f as usize][0]);
        let decided = |vertex_triangle: &[[u32; 2]], edge_edge: &[[u32; 2]]| {
            let mut narrow = Narrow::new(scene);
            narrow.take(&mut Candidates {
                vertex_triangle: vertex_triangle.iter().filter(|p| of_vertex(p)).copied().collect(),
                edge_edge: edge_edge.iter().filter(|p| of_edge(p)).copied().collect(),
            });
            narrow
        };
        let part = pool.install(|| {
            let vertex_triangle = vertex_triangle.par_chunks(CHUNK).map(|chunk| decided(chunk, &[]));
            let edge_edge = edge_edge.par_chunks(CHUNK).map(|chunk| decided(&[], chunk));
            merge(vertex_triangle.chain(edge_edge).collect::<Vec<_>>().into_iter())
        });
        out.vertex_triangle.extend(part.vertex_triangle);
        out.time_vertex_triangle.extend(part.time_vertex_triangle);
        out.edge_edge.extend(part.edge_edge);
        out.time_edge_edge.extend(part.time_edge_edge);
        out.stats.candidates_vertex_triangle += part.stats.candidates_vertex_triangle;
        out.stats.candidates_edge_edge += part.stats.candidates_edge_edge;
        out.stats.root_searches += part.stats.root_searches;
    }

    /// All contacts: unique, sorted.
    pub fn finish(mut self) -> Contacts {
        sort_unique(&mut self.out.vertex_triangle, &mut self.out.time_vertex_triangle);
        sort_unique(&mut self.out.edge_edge, &mut self.out.time_edge_edge);
        self.out
    }
}

/// A pair that came twice got the same time twice.
fn sort_unique(pairs: &mut Vec<[u32; 2]>, times: &mut Vec<f64>) {
    let mut both: Vec<([u32; 2], f64)> = pairs.drain(..).zip(times.drain(..)).collect();
    both.sort_unstable_by_key(|c| c.0);
    both.dedup_by_key(|c| c.0);
    (*pairs, *times) = both.into_iter().unzip();
}
