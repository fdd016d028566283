//! The narrow phase of a traversal: candidates in, contacts out.

use super::traverse::{Candidates, Sink};
use crate::ccd::batch::Batch;
use crate::ccd::filter::{Row, row};
use crate::ccd::instructions::Instructions;
use crate::ccd::lanes::Rows;
use crate::{CollisionMesh, Contacts, Mode, Query, StencilKind};
use cloth_mesh::NONE;

/// Both ends of a vertex's motion, in one cache line.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Motion([Row; 2]);

/// What the narrow phase knows of a query.
pub(crate) struct Scene<'a> {
    mesh: &'a CollisionMesh,
    query: &'a Query<'a>,
    motion: Vec<Motion>,
}

impl<'a> Scene<'a> {
    pub(crate) fn new(mesh: &'a CollisionMesh, query: &'a Query<'a>) -> Self {
        let start = if query.mode == Mode::Continuous { query.x_t0 } else { query.x_t1 };
        Self {
            mesh,
            query,
            motion: start.iter().zip(query.x_t1).map(|(a, b)| Motion([row(a), row(b)])).collect(),
        }
    }

    fn is_wanted(&self, first: &[u32], second: &[u32]) -> bool {
        // The traversal has seen to the bodies.
        !first.iter().any(|v| second.contains(v))
            && !self.mesh.is_attached(first, second)
            && self.query.active.is_none_or(|mask| first.iter().chain(second).any(|&v| mask[v as usize]))
    }

    #[inline]
    fn rows(&self, vertices: [u32; 4]) -> Rows<'_> {
        let (a, b) = (&self.motion[vertices[0] as usize].0, &self.motion[vertices[1] as usize].0);
        let (c, d) = (&self.motion[vertices[2] as usize].0, &self.motion[vertices[3] as usize].0);
        [&a[0], &b[0], &c[0], &d[0], &a[1], &b[1], &c[1], &d[1]]
    }
}

type Pair = ([u32; 2], [u32; 4]);

/// The contacts of one task.
pub(crate) struct Narrow<'a> {
    scene: &'a Scene<'a>,
    waiting: Vec<Pair>,
    batch: Batch,
    vertex_triangle: Vec<([u32; 2], f64)>,
    edge_edge: Vec<([u32; 2], f64)>,
    candidates_vertex_triangle: u64,
    candidates_edge_edge: u64,
    root_searches: u64,
}

impl<'a> Narrow<'a> {
    pub(crate) fn new(scene: &'a Scene<'a>) -> Self {
        Self {
            scene,
            waiting: vec![],
            batch: Batch::default(),
            vertex_triangle: vec![],
            edge_edge: vec![],
            candidates_vertex_triangle: 0,
            candidates_edge_edge: 0,
            root_searches: 0,
        }
    }
}

impl Narrow<'_> {
    /// Decides the waiting pairs: their contacts.
    fn decide(&mut self, kind: StencilKind) {
        let Self { scene, waiting, batch, .. } = self;
        let rows = |pair: u32| scene.rows(waiting[pair as usize].1);
        let thickness = scene.query.thickness;
        let left = batch.decide(Instructions::widest(), kind, waiting.len(), rows, thickness);
        self.root_searches += left as u64;
        let is_continuous = scene.query.mode == Mode::Continuous;
        let contacts = batch
            .contacts()
            .map(|(pair, time)| (waiting[pair as usize].0, if is_continuous { time } else { 1.0 }));
        match kind {
            StencilKind::VertexTriangle => {
                self.candidates_vertex_triangle += waiting.len() as u64;
                self.vertex_triangle.extend(contacts);
            }
            StencilKind::EdgeEdge => {
                self.candidates_edge_edge += waiting.len() as u64;
                self.edge_edge.extend(contacts);
            }
        }
        waiting.clear();
    }
}

impl Sink for Narrow<'_> {
    fn take(&mut self, candidates: &mut Candidates) {
        let Self { scene, waiting, .. } = self;
        let mesh = scene.mesh;
        for [v, t] in candidates.vertex_triangle.drain(..) {
            if v != NONE && t != NONE {
                let [a, b, c] = mesh.triangles[t as usize];
                if scene.is_wanted(&[v], &[a, b, c]) {
                    waiting.push(([v, t], [v, a, b, c]));
                }
            }
        }
        self.decide(StencilKind::VertexTriangle);

        let Self { scene, waiting, .. } = self;
        for [e, f] in candidates.edge_edge.drain(..) {
            if e != NONE && f != NONE {
                let pair = [e.min(f), e.max(f)];
                let (a, b) = (mesh.edges[pair[0] as usize], mesh.edges[pair[1] as usize]);
                if scene.is_wanted(&a, &b) {
                    waiting.push((pair, [a[0], a[1], b[0], b[1]]));
                }
            }
        }
        self.decide(StencilKind::EdgeEdge);
    }
}

/// All contacts, sorted. Each pair comes from one task only.
pub(crate) fn merge<'a>(sinks: impl Iterator<Item = Narrow<'a>>) -> Contacts {
    let mut out = Contacts::default();
    let (mut vertex_triangle, mut edge_edge) = (vec![], vec![]);
    for sink in sinks {
        vertex_triangle.extend(sink.vertex_triangle);
        edge_edge.extend(sink.edge_edge);
        out.stats.candidates_vertex_triangle += sink.candidates_vertex_triangle;
        out.stats.candidates_edge_edge += sink.candidates_edge_edge;
        out.stats.root_searches += sink.root_searches;
    }
    vertex_triangle.sort_unstable_by_key(|c| c.0);
    edge_edge.sort_unstable_by_key(|c| c.0);
    (out.vertex_triangle, out.time_vertex_triangle) = vertex_triangle.into_iter().unzip();
    (out.edge_edge, out.time_edge_edge) = edge_edge.into_iter().unzip();
    out
}
