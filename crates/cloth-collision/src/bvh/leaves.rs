//! The leaves of the tree: their triangles and the features that these own.
//!
//! Each list is made once at its size, and filled in parallel: how many features each leaf owns is counted before.

use super::LEAF_TRIANGLES;
use super::build::{Item, Leaf, Tree};
use crate::CollisionMesh;
use crate::bounds::LANES;
use cloth_mesh::NONE;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Leaves or triangles per task; fixed, though nothing here depends on it.
const LEAF_CHUNK: usize = 256;
const TRIANGLE_CHUNK: usize = 2048;
/// Why a part can be split off.
const WITHIN: &str = "the lists have room for what was counted";
/// Features of one kind that the triangles of a leaf own at most, and one more place to write to.
const MOST: usize = 3 * LEAF_TRIANGLES + 1;

/// Fills an empty tree with the leaves of the bodies, whose triangles are in their order, and numbers the vertices by the
/// leaves that own them, so that those of close leaves lie close in memory.
pub(super) fn fill(
    mesh: &CollisionMesh,
    bodies: &[&[Item]],
    tree: &mut Tree,
    pool: Option<&rayon::ThreadPool>,
) {
    let items: Vec<&[Item]> = bodies.iter().flat_map(|items| items.chunks(LEAF_TRIANGLES)).collect();
    // A mesh without features has no owners: its leaves hold triangles only.
    let owned = if mesh.triangle_edges.is_empty() { vec![] } else { owned(mesh, pool) };
    let mask = |item: &Item| owned.get(item.triangle as usize).copied().unwrap_or(0);
    let counts = mapped(pool, LEAF_CHUNK, &items, |items| {
        let count = |bits: u8| items.iter().map(|item| (mask(item) & bits).count_ones()).sum::<u32>();
        [count(CORNERS), count(SIDES)]
    });

    let mut leaf = Leaf { count: 0, vertex_blocks: [0; 2], edge_blocks: [0; 2] };
    let mut first_rank = 0;
    let mut first_ranks = Vec::with_capacity(items.len());
    tree.leaves = Vec::with_capacity(items.len());
    for (items, &[vertices, edges]) in items.iter().zip(&counts) {
        let after = |blocks: [u32; 2], count: u32| [blocks[1], blocks[1] + count.div_ceil(LANES as u32)];
        leaf = Leaf {
            count: items.len() as u32,
            vertex_blocks: after(leaf.vertex_blocks, vertices),
            edge_blocks: after(leaf.edge_blocks, edges),
        };
        tree.leaves.push(leaf);
        first_ranks.push(first_rank);
        first_rank += vertices;
    }
    tree.triangle_ids = mapped(pool, LEAF_CHUNK, &items, |items| {
        let mut ids = [NONE; LANES];
        for (id, item) in ids.iter_mut().zip(*items) {
            *id = item.triangle;
        }
        ids
    });
    tree.corners = mapped(pool, LEAF_CHUNK, &tree.triangle_ids, |ids| {
        let mut corners = [[NONE; LANES]; 3];
        for lane in 0..LANES {
            let triangle = mesh.triangles.get(ids[lane] as usize).unwrap_or(&[NONE; 3]);
            for k in 0..3 {
                corners[k][lane] = triangle[k];
            }
        }
        corners
    });
    if owned.is_empty() {
        return;
    }

    tree.vertex_order = vec![0; first_rank as usize];
    tree.vertex_ids = vec![[NONE; LANES]; leaf.vertex_blocks[1] as usize];
    tree.vertex_ranks = tree.vertex_ids.clone();
    tree.edge_ids = vec![[NONE; LANES]; leaf.edge_blocks[1] as usize];
    tree.edge_ends = vec![[[NONE; LANES]; 2]; leaf.edge_blocks[1] as usize];
    let mut ranks = Vec::with_capacity(mesh.vertex_count);
    ranks.resize_with(mesh.vertex_count, || AtomicU32::new(NONE));
    let parts = parts(tree, &items, &first_ranks);
    each(pool, parts, |part| part.fill(mesh, &mask, &ranks));

    // Without a vertex, without a rank.
    let rank = |v: u32| ranks.get(v as usize).map_or(NONE, |rank| rank.load(Ordering::Relaxed));
    tree.triangle_ranks =
        mapped(pool, LEAF_CHUNK, &tree.corners, |corners| by_lane(corners, rank)).into_flattened();
    tree.edge_ranks = mapped(pool, LEAF_CHUNK, &tree.edge_ends, |ends| by_lane(ends, rank)).into_flattened();
}

/// The ranks of each lane's vertices.
#[inline(always)]
fn by_lane<const N: usize>(vertices: &[[u32; LANES]; N], rank: impl Fn(u32) -> u32) -> [[u32; N]; LANES] {
    let mut ranks = [[NONE; N]; LANES];
    for lane in 0..LANES {
        for k in 0..N {
            ranks[lane][k] = rank(vertices[k][lane]);
        }
    }
    ranks
}

/// Bits of what a triangle owns: its corners, and its sides as [`CollisionMesh::triangle_edges`] has them.
const CORNERS: u8 = 0b111;
const SIDES: u8 = 0b11_1000;

fn owned(mesh: &CollisionMesh, pool: Option<&rayon::ThreadPool>) -> Vec<u8> {
    let numbers: Vec<u32> = (0..mesh.triangles.len() as u32).step_by(TRIANGLE_CHUNK).collect();
    let of_chunk = |&first: &u32| -> Vec<u8> {
        let chunk = first as usize..mesh.triangles.len().min(first as usize + TRIANGLE_CHUNK);
        let both = mesh.triangles[chunk.clone()].iter().zip(&mesh.triangle_edges[chunk]);
        let of_triangle = |(t, (corners, sides)): (u32, (&[u32; 3], &[u32; 3]))| {
            (0..3).fold(0, |mask, k| {
                let corner = u8::from(mesh.vertex_owner[corners[k] as usize] == t);
                mask | corner << k | u8::from(mesh.edge_owner[sides[k] as usize] == t) << (k + 3)
            })
        };
        (first..).zip(both).map(of_triangle).collect()
    };
    mapped(pool, 1, &numbers, of_chunk).concat()
}

/// Some leaves in a row, and their part of the lists of features.
struct Part<'a> {
    leaves: &'a [Leaf],
    items: &'a [&'a [Item]],
    first_ranks: &'a [u32],
    vertex_order: &'a mut [u32],
    vertex_ids: &'a mut [[u32; LANES]],
    vertex_ranks: &'a mut [[u32; LANES]],
    edge_ids: &'a mut [[u32; LANES]],
    edge_ends: &'a mut [[[u32; LANES]; 2]],
}

fn parts<'a>(tree: &'a mut Tree, items: &'a [&'a [Item]], first_ranks: &'a [u32]) -> Vec<Part<'a>> {
    let Tree { leaves, vertex_order, vertex_ids, vertex_ranks, edge_ids, edge_ends, .. } = tree;
    let mut order = &mut vertex_order[..];
    let (mut ids, mut ranks) = (&mut vertex_ids[..], &mut vertex_ranks[..]);
    let (mut edges, mut ends) = (&mut edge_ids[..], &mut edge_ends[..]);
    let vertex_count = order.len();
    let mut parts = Vec::with_capacity(leaves.len() / LEAF_CHUNK + 1);
    for first in (0..leaves.len()).step_by(LEAF_CHUNK) {
        let after = leaves.len().min(first + LEAF_CHUNK);
        let own = &leaves[first..after];
        let blocks = |of: fn(&Leaf) -> [u32; 2]| (of(&own[own.len() - 1])[1] - of(&own[0])[0]) as usize;
        let next_rank = first_ranks.get(after).map_or(vertex_count, |&rank| rank as usize);
        let (vertex_blocks, edge_blocks) =
            (blocks(|leaf| leaf.vertex_blocks), blocks(|leaf| leaf.edge_blocks));
        parts.push(Part {
            leaves: own,
            items: &items[first..after],
            first_ranks: &first_ranks[first..after],
            vertex_order: order.split_off_mut(..next_rank - first_ranks[first] as usize).expect(WITHIN),
            vertex_ids: ids.split_off_mut(..vertex_blocks).expect(WITHIN),
            vertex_ranks: ranks.split_off_mut(..vertex_blocks).expect(WITHIN),
            edge_ids: edges.split_off_mut(..edge_blocks).expect(WITHIN),
            edge_ends: ends.split_off_mut(..edge_blocks).expect(WITHIN),
        });
    }
    parts
}

impl Part<'_> {
    /// Notes the features of the leaves and the rank of each vertex.
    fn fill(self, mesh: &CollisionMesh, mask: &impl Fn(&Item) -> u8, ranks: &[AtomicU32]) {
        let Some(&Leaf { vertex_blocks: [first_vertex, _], edge_blocks: [first_edge, _], .. }) =
            self.leaves.first()
        else {
            return;
        };
        for (k, (leaf, items)) in self.leaves.iter().zip(self.items).enumerate() {
            // Every feature is written, and the next one over it if it is not owned: no branch on what is hard to foresee.
            let (mut vertices, mut vertex_count) = ([0; MOST], 0);
            let (mut edges, mut edge_count) = ([[0; 3]; MOST], 0);
            for item in *items {
                let (t, mask) = (item.triangle as usize, mask(item));
                let (corners, sides) = (mesh.triangles[t], mesh.triangle_edges[t]);
                for side in 0..3 {
                    let (a, b) = (corners[side], corners[(side + 1) % 3]);
                    vertices[vertex_count] = a;
                    vertex_count += usize::from(mask >> side & 1);
                    edges[edge_count] = [sides[side], a.min(b), a.max(b)];
                    edge_count += usize::from(mask >> (side + 3) & 1);
                }
            }
            let first_rank = self.first_ranks[k];
            let place = (leaf.vertex_blocks[0] - first_vertex) as usize * LANES;
            let order = &mut self.vertex_order[(first_rank - self.first_ranks[0]) as usize..];
            for (n, &v) in vertices[..vertex_count].iter().enumerate() {
                let rank = first_rank + n as u32;
                self.vertex_ids.as_flattened_mut()[place + n] = v;
                self.vertex_ranks.as_flattened_mut()[place + n] = rank;
                order[n] = v;
                ranks[v as usize].store(rank, Ordering::Relaxed);
            }
            let block = (leaf.edge_blocks[0] - first_edge) as usize;
            for (n, &[e, lower, higher]) in edges[..edge_count].iter().enumerate() {
                let (block, lane) = (block + n / LANES, n % LANES);
                self.edge_ids[block][lane] = e;
                (self.edge_ends[block][0][lane], self.edge_ends[block][1][lane]) = (lower, higher);
            }
        }
    }
}

/// The values of a list, in its order.
fn mapped<T: Sync, U: Send>(
    pool: Option<&rayon::ThreadPool>,
    at_least: usize,
    list: &[T],
    value: impl Fn(&T) -> U + Sync + Send,
) -> Vec<U> {
    match pool {
        Some(pool) => pool.install(|| list.par_iter().with_min_len(at_least).map(value).collect()),
        None => list.iter().map(value).collect(),
    }
}

fn each<T: Send>(pool: Option<&rayon::ThreadPool>, list: Vec<T>, work: impl Fn(T) + Sync + Send) {
    match pool {
        Some(pool) => pool.install(|| list.into_par_iter().with_max_len(1).for_each(work)),
        None => list.into_iter().for_each(work),
    }
}
