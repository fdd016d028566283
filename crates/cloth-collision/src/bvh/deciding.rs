//! Detection's visit of pairs of leaves: their features are paired and decided while the traversal runs.

use super::narrow::Narrow;
use super::places::{Pairing, Places};
use super::traverse::{LeafPairs, Visit};

/// Candidates wait until there are so many.
const FLUSH: usize = 2048;

/// The contacts of one task.
pub(super) struct Deciding<'a> {
    pairing: Pairing,
    places: Places,
    pub(super) narrow: Narrow<'a>,
}

impl<'a> Deciding<'a> {
    /// `narrow` is of a scene by rank.
    pub(super) fn new(narrow: Narrow<'a>) -> Self {
        Self { pairing: Pairing::fastest(), places: Places::default(), narrow }
    }
}

impl<const ENDS: usize> Visit<ENDS> for Deciding<'_> {
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_, ENDS>, a: u32, b: u32) {
        self.pairing.features(leaves.tree, leaves.boxes, a, b, &mut self.places);
        if self.places.vertex_triangle.len() + self.places.edge_edge.len() > FLUSH {
            self.narrow.take_places(leaves.tree, &mut self.places);
        }
    }

    fn finish(&mut self, leaves: &LeafPairs<'_, ENDS>) {
        self.narrow.take_places(leaves.tree, &mut self.places);
        // What only the work needed goes to the next task, still in the cache.
        self.places = Places::default();
        self.narrow.release();
    }
}
