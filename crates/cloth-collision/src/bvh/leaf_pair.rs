//! The features of two leaves against each other: boxes of one against blocks of eight.

use super::build::Tree;
use super::refit::Boxes;
#[cfg(target_arch = "x86_64")]
use crate::bounds::avx::Avx2;
use crate::bounds::{Compare, LANES, Plain, lanes};

/// Candidates of one task, waiting for the narrow phase.
#[derive(Debug, Default)]
pub(crate) struct Candidates {
    /// (vertex, triangle)
    pub(crate) vertex_triangle: Vec<[u32; 2]>,
    /// (edge, edge), unordered
    pub(crate) edge_edge: Vec<[u32; 2]>,
}

/// Pairs of triangles of one task, waiting for the exact test. A triangle is named by its place in the leaves: leaf times
/// [`LANES`] plus lane.
#[derive(Debug, Default)]
pub(super) struct TrianglePairs {
    /// Without a common vertex.
    pub(super) strangers: Vec<[u32; 2]>,
    /// With one common vertex.
    pub(super) joined: Vec<[u32; 2]>,
}

/// Pairs of features of the leaves `a` and `b` (once each if they are equal) that share no vertex and whose boxes overlap.
/// Pairs with an unused lane ([`cloth_mesh::NONE`]) are among them where boxes reach to infinity.
#[inline]
pub(super) fn features<const ENDS: usize>(
    tree: &Tree,
    boxes: &Boxes<ENDS>,
    a: u32,
    b: u32,
    out: &mut Candidates,
) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        unsafe { features_avx2(tree, boxes, a, b, out) };
        return;
    }
    features_with(tree, boxes, a, b, out, Plain);
}

/// Pairs of triangles of the leaves `a` and `b` (once each if they are equal) whose boxes overlap and that have at most
/// one common vertex.
#[inline]
pub(super) fn triangles(tree: &Tree, boxes: &Boxes<1>, a: u32, b: u32, out: &mut TrianglePairs) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        unsafe { triangles_avx2(tree, boxes, a, b, out) };
        return;
    }
    triangles_with(tree, boxes, a, b, out, Plain);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn features_avx2<const ENDS: usize>(tree: &Tree, boxes: &Boxes<ENDS>, a: u32, b: u32, out: &mut Candidates) {
    // SAFETY: this function runs only where the processor has AVX2.
    features_with(tree, boxes, a, b, out, unsafe { Avx2::new() });
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn triangles_avx2(tree: &Tree, boxes: &Boxes<1>, a: u32, b: u32, out: &mut TrianglePairs) {
    // SAFETY: this function runs only where the processor has AVX2.
    triangles_with(tree, boxes, a, b, out, unsafe { Avx2::new() });
}

#[inline(always)]
fn triangles_with(
    tree: &Tree,
    boxes: &Boxes<1>,
    a: u32,
    b: u32,
    out: &mut TrianglePairs,
    compare: impl Compare,
) {
    let (block_a, block_b) = (&boxes.blocks[a as usize], &boxes.blocks[b as usize]);
    let (corners_a, corners_b) = (&tree.corners[a as usize], &tree.corners[b as usize]);
    let used = [a, b].map(|leaf| boxes.lanes[leaf as usize].used);
    let place = |leaf: u32, lane: usize| leaf * LANES as u32 + lane as u32;
    // Room for all pairs: pushing need not grow.
    out.strangers.reserve(LANES * LANES);
    out.joined.reserve(LANES * LANES);
    for lane in lanes(compare.overlaps(&boxes.hulls[b as usize], block_a) & used[0]) {
        let mut hits = compare.overlaps(&(block_a, lane), block_b) & used[1];
        if a == b {
            hits &= !0 << (lane + 1);
        }
        // Lanes that have the one corner, the other, the third.
        let p = compare.has_corner(corners_a[0][lane], corners_b);
        let q = compare.has_corner(corners_a[1][lane], corners_b);
        let r = compare.has_corner(corners_a[2][lane], corners_b);
        let (one_or_more, two_or_more) = (p | q | r, (p & q) | (q & r) | (r & p));
        for hit in lanes(hits & !one_or_more) {
            out.strangers.push([place(a, lane), place(b, hit)]);
        }
        for hit in lanes(hits & one_or_more & !two_or_more) {
            out.joined.push([place(a, lane), place(b, hit)]);
        }
    }
}

#[inline(always)]
fn features_with<const ENDS: usize>(
    tree: &Tree,
    boxes: &Boxes<ENDS>,
    a: u32,
    b: u32,
    out: &mut Candidates,
    compare: impl Compare,
) {
    let (leaf_a, leaf_b) = (&tree.leaves[a as usize], &tree.leaves[b as usize]);
    let (box_a, box_b) = (&boxes.hulls[a as usize], &boxes.hulls[b as usize]);

    // A loop, not a closure called twice: what is not inlined here knows nothing of the vector instructions.
    let sides = [(leaf_a, b, box_b), (leaf_b, a, box_a)];
    for &(leaf, other, other_box) in &sides[..if a == b { 1 } else { 2 }] {
        let (blocks, ids) = (&boxes.blocks[other as usize], &tree.triangle_ids[other as usize]);
        let corners = &tree.corners[other as usize];
        for block in leaf.vertex_blocks[0]..leaf.vertex_blocks[1] {
            let vertices = &boxes.vertex_blocks[block as usize];
            for lane in lanes(compare.overlaps(other_box, vertices)) {
                let v = tree.vertex_ids[block as usize][lane];
                let hits = compare.overlaps(&(vertices, lane), blocks) & !compare.has_corner(v, corners);
                compare.push(hits, v, ids, &mut out.vertex_triangle);
            }
        }
    }

    for block_a in leaf_a.edge_blocks[0]..leaf_a.edge_blocks[1] {
        let edges = &boxes.edge_blocks[block_a as usize];
        let [starts, ends] = &tree.edge_ends[block_a as usize];
        for lane in lanes(compare.overlaps(box_b, edges)) {
            let e = tree.edge_ids[block_a as usize][lane];
            let first = if a == b { block_a } else { leaf_b.edge_blocks[0] };
            for block_b in first..leaf_b.edge_blocks[1] {
                let ends_b = &tree.edge_ends[block_b as usize];
                let mut hits = compare.overlaps(&(edges, lane), &boxes.edge_blocks[block_b as usize])
                    & !compare.has_corner(starts[lane], ends_b)
                    & !compare.has_corner(ends[lane], ends_b);
                if a == b && block_a == block_b {
                    hits &= !0 << (lane + 1);
                }
                compare.push(hits, e, &tree.edge_ids[block_b as usize], &mut out.edge_edge);
            }
        }
    }
}
