//! Detection's visit of pairs of leaves: their features are paired and decided while the traversal runs.

use super::narrow::Narrow;
use super::places::{Pairing, Places};
use super::traverse::{LeafPairs, Visit};
use crate::ccd::batch::Batch;
use std::cell::RefCell;

/// Candidates wait until there are so many.
const FLUSH: usize = 2048;

/// What only the work needs: the next task of the same thread goes on with it, still in the cache.
#[derive(Debug, Default)]
struct Scratch {
    places: Places,
    batch: Batch,
}

thread_local! {
    static SPARE: RefCell<Option<Scratch>> = const { RefCell::new(None) };
}

/// The contacts of one task.
pub(super) struct Deciding<'a> {
    pairing: Pairing,
    places: Places,
    pub(super) narrow: Narrow<'a>,
}

impl<'a> Deciding<'a> {
    /// `narrow` is of a scene by rank.
    pub(super) fn new(mut narrow: Narrow<'a>) -> Self {
        let Scratch { places, batch } = SPARE.take().unwrap_or_default();
        narrow.reuse(batch);
        Self { pairing: Pairing::fastest(), places, narrow }
    }
}

impl<const ENDS: usize> Visit<ENDS> for Deciding<'_> {
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_, ENDS>, a: u32, b: u32) {
        let diagonals = &leaves.boxes.diagonals;
        if a != b && !diagonals.is_empty() && diagonals[a as usize].are_apart(&diagonals[b as usize]) {
            return;
        }
        self.pairing.features(leaves.tree, leaves.boxes, a, b, &mut self.places);
        if self.places.vertex_triangle.len() + self.places.edge_edge.len() > FLUSH {
            self.narrow.take_places(leaves.tree, &mut self.places);
        }
    }

    fn finish(&mut self, leaves: &LeafPairs<'_, ENDS>) {
        self.narrow.take_places(leaves.tree, &mut self.places);
        let scratch = Scratch { places: std::mem::take(&mut self.places), batch: self.narrow.release() };
        SPARE.set(Some(scratch));
    }
}
