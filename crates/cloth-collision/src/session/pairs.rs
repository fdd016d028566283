//! The pending list: pairs of features that may come into contact while their vertices stay in their balls.

use super::distance::{PAIRS, Row, eight_edge_edges, eight_vertex_triangles};
use crate::CollisionMesh;
use crate::bvh::traverse::{Candidates, Sink};
use crate::ccd::filter::in_lanes;
use cloth_mesh::NONE;
use rayon::prelude::*;

/// Pairs of one kind: two indices and a distance, 12 bytes each.
#[derive(Debug, Clone, Default)]
pub(super) struct Kind {
    /// (vertex, triangle), or (edge, edge).
    pub(super) ids: Vec<[u32; 2]>,
    /// What the features are certainly apart while their vertices are at the middles of their balls [m].
    pub(super) distances: Vec<f32>,
}

impl Kind {
    fn append(&mut self, parts: &[&Self]) {
        let more = parts.iter().map(|part| part.ids.len()).sum();
        self.ids.reserve_exact(more);
        self.distances.reserve_exact(more);
        for part in parts {
            self.ids.extend_from_slice(&part.ids);
            self.distances.extend_from_slice(&part.distances);
        }
    }

    fn retain(&mut self, keep: impl Fn([u32; 2]) -> bool) {
        let mut kept = 0;
        for k in 0..self.ids.len() {
            if keep(self.ids[k]) {
                (self.ids[kept], self.distances[kept]) = (self.ids[k], self.distances[k]);
                kept += 1;
            }
        }
        self.ids.truncate(kept);
        self.distances.truncate(kept);
    }

    fn bytes(&self) -> usize {
        self.ids.capacity() * size_of::<[u32; 2]>() + self.distances.capacity() * size_of::<f32>()
    }
}

/// The pending list.
#[derive(Debug, Clone, Default)]
pub(super) struct Pairs {
    pub(super) vertex_triangle: Kind,
    pub(super) edge_edge: Kind,
}

impl Pairs {
    pub(super) fn len(&self) -> usize {
        self.vertex_triangle.ids.len() + self.edge_edge.ids.len()
    }

    /// Memory \[B\].
    pub(super) fn bytes(&self) -> usize {
        self.vertex_triangle.bytes() + self.edge_edge.bytes()
    }

    /// Takes off the pairs with a vertex marked here.
    pub(super) fn remove(&mut self, mesh: &CollisionMesh, marked: &[bool]) {
        let is_marked = |vertices: &[u32]| vertices.iter().any(|&v| marked[v as usize]);
        self.vertex_triangle.retain(|[v, t]| !is_marked(&[v]) && !is_marked(&mesh.triangles[t as usize]));
        self.edge_edge
            .retain(|[e, f]| !is_marked(&mesh.edges[e as usize]) && !is_marked(&mesh.edges[f as usize]));
    }

    pub(super) fn append(&mut self, parts: &[Pairs]) {
        self.vertex_triangle.append(&parts.iter().map(|p| &p.vertex_triangle).collect::<Vec<_>>());
        self.edge_edge.append(&parts.iter().map(|p| &p.edge_edge).collect::<Vec<_>>());
    }
}

/// What of a vertex (a radius, a reach), as the largest of a feature's vertices.
#[inline]
fn most(of_vertex: &[f32], vertices: &[u32]) -> f64 {
    let mut most = 0.0f32;
    for &v in vertices {
        let value = of_vertex[v as usize];
        most = if value > most { value } else { most };
    }
    f64::from(most)
}

/// Registers the candidates of a traversal that may come into contact within the radii.
pub(super) struct Register<'a> {
    pub(super) mesh: &'a CollisionMesh,
    pub(super) middles: &'a [Row],
    pub(super) radii: &'a [f32],
    /// Only pairs with a vertex marked here.
    pub(super) marked: Option<&'a [bool]>,
    pub(super) thickness: f64,
    pub(super) pairs: Pairs,
    pub(super) distance_tests: u64,
    waiting: Vec<([u32; 2], [u32; 4])>,
}

impl<'a> Register<'a> {
    pub(super) fn new(
        mesh: &'a CollisionMesh,
        middles: &'a [Row],
        radii: &'a [f32],
        marked: Option<&'a [bool]>,
        thickness: f64,
    ) -> Self {
        Self {
            mesh,
            middles,
            radii,
            marked,
            thickness,
            pairs: Pairs::default(),
            distance_tests: 0,
            waiting: vec![],
        }
    }

    #[inline]
    fn decide(
        &mut self,
        distances: impl Fn(&[[&Row; 4]; PAIRS]) -> [f32; PAIRS],
        split: usize,
        kind: fn(&mut Pairs) -> &mut Kind,
    ) {
        let Self { middles, radii, thickness, pairs, waiting, .. } = self;
        self.distance_tests += waiting.len() as u64;
        let kind = kind(pairs);
        let rows = |pair: &([u32; 2], [u32; 4])| pair.1.map(|v| &middles[v as usize]);
        in_lanes(waiting, rows, distances, |(ids, vertices), bounds, lane| {
            let (distance, (a, b)) = (f64::from(bounds[lane]), vertices.split_at(split));
            if !(distance > most(radii, a) + most(radii, b) + *thickness) {
                kind.ids.push(ids);
                kind.distances.push(bounds[lane]);
            }
        });
        waiting.clear();
    }
}

impl Sink for Register<'_> {
    fn take(&mut self, candidates: &mut Candidates) {
        let (mesh, marked) = (self.mesh, self.marked);
        let is_wanted = |vertices: [u32; 4]| marked.is_none_or(|m| vertices.iter().any(|&v| m[v as usize]));
        for [v, t] in candidates.vertex_triangle.drain(..) {
            if v != NONE && t != NONE {
                let [a, b, c] = mesh.triangles[t as usize];
                if v != a && v != b && v != c && is_wanted([v, a, b, c]) {
                    self.waiting.push(([v, t], [v, a, b, c]));
                }
            }
        }
        self.decide(eight_vertex_triangles, 1, |pairs| &mut pairs.vertex_triangle);
        for [e, f] in candidates.edge_edge.drain(..) {
            if e != NONE && f != NONE {
                let ([a, b], [c, d]) = (mesh.edges[e as usize], mesh.edges[f as usize]);
                if a != c && a != d && b != c && b != d && is_wanted([a, b, c, d]) {
                    self.waiting.push(([e, f], [a, b, c, d]));
                }
            }
        }
        self.decide(eight_edge_edges, 2, |pairs| &mut pairs.edge_edge);
    }
}

/// Pairs per task; fixed, though nothing here depends on it.
const CHUNK: usize = 1 << 14;

/// What the front-end filter needs to know.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrontEnd<'a> {
    pub(super) mesh: &'a CollisionMesh,
    /// How far each vertex is from the middle of its ball [m].
    pub(super) reach: &'a [f32],
    /// The largest of these [m].
    pub(super) largest: f32,
    pub(super) thickness: f64,
}

impl FrontEnd<'_> {
    /// The pairs that may be in contact: apart by no more than their features have moved, and the thickness.
    fn filter(&self, ids: &[[u32; 2]], distances: &[f32], moved: impl Fn([u32; 2]) -> f64) -> Vec<[u32; 2]> {
        let mut left = vec![];
        let farthest = 2.0 * f64::from(self.largest) + self.thickness;
        for (&pair, &distance) in ids.iter().zip(distances) {
            let distance = f64::from(distance);
            // The first comparison needs no vertex.
            if !(distance > farthest) && !(distance > moved(pair) + self.thickness) {
                left.push(pair);
            }
        }
        left
    }

    /// What each task's pairs leave, in order, as `use_them` makes of it.
    pub(super) fn run<R: Send>(
        &self,
        pairs: &Pairs,
        use_them: impl Fn(Candidates) -> R + Sync,
        pool: &rayon::ThreadPool,
    ) -> Vec<R> {
        let (mesh, reach) = (self.mesh, self.reach);
        let of_vertex = |[v, t]: [u32; 2]| most(reach, &[v]) + most(reach, &mesh.triangles[t as usize]);
        let of_edge =
            |[e, f]: [u32; 2]| most(reach, &mesh.edges[e as usize]) + most(reach, &mesh.edges[f as usize]);
        let chunks = |kind: &Kind| kind.ids.len().div_ceil(CHUNK);
        let (first, second) = (chunks(&pairs.vertex_triangle), chunks(&pairs.edge_edge));
        let part = |kind: &'_ Kind, k: usize| k * CHUNK..((k + 1) * CHUNK).min(kind.ids.len());
        pool.install(|| {
            (0..first + second)
                .into_par_iter()
                .with_max_len(1)
                .map(|k| {
                    let mut candidates = Candidates::default();
                    if k < first {
                        let (kind, range) = (&pairs.vertex_triangle, part(&pairs.vertex_triangle, k));
                        let (ids, distances) = (&kind.ids[range.clone()], &kind.distances[range]);
                        candidates.vertex_triangle = self.filter(ids, distances, of_vertex);
                    } else {
                        let (kind, range) = (&pairs.edge_edge, part(&pairs.edge_edge, k - first));
                        let (ids, distances) = (&kind.ids[range.clone()], &kind.distances[range]);
                        candidates.edge_edge = self.filter(ids, distances, of_edge);
                    }
                    use_them(candidates)
                })
                .collect()
        })
    }
}
