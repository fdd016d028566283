//! The pending list: pairs of features that may come into contact while their vertices stay in their balls.

use super::distance::{PAIRS, Row, eight_edge_edges, eight_vertex_triangles};
use crate::bvh::traverse::{Candidates, Sink};
use crate::ccd::filter::in_lanes;
use crate::{CollisionMesh, StencilKind};
use cloth_mesh::NONE;
use rayon::prelude::*;
use std::ops::Range;

/// Pairs of one kind: two indices, four vertices and a distance, 28 bytes each.
#[derive(Debug, Clone, Default)]
pub(super) struct Kind {
    /// (vertex, triangle), or (edge, edge), the lower one first.
    pub(super) ids: Vec<[u32; 2]>,
    /// Their vertices, in this order.
    pub(super) vertices: Vec<[u32; 4]>,
    /// What the features are certainly apart while their vertices are at the middles of their balls [m].
    pub(super) distances: Vec<f32>,
}

impl Kind {
    /// Appends what was found, with its vertices, which are marked.
    fn append<'a>(
        &mut self,
        found: impl Iterator<Item = &'a Found> + Clone,
        vertices: impl Fn([u32; 2]) -> [u32; 4],
        has_pairs: &mut [bool],
    ) {
        let more = found.clone().map(|part| part.ids.len()).sum();
        self.ids.reserve_exact(more);
        self.vertices.reserve_exact(more);
        self.distances.reserve_exact(more);
        for part in found {
            self.ids.extend_from_slice(&part.ids);
            self.distances.extend_from_slice(&part.distances);
            self.vertices.extend(part.ids.iter().map(|&ids| {
                let vertices = vertices(ids);
                for v in vertices {
                    has_pairs[v as usize] = true;
                }
                vertices
            }));
        }
        self.shrink();
    }

    /// Keeps memory for half as many pairs again.
    fn shrink(&mut self) {
        let reserve = self.ids.len() + self.ids.len() / 2;
        self.ids.shrink_to(reserve);
        self.vertices.shrink_to(reserve);
        self.distances.shrink_to(reserve);
    }

    fn clear(&mut self) {
        self.ids.clear();
        self.vertices.clear();
        self.distances.clear();
    }

    /// Keeps the pairs without a vertex marked here.
    fn retain_unmarked(&mut self, marked: &[bool]) {
        let mut kept = 0;
        for k in 0..self.ids.len() {
            if !self.vertices[k].iter().any(|&v| marked[v as usize]) {
                self.ids[kept] = self.ids[k];
                self.vertices[kept] = self.vertices[k];
                self.distances[kept] = self.distances[k];
                kept += 1;
            }
        }
        self.ids.truncate(kept);
        self.vertices.truncate(kept);
        self.distances.truncate(kept);
    }

    fn bytes(&self) -> usize {
        self.ids.capacity() * size_of::<[u32; 2]>()
            + self.vertices.capacity() * size_of::<[u32; 4]>()
            + self.distances.capacity() * size_of::<f32>()
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
    pub(super) fn remove(&mut self, marked: &[bool]) {
        self.vertex_triangle.retain_unmarked(marked);
        self.edge_edge.retain_unmarked(marked);
    }

    /// Takes all pairs off and keeps their memory.
    pub(super) fn clear(&mut self) {
        self.vertex_triangle.clear();
        self.edge_edge.clear();
    }

    /// Puts what tasks have found on the list, in their order, and marks its vertices.
    pub(super) fn append(&mut self, parts: &[[Found; 2]], mesh: &CollisionMesh, has_pairs: &mut [bool]) {
        let of_triangle = |[v, t]: [u32; 2]| {
            let [a, b, c] = mesh.triangles[t as usize];
            [v, a, b, c]
        };
        let of_edges = |[e, f]: [u32; 2]| {
            let ([a, b], [c, d]) = (mesh.edges[e as usize], mesh.edges[f as usize]);
            [a, b, c, d]
        };
        self.vertex_triangle.append(parts.iter().map(|part| &part[0]), of_triangle, has_pairs);
        self.edge_edge.append(parts.iter().map(|part| &part[1]), of_edges, has_pairs);
    }
}

/// Pairs of one kind that a task registers, as in [`Kind`].
#[derive(Debug, Default)]
pub(super) struct Found {
    ids: Vec<[u32; 2]>,
    distances: Vec<f32>,
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
    /// Vertices and triangles; edges.
    pub(super) found: [Found; 2],
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
            found: Default::default(),
            distance_tests: 0,
            waiting: vec![],
        }
    }

    #[inline]
    fn decide(&mut self, distances: impl Fn(&[[&Row; 4]; PAIRS]) -> [f32; PAIRS], kind: StencilKind) {
        let Self { middles, radii, thickness, found: [of_triangles, of_edges], waiting, .. } = self;
        self.distance_tests += waiting.len() as u64;
        let (found, split) = match kind {
            StencilKind::VertexTriangle => (of_triangles, 1),
            StencilKind::EdgeEdge => (of_edges, 2),
        };
        let rows = |pair: &([u32; 2], [u32; 4])| pair.1.map(|v| &middles[v as usize]);
        in_lanes(waiting, rows, distances, |(ids, vertices), bounds, lane| {
            let (distance, (a, b)) = (f64::from(bounds[lane]), vertices.split_at(split));
            if !(distance > most(radii, a) + most(radii, b) + *thickness) {
                found.ids.push(ids);
                found.distances.push(bounds[lane]);
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
        self.decide(eight_vertex_triangles, StencilKind::VertexTriangle);
        for [e, f] in candidates.edge_edge.drain(..) {
            if e != NONE && f != NONE {
                let [e, f] = [e.min(f), e.max(f)];
                let ([a, b], [c, d]) = (mesh.edges[e as usize], mesh.edges[f as usize]);
                if a != c && a != d && b != c && b != d && is_wanted([a, b, c, d]) {
                    self.waiting.push(([e, f], [a, b, c, d]));
                }
            }
        }
        self.decide(eight_edge_edges, StencilKind::EdgeEdge);
    }
}

/// Pairs per task; fixed, though nothing here depends on it.
const CHUNK: usize = 1 << 14;

/// What the front-end filter needs to know.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrontEnd<'a> {
    /// How far each vertex is from the middle of its ball [m].
    pub(super) reach: &'a [f32],
    pub(super) thickness: f64,
}

/// Pairs that may be in contact, and their vertices.
#[derive(Debug)]
pub(super) struct Admissible {
    pub(super) kind: StencilKind,
    pub(super) pairs: Vec<[u32; 2]>,
    pub(super) vertices: Vec<[u32; 4]>,
}

impl FrontEnd<'_> {
    /// The pairs of `range` that are apart by no more than their features have moved, and the thickness.
    fn filter(&self, kind: StencilKind, of: &Kind, range: Range<usize>) -> Admissible {
        match kind {
            StencilKind::VertexTriangle => self.filter_split::<1>(kind, of, range),
            StencilKind::EdgeEdge => self.filter_split::<2>(kind, of, range),
        }
    }

    /// `SPLIT`: vertices of the first feature.
    fn filter_split<const SPLIT: usize>(
        &self,
        kind: StencilKind,
        of: &Kind,
        range: Range<usize>,
    ) -> Admissible {
        let (reach, count) = (self.reach, range.len());
        let ids = &of.ids[range.clone()];
        let (of_pairs, distances) = (&of.vertices[range.clone()], &of.distances[range]);
        let (mut pairs, mut vertices) = (vec![[0; 2]; count], vec![[0; 4]; count]);
        // Every pair is written, and the next one over it if it is not admissible: no branch on what is hard to foresee.
        let mut kept = 0;
        for k in 0..count {
            let (first, second) = of_pairs[k].split_at(SPLIT);
            (pairs[kept], vertices[kept]) = (ids[k], of_pairs[k]);
            let farthest = most(reach, first) + most(reach, second) + self.thickness;
            kept += usize::from(!(f64::from(distances[k]) > farthest));
        }
        pairs.truncate(kept);
        vertices.truncate(kept);
        Admissible { kind, pairs, vertices }
    }

    /// What each task's pairs leave, in order, as `use_them` makes of it.
    pub(super) fn run<R: Send>(
        &self,
        pairs: &Pairs,
        use_them: impl Fn(Admissible) -> R + Sync,
        pool: &rayon::ThreadPool,
    ) -> Vec<R> {
        let chunks = |kind: &Kind| kind.ids.len().div_ceil(CHUNK);
        let (first, second) = (chunks(&pairs.vertex_triangle), chunks(&pairs.edge_edge));
        let part = |of: &Kind, k: usize| k * CHUNK..((k + 1) * CHUNK).min(of.ids.len());
        let filter = |k: usize| {
            let (kind, of, k) = if k < first {
                (StencilKind::VertexTriangle, &pairs.vertex_triangle, k)
            } else {
                (StencilKind::EdgeEdge, &pairs.edge_edge, k - first)
            };
            use_them(self.filter(kind, of, part(of, k)))
        };
        pool.install(|| (0..first + second).into_par_iter().with_max_len(1).map(filter).collect())
    }
}
