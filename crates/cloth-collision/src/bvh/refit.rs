//! New boxes for the present positions: per vertex, per feature block, per block of the tree.

use super::build::Tree;
use crate::bounds::{Block, LANES, MovingBox, middle};
use crate::{CollisionMesh, Vec3};
use cloth_mesh::NONE;
use rayon::prelude::*;

/// The boxes of one call: at both ends of the step, or at rest.
#[derive(Debug, Clone, Default)]
pub(super) struct Boxes<const ENDS: usize> {
    pub(super) vertices: Vec<MovingBox<ENDS>>,
    /// The tree's blocks, leaves first.
    pub(super) blocks: Vec<Block<ENDS>>,
    /// The box around all lanes of each block.
    pub(super) hulls: Vec<MovingBox<ENDS>>,
    /// Which lanes of each block are used, and which of these have an active vertex below them.
    pub(super) lanes: Vec<BlockLanes>,
    pub(super) vertex_blocks: Vec<Block<ENDS>>,
    pub(super) edge_blocks: Vec<Block<ENDS>>,
}

/// Bit per lane.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BlockLanes {
    pub(super) used: u32,
    pub(super) active: u32,
}

/// Work per task; fixed, though nothing here depends on it.
const VERTEX_CHUNK: usize = 4096;
const BLOCK_CHUNK: usize = 256;

impl<const ENDS: usize> Boxes<ENDS> {
    /// Memory of the boxes over a tree \[B\].
    pub(super) fn bytes(tree: &Tree, vertex_count: usize) -> usize {
        let per_block = size_of::<Block<ENDS>>() + size_of::<MovingBox<ENDS>>() + size_of::<BlockLanes>();
        vertex_count * size_of::<MovingBox<ENDS>>()
            + tree.block_count() * per_block
            + (tree.vertex_ids.len() + tree.edge_ids.len()) * size_of::<Block<ENDS>>()
    }

    /// Fits all boxes to the positions `x` \[m\] at the ends, inflated by `margin` \[m\].
    pub(super) fn refit(
        &mut self,
        tree: &Tree,
        mesh: &CollisionMesh,
        x: [&[Vec3]; ENDS],
        margin: f64,
        active: Option<&[bool]>,
        pool: &rayon::ThreadPool,
    ) {
        let origin = middle(x[0]);
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
                    *b = MovingBox::of_vertex(&x, chunk * VERTEX_CHUNK + k, &origin, margin);
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
            self.lanes[k] = BlockLanes { used, active };
        }
        for (k, inner) in tree.inner.iter().enumerate() {
            let (mut bounds, mut is_active) = (Block::EMPTY, [false; LANES]);
            for lane in 0..inner.count as usize {
                let child = inner.first as usize + lane;
                bounds.set(lane, &self.hulls[child]);
                is_active[lane] = self.lanes[child].active != 0;
            }
            self.blocks[leaf_count + k] = bounds;
            self.hulls[leaf_count + k] = bounds.hull();
            self.lanes[leaf_count + k] =
                BlockLanes { used: first_lanes(inner.count), active: bits(is_active) };
        }
    }
}

fn first_lanes(count: u32) -> u32 {
    (1 << count) - 1
}

fn bits(lanes: [bool; LANES]) -> u32 {
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
            for (lane, &id) in ids.iter().enumerate().filter(|&(_, &id)| id != NONE) {
                let corners = corners(id as usize);
                let mut bounds = vertices[corners[0] as usize];
                for &v in &corners[1..] {
                    bounds.grow(&vertices[v as usize]);
                }
                block.set(lane, &bounds);
            }
        }
    });
}
