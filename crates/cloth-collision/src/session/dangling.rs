//! Dangling triangles inside a session: the part of the tree above them is fitted again, bottom up, and met with the tree.

use super::distance::Row;
use crate::CollisionMesh;
use crate::bounds::{LANES, MovingBox, lanes};
use crate::bvh::build::Tree;
use crate::bvh::refit::Boxes;
use cloth_mesh::NONE;

/// For each vertex the leaves of its triangles, and for each block the one above it. Found when first needed.
#[derive(Debug, Clone, Default)]
pub(super) struct Upwards {
    first_of_vertex: Vec<u32>,
    leaves: Vec<u32>,
    parents: Vec<u32>,
}

impl Upwards {
    pub(super) fn new(tree: &Tree, mesh: &CollisionMesh) -> Self {
        let mut first_of_vertex = vec![0u32; mesh.vertex_count + 1];
        for &v in mesh.triangles.iter().flatten() {
            first_of_vertex[v as usize + 1] += 1;
        }
        for v in 0..mesh.vertex_count {
            first_of_vertex[v + 1] += first_of_vertex[v];
        }
        let mut next = first_of_vertex.clone();
        let mut leaves = vec![0; 3 * mesh.triangles.len()];
        for (leaf, ids) in tree.triangle_ids.iter().enumerate() {
            for &t in ids.iter().filter(|&&t| t != NONE) {
                for v in mesh.triangles[t as usize] {
                    leaves[next[v as usize] as usize] = leaf as u32;
                    next[v as usize] += 1;
                }
            }
        }
        let mut parents = vec![NONE; tree.block_count()];
        for (k, inner) in tree.inner.iter().enumerate() {
            for child in inner.first..inner.first + inner.count {
                parents[child as usize] = (tree.leaves.len() + k) as u32;
            }
        }
        Self { first_of_vertex, leaves, parents }
    }

    fn leaves_of(&self, v: u32) -> &[u32] {
        let range = self.first_of_vertex[v as usize]..self.first_of_vertex[v as usize + 1];
        &self.leaves[range.start as usize..range.end as usize]
    }

    /// The leaves of the triangles of these vertices, ascending.
    pub(super) fn leaves(&self, vertices: &[u32]) -> Vec<u32> {
        let mut leaves: Vec<u32> = vertices.iter().flat_map(|&v| self.leaves_of(v)).copied().collect();
        leaves.sort_unstable();
        leaves.dedup();
        leaves
    }

    /// Fits the boxes of the leaves and of all blocks above them after the radii of `vertices` have changed, and marks what has a
    /// triangle with such a vertex below it, and nothing else. The number of such triangles and of fitted blocks.
    pub(super) fn refit(
        &self,
        boxes: &mut Boxes<1>,
        tree: &Tree,
        mesh: &CollisionMesh,
        (middles, radii, thickness): (&[Row], &[f32], f64),
        vertices: &[u32],
        leaves: &[u32],
    ) -> (u64, u64) {
        for &v in vertices {
            boxes.vertices[v as usize] = ball_box(&middles[v as usize], radii[v as usize], thickness);
        }
        for lanes in &mut boxes.lanes {
            lanes.active = 0;
        }
        let is_dangling = |v: &u32| vertices.binary_search(v).is_ok();
        let (mut triangles, mut marked) = (0, vec![]);
        for &leaf in leaves {
            boxes.refit_leaf(tree, leaf as usize);
            let lanes = &mut boxes.lanes[leaf as usize];
            lanes.is_flat = false;
            for (lane, &t) in tree.triangle_ids[leaf as usize].iter().enumerate() {
                if t != NONE && mesh.triangles[t as usize].iter().any(is_dangling) {
                    lanes.active |= 1 << lane;
                }
            }
            triangles += u64::from(lanes.active.count_ones());
            marked.push(self.parents[leaf as usize]);
        }
        // Level by level: blocks of a level are all numbered before those of the next.
        let mut fitted = leaves.len() as u64;
        loop {
            marked.retain(|&block| block != NONE);
            marked.dedup();
            if marked.is_empty() {
                return (triangles, fitted);
            }
            fitted += marked.len() as u64;
            for block in &mut marked {
                boxes.refit_inner(tree, *block as usize - tree.leaves.len());
                *block = self.parents[*block as usize];
            }
        }
    }
}

/// The box of a ball with half the thickness around it.
#[inline]
pub(super) fn ball_box(middle: &Row, radius: f32, thickness: f64) -> MovingBox<1> {
    MovingBox::around([middle[0], middle[1], middle[2]], f64::from(radius) + 0.5 * thickness)
}

/// All pairs of a marked leaf and another leaf whose boxes overlap, each once: every leaf meets the tree on its own.
/// Calls `visit` with them; the number of boxes compared.
pub(super) fn one_by_one(
    tree: &Tree,
    boxes: &Boxes<1>,
    mesh: &CollisionMesh,
    leaves: &[u32],
    mut visit: impl FnMut(u32, u32),
) -> u64 {
    let mut tests = 0;
    let mut stack = vec![];
    for &leaf in leaves {
        let hull = boxes.hulls[leaf as usize];
        let body = mesh.vertex_body[mesh.triangles[tree.triangle_ids[leaf as usize][0] as usize][0] as usize];
        stack.extend(tree.roots.iter().filter(|r| mesh.bodies_meet(body, r.body)).map(|r| r.block));
        while let Some(block) = stack.pop() {
            let Some(inner) = tree.inner(block) else {
                // Of two marked leaves the lower one meets the other, and each itself.
                if block >= leaf || boxes.lanes[block as usize].active == 0 {
                    visit(leaf, block);
                }
                continue;
            };
            tests += u64::from(inner.count);
            let children = &boxes.blocks[block as usize];
            let used = boxes.lanes[block as usize].used;
            for lane in lanes(used).filter(|&lane| children.get(lane).overlaps(&hull)) {
                stack.push(inner.first + lane as u32);
            }
        }
    }
    tests
}

/// Boxes that [`one_by_one`] is expected to compare for so many leaves: about two full blocks in each level of the tree.
pub(super) fn one_by_one_tests(tree: &Tree, leaves: usize) -> u64 {
    let levels = u64::from(tree.block_count().max(2).ilog(LANES)) + 1;
    2 * LANES as u64 * levels * leaves as u64
}
