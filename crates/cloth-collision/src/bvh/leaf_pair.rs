//! The features of two leaves against each other: boxes of one against blocks of eight.

use super::build::Tree;
use super::refit::Boxes;
use crate::bounds::{Block, LANES, MovingBox};

/// Candidates of one task, waiting for the narrow phase.
#[derive(Debug, Default)]
pub(super) struct Candidates {
    /// (vertex, triangle)
    pub(super) vertex_triangle: Vec<[u32; 2]>,
    /// (edge, edge), unordered
    pub(super) edge_edge: Vec<[u32; 2]>,
}

/// Two triangles whose boxes overlap, with their vertices.
#[derive(Debug, Clone, Copy)]
pub(super) struct TrianglePair {
    pub(super) triangles: [u32; 2],
    pub(super) first: [u32; 3],
    pub(super) second: [u32; 3],
}

/// Pairs of features of the leaves `a` and `b` (once each if they are equal) whose boxes overlap. Pairs that share a
/// vertex are among them, and pairs with an unused lane ([`cloth_mesh::NONE`]) where boxes reach to infinity.
#[inline]
pub(super) fn features(tree: &Tree, boxes: &Boxes, a: u32, b: u32, out: &mut Candidates) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        unsafe { features_avx2(tree, boxes, a, b, out) };
        return;
    }
    features_with(tree, boxes, a, b, out, overlap_mask);
}

/// Pairs of triangles of the leaves `a` and `b` (once each if they are equal) whose boxes overlap, as in
/// [`features`].
#[inline]
pub(super) fn triangles(tree: &Tree, boxes: &Boxes, a: u32, b: u32, out: &mut Vec<TrianglePair>) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        unsafe { triangles_avx2(tree, boxes, a, b, out) };
        return;
    }
    triangles_with(tree, boxes, a, b, out, overlap_mask);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn features_avx2(tree: &Tree, boxes: &Boxes, a: u32, b: u32, out: &mut Candidates) {
    if boxes.still {
        features_with(tree, boxes, a, b, out, |bounds, block| overlap_mask_avx2::<true>(bounds, block));
    } else {
        features_with(tree, boxes, a, b, out, |bounds, block| overlap_mask_avx2::<false>(bounds, block));
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn triangles_avx2(tree: &Tree, boxes: &Boxes, a: u32, b: u32, out: &mut Vec<TrianglePair>) {
    if boxes.still {
        triangles_with(tree, boxes, a, b, out, |bounds, block| overlap_mask_avx2::<true>(bounds, block));
    } else {
        triangles_with(tree, boxes, a, b, out, |bounds, block| overlap_mask_avx2::<false>(bounds, block));
    }
}

#[inline(always)]
fn triangles_with(
    tree: &Tree,
    boxes: &Boxes,
    a: u32,
    b: u32,
    out: &mut Vec<TrianglePair>,
    overlap: impl Fn(&MovingBox, &Block) -> u32 + Copy,
) {
    let box_b = &boxes.nodes[tree.leaves[b as usize].node as usize];
    let (blocks_a, blocks_b) = (&boxes.triangle_blocks[a as usize], &boxes.triangle_blocks[b as usize]);
    let (ids_a, ids_b) = (&tree.triangle_ids[a as usize], &tree.triangle_ids[b as usize]);
    let (corners_a, corners_b) = (&tree.corners[a as usize], &tree.corners[b as usize]);
    for lane in lanes(overlap(box_b, blocks_a)) {
        let mut hits = overlap(&blocks_a.get(lane), blocks_b);
        if a == b {
            hits &= !0 << (lane + 1);
        }
        for hit in lanes(hits) {
            out.push(TrianglePair {
                triangles: [ids_a[lane], ids_b[hit]],
                first: corners_a[lane],
                second: corners_b[hit],
            });
        }
    }
}

#[inline(always)]
fn features_with(
    tree: &Tree,
    boxes: &Boxes,
    a: u32,
    b: u32,
    out: &mut Candidates,
    overlap: impl Fn(&MovingBox, &Block) -> u32 + Copy,
) {
    let (leaf_a, leaf_b) = (&tree.leaves[a as usize], &tree.leaves[b as usize]);
    let (box_a, box_b) = (&boxes.nodes[leaf_a.node as usize], &boxes.nodes[leaf_b.node as usize]);

    let mut vertices_against_triangles = |leaf: &super::Leaf, other: u32, other_box: &MovingBox| {
        let (blocks, ids) = (&boxes.triangle_blocks[other as usize], &tree.triangle_ids[other as usize]);
        for block in leaf.vertex_blocks[0]..leaf.vertex_blocks[1] {
            let vertices = &boxes.vertex_blocks[block as usize];
            for lane in lanes(overlap(other_box, vertices)) {
                let v = tree.vertex_ids[block as usize][lane];
                for hit in lanes(overlap(&vertices.get(lane), blocks)) {
                    out.vertex_triangle.push([v, ids[hit]]);
                }
            }
        }
    };
    vertices_against_triangles(leaf_a, b, box_b);
    if a != b {
        vertices_against_triangles(leaf_b, a, box_a);
    }

    for block_a in leaf_a.edge_blocks[0]..leaf_a.edge_blocks[1] {
        let edges = &boxes.edge_blocks[block_a as usize];
        for lane in lanes(overlap(box_b, edges)) {
            let (e, bounds) = (tree.edge_ids[block_a as usize][lane], edges.get(lane));
            let first = if a == b { block_a } else { leaf_b.edge_blocks[0] };
            for block_b in first..leaf_b.edge_blocks[1] {
                let mut hits = overlap(&bounds, &boxes.edge_blocks[block_b as usize]);
                if a == b && block_a == block_b {
                    hits &= !0 << (lane + 1);
                }
                for hit in lanes(hits) {
                    out.edge_edge.push([e, tree.edge_ids[block_b as usize][hit]]);
                }
            }
        }
    }
}

/// The set bits, ascending.
#[inline(always)]
fn lanes(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            lane
        })
    })
}

/// Bit per lane: whether the box may touch the lane's box ([`MovingBox::overlaps`]). Unused lanes never do, except
/// against boxes that reach to infinity.
#[inline(always)]
fn overlap_mask(bounds: &MovingBox, block: &Block) -> u32 {
    let mut mask = 0;
    for lane in 0..LANES {
        mask |= u32::from(bounds.overlaps(&block.get(lane))) << lane;
    }
    mask
}

/// [`overlap_mask`]; a still query has no second end to look at.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
#[inline]
fn overlap_mask_avx2<const STILL: bool>(bounds: &MovingBox, block: &Block) -> u32 {
    use std::arch::x86_64::{
        _CMP_GT_OQ, _CMP_LT_OQ, _mm256_and_ps, _mm256_cmp_ps, _mm256_load_ps, _mm256_movemask_ps,
        _mm256_or_ps, _mm256_set1_ps, _mm256_setzero_ps,
    };
    let mut apart = _mm256_setzero_ps();
    for axis in 0..3 {
        // SAFETY: a lane array is 32 bytes long and, as a multiple of that inside an aligned block, aligned to 32.
        let load = |lanes: &[f32; LANES]| unsafe { _mm256_load_ps(lanes.as_ptr()) };
        let above = |end: usize| {
            _mm256_cmp_ps::<_CMP_GT_OQ>(_mm256_set1_ps(bounds.lo[end][axis]), load(&block.hi[end][axis]))
        };
        let below = |end: usize| {
            _mm256_cmp_ps::<_CMP_LT_OQ>(_mm256_set1_ps(bounds.hi[end][axis]), load(&block.lo[end][axis]))
        };
        if STILL {
            apart = _mm256_or_ps(apart, _mm256_or_ps(above(0), below(0)));
        } else {
            apart = _mm256_or_ps(apart, _mm256_and_ps(above(0), above(1)));
            apart = _mm256_or_ps(apart, _mm256_and_ps(below(0), below(1)));
        }
    }
    !_mm256_movemask_ps(apart) as u32 & 0xff
}
