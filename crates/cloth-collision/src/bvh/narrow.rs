//! The narrow phase of a traversal: candidates in, contacts out.

use super::build::Tree;
use super::places::{PlacePairs, Places};
use super::traverse::{Candidates, Sink};
use crate::ccd::batch::{Batch, Pairs};
use crate::ccd::instructions::Instructions;
use crate::ccd::motions::Motions;
use crate::{CollisionMesh, Contacts, Mode, Query, StencilKind, Vec3};
use cloth_mesh::NONE;

/// What the narrow phase knows of a query.
pub(crate) struct Scene<'a> {
    mesh: &'a CollisionMesh,
    query: &'a Query<'a>,
    motions: Motions,
    /// Attachments or the query's mask exclude pairs.
    has_exclusions: bool,
}

impl<'a> Scene<'a> {
    pub(crate) fn new(mesh: &'a CollisionMesh, query: &'a Query<'a>) -> Self {
        Self::with(mesh, query, Motions::new(start(query), query.x_t1, query.thickness))
    }

    /// [`Scene::new`] on a pool.
    pub(crate) fn new_in(mesh: &'a CollisionMesh, query: &'a Query<'a>, pool: &rayon::ThreadPool) -> Self {
        Self::with(mesh, query, Motions::new_in(start(query), query.x_t1, query.thickness, pool))
    }

    /// [`Scene::new_in`] for pairs of places: the vertices are numbered by their ranks in the tree.
    pub(crate) fn by_rank(
        mesh: &'a CollisionMesh,
        query: &'a Query<'a>,
        order: &[u32],
        pool: &rayon::ThreadPool,
    ) -> Self {
        Self::with(mesh, query, Motions::ordered_in(start(query), query.x_t1, order, query.thickness, pool))
    }

    /// With these motions of the query's vertices.
    pub(crate) fn with(mesh: &'a CollisionMesh, query: &'a Query<'a>, motions: Motions) -> Self {
        Self { mesh, query, motions, has_exclusions: mesh.has_attachments() || query.active.is_some() }
    }

    pub(crate) fn into_motions(self) -> Motions {
        self.motions
    }

    /// Whether a pair that shares no vertex is to be decided. The traversal has seen to the bodies.
    #[inline(always)]
    fn is_wanted(&self, first: &[u32], second: &[u32]) -> bool {
        !self.has_exclusions
            || (!self.mesh.is_attached(first, second)
                && self.query.active.is_none_or(|mask| first.iter().chain(second).any(|&v| mask[v as usize])))
    }
}

/// The positions at the start of the motion.
pub(crate) fn start<'a>(query: &Query<'a>) -> &'a [Vec3] {
    if query.mode == Mode::Continuous { query.x_t0 } else { query.x_t1 }
}

/// The contacts of one task.
pub(crate) struct Narrow<'a> {
    scene: &'a Scene<'a>,
    /// Pairs that wait, and their vertices.
    waiting: Vec<[u32; 2]>,
    vertices: Vec<[u32; 4]>,
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
            vertices: vec![],
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
    /// Decides pairs of one kind that share no vertex, the lower edge first; `corners` are their vertices.
    pub(crate) fn take_strangers(&mut self, kind: StencilKind, pairs: &[[u32; 2]], corners: &[[u32; 4]]) {
        let scene = self.scene;
        if !scene.has_exclusions {
            self.decide(kind, corners, |pair| pairs[pair]);
            return;
        }
        self.waiting.clear();
        self.vertices.clear();
        let split = if kind == StencilKind::VertexTriangle { 1 } else { 2 };
        for (pair, corners) in pairs.iter().zip(corners) {
            let (first, second) = corners.split_at(split);
            if scene.is_wanted(first, second) {
                self.waiting.push(*pair);
                self.vertices.push(*corners);
            }
        }
        self.decide_waiting(kind);
    }

    /// Decides pairs, notes their contacts by `name` and counts them.
    fn decide<P: Pairs + ?Sized>(&mut self, kind: StencilKind, pairs: &P, name: impl Fn(usize) -> [u32; 2]) {
        let Self { scene, batch, .. } = self;
        let left = batch.decide(Instructions::widest(), kind, &scene.motions, pairs);
        self.root_searches += left as u64;
        let is_continuous = scene.query.mode == Mode::Continuous;
        let contacts = batch
            .contacts()
            .map(|(pair, time)| (name(pair as usize), if is_continuous { time } else { 1.0 }));
        match kind {
            StencilKind::VertexTriangle => {
                self.candidates_vertex_triangle += pairs.count() as u64;
                self.vertex_triangle.extend(contacts);
            }
            StencilKind::EdgeEdge => {
                self.candidates_edge_edge += pairs.count() as u64;
                self.edge_edge.extend(contacts);
            }
        }
    }

    /// Decides the waiting pairs.
    fn decide_waiting(&mut self, kind: StencilKind) {
        let (waiting, vertices) = (std::mem::take(&mut self.waiting), std::mem::take(&mut self.vertices));
        self.decide(kind, &vertices[..], |pair| waiting[pair]);
        (self.waiting, self.vertices) = (waiting, vertices);
    }

    /// Works in the memory of that batch.
    pub(crate) fn reuse(&mut self, batch: Batch) {
        self.batch = batch;
    }

    /// Gives back the memory of what waits; nothing does. The batch may be used again.
    pub(crate) fn release(&mut self) -> Batch {
        (self.waiting, self.vertices) = (vec![], vec![]);
        std::mem::take(&mut self.batch)
    }

    /// Takes pairs of places out and decides them. The scene is one by rank, of this tree.
    pub(crate) fn take_places(&mut self, tree: &Tree, places: &mut Places) {
        let Places { vertex_triangle, edge_edge } = places;
        let (scene, mesh) = (self.scene, self.scene.mesh);
        let (vertices, triangles) = (tree.vertex_ids.as_flattened(), tree.triangle_ids.as_flattened());
        let name = |pair: [u32; 2]| [vertices[pair[0] as usize], triangles[pair[1] as usize]];
        if scene.has_exclusions {
            vertex_triangle.retain(|pair| {
                let [v, t] = name(pair);
                scene.is_wanted(&[v], &mesh.triangles[t as usize])
            });
        }
        let pairs =
            VertexTrianglePlaces { ranks: tree.vertex_ranks.as_flattened(), tree, pairs: vertex_triangle };
        self.decide(StencilKind::VertexTriangle, &pairs, |pair| name(pairs.pairs.get(pair)));
        vertex_triangle.clear();

        let edges = tree.edge_ids.as_flattened();
        let name = |pair: [u32; 2]| pair.map(|place| edges[place as usize]);
        if scene.has_exclusions {
            edge_edge.retain(|pair| {
                let [e, f] = name(pair).map(|e| &mesh.edges[e as usize]);
                scene.is_wanted(e, f)
            });
        }
        let pairs = EdgeEdgePlaces { tree, pairs: edge_edge };
        self.decide(StencilKind::EdgeEdge, &pairs, |pair| name(pairs.pairs.get(pair)));
        edge_edge.clear();
    }
}

struct VertexTrianglePlaces<'a> {
    ranks: &'a [u32],
    tree: &'a Tree,
    pairs: &'a PlacePairs,
}

impl Pairs for VertexTrianglePlaces<'_> {
    #[inline(always)]
    fn count(&self) -> usize {
        self.pairs.len()
    }
    #[inline(always)]
    fn vertices(&self, pair: usize) -> [u32; 4] {
        let [v, t] = self.pairs.get(pair);
        let [a, b, c] = self.tree.triangle_ranks[t as usize];
        [self.ranks[v as usize], a, b, c]
    }
}

struct EdgeEdgePlaces<'a> {
    tree: &'a Tree,
    pairs: &'a PlacePairs,
}

impl Pairs for EdgeEdgePlaces<'_> {
    #[inline(always)]
    fn count(&self) -> usize {
        self.pairs.len()
    }
    #[inline(always)]
    fn vertices(&self, pair: usize) -> [u32; 4] {
        let [[a, b], [c, d]] = self.pairs.get(pair).map(|place| self.tree.edge_ranks[place as usize]);
        [a, b, c, d]
    }
}

impl Sink for Narrow<'_> {
    #[allow(
        clippy::needless_bitwise_bool,
        reason = "a branch per comparison costs more than the comparisons"
    )]
    fn take(&mut self, candidates: &mut Candidates) {
        let Self { scene, waiting, vertices, .. } = self;
        let mesh = scene.mesh;
        // Every candidate is written, and the next one over it if it is not wanted: no branch on what is hard to foresee.
        let mut count = 0;
        waiting.resize(candidates.vertex_triangle.len(), [0; 2]);
        vertices.resize(candidates.vertex_triangle.len(), [0; 4]);
        for [v, t] in candidates.vertex_triangle.drain(..) {
            if v != NONE && t != NONE {
                let [a, b, c] = mesh.triangles[t as usize];
                (waiting[count], vertices[count]) = ([v, t], [v, a, b, c]);
                let is_stranger = (v != a) & (v != b) & (v != c);
                count += usize::from(is_stranger && scene.is_wanted(&[v], &[a, b, c]));
            }
        }
        waiting.truncate(count);
        vertices.truncate(count);
        self.decide_waiting(StencilKind::VertexTriangle);

        let Self { scene, waiting, vertices, .. } = self;
        let mut count = 0;
        waiting.resize(candidates.edge_edge.len(), [0; 2]);
        vertices.resize(candidates.edge_edge.len(), [0; 4]);
        for [e, f] in candidates.edge_edge.drain(..) {
            if e != NONE && f != NONE {
                let pair = [e.min(f), e.max(f)];
                let ([a, b], [c, d]) = (mesh.edges[pair[0] as usize], mesh.edges[pair[1] as usize]);
                (waiting[count], vertices[count]) = (pair, [a, b, c, d]);
                let are_strangers = (a != c) & (a != d) & (b != c) & (b != d);
                count += usize::from(are_strangers && scene.is_wanted(&[a, b], &[c, d]));
            }
        }
        waiting.truncate(count);
        vertices.truncate(count);
        self.decide_waiting(StencilKind::EdgeEdge);
    }
}

/// All contacts, sorted. Each pair comes from one task only.
pub(crate) fn merge<'a>(sinks: impl Iterator<Item = Narrow<'a>>) -> Contacts {
    let mut out = Contacts::default();
    let (mut vertex_triangle, mut edge_edge) = (vec![], vec![]);
    for sink in sinks {
        out.stats.candidates_vertex_triangle += sink.candidates_vertex_triangle;
        out.stats.candidates_edge_edge += sink.candidates_edge_edge;
        out.stats.root_searches += sink.root_searches;
        vertex_triangle.push(sink.vertex_triangle);
        edge_edge.push(sink.edge_edge);
    }
    let sorted = |parts: Vec<Vec<([u32; 2], f64)>>| -> (Vec<[u32; 2]>, Vec<f64>) {
        sort_by_pair(parts.concat()).into_iter().unzip()
    };
    // The smaller part beside the larger one, where there is a pool to do so.
    let (vertex_triangle, edge_edge) = match rayon::current_thread_index() {
        Some(_) => rayon::join(|| sorted(vertex_triangle), || sorted(edge_edge)),
        None => (sorted(vertex_triangle), sorted(edge_edge)),
    };
    (out.vertex_triangle, out.time_vertex_triangle) = vertex_triangle;
    (out.edge_edge, out.time_edge_edge) = edge_edge;
    out
}

/// Sorts contacts by their pairs, each of which is there once.
fn sort_by_pair(mut contacts: Vec<([u32; 2], f64)>) -> Vec<([u32; 2], f64)> {
    let first_count = contacts.iter().map(|c| c.0[0] as usize + 1).max().unwrap_or(0);
    // Few contacts among many features: not worth a look at each feature.
    if first_count > 8 * contacts.len() {
        contacts.sort_unstable_by_key(|c| c.0);
        return contacts;
    }
    // A place for each by its first feature, then an order among the few with the same one.
    let mut place = vec![0_u32; first_count + 1];
    for contact in &contacts {
        place[contact.0[0] as usize + 1] += 1;
    }
    for k in 0..first_count {
        place[k + 1] += place[k];
    }
    let mut sorted = vec![([0; 2], 0.0); contacts.len()];
    for &contact in &contacts {
        let place = &mut place[contact.0[0] as usize];
        sorted[*place as usize] = contact;
        *place += 1;
    }
    for same in sorted.chunk_by_mut(|a, b| a.0[0] == b.0[0]) {
        same.sort_unstable_by_key(|c| c.0[1]);
    }
    sorted
}

#[cfg(test)]
mod tests {
    use super::sort_by_pair;

    #[test]
    fn contacts_are_sorted_whatever_their_number() {
        for (count, features) in [(0, 1), (1, 1), (3, 1000), (2000, 5), (2000, 300), (2000, 100_000)] {
            let mut state = 1_u32;
            let mut random = |below: u32| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) % below
            };
            let contacts: Vec<_> =
                (0..count).map(|k| ([random(features), 10_000 * random(9) + k], f64::from(k))).collect();
            let mut expected = contacts.clone();
            expected.sort_by_key(|c| c.0);
            assert_eq!(sort_by_pair(contacts), expected);
        }
    }
}
