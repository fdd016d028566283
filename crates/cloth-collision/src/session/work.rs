//! Counted work: what a call did, each kind with a weight, so that runs repeat to the bit.

use crate::bvh::build::Tree;
use crate::bvh::traverse::TraverseCounts;
use crate::{CollisionMesh, DetectStats};

/// Weights in about a nanosecond each, fitted to the stages' times over counts of coherent sequences; only their ratios matter.
mod weight {
    pub(super) const UPDATED_VERTEX: u64 = 60;
    pub(super) const UPDATED_BLOCK: u64 = 450;
    pub(super) const BOX_TEST: u64 = 15;
    pub(super) const LEAF_PAIR: u64 = 200;
    pub(super) const DISTANCE: u64 = 30;
    pub(super) const REACHED_VERTEX: u64 = 20;
    pub(super) const PENDING: u64 = 5;
    pub(super) const ADMISSIBLE: u64 = 18;
    pub(super) const ROOT_SEARCH: u64 = 100;
}

/// Counts of one call.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Work {
    pub(super) box_tests: u64,
    pub(super) leaf_pairs: u64,
    updated_vertices: u64,
    updated_blocks: u64,
    distance_tests: u64,
    reached_vertices: u64,
    pending: u64,
    admissible: u64,
    root_searches: u64,
}

impl Work {
    pub(super) fn updated(&mut self, vertices: usize, blocks: usize) {
        self.updated_vertices += vertices as u64;
        self.updated_blocks += blocks as u64;
    }

    pub(super) fn traversed(&mut self, counts: TraverseCounts, distance_tests: u64) {
        self.box_tests += counts.box_tests;
        self.leaf_pairs += counts.leaf_pairs;
        self.distance_tests += distance_tests;
    }

    pub(super) fn elementary(&mut self, vertices: usize, pending: u64, admissible: u64, root_searches: u64) {
        self.reached_vertices += vertices as u64;
        self.pending += pending;
        self.admissible += admissible;
        self.root_searches += root_searches;
    }

    /// A frame by moving boxes: their two ends take about the time of one end and of what a session adds to it.
    pub(super) fn alone(mesh: &CollisionMesh, tree: &Tree, stats: &DetectStats) -> Self {
        let mut work =
            Self { box_tests: stats.broad_phase_tests, leaf_pairs: stats.leaf_pairs, ..Self::default() };
        work.updated(mesh.vertex_count, tree.block_count());
        let candidates = stats.candidates_vertex_triangle + stats.candidates_edge_edge;
        work.elementary(mesh.vertex_count, 0, candidates, stats.root_searches);
        work
    }

    pub(super) fn total(&self) -> u64 {
        weight::UPDATED_VERTEX * self.updated_vertices
            + weight::UPDATED_BLOCK * self.updated_blocks
            + weight::BOX_TEST * self.box_tests
            + weight::LEAF_PAIR * self.leaf_pairs
            + weight::DISTANCE * self.distance_tests
            + weight::REACHED_VERTEX * self.reached_vertices
            + weight::PENDING * self.pending
            + weight::ADMISSIBLE * self.admissible
            + weight::ROOT_SEARCH * self.root_searches
    }
}
