//! Building the tree: once per topology.

use super::{LEAF_TRIANGLES, leaves};
use crate::bounds::{LANES, middle};
use crate::{CollisionMesh, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// What does not change after the build: a tree per body, all of the same height.
///
/// A node is a block: its lanes are triangles in a leaf, blocks of the level below elsewhere. Blocks are numbered
/// by level, the leaves first, and within a level by body.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tree {
    pub(crate) leaves: Vec<Leaf>,
    /// Triangles of each leaf, [`cloth_mesh::NONE`] in unused lanes.
    pub(crate) triangle_ids: Vec<[u32; LANES]>,
    /// Their vertices, `[corner][lane]`.
    pub(crate) corners: Vec<[[u32; LANES]; 3]>,
    /// Vertices owned by the triangles of a leaf, in blocks.
    pub(crate) vertex_ids: Vec<[u32; LANES]>,
    /// Edges owned by the triangles of a leaf, in blocks.
    pub(crate) edge_ids: Vec<[u32; LANES]>,
    /// Their vertices, `[end][lane]`, [`cloth_mesh::NONE`] in unused lanes.
    pub(crate) edge_ends: Vec<[[u32; LANES]; 2]>,
    /// The vertices in the order of the leaves that own them: the vertex of each rank.
    pub(crate) vertex_order: Vec<u32>,
    /// The rank of each of the vertices in blocks.
    pub(crate) vertex_ranks: Vec<[u32; LANES]>,
    /// The ranks of a triangle's corners, by its place: leaf times [`LANES`] plus lane.
    pub(crate) triangle_ranks: Vec<[u32; 3]>,
    /// The ranks of an edge's ends, by its place.
    pub(crate) edge_ranks: Vec<[u32; 2]>,
    /// The blocks above the leaves.
    pub(crate) inner: Vec<Inner>,
    pub(crate) roots: Vec<Root>,
}

/// A leaf: its number of triangles and the ranges of its feature blocks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leaf {
    pub(crate) count: u32,
    pub(crate) vertex_blocks: [u32; 2],
    pub(crate) edge_blocks: [u32; 2],
}

/// A block of `count` blocks from `first` on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Inner {
    pub(crate) first: u32,
    pub(crate) count: u32,
}

/// The block above all triangles of a body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Root {
    pub(crate) block: u32,
    pub(crate) body: u32,
}

impl Tree {
    /// Memory \[B\].
    pub(crate) fn bytes(&self) -> usize {
        fn held<T>(list: &Vec<T>) -> usize {
            list.capacity() * size_of::<T>()
        }
        held(&self.leaves)
            + held(&self.triangle_ids)
            + held(&self.corners)
            + held(&self.vertex_ids)
            + held(&self.edge_ids)
            + held(&self.edge_ends)
            + held(&self.vertex_order)
            + held(&self.vertex_ranks)
            + held(&self.triangle_ranks)
            + held(&self.edge_ranks)
            + held(&self.inner)
            + held(&self.roots)
    }

    pub(crate) fn block_count(&self) -> usize {
        self.leaves.len() + self.inner.len()
    }

    /// The block, if it is above the leaves.
    #[inline(always)]
    pub(crate) fn inner(&self, block: u32) -> Option<&Inner> {
        self.inner.get((block as usize).wrapping_sub(self.leaves.len()))
    }
}

/// Median splits of each body's triangles along the longest axis of their centroids' box, down to full leaves.
///
/// The splits run on the pool, if there is one; they do not depend on it.
pub(crate) fn build(mesh: &CollisionMesh, x: &[Vec3], pool: Option<&rayon::ThreadPool>) -> Tree {
    let origin = middle(x);
    let item = |(t, tri): (usize, &[u32; 3])| {
        // Thirds before the sum: no overflow.
        let third = |v: u32| (x[v as usize] - origin) * (1.0 / 3.0);
        let c = third(tri[0]) + third(tri[1]) + third(tri[2]);
        Item { centroid: [c.x as f32, c.y as f32, c.z as f32], triangle: t as u32 }
    };
    let mut items: Vec<Item> = match pool {
        Some(pool) => {
            pool.install(|| mesh.triangles.par_iter().enumerate().with_min_len(PARALLEL).map(item).collect())
        }
        None => mesh.triangles.iter().enumerate().map(item).collect(),
    };
    let mut tree = Tree::default();
    let mut levels: Vec<(u32, Range<u32>)> = vec![];
    // Triangles come body by body.
    let body_of = |item: &Item| mesh.vertex_body[mesh.triangles[item.triangle as usize][0] as usize];
    let mut leaf_count = 0;
    let mut bodies: Vec<&[Item]> = vec![];
    for items in items.chunk_by_mut(|a, b| body_of(a) == body_of(b)) {
        match pool {
            Some(pool) if items.len() > PARALLEL => pool.install(|| arrange(items)),
            _ => arrange(items),
        }
        let first = leaf_count;
        leaf_count += items.len().div_ceil(LEAF_TRIANGLES) as u32;
        levels.push((body_of(&items[0]), first..leaf_count));
        bodies.push(items);
    }
    leaves::fill(mesh, &bodies, &mut tree, pool);
    while levels.iter().any(|(_, level)| level.len() > 1) {
        for (_, level) in &mut levels {
            let start = tree.block_count() as u32;
            for first in level.clone().step_by(LANES) {
                tree.inner.push(Inner { first, count: (level.end - first).min(LANES as u32) });
            }
            *level = start..tree.block_count() as u32;
        }
    }
    tree.roots = levels.into_iter().map(|(body, level)| Root { block: level.start, body }).collect();
    tree
}

/// A triangle on its way to a leaf.
#[derive(Debug, Clone, Copy)]
pub(super) struct Item {
    centroid: [f32; 3],
    pub(super) triangle: u32,
}

fn longest_axis(items: &[Item]) -> usize {
    let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for Item { centroid: c, .. } in items {
        for axis in 0..3 {
            lo[axis] = if c[axis] < lo[axis] { c[axis] } else { lo[axis] };
            hi[axis] = if c[axis] > hi[axis] { c[axis] } else { hi[axis] };
        }
    }
    (1..3).fold(0, |best, axis| if hi[axis] - lo[axis] > hi[best] - lo[best] { axis } else { best })
}

/// Triangles from which on the two halves are arranged in parallel.
const PARALLEL: usize = 4096;

/// How many of more triangles than a leaf holds go to the left half: those of half of the children of their block.
fn left_count(count: usize) -> usize {
    let mut child = LEAF_TRIANGLES;
    while child * LANES < count {
        child *= LANES;
    }
    count.div_ceil(child).div_ceil(2) * child
}

/// Brings the triangles into the order of the leaves.
fn arrange(items: &mut [Item]) {
    fn split<const AXIS: usize>(items: &mut [Item], left: usize) {
        // Of equal centroids any may go left: the selection depends on nothing but its input.
        items.select_nth_unstable_by(left, |a, b| a.centroid[AXIS].total_cmp(&b.centroid[AXIS]));
    }
    if items.len() <= LEAF_TRIANGLES {
        return;
    }
    let left = left_count(items.len());
    match longest_axis(items) {
        0 => split::<0>(items, left),
        1 => split::<1>(items, left),
        _ => split::<2>(items, left),
    }
    let (left, right) = items.split_at_mut(left);
    if left.len() + right.len() > PARALLEL && rayon::current_thread_index().is_some() {
        rayon::join(|| arrange(left), || arrange(right));
    } else {
        arrange(left);
        arrange(right);
    }
}
