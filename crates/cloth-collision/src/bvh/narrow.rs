//! The narrow phase of a traversal: candidates in, contacts out.

use super::traverse::{Candidates, Sink};
use crate::ccd::filter::{Group, filter, four_edge_edges_apart, four_vertex_triangles_apart, put};
use crate::ccd::{edge_edge_march, vertex_triangle_march};
use crate::{CollisionMesh, Contacts, Mode, Query, Vec3};
use cloth_mesh::NONE;

/// What the narrow phase knows of a query.
pub(super) struct Scene<'a> {
    mesh: &'a CollisionMesh,
    query: &'a Query<'a>,
    /// Both ends of each vertex's motion side by side.
    motion: Vec<[Vec3; 2]>,
}

impl<'a> Scene<'a> {
    pub(super) fn new(mesh: &'a CollisionMesh, query: &'a Query<'a>) -> Self {
        let start = if query.mode == Mode::Continuous { query.x_t0 } else { query.x_t1 };
        Self { mesh, query, motion: start.iter().zip(query.x_t1).map(|(&a, &b)| [a, b]).collect() }
    }

    fn is_wanted(&self, first: &[u32], second: &[u32]) -> bool {
        // The traversal has seen to the bodies.
        !first.iter().any(|v| second.contains(v))
            && !self.mesh.is_attached(first, second)
            && self.query.active.is_none_or(|mask| first.iter().chain(second).any(|&v| mask[v as usize]))
    }

    fn points(&self, vertices: [u32; 4]) -> [Vec3; 8] {
        let p = vertices.map(|v| self.motion[v as usize]);
        [p[0][0], p[1][0], p[2][0], p[3][0], p[0][1], p[1][1], p[2][1], p[3][1]]
    }

    /// Writes the four vertices of a pair into its lane.
    fn gather(&self, vertices: [u32; 4], lane: usize, group: &mut Group<8>) {
        for (k, v) in vertices.into_iter().enumerate() {
            let [x0, x1] = &self.motion[v as usize];
            put(group, k, lane, x0);
            put(group, k + 4, lane, x1);
        }
    }
}

type Pair = ([u32; 2], [u32; 4]);

/// The contacts of one task.
pub(super) struct Narrow<'a> {
    scene: &'a Scene<'a>,
    waiting: Vec<Pair>,
    vertex_triangle: Vec<([u32; 2], f64)>,
    edge_edge: Vec<([u32; 2], f64)>,
    candidates_vertex_triangle: u64,
    candidates_edge_edge: u64,
    root_searches: u64,
}

impl<'a> Narrow<'a> {
    pub(super) fn new(scene: &'a Scene<'a>) -> Self {
        Self {
            scene,
            waiting: vec![],
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
        let Self { scene, waiting, .. } = self;
        let (mesh, thickness) = (scene.mesh, scene.query.thickness);
        let gather = |pair: &Pair, lane: usize, group: &mut Group<8>| scene.gather(pair.1, lane, group);
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
        filter(
            waiting,
            gather,
            |g| four_vertex_triangles_apart(g, thickness),
            |&(pair, vertices)| {
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
        filter(
            waiting,
            gather,
            |g| four_edge_edges_apart(g, thickness),
            |&(pair, vertices)| {
                self.root_searches += 1;
                if let Some(t) = edge_edge_march(&scene.points(vertices), thickness) {
                    self.edge_edge.push((pair, time(t)));
                }
            },
        );
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
        out.stats.root_searches += sink.root_searches;
    }
    vertex_triangle.sort_unstable_by_key(|c| c.0);
    edge_edge.sort_unstable_by_key(|c| c.0);
    (out.vertex_triangle, out.time_vertex_triangle) = vertex_triangle.into_iter().unzip();
    (out.edge_edge, out.time_edge_edge) = edge_edge.into_iter().unzip();
    out
}
