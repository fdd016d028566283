//! The variants without any memory of the last frame: update, traversal and elementary tests one after the other.

use super::SkippingSession;
use crate::bounds::{LANES, lanes};
use crate::bvh::leaf_pair;
use crate::bvh::narrow::{Narrow, Scene, merge};
use crate::bvh::traverse::{Candidates, LeafPairs, Sink, Visit, traverse};
use crate::{CollisionMesh, Contacts, Query, Variant};
use rayon::prelude::*;
use std::time::Instant;

/// Keeps the candidates of one task.
struct Collect<'a> {
    mesh: &'a CollisionMesh,
    /// Whether features have boxes of their own.
    has_feature_boxes: bool,
    candidates: Candidates,
}

impl Visit<2> for Collect<'_> {
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_, 2>, a: u32, b: u32) {
        if self.has_feature_boxes {
            leaf_pair::features(leaves.tree, leaves.boxes, a, b, &mut self.candidates);
            return;
        }
        let (block_a, block_b) = (&leaves.boxes.blocks[a as usize], &leaves.boxes.blocks[b as usize]);
        let used = [a, b].map(|leaf| leaves.boxes.lanes[leaf as usize].used);
        let (ids_a, ids_b) = (&leaves.tree.triangle_ids[a as usize], &leaves.tree.triangle_ids[b as usize]);
        for lane in lanes(used[0]) {
            let own = block_a.get(lane);
            for other in lanes(used[1]).skip_while(|&other| a == b && other <= lane) {
                if own.overlaps(&block_b.get(other)) {
                    self.assigned(ids_a[lane], ids_b[other]);
                }
            }
        }
        debug_assert!(used[0] >> LANES == 0);
    }

    fn finish(&mut self, _: &LeafPairs<'_, 2>) {}
}

impl Collect<'_> {
    /// Pairs of the features that the two triangles test for all.
    fn assigned(&mut self, s: u32, t: u32) {
        let mesh = self.mesh;
        for (first, second) in [(s, t), (t, s)] {
            for v in mesh.triangles[first as usize] {
                if mesh.vertex_owner[v as usize] == first {
                    self.candidates.vertex_triangle.push([v, second]);
                }
            }
        }
        for e in mesh.triangle_edges[s as usize] {
            for f in mesh.triangle_edges[t as usize] {
                if mesh.edge_owner[e as usize] == s && mesh.edge_owner[f as usize] == t {
                    self.candidates.edge_edge.push([e, f]);
                }
            }
        }
    }
}

impl SkippingSession {
    /// [`Variant::NoDup`] and [`Variant::RTri`].
    pub(super) fn every_frame(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Contacts {
        let start = Instant::now();
        let at_rest = Query { x_t0: query.x_t1, ..*query };
        let moved = if query.mode == crate::Mode::Continuous { query } else { &at_rest };
        self.bvh.refit_moving(mesh, moved, pool);
        let updated = Instant::now();
        let has_feature_boxes = self.options.variant == Variant::RTri;
        let collect = || Collect { mesh, has_feature_boxes, candidates: Candidates::default() };
        let (visits, counts) = traverse(&self.bvh.tree, &self.bvh.moving, mesh, pool, collect);
        let traversed = Instant::now();
        let scene = Scene::new_in(mesh, query, pool);
        let pending = |c: &Candidates| (c.vertex_triangle.len() + c.edge_edge.len()) as u64;
        self.stats.pending = visits.iter().map(|v| pending(&v.candidates)).sum();
        let parts: Vec<Narrow<'_>> = pool.install(|| {
            let decide = |mut visit: Collect<'_>| {
                let mut narrow = Narrow::new(&scene);
                narrow.take(&mut visit.candidates);
                narrow
            };
            visits.into_par_iter().with_max_len(1).map(decide).collect()
        });
        let mut out = merge(parts.into_iter());
        out.stats.broad_phase_tests = counts.box_tests;
        out.stats.leaf_pairs = counts.leaf_pairs;
        self.stats.frames = 1;
        self.stats.admissible = out.stats.candidates_vertex_triangle + out.stats.candidates_edge_edge;
        self.stats.update_seconds = (updated - start).as_secs_f64();
        self.stats.traversal_seconds = (traversed - updated).as_secs_f64();
        self.stats.elementary_seconds = traversed.elapsed().as_secs_f64();
        out.stats.seconds = vec![
            ("update", self.stats.update_seconds),
            ("traversal", self.stats.traversal_seconds),
            ("elementary tests", self.stats.elementary_seconds),
        ];
        out
    }
}
