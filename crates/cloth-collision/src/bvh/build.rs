//! Building the tree: once per topology.

use super::{LEAF_TRIANGLES, Leaf, Node};
use crate::bounds::LANES;
use crate::{CollisionMesh, Vec3};
use cloth_mesh::NONE;

/// What does not change after the build.
#[derive(Debug, Clone, Default)]
pub(super) struct Tree {
    /// Preorder: the left child follows its parent.
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<Leaf>,
    /// Triangles of each leaf, [`NONE`] in unused lanes; block = leaf.
    pub(super) triangle_ids: Vec<[u32; LANES]>,
    /// Their vertices, side by side where they are looked at together.
    pub(super) corners: Vec<[[u32; 3]; LANES]>,
    /// Vertices owned by the triangles of a leaf, in blocks.
    pub(super) vertex_ids: Vec<[u32; LANES]>,
    /// Edges owned by the triangles of a leaf, in blocks.
    pub(super) edge_ids: Vec<[u32; LANES]>,
}

/// Median splits of each body's triangles along the longest axis of their centroids' box, down to full leaves; above
/// the bodies, median splits of the bodies.
///
/// The split of the triangles runs on the pool, if there is one; it does not depend on it.
pub(super) fn build(mesh: &CollisionMesh, x: &[Vec3], pool: Option<&rayon::ThreadPool>) -> Tree {
    let mut tree = Tree::default();
    let mut items: Vec<Item> = mesh
        .triangles
        .iter()
        .enumerate()
        .map(|(t, tri)| {
            // Thirds before the sum: no overflow at any finite position.
            let c: Vec3 = tri.iter().map(|&v| x[v as usize] / 3.0).sum();
            Item { centroid: [c.x as f32, c.y as f32, c.z as f32], triangle: t as u32 }
        })
        .collect();
    // Triangles come body by body.
    let body_of = |item: &Item| mesh.vertex_body[mesh.triangles[item.triangle as usize][0] as usize];
    let mut bodies: Vec<(u32, &mut [Item])> = items
        .chunk_by_mut(|a, b| body_of(a) == body_of(b))
        .map(|chunk| (body_of(&chunk[0]), chunk))
        .collect();
    for (_, items) in &mut bodies {
        match pool {
            Some(pool) if items.len() > PARALLEL => pool.install(|| arrange(items)),
            _ => arrange(items),
        }
    }
    if !bodies.is_empty() {
        split_bodies(mesh, &mut bodies, &mut tree);
    }
    tree
}

#[derive(Debug, Clone, Copy)]
struct Item {
    centroid: [f32; 3],
    triangle: u32,
}

fn longest_axis(centroids: impl Iterator<Item = [f32; 3]>) -> usize {
    let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for c in centroids {
        for axis in 0..3 {
            lo[axis] = lo[axis].min(c[axis]);
            hi[axis] = hi[axis].max(c[axis]);
        }
    }
    (1..3).fold(0, |best, axis| if hi[axis] - lo[axis] > hi[best] - lo[best] { axis } else { best })
}

fn split_bodies(mesh: &CollisionMesh, bodies: &mut [(u32, &mut [Item])], tree: &mut Tree) {
    if let [(body, items)] = bodies {
        push_subtree(mesh, *body, items, tree);
        return;
    }
    let middle_of = |items: &[Item]| items[items.len() / 2].centroid;
    let axis = longest_axis(bodies.iter().map(|b| middle_of(b.1)));
    bodies.sort_by(|a, b| middle_of(a.1)[axis].total_cmp(&middle_of(b.1)[axis]));
    let node = tree.nodes.len();
    tree.nodes.push(Node { right: NONE, leaf: NONE, body: NONE });
    let (left, right) = bodies.split_at_mut(bodies.len() / 2);
    split_bodies(mesh, left, tree);
    tree.nodes[node].right = tree.nodes.len() as u32;
    split_bodies(mesh, right, tree);
}

/// Triangles from which on the two halves are arranged in parallel.
const PARALLEL: usize = 4096;

/// How many triangles the left one of two children has: full leaves, half of all, rounded up.
fn left_count(count: usize) -> usize {
    count.div_ceil(LEAF_TRIANGLES).div_ceil(2) * LEAF_TRIANGLES
}

/// Brings the triangles into the order of the leaves.
fn arrange(items: &mut [Item]) {
    if items.len() <= LEAF_TRIANGLES {
        return;
    }
    let axis = longest_axis(items.iter().map(|i| i.centroid));
    let half = left_count(items.len());
    items.select_nth_unstable_by(half - 1, |a, b| {
        a.centroid[axis].total_cmp(&b.centroid[axis]).then(a.triangle.cmp(&b.triangle))
    });
    let (left, right) = items.split_at_mut(half);
    if left.len() + right.len() > PARALLEL && rayon::current_thread_index().is_some() {
        rayon::join(|| arrange(left), || arrange(right));
    } else {
        arrange(left);
        arrange(right);
    }
}

/// The subtree of arranged triangles.
fn push_subtree(mesh: &CollisionMesh, body: u32, items: &mut [Item], tree: &mut Tree) {
    let node = tree.nodes.len();
    tree.nodes.push(Node { right: NONE, leaf: NONE, body });
    if items.len() <= LEAF_TRIANGLES {
        tree.nodes[node].leaf = tree.leaves.len() as u32;
        push_leaf(mesh, node as u32, items, tree);
        return;
    }
    let (left, right) = items.split_at_mut(left_count(items.len()));
    push_subtree(mesh, body, left, tree);
    tree.nodes[node].right = tree.nodes.len() as u32;
    push_subtree(mesh, body, right, tree);
}

fn push_leaf(mesh: &CollisionMesh, node: u32, items: &mut [Item], tree: &mut Tree) {
    items.sort_unstable_by_key(|i| i.triangle);
    let mut triangles = [NONE; LANES];
    let mut corners = [[NONE; 3]; LANES];
    let (mut vertices, mut edges) = (Vec::new(), Vec::new());
    for (lane, item) in items.iter().enumerate() {
        let t = item.triangle;
        triangles[lane] = t;
        corners[lane] = mesh.triangles[t as usize];
        // A mesh without features has no owners: its leaves hold triangles only.
        let Some(sides) = mesh.triangle_edges.get(t as usize) else { continue };
        for k in 0..3 {
            let (v, e) = (mesh.triangles[t as usize][k], sides[k]);
            if mesh.vertex_owner[v as usize] == t {
                vertices.push(v);
            }
            if mesh.edge_owner[e as usize] == t {
                edges.push(e);
            }
        }
    }
    let (first_vertex_block, first_edge_block) = (tree.vertex_ids.len() as u32, tree.edge_ids.len() as u32);
    push_blocks(&vertices, &mut tree.vertex_ids);
    push_blocks(&edges, &mut tree.edge_ids);
    tree.triangle_ids.push(triangles);
    tree.corners.push(corners);
    tree.leaves.push(Leaf {
        node,
        vertex_blocks: [first_vertex_block, tree.vertex_ids.len() as u32],
        edge_blocks: [first_edge_block, tree.edge_ids.len() as u32],
    });
}

fn push_blocks(ids: &[u32], blocks: &mut Vec<[u32; LANES]>) {
    for chunk in ids.chunks(LANES) {
        let mut block = [NONE; LANES];
        block[..chunk.len()].copy_from_slice(chunk);
        blocks.push(block);
    }
}
