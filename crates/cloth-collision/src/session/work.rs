//! Counted work: what a call did, each kind with a weight, so that runs repeat to the bit.

use crate::bvh::build::Tree;
use crate::bvh::traverse::TraverseCounts;
use crate::{CollisionMesh, DetectStats};

/// Weights in about a nanosecond each, by profile; only their ratios matter.
mod weight {
    pub(super) const UPDATED_VERTEX: u64 = 30;
    pub(super) const UPDATED_BLOCK: u64 = 300;
    pub(super) const BOX_TEST: u64 = 1;
    pub(super) const LEAF_PAIR: u64 = 250;
    pub(super) const DISTANCE: u64 = 10;
    pub(super) const REACHED_VERTEX: u64 = 15;
    pub(super) const PENDING: u64 = 4;
    pub(super) const ADMISSIBLE: u64 = 40;
    pub(super) const ROOT_SEARCH: u64 = 400;
}

/// Counts of one call.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Work {
    pub(super) box_tests: u64,
    pub(super) leaf_pairs: u64,
    rest: u64,
}

impl Work {
    pub(super) fn updated(&mut self, vertices: usize, blocks: usize) {
        self.rest += weight::UPDATED_VERTEX * vertices as u64 + weight::UPDATED_BLOCK * blocks as u64;
    }

    pub(super) fn traversed(&mut self, counts: TraverseCounts, distance_tests: u64) {
        self.box_tests += counts.box_tests;
        self.leaf_pairs += counts.leaf_pairs;
        self.rest += weight::DISTANCE * distance_tests;
    }

    pub(super) fn elementary(&mut self, vertices: usize, pending: u64, admissible: u64, root_searches: u64) {
        self.rest += weight::REACHED_VERTEX * vertices as u64
            + weight::PENDING * pending
            + weight::ADMISSIBLE * admissible
            + weight::ROOT_SEARCH * root_searches;
    }

    /// A frame by moving boxes: their two ends are twice the work of one.
    pub(super) fn alone(mesh: &CollisionMesh, tree: &Tree, stats: &DetectStats) -> Self {
        let mut work = Self { box_tests: stats.broad_phase_tests, leaf_pairs: stats.leaf_pairs, rest: 0 };
        work.updated(2 * mesh.vertex_count, 2 * tree.block_count());
        let candidates = stats.candidates_vertex_triangle + stats.candidates_edge_edge;
        work.elementary(0, 0, candidates, stats.root_searches);
        work
    }

    pub(super) fn total(&self) -> u64 {
        weight::BOX_TEST * self.box_tests + weight::LEAF_PAIR * self.leaf_pairs + self.rest
    }
}
