//! New boxes for the present positions: per vertex, per feature block, per node.

use super::build::Tree;
use crate::bounds::{Block, LANES, MovingBox};
use crate::{CollisionMesh, Vec3};
use cloth_mesh::NONE;
use rayon::prelude::*;

/// The boxes of one call.
#[derive(Debug, Clone, Default)]
pub(super) struct Boxes {
    /// Both ends are equal.
    pub(super) still: bool,
    pub(super) vertices: Vec<MovingBox>,
    pub(super) nodes: Vec<MovingBox>,
    /// Whether a vertex of the subtree's triangles is active.
    pub(super) node_active: Vec<bool>,
    pub(super) triangle_blocks: Vec<Block>,
    pub(super) vertex_blocks: Vec<Block>,
    pub(super) edge_blocks: Vec<Block>,
}

/// Work per task; fixed, though nothing here depends on it.
const VERTEX_CHUNK: usize = 4096;
const BLOCK_CHUNK: usize = 256;

impl Boxes {
    /// Fits all boxes to the motion from `x_t0` to `x_t1` \[m\] (the same slice: at rest), inflated by `margin` \[m\].
    pub(super) fn refit(
        &mut self,
        tree: &Tree,
        mesh: &CollisionMesh,
        x_t0: &[Vec3],
        x_t1: &[Vec3],
        margin: f64,
        active: Option<&[bool]>,
        pool: &rayon::ThreadPool,
    ) {
        let origin = middle(x_t0);
        let still = std::ptr::eq(x_t0, x_t1);
        self.still = still;
        self.vertices.resize(mesh.vertex_count, MovingBox::EMPTY);
        self.triangle_blocks.resize(tree.triangle_ids.len(), Block::EMPTY);
        self.vertex_blocks.resize(tree.vertex_ids.len(), Block::EMPTY);
        self.edge_blocks.resize(tree.edge_ids.len(), Block::EMPTY);
        self.nodes.resize(tree.nodes.len(), MovingBox::EMPTY);
        self.node_active.resize(tree.nodes.len(), true);

        let (vertices, triangle_blocks) = (&mut self.vertices, &mut self.triangle_blocks);
        let (vertex_blocks, edge_blocks) = (&mut self.vertex_blocks, &mut self.edge_blocks);
        pool.install(|| {
            vertices.par_chunks_mut(VERTEX_CHUNK).enumerate().for_each(|(chunk, boxes)| {
                for (k, b) in boxes.iter_mut().enumerate() {
                    let v = chunk * VERTEX_CHUNK + k;
                    *b = if still {
                        MovingBox::of_still_vertex(&x_t0[v], &origin, margin)
                    } else {
                        MovingBox::of_vertex(&x_t0[v], &x_t1[v], &origin, margin)
                    };
                }
            });
            let vertices = &*vertices;
            fill(triangle_blocks, &tree.triangle_ids, vertices, |t| &mesh.triangles[t]);
            fill(edge_blocks, &tree.edge_ids, vertices, |e| &mesh.edges[e]);
            vertex_blocks.par_chunks_mut(BLOCK_CHUNK).zip(tree.vertex_ids.par_chunks(BLOCK_CHUNK)).for_each(
                |(blocks, ids)| {
                    for (block, ids) in blocks.iter_mut().zip(ids) {
                        for (lane, &v) in ids.iter().enumerate().filter(|&(_, &v)| v != NONE) {
                            block.set(lane, &vertices[v as usize]);
                        }
                    }
                },
            );
        });

        for node in (0..tree.nodes.len()).rev() {
            let shape = &tree.nodes[node];
            let (mut bounds, mut is_active) = (MovingBox::EMPTY, active.is_none());
            if shape.leaf == NONE {
                for child in [node + 1, shape.right as usize] {
                    bounds.grow(&self.nodes[child]);
                    is_active |= self.node_active[child];
                }
            } else {
                bounds = self.triangle_blocks[shape.leaf as usize].hull();
                if let Some(mask) = active {
                    let triangles = tree.triangle_ids[shape.leaf as usize].iter().filter(|&&t| t != NONE);
                    is_active =
                        triangles.flat_map(|&t| &mesh.triangles[t as usize]).any(|&v| mask[v as usize]);
                }
            }
            self.nodes[node] = bounds;
            self.node_active[node] = is_active;
        }
    }
}

/// Middle of the positions' box: coordinates relative to it keep the most digits in single precision.
fn middle(x: &[Vec3]) -> Vec3 {
    let (mut lo, mut hi) = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
    for p in x {
        lo = lo.inf(p);
        hi = hi.sup(p);
    }
    // Halves before the sum: no overflow.
    if x.is_empty() { Vec3::zeros() } else { lo * 0.5 + hi * 0.5 }
}

fn fill<'a, const N: usize>(
    blocks: &mut [Block],
    ids: &[[u32; LANES]],
    vertices: &[MovingBox],
    corners: impl Fn(usize) -> &'a [u32; N] + Sync,
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
