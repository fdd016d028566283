//! The leaves that meet in a session, and the boxes of their features.
//!
//! Where no body meets itself, most leaves of a large cloth meet no other body's: the pairs of leaves are found first, by the boxes of
//! triangles, and only the features of leaves in these pairs get boxes. Else all get them.

use super::pairs::Register;
use crate::CollisionMesh;
use crate::bvh::build::Tree;
use crate::bvh::refit::Boxes;
use crate::bvh::traverse::{LeafPairs, Streaming, TraverseCounts, Visit, traverse};
use rayon::prelude::*;

/// Which leaves have boxes of their features that are those of the present balls.
#[derive(Debug, Clone, Default)]
pub(super) struct Featured {
    /// Empty: all.
    leaves: Vec<bool>,
}

/// Whether features get boxes only where their leaf meets another one.
pub(super) fn is_by_need(tree: &Tree, mesh: &CollisionMesh) -> bool {
    !tree.roots.iter().any(|root| mesh.bodies_meet(root.body, root.body))
}

/// The pairs of leaves of one task.
#[derive(Debug, Default)]
struct Collect(Vec<[u32; 2]>);

impl Visit<1> for Collect {
    fn leaf_pair(&mut self, _: &LeafPairs<'_, 1>, a: u32, b: u32) {
        self.0.push([a, b]);
    }

    fn finish(&mut self, _: &LeafPairs<'_, 1>) {}
}

impl Featured {
    pub(super) fn all() -> Self {
        Self::default()
    }

    pub(super) fn none(tree: &Tree) -> Self {
        Self { leaves: vec![false; tree.leaves.len()] }
    }

    /// Fits the boxes of the features of leaves in `pairs` that have none yet.
    fn refit<'p>(
        &mut self,
        tree: &Tree,
        boxes: &mut Boxes<1>,
        pairs: impl Iterator<Item = &'p [u32; 2]>,
        pool: &rayon::ThreadPool,
    ) {
        let mut wanted = vec![false; self.leaves.len()];
        for &leaf in pairs.flatten() {
            wanted[leaf as usize] = !self.leaves[leaf as usize];
        }
        boxes.refit_features(tree, &wanted, pool);
        self.leaves.iter_mut().zip(wanted).for_each(|(is_there, new)| *is_there |= new);
    }

    /// Registers what the tree finds where it meets itself; the visits in the order of their tasks.
    pub(super) fn meet<'a>(
        &mut self,
        tree: &Tree,
        boxes: &mut Boxes<1>,
        mesh: &CollisionMesh,
        register: impl Fn() -> Streaming<Register<'a>> + Sync,
        pool: &rayon::ThreadPool,
    ) -> (Vec<Streaming<Register<'a>>>, TraverseCounts) {
        if self.leaves.is_empty() {
            return traverse(tree, boxes, mesh, pool, register);
        }
        let (lists, counts) = traverse(tree, boxes, mesh, pool, Collect::default);
        self.refit(tree, boxes, lists.iter().flat_map(|list| &list.0), pool);
        let visit = |list: &Collect| visited(tree, boxes, &list.0, register());
        (pool.install(|| lists.par_iter().with_max_len(1).map(visit).collect()), counts)
    }

    /// Registers what these pairs of leaves have.
    pub(super) fn meet_pairs<'a>(
        &mut self,
        tree: &Tree,
        boxes: &mut Boxes<1>,
        pairs: &[[u32; 2]],
        register: Streaming<Register<'a>>,
        pool: &rayon::ThreadPool,
    ) -> Streaming<Register<'a>> {
        if !self.leaves.is_empty() {
            self.refit(tree, boxes, pairs.iter(), pool);
        }
        visited(tree, boxes, pairs, register)
    }
}

fn visited<'a>(
    tree: &Tree,
    boxes: &Boxes<1>,
    pairs: &[[u32; 2]],
    mut visit: Streaming<Register<'a>>,
) -> Streaming<Register<'a>> {
    let leaves = LeafPairs { tree, boxes };
    for &[a, b] in pairs {
        visit.leaf_pair(&leaves, a, b);
    }
    visit.finish(&leaves);
    visit
}

#[cfg(test)]
mod tests {
    use super::super::dangling::ball_box;
    use super::super::distance::Row;
    use super::*;
    use crate::{Body, Bvh, Vec3};
    use cloth_mesh::generators;

    /// A cloth of 41 × 41 vertices over the middle of which a small one lies: candidates registered by the boxes that `featured` lets
    /// be fitted, and how many leaves of how many have boxes of features.
    fn registered(featured: impl Fn(&Tree) -> Featured) -> (u64, usize, usize) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let (large, small) =
            (generators::grid(1.0, 1.0, 41, 41).unwrap(), generators::grid(0.2, 0.2, 9, 9).unwrap());
        let lifted = small.vertices.iter().map(|p| p + Vec3::new(0.0, 0.003, 0.0));
        let x: Vec<Vec3> = large.vertices.iter().copied().chain(lifted).collect();
        let body = |dynamic| Body { dynamic, self_collision: false };
        let mesh = CollisionMesh::new(&[
            (body(true), large.vertices.len(), &large.triangles),
            (body(false), small.vertices.len(), &small.triangles),
        ])
        .unwrap();
        let tree = Bvh::new(&mesh, &x).unwrap().tree;
        assert!(is_by_need(&tree, &mesh));
        let middles: Vec<Row> = x.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32, 0.0]).collect();
        let radii = vec![0.002; x.len()];
        let mut boxes = Boxes::<1>::default();
        let of_vertex = |v: usize| ball_box(&middles[v], radii[v], 0.0);
        boxes.refit_blocks(&tree, &mesh, of_vertex, None, &pool);
        let mut featured = featured(&tree);
        let register = || Streaming::new(Register::new(&mesh, &middles, &radii, None, 0.0));
        let (visits, _) = featured.meet(&tree, &mut boxes, &mesh, register, &pool);
        let found = visits.iter().map(|v| v.sink.distance_tests).sum();
        (found, featured.leaves.iter().filter(|&&f| f).count(), tree.leaves.len())
    }

    #[test]
    fn only_leaves_that_meet_get_boxes_of_features_and_without_these_all_is_lost() {
        let (found, with_boxes, leaves) = registered(Featured::none);
        assert!(found > 100 && with_boxes > 1 && 4 * with_boxes < leaves, "{found} {with_boxes} of {leaves}");
        let planted = |tree: &Tree| Featured { leaves: vec![true; tree.leaves.len()] };
        assert_eq!(
            registered(planted).0,
            0,
            "the planted fault: boxes that are not there are taken for granted"
        );
    }
}
