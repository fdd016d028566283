//! The tree against itself: pairs of subtrees whose boxes overlap and that may meet, down to pairs of leaves.

use super::build::Tree;
use super::refit::Boxes;
use super::{Bvh, leaf_pair};
use crate::CollisionMesh;
use cloth_mesh::NONE;
use rayon::prelude::*;

pub(super) use leaf_pair::Candidates;

/// The traversal is cut into at least so many tasks where it can be; fixed, so that nothing depends on the number of
/// threads.
const TASKS: usize = 512;
/// Candidates wait until there are so many.
const FLUSH: usize = 2048;

/// Counts of a traversal.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TraverseCounts {
    pub(super) box_tests: u64,
    pub(super) leaf_pairs: u64,
}

/// What is done with the pairs of leaves of one task; the visits of all tasks are handed back in their order.
pub(super) trait Visit: Send {
    /// Two leaves whose boxes overlap (or one, twice).
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_>, a: u32, b: u32);
    /// There is no further pair.
    fn finish(&mut self);
}

/// The leaves that a [`Visit`] is called with.
pub(super) struct LeafPairs<'a> {
    pub(super) tree: &'a Tree,
    pub(super) boxes: &'a Boxes,
}

/// What is done with candidates.
pub(super) trait Sink: Send {
    /// Takes the waiting candidates out.
    fn take(&mut self, candidates: &mut Candidates);
}

/// Streams the feature pairs of leaves into a sink.
pub(super) struct Streaming<S> {
    candidates: Candidates,
    pub(super) sink: S,
}

impl<S> Streaming<S> {
    pub(super) fn new(sink: S) -> Self {
        Self { candidates: Candidates::default(), sink }
    }
}

impl<S: Sink> Visit for Streaming<S> {
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_>, a: u32, b: u32) {
        leaf_pair::features(leaves.tree, leaves.boxes, a, b, &mut self.candidates);
        if self.candidates.vertex_triangle.len() + self.candidates.edge_edge.len() > FLUSH {
            self.sink.take(&mut self.candidates);
        }
    }

    fn finish(&mut self) {
        self.sink.take(&mut self.candidates);
    }
}

struct Walk<'a> {
    tree: &'a Tree,
    boxes: &'a Boxes,
    mesh: &'a CollisionMesh,
}

impl Walk<'_> {
    fn may_meet(&self, a: u32, b: u32) -> bool {
        let (node_a, node_b) = (&self.tree.nodes[a as usize], &self.tree.nodes[b as usize]);
        if node_a.body != NONE && node_b.body != NONE && !self.mesh.bodies_meet(node_a.body, node_b.body) {
            return false;
        }
        (self.boxes.node_active[a as usize] || self.boxes.node_active[b as usize])
            && (a == b || self.boxes.nodes[a as usize].overlaps(&self.boxes.nodes[b as usize]))
    }

    /// Replaces a pair by its children's pairs; false if both are leaves.
    fn expand(&self, (a, b): (u32, u32), push: &mut impl FnMut((u32, u32))) -> bool {
        let children = |n: u32| (n + 1, self.tree.nodes[n as usize].right);
        let is_leaf = |n: u32| self.tree.nodes[n as usize].leaf != NONE;
        match (is_leaf(a), is_leaf(b)) {
            (true, true) => return false,
            _ if a == b => {
                let (left, right) = children(a);
                push((left, left));
                push((left, right));
                push((right, right));
            }
            (false, false) => {
                let ((al, ar), (bl, br)) = (children(a), children(b));
                for pair in [(al, bl), (al, br), (ar, bl), (ar, br)] {
                    push(pair);
                }
            }
            (true, false) => {
                let (left, right) = children(b);
                push((a, left));
                push((a, right));
            }
            (false, true) => {
                let (left, right) = children(a);
                push((left, b));
                push((right, b));
            }
        }
        true
    }

    /// Pairs of subtrees that together hold all pairs of leaves, in a fixed order.
    fn tasks(&self, counts: &mut TraverseCounts) -> Vec<(u32, u32)> {
        let mut tasks = if self.tree.nodes.is_empty() { vec![] } else { vec![(0, 0)] };
        loop {
            let (mut next, mut grew) = (Vec::with_capacity(4 * tasks.len()), false);
            for &pair in &tasks {
                let expanded = self.expand(pair, &mut |child| {
                    counts.box_tests += 1;
                    if self.may_meet(child.0, child.1) {
                        next.push(child);
                    }
                });
                grew |= expanded;
                if !expanded {
                    next.push(pair);
                }
            }
            tasks = next;
            if tasks.len() >= TASKS || !grew {
                return tasks;
            }
        }
    }

    fn run<V: Visit>(&self, task: (u32, u32), visit: &mut V) -> TraverseCounts {
        let mut counts = TraverseCounts::default();
        let leaves = LeafPairs { tree: self.tree, boxes: self.boxes };
        let mut stack = vec![task];
        while let Some((a, b)) = stack.pop() {
            let expanded = self.expand((a, b), &mut |child| {
                counts.box_tests += 1;
                if self.may_meet(child.0, child.1) {
                    stack.push(child);
                }
            });
            if !expanded {
                counts.leaf_pairs += 1;
                let leaf = |n: u32| self.tree.nodes[n as usize].leaf;
                visit.leaf_pair(&leaves, leaf(a), leaf(b));
            }
        }
        visit.finish();
        counts
    }
}

impl Bvh {
    /// Meets the tree with itself: one visit per task.
    pub(super) fn traverse<V: Visit>(
        &self,
        mesh: &CollisionMesh,
        pool: &rayon::ThreadPool,
        visit: impl Fn() -> V + Sync,
    ) -> (Vec<V>, TraverseCounts) {
        let walk = Walk { tree: &self.tree, boxes: &self.boxes, mesh };
        let mut counts = TraverseCounts::default();
        let tasks = walk.tasks(&mut counts);
        let results: Vec<(V, TraverseCounts)> = pool.install(|| {
            tasks
                .par_iter()
                .with_max_len(1)
                .map(|&task| {
                    let mut visit = visit();
                    let counts = walk.run(task, &mut visit);
                    (visit, counts)
                })
                .collect()
        });
        let mut visits = Vec::with_capacity(results.len());
        for (visit, task) in results {
            counts.box_tests += task.box_tests;
            counts.leaf_pairs += task.leaf_pairs;
            visits.push(visit);
        }
        (visits, counts)
    }
}
