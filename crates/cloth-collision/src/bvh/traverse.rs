//! The trees against each other and themselves: pairs of blocks of one level whose boxes overlap, down to leaves.

use super::build::Tree;
use super::leaf_pair;
use super::refit::Boxes;
use crate::CollisionMesh;
#[cfg(target_arch = "x86_64")]
use crate::bounds::avx::Avx2;
use crate::bounds::{Compare, LANES, Plain, lanes};
use rayon::prelude::*;

pub(crate) use leaf_pair::Candidates;

/// The traversal is cut into about so many tasks where it can be; fixed, so that nothing depends on the number of
/// threads.
const TASKS: usize = 512;
/// Candidates wait until there are so many.
const FLUSH: usize = 2048;

/// Counts of a traversal.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct TraverseCounts {
    pub(crate) box_tests: u64,
    pub(crate) leaf_pairs: u64,
}

/// What is done with the pairs of leaves of one task; the visits of all tasks are handed back in their order.
pub(crate) trait Visit<const ENDS: usize>: Send {
    /// Two leaves whose boxes overlap (or one, twice).
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_, ENDS>, a: u32, b: u32);
    /// There is no further pair.
    fn finish(&mut self, leaves: &LeafPairs<'_, ENDS>);
}

/// The leaves that a [`Visit`] is called with.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LeafPairs<'a, const ENDS: usize> {
    pub(crate) tree: &'a Tree,
    pub(crate) boxes: &'a Boxes<ENDS>,
}

/// What is done with candidates.
pub(crate) trait Sink: Send {
    /// Takes the waiting candidates out.
    fn take(&mut self, candidates: &mut Candidates);
}

/// Streams the feature pairs of leaves into a sink.
pub(crate) struct Streaming<S> {
    candidates: Candidates,
    pub(crate) sink: S,
}

impl<S> Streaming<S> {
    pub(crate) fn new(sink: S) -> Self {
        Self { candidates: Candidates::default(), sink }
    }
}

impl<const ENDS: usize, S: Sink> Visit<ENDS> for Streaming<S> {
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_, ENDS>, a: u32, b: u32) {
        leaf_pair::features(leaves.tree, leaves.boxes, a, b, &mut self.candidates);
        if self.candidates.vertex_triangle.len() + self.candidates.edge_edge.len() > FLUSH {
            self.sink.take(&mut self.candidates);
        }
    }

    fn finish(&mut self, _: &LeafPairs<'_, ENDS>) {
        self.sink.take(&mut self.candidates);
    }
}

struct Walk<'a, const ENDS: usize> {
    leaves: LeafPairs<'a, ENDS>,
    mesh: &'a CollisionMesh,
}

impl<const ENDS: usize> Walk<'_, ENDS> {
    /// Pairs of roots that may meet.
    fn roots(&self) -> Vec<(u32, u32)> {
        let LeafPairs { tree, boxes } = self.leaves;
        let mut pairs = vec![];
        for (k, a) in tree.roots.iter().enumerate() {
            for b in &tree.roots[k..] {
                let active = boxes.lanes[a.block as usize].active | boxes.lanes[b.block as usize].active;
                if active != 0
                    && self.mesh.bodies_meet(a.body, b.body)
                    && boxes.hulls[a.block as usize].overlaps(&boxes.hulls[b.block as usize])
                {
                    pairs.push((a.block, b.block));
                }
            }
        }
        pairs
    }

    /// Replaces a pair by its children's pairs, or by nothing; false if both are leaves.
    #[inline(always)]
    fn expand(
        &self,
        (a, b): (u32, u32),
        counts: &mut TraverseCounts,
        compare: impl Compare,
        mut push: impl FnMut((u32, u32)),
    ) -> bool {
        let LeafPairs { tree, boxes } = self.leaves;
        if a == b && boxes.lanes[a as usize].is_flat {
            return true;
        }
        let (Some(inner_a), Some(inner_b)) = (tree.inner(a), tree.inner(b)) else { return false };
        let (block_a, block_b) = (&boxes.blocks[a as usize], &boxes.blocks[b as usize]);
        let (lanes_a, lanes_b) = (boxes.lanes[a as usize], boxes.lanes[b as usize]);
        counts.box_tests += u64::from(inner_a.count);
        for lane in lanes(compare.overlaps(&boxes.hulls[b as usize], block_a) & lanes_a.used) {
            counts.box_tests += u64::from(inner_b.count);
            let mut hits = compare.overlaps(&(block_a, lane), block_b);
            hits &= if lanes_a.active >> lane & 1 == 1 { lanes_b.used } else { lanes_b.active };
            if a == b {
                hits &= !0 << lane;
            }
            for hit in lanes(hits) {
                push((inner_a.first + lane as u32, inner_b.first + hit as u32));
            }
        }
        true
    }

    /// Pairs of subtrees that together hold all pairs of leaves, in a fixed order.
    fn tasks(&self, counts: &mut TraverseCounts) -> Vec<(u32, u32)> {
        let mut tasks = self.roots();
        while !tasks.is_empty() && tasks.len() < TASKS {
            let mut next = Vec::with_capacity(LANES * tasks.len());
            for &pair in &tasks {
                if !self.expand(pair, counts, Plain, |child| next.push(child)) {
                    // All pairs are of one level: the leaves.
                    return tasks;
                }
            }
            tasks = next;
        }
        tasks
    }

    fn run<V: Visit<ENDS>>(&self, tasks: &[(u32, u32)], visit: &mut V) -> TraverseCounts {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.run_avx2(tasks, visit) };
        }
        self.run_with(tasks, visit, Plain)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn run_avx2<V: Visit<ENDS>>(&self, tasks: &[(u32, u32)], visit: &mut V) -> TraverseCounts {
        // SAFETY: this function runs only where the processor has AVX2.
        self.run_with(tasks, visit, unsafe { Avx2::new() })
    }

    #[inline(always)]
    fn run_with<V: Visit<ENDS>>(
        &self,
        tasks: &[(u32, u32)],
        visit: &mut V,
        compare: impl Compare,
    ) -> TraverseCounts {
        let mut counts = TraverseCounts::default();
        let mut stack = tasks.to_vec();
        while let Some(pair) = stack.pop() {
            if !self.expand(pair, &mut counts, compare, |child| stack.push(child)) {
                counts.leaf_pairs += 1;
                visit.leaf_pair(&self.leaves, pair.0, pair.1);
            }
        }
        visit.finish(&self.leaves);
        counts
    }
}

/// Meets the trees with each other and themselves: the visits in the order of their tasks.
pub(crate) fn traverse<const ENDS: usize, V: Visit<ENDS>>(
    tree: &Tree,
    boxes: &Boxes<ENDS>,
    mesh: &CollisionMesh,
    pool: &rayon::ThreadPool,
    visit: impl Fn() -> V + Sync,
) -> (Vec<V>, TraverseCounts) {
    let walk = Walk { leaves: LeafPairs { tree, boxes }, mesh };
    let mut counts = TraverseCounts::default();
    let tasks = walk.tasks(&mut counts);
    let results: Vec<(V, TraverseCounts)> = pool.install(|| {
        tasks
            .par_chunks(tasks.len().div_ceil(TASKS).max(1))
            .with_max_len(1)
            .map(|tasks| {
                let mut visit = visit();
                let counts = walk.run(tasks, &mut visit);
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
