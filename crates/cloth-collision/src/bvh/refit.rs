//! New boxes for the present positions: per vertex, per feature block, per block of the tree.

use super::build::{Leaf, Tree};
use super::diagonals::Diagonals;
use crate::CollisionMesh;
use crate::bounds::{Block, LANES, MovingBox, fit};
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
    /// Of each leaf, or none where nobody asked for them.
    pub(crate) diagonals: Vec<Diagonals<ENDS>>,
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
    /// Memory of the boxes over a tree, without the leaves' diagonals \[B\].
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
        self.refit_blocks(tree, mesh, of_vertex, active, pool);
        let Self { vertices, vertex_blocks, edge_blocks, .. } = self;
        pool.install(|| {
            refit_all(edge_blocks, &tree.edge_ends, vertices);
            refit_all(vertex_blocks, one_corner(&tree.vertex_ids), vertices);
        });
    }

    /// [`Boxes::refit`] without the boxes of features: those of triangles and of what lies above them.
    pub(crate) fn refit_blocks(
        &mut self,
        tree: &Tree,
        mesh: &CollisionMesh,
        of_vertex: impl Fn(usize) -> MovingBox<ENDS> + Sync,
        active: Option<&[bool]>,
        pool: &rayon::ThreadPool,
    ) {
        let Self { vertices, blocks, hulls, lanes, diagonals, .. } = self;
        // Those of other positions.
        diagonals.clear();
        pool.install(|| {
            vertices.clear();
            let all = (0..mesh.vertex_count).into_par_iter().with_min_len(VERTEX_CHUNK);
            vertices.par_extend(all.map(&of_vertex));
            blocks.reserve(tree.block_count().saturating_sub(blocks.len()));
            refit_all(blocks, &tree.corners, vertices);
            hulls.reserve(tree.block_count().saturating_sub(hulls.len()));
            refill(hulls, blocks, Block::hull);
        });
        blocks.resize(tree.block_count(), Block::EMPTY);
        hulls.resize(tree.block_count(), MovingBox::EMPTY);
        lanes.resize(tree.block_count(), BlockLanes::default());
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

    /// Fits the diagonals of the leaves to the boxes of the vertices.
    pub(crate) fn refit_diagonals(&mut self, tree: &Tree, pool: &rayon::ThreadPool) {
        let Self { vertices, diagonals, .. } = self;
        pool.install(|| {
            refill(diagonals, &tree.corners, |corners| {
                let used = corners.as_flattened().iter().filter(|&&v| v != NONE);
                Diagonals::around(used.map(|&v| &vertices[v as usize]))
            });
        });
    }

    /// Fits the boxes of the features of the leaves that `wanted` marks.
    pub(crate) fn refit_features(&mut self, tree: &Tree, wanted: &[bool], pool: &rayon::ThreadPool) {
        let Self { vertices, vertex_blocks, edge_blocks, .. } = self;
        vertex_blocks.resize(tree.vertex_ids.len(), Block::EMPTY);
        edge_blocks.resize(tree.edge_ids.len(), Block::EMPTY);
        // The features of a chunk of leaves lie together.
        let (mut of_vertices, mut of_edges) = (&mut vertex_blocks[..], &mut edge_blocks[..]);
        let mut chunks = Vec::with_capacity(tree.leaves.len() / BLOCK_CHUNK + 1);
        for (leaves, wanted) in tree.leaves.chunks(BLOCK_CHUNK).zip(wanted.chunks(BLOCK_CHUNK)) {
            let (first, last) = (leaves[0], leaves[leaves.len() - 1]);
            let count = |of: fn(&Leaf) -> [u32; 2]| (of(&last)[1] - of(&first)[0]) as usize;
            let (vertex_chunk, other_vertices) = of_vertices.split_at_mut(count(|leaf| leaf.vertex_blocks));
            let (edge_chunk, other_edges) = of_edges.split_at_mut(count(|leaf| leaf.edge_blocks));
            (of_vertices, of_edges) = (other_vertices, other_edges);
            chunks.push((leaves, wanted, vertex_chunk, edge_chunk));
        }
        pool.install(|| {
            chunks.into_par_iter().with_max_len(1).for_each(|(leaves, wanted, vertex_chunk, edge_chunk)| {
                let [first_vertex, first_edge] = [leaves[0].vertex_blocks[0], leaves[0].edge_blocks[0]];
                for (leaf, _) in leaves.iter().zip(wanted).filter(|(_, wanted)| **wanted) {
                    for k in leaf.vertex_blocks[0]..leaf.vertex_blocks[1] {
                        let corners = std::array::from_ref(&tree.vertex_ids[k as usize]);
                        fit(&mut vertex_chunk[(k - first_vertex) as usize], corners, vertices);
                    }
                    for k in leaf.edge_blocks[0]..leaf.edge_blocks[1] {
                        let ends = &tree.edge_ends[k as usize];
                        fit(&mut edge_chunk[(k - first_edge) as usize], ends, vertices);
                    }
                }
            });
        });
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
        fit(&mut blocks[leaf], &tree.corners[leaf], vertices);
        for k in of_vertices {
            fit(&mut vertex_blocks[k], std::array::from_ref(&tree.vertex_ids[k]), vertices);
        }
        for k in of_edges {
            fit(&mut edge_blocks[k], &tree.edge_ends[k], vertices);
        }
        hulls[leaf] = blocks[leaf].hull();
    }
}

/// Writes a list anew on all threads of the pool: pages that are touched for the first time cost more than what is written there.
fn refill<T: Sync, U: Send>(list: &mut Vec<U>, of: &[T], value: impl Fn(&T) -> U + Sync + Send) {
    list.clear();
    list.par_extend(of.par_iter().with_min_len(BLOCK_CHUNK).map(value));
}

/// [`refill`] with the boxes of features, each block where it is to lie.
fn refit_all<const ENDS: usize, const N: usize>(
    blocks: &mut Vec<Block<ENDS>>,
    corners: &[[[u32; LANES]; N]],
    vertices: &[MovingBox<ENDS>],
) {
    blocks.clear();
    blocks.reserve(corners.len());
    let room = &mut blocks.spare_capacity_mut()[..corners.len()];
    let both = room.par_iter_mut().zip(corners).with_min_len(BLOCK_CHUNK);
    both.for_each(|(block, corners)| fit(block.write(Block::EMPTY), corners, vertices));
    // SAFETY: there is room for so many, and each has been written.
    unsafe { blocks.set_len(corners.len()) };
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
