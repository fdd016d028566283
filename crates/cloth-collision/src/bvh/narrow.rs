//! The narrow phase of a traversal: candidates in, contacts out.

use super::traverse::{Candidates, Sink};
use crate::ccd::filter::{
    Row, filter, four_edge_edges_apart, four_edge_edges_maybe_apart, four_vertex_triangles_apart,
    four_vertex_triangles_maybe_apart, row,
};
use crate::ccd::{edge_edge_march, vertex_triangle_march};
use crate::{CollisionMesh, Contacts, Mode, Query, Vec3};
use cloth_mesh::NONE;
use rayon::prelude::*;

/// Vertices of one task at least.
const VERTEX_CHUNK: usize = 4096;

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

    /// [`Scene::new`] on a pool.
    pub(crate) fn new_in(mesh: &'a CollisionMesh, query: &'a Query<'a>, pool: &rayon::ThreadPool) -> Self {
        let start = if query.mode == Mode::Continuous { query.x_t0 } else { query.x_t1 };
        let both = start.par_iter().zip(query.x_t1).with_min_len(VERTEX_CHUNK);
        let motion = pool.install(|| both.map(|(a, b)| Motion([row(a), row(b)])).collect());
        Self { mesh, query, motion }
    }

    fn is_wanted(&self, first: &[u32], second: &[u32]) -> bool {
        // The traversal has seen to the bodies.
        !first.iter().any(|v| second.contains(v))
            && !self.mesh.is_attached(first, second)
            && self.query.active.is_none_or(|mask| first.iter().chain(second).any(|&v| mask[v as usize]))
    }

    #[inline]
    fn rows(&self, vertices: [u32; 4]) -> [&Row; 8] {
        let motion = |k: usize| &self.motion[vertices[k] as usize].0;
        let (a, b, c, d) = (motion(0), motion(1), motion(2), motion(3));
        [&a[0], &b[0], &c[0], &d[0], &a[1], &b[1], &c[1], &d[1]]
    }

    fn points(&self, vertices: [u32; 4]) -> [Vec3; 8] {
        self.rows(vertices).map(|row| Vec3::new(row[0], row[1], row[2]))
    }
}

type Pair = ([u32; 2], [u32; 4]);

/// The contacts of one task.
pub(crate) struct Narrow<'a> {
    scene: &'a Scene<'a>,
    waiting: Vec<Pair>,
    left: Vec<Pair>,
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
            left: vec![],
            vertex_triangle: vec![],
            edge_edge: vec![],
            candidates_vertex_triangle: 0,
            candidates_edge_edge: 0,
            root_searches: 0,
        }
    }
}

impl Sink for Narrow<'_> {
    fn take(&mut self, candidates: &mut Candidates) {
        let Self { scene, waiting, left, .. } = self;
        let (mesh, thickness) = (scene.mesh, scene.query.thickness);
        let rows = |pair: &Pair| scene.rows(pair.1);
        let time = |t: f64| if scene.query.mode == Mode::Continuous { t } else { 1.0 };

        waiting.clear();
        for [v, t] in candidates.vertex_triangle.drain(..) {
            if v != NONE && t != NONE {
                let [a, b, c] = mesh.triangles[t as usize];
                if scene.is_wanted(&[v], &[a, b, c]) {
                    waiting.push(([v, t], [v, a, b, c]));
                }
            }
        }
        self.candidates_vertex_triangle += waiting.len() as u64;
        left.clear();
        filter(waiting, rows, |r| four_vertex_triangles_maybe_apart(r, thickness), |pair| left.push(pair));
        filter(
            left,
            rows,
            |r| four_vertex_triangles_apart(r, thickness),
            |(pair, vertices)| {
                self.root_searches += 1;
                if let Some(t) = vertex_triangle_march(&scene.points(vertices), thickness) {
                    self.vertex_triangle.push((pair, time(t)));
                }
            },
        );

        waiting.clear();
        for [e, f] in candidates.edge_edge.drain(..) {
            if e != NONE && f != NONE {
                let pair = [e.min(f), e.max(f)];
                let (a, b) = (mesh.edges[pair[0] as usize], mesh.edges[pair[1] as usize]);
                if scene.is_wanted(&a, &b) {
                    waiting.push((pair, [a[0], a[1], b[0], b[1]]));
                }
            }
        }
        self.candidates_edge_edge += waiting.len() as u64;
        left.clear();
        filter(waiting, rows, |r| four_edge_edges_maybe_apart(r, thickness), |pair| left.push(pair));
        filter(
            left,
            rows,
            |r| four_edge_edges_apart(r, thickness),
            |(pair, vertices)| {
                self.root_searches += 1;
                if let Some(t) = edge_edge_march(&scene.points(vertices), thickness) {
                    self.edge_edge.push((pair, time(t)));
                }
            },
        );
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
