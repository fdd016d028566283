//! The leaves of the tree: their triangles and the features that these own.

use super::LEAF_TRIANGLES;
use super::build::{Item, Leaf, Tree};
use crate::CollisionMesh;
use crate::bounds::LANES;
use cloth_mesh::NONE;
use rayon::prelude::*;

/// Leaves per task; fixed, though nothing here depends on it.
const LEAF_CHUNK: usize = 256;

/// Appends the leaves of a body, whose triangles are in their order.
pub(super) fn push(mesh: &CollisionMesh, items: &[Item], tree: &mut Tree, pool: Option<&rayon::ThreadPool>) {
    let part = |items: &[Item]| {
        let mut part = Tree::default();
        items.chunks(LEAF_TRIANGLES).for_each(|leaf| push_leaf(mesh, leaf, &mut part));
        part
    };
    match pool {
        Some(pool) if pool.current_num_threads() > 1 && items.len() > LEAF_CHUNK * LEAF_TRIANGLES => {
            let parts: Vec<Tree> =
                pool.install(|| items.par_chunks(LEAF_CHUNK * LEAF_TRIANGLES).map(part).collect());
            append(tree, &parts);
        }
        _ => append(tree, &[part(items)]),
    }
}

fn append(tree: &mut Tree, parts: &[Tree]) {
    fn extend<T: Copy>(list: &mut Vec<T>, parts: &[Tree], of: impl Fn(&Tree) -> &Vec<T>) {
        list.reserve(parts.iter().map(|part| of(part).len()).sum());
        for part in parts {
            list.extend_from_slice(of(part));
        }
    }
    tree.leaves.reserve(parts.iter().map(|part| part.leaves.len()).sum());
    let (mut vertex_block, mut edge_block) = (tree.vertex_ids.len() as u32, tree.edge_ids.len() as u32);
    for part in parts {
        tree.leaves.extend(part.leaves.iter().map(|leaf| Leaf {
            count: leaf.count,
            vertex_blocks: leaf.vertex_blocks.map(|k| k + vertex_block),
            edge_blocks: leaf.edge_blocks.map(|k| k + edge_block),
        }));
        vertex_block += part.vertex_ids.len() as u32;
        edge_block += part.edge_ids.len() as u32;
    }
    extend(&mut tree.triangle_ids, parts, |part| &part.triangle_ids);
    extend(&mut tree.corners, parts, |part| &part.corners);
    extend(&mut tree.vertex_ids, parts, |part| &part.vertex_ids);
    extend(&mut tree.edge_ids, parts, |part| &part.edge_ids);
    extend(&mut tree.edge_ends, parts, |part| &part.edge_ends);
}

/// Numbers the vertices by the leaves that own them, so that those of close leaves lie close in memory.
pub(super) fn number_vertices(mesh: &CollisionMesh, tree: &mut Tree, pool: Option<&rayon::ThreadPool>) {
    let mut ranks = vec![NONE; mesh.vertex_count];
    tree.vertex_order = Vec::with_capacity(tree.vertex_ids.iter().flatten().filter(|&&v| v != NONE).count());
    for &v in tree.vertex_ids.iter().flatten().filter(|&&v| v != NONE) {
        ranks[v as usize] = tree.vertex_order.len() as u32;
        tree.vertex_order.push(v);
    }
    // A mesh without features numbers none.
    if tree.vertex_order.is_empty() {
        return;
    }
    let rank = |v: u32| if v == NONE { NONE } else { ranks[v as usize] };
    let of_vertices = || tree.vertex_ids.iter().map(|ids| ids.map(rank)).collect();
    let of_triangle = |leaf: &[[u32; LANES]; 3]| -> [[u32; 3]; LANES] {
        std::array::from_fn(|lane| std::array::from_fn(|k| rank(leaf[k][lane])))
    };
    let of_edge = |block: &[[u32; LANES]; 2]| -> [[u32; 2]; LANES] {
        std::array::from_fn(|lane| [rank(block[0][lane]), rank(block[1][lane])])
    };
    let (vertices, triangles, edges): (_, Vec<_>, Vec<_>) = match pool {
        Some(pool) => pool.install(|| {
            (
                of_vertices(),
                tree.corners.par_iter().with_min_len(LEAF_CHUNK).map(of_triangle).collect(),
                tree.edge_ends.par_iter().with_min_len(LEAF_CHUNK).map(of_edge).collect(),
            )
        }),
        None => (
            of_vertices(),
            tree.corners.iter().map(of_triangle).collect(),
            tree.edge_ends.iter().map(of_edge).collect(),
        ),
    };
    tree.vertex_ranks = vertices;
    tree.triangle_ranks = triangles.into_flattened();
    tree.edge_ranks = edges.into_flattened();
}

fn push_leaf(mesh: &CollisionMesh, items: &[Item], tree: &mut Tree) {
    let mut triangles = [NONE; LANES];
    let mut corners = [[NONE; LANES]; 3];
    let (first_vertex_block, first_edge_block) = (tree.vertex_ids.len() as u32, tree.edge_ids.len() as u32);
    // A mesh without features has no owners: its leaves hold triangles only.
    let has_features = !mesh.triangle_edges.is_empty();
    let (mut vertices, mut edges) = (Features::default(), Features::default());
    for (lane, item) in items.iter().enumerate() {
        let t = item.triangle;
        triangles[lane] = t;
        for k in 0..3 {
            let v = mesh.triangles[t as usize][k];
            corners[k][lane] = v;
            if has_features {
                let e = mesh.triangle_edges[t as usize][k];
                vertices.push_if(mesh.vertex_owner[v as usize] == t, v);
                edges.push_if(mesh.edge_owner[e as usize] == t, e);
            }
        }
    }
    vertices.push_blocks(&mut tree.vertex_ids);
    edges.push_blocks(&mut tree.edge_ids);
    for ids in &tree.edge_ids[first_edge_block as usize..] {
        let mut ends = [[NONE; LANES]; 2];
        for (lane, &e) in ids.iter().enumerate().filter(|&(_, &e)| e != NONE) {
            [ends[0][lane], ends[1][lane]] = mesh.edges[e as usize];
        }
        tree.edge_ends.push(ends);
    }
    tree.triangle_ids.push(triangles);
    tree.corners.push(corners);
    tree.leaves.push(Leaf {
        count: items.len() as u32,
        vertex_blocks: [first_vertex_block, tree.vertex_ids.len() as u32],
        edge_blocks: [first_edge_block, tree.edge_ids.len() as u32],
    });
}

/// Features of one kind that the triangles of a leaf own.
#[derive(Default)]
struct Features {
    ids: [u32; 3 * LEAF_TRIANGLES],
    count: usize,
}

impl Features {
    fn push_if(&mut self, is_owned: bool, id: u32) {
        if is_owned {
            self.ids[self.count] = id;
            self.count += 1;
        }
    }

    fn push_blocks(&self, blocks: &mut Vec<[u32; LANES]>) {
        for chunk in self.ids[..self.count].chunks(LANES) {
            let mut block = [NONE; LANES];
            block[..chunk.len()].copy_from_slice(chunk);
            blocks.push(block);
        }
    }
}
