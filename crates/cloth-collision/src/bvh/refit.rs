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
        self.vertices.resize(mesh.vertex_count, MovingBox::EMPTY);
        self.blocks.resize(tree.block_count(), Block::EMPTY);
        self.hulls.resize(tree.block_count(), MovingBox::EMPTY);
        self.lanes.resize(tree.block_count(), BlockLanes::default());
        self.vertex_blocks.resize(tree.vertex_ids.len(), Block::EMPTY);
        self.edge_blocks.resize(tree.edge_ids.len(), Block::EMPTY);

        let Self { vertices, blocks, hulls, vertex_blocks, edge_blocks, .. } = self;
        pool.install(|| {
            vertices.par_chunks_mut(VERTEX_CHUNK).enumerate().for_each(|(chunk, boxes)| {
                for (k, b) in boxes.iter_mut().enumerate() {
                    *b = of_vertex(chunk * VERTEX_CHUNK + k);
                }
            });
            let vertices = &*vertices;
            fill(&mut blocks[..leaf_count], &tree.triangle_ids, vertices, |t| mesh.triangles[t]);
            fill(edge_blocks, &tree.edge_ids, vertices, |e| mesh.edges[e]);
            fill(vertex_blocks, &tree.vertex_ids, vertices, |v| [v as u32]);
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
    pub(crate) fn refit_leaf(&mut self, tree: &Tree, mesh: &CollisionMesh, leaf: usize) {
        let Self { vertices, blocks, hulls, vertex_blocks, edge_blocks, .. } = self;
        let range = |[first, end]: [u32; 2]| first as usize..end as usize;
        let of_vertices = range(tree.leaves[leaf].vertex_blocks);
        let of_edges = range(tree.leaves[leaf].edge_blocks);
        fill_one(&mut blocks[leaf], &tree.triangle_ids[leaf], vertices, |t| mesh.triangles[t]);
        for k in of_vertices {
            fill_one(&mut vertex_blocks[k], &tree.vertex_ids[k], vertices, |v| [v as u32]);
        }
        for k in of_edges {
            fill_one(&mut edge_blocks[k], &tree.edge_ids[k], vertices, |e| mesh.edges[e]);
        }
        hulls[leaf] = blocks[leaf].hull();
    }
}

fn first_lanes(count: u32) -> u32 {
    (1 << count) - 1
}

pub(crate) fn bits(lanes: [bool; LANES]) -> u32 {
    lanes.iter().enumerate().map(|(lane, &set)| u32::from(set) << lane).sum()
}

fn fill<const ENDS: usize, const N: usize>(
    blocks: &mut [Block<ENDS>],
    ids: &[[u32; LANES]],
    vertices: &[MovingBox<ENDS>],
    corners: impl Fn(usize) -> [u32; N] + Sync,
) {
    blocks.par_chunks_mut(BLOCK_CHUNK).zip(ids.par_chunks(BLOCK_CHUNK)).for_each(|(blocks, ids)| {
        for (block, ids) in blocks.iter_mut().zip(ids) {
            fill_one(block, ids, vertices, &corners);
        }
    });
}

#[inline]
fn fill_one<const ENDS: usize, const N: usize>(
    block: &mut Block<ENDS>,
    ids: &[u32; LANES],
    vertices: &[MovingBox<ENDS>],
    corners: impl Fn(usize) -> [u32; N],
) {
    for (lane, &id) in ids.iter().enumerate().filter(|&(_, &id)| id != NONE) {
        let corners = corners(id as usize);
        let mut bounds = vertices[corners[0] as usize];
        for &v in &corners[1..] {
            bounds.grow(&vertices[v as usize]);
        }
        block.set(lane, &bounds);
    }
}
