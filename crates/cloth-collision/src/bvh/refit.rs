//! New boxes for the present positions: per vertex, per feature block, per block of the tree.

use super::build::Tree;
use crate::CollisionMesh;
use crate::bounds::{Block, LANES, MovingBox};
use cloth_mesh::NONE;
use rayon::prelude::*;

/// The boxes of one call: at both ends of the step, or at rest.
#[derive(Debug, Clone, Default)]
pub(crate) struct Boxes<const ENDS: usize> {
    pub(crate) vertices: Vec<MovingBox<ENDS>>,
    /// The tree's blocks, leaves first.
    pub(crate) blocks: Vec<Block<ENDS>>,
    /// The box around all lanes of each block.
    pub(crate) hulls: Vec<MovingBox<ENDS>>,
    /// Which lanes of each block are used, and which of these have an active vertex below them.
    pub(crate) lanes: Vec<BlockLanes>,
    pub(crate) vertex_blocks: Vec<Block<ENDS>>,
    pub(crate) edge_blocks: Vec<Block<ENDS>>,
}

/// Bit per lane, and what is known of the whole block.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct BlockLanes {
    pub(crate) used: u32,
    pub(crate) active: u32,
    /// What lies below the block certainly does not meet itself.
    pub(crate) is_flat: bool,
}

/// Work per task; fixed, though nothing here depends on it.
const VERTEX_CHUNK: usize = 4096;
const BLOCK_CHUNK: usize = 256;

impl<const ENDS: usize> Boxes<ENDS> {
    /// Memory of the boxes over a tree \[B\].
    pub(crate) fn bytes(tree: &Tree, vertex_count: usize) -> usize {
        let per_block = size_of::<Block<ENDS>>() + size_of::<MovingBox<ENDS>>() + size_of::<BlockLanes>();
        vertex_count * size_of::<MovingBox<ENDS>>()
            + tree.block_count() * per_block
            + (tree.vertex_ids.len() + tree.edge_ids.len()) * size_of::<Block<ENDS>>()
    }

    /// Fits all boxes to those of the vertices.
    pub(crate) fn refit(
        &mut self,
        tree: &Tree,
        mesh: &CollisionMesh,
        of_vertex: impl Fn(usize) -> MovingBox<ENDS> + Sync,
        active: Option<&[bool]>,
        pool: &rayon::ThreadPool,
    ) {
        let leaf_count = tree.leaves.len();
        pool.install(|| {
            resize(&mut self.vertices, mesh.vertex_count, MovingBox::EMPTY);
            resize(&mut self.blocks, tree.block_count(), Block::EMPTY);
            resize(&mut self.hulls, tree.block_count(), MovingBox::EMPTY);
            resize(&mut self.lanes, tree.block_count(), BlockLanes::default());
            resize(&mut self.vertex_blocks, tree.vertex_ids.len(), Block::EMPTY);
            resize(&mut self.edge_blocks, tree.edge_ids.len(), Block::EMPTY);
        });

        let Self { vertices, blocks, hulls, vertex_blocks, edge_blocks, .. } = self;
        pool.install(|| {
            vertices.par_chunks_mut(VERTEX_CHUNK).enumerate().for_each(|(chunk, boxes)| {
                for (k, b) in boxes.iter_mut().enumerate() {
                    *b = of_vertex(chunk * VERTEX_CHUNK + k);
                }
            });
            let vertices = &*vertices;
            fill(&mut blocks[..leaf_count], &tree.corners, vertices);
            fill(edge_blocks, &tree.edge_ends, vertices);
            fill(vertex_blocks, one_corner(&tree.vertex_ids), vertices);
            hulls[..leaf_count].par_chunks_mut(BLOCK_CHUNK).zip(blocks.par_chunks(BLOCK_CHUNK)).for_each(
                |(hulls, blocks)| {
                    for (hull, block) in hulls.iter_mut().zip(blocks) {
                        *hull = block.hull();
                    }
                },
            );
        });
        for (k, leaf) in tree.leaves.iter().enumerate() {
            let used = first_lanes(leaf.count);
            let is_active = |mask: &[bool], t: u32| {
                t != NONE && mesh.triangles[t as usize].iter().any(|&v| mask[v as usize])
            };
            let active = active.map_or(used, |mask| bits(tree.triangle_ids[k].map(|t| is_active(mask, t))));
            self.lanes[k] = BlockLanes { used, active, is_flat: false };
        }
        for k in 0..tree.inner.len() {
            self.refit_inner(tree, k);
        }
    }

    /// Fits block `k` of those above the leaves to the blocks below it.
    pub(crate) fn refit_inner(&mut self, tree: &Tree, k: usize) {
        let (inner, block) = (&tree.inner[k], tree.leaves.len() + k);
        let (mut bounds, mut is_active) = (Block::EMPTY, [false; LANES]);
        for lane in 0..inner.count as usize {
            let child = inner.first as usize + lane;
            bounds.set(lane, &self.hulls[child]);
            is_active[lane] = self.lanes[child].active != 0;
        }
        self.blocks[block] = bounds;
        self.hulls[block] = bounds.hull();
        self.lanes[block] =
            BlockLanes { used: first_lanes(inner.count), active: bits(is_active), is_flat: false };
    }

    /// Fits a leaf to the boxes of its vertices, which have changed.
    pub(crate) fn refit_leaf(&mut self, tree: &Tree, leaf: usize) {
        let Self { vertices, blocks, hulls, vertex_blocks, edge_blocks, .. } = self;
        let range = |[first, end]: [u32; 2]| first as usize..end as usize;
        let of_vertices = range(tree.leaves[leaf].vertex_blocks);
        let of_edges = range(tree.leaves[leaf].edge_blocks);
        fill_one(&mut blocks[leaf], &tree.corners[leaf], vertices);
        for k in of_vertices {
            fill_one(&mut vertex_blocks[k], std::array::from_ref(&tree.vertex_ids[k]), vertices);
        }
        for k in of_edges {
            fill_one(&mut edge_blocks[k], &tree.edge_ends[k], vertices);
        }
        hulls[leaf] = blocks[leaf].hull();
    }
}

/// Makes room on all threads of the pool: pages that are touched for the first time cost more than what is written there.
fn resize<T: Copy + Send + Sync>(list: &mut Vec<T>, len: usize, value: T) {
    if list.len() != len {
        list.clear();
        list.par_extend(rayon::iter::repeat_n(value, len));
    }
}

fn first_lanes(count: u32) -> u32 {
    (1 << count) - 1
}

pub(crate) fn bits(lanes: [bool; LANES]) -> u32 {
    lanes.iter().enumerate().map(|(lane, &set)| u32::from(set) << lane).sum()
}

/// Features of one vertex.
fn one_corner(ids: &[[u32; LANES]]) -> &[[[u32; LANES]; 1]] {
    ids.as_chunks::<1>().0
}

fn fill<const ENDS: usize, const N: usize>(
    blocks: &mut [Block<ENDS>],
    corners: &[[[u32; LANES]; N]],
    vertices: &[MovingBox<ENDS>],
) {
    blocks.par_chunks_mut(BLOCK_CHUNK).zip(corners.par_chunks(BLOCK_CHUNK)).for_each(|(blocks, corners)| {
        for (block, corners) in blocks.iter_mut().zip(corners) {
            fill_one(block, corners, vertices);
        }
    });
}

/// Fits a block to the boxes of its features' vertices, `[corner][lane]`.
#[inline]
fn fill_one<const ENDS: usize, const N: usize>(
    block: &mut Block<ENDS>,
    corners: &[[u32; LANES]; N],
    vertices: &[MovingBox<ENDS>],
) {
    for lane in (0..LANES).filter(|&lane| corners[0][lane] != NONE) {
        let mut bounds = vertices[corners[0][lane] as usize];
        for corner in &corners[1..] {
            bounds.grow(&vertices[corner[lane] as usize]);
        }
        block.set(lane, &bounds);
    }
}
