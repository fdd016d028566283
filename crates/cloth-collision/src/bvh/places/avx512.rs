//! [`super::Pairing::Avx512`]: comparisons end in masks, two blocks of edges are one register, pairs are written at once.

use super::{PlacePairs, Places};
use crate::bounds::{Block, Bounds, LANES, MovingBox, lanes};
use crate::bvh::build::Tree;
use crate::bvh::refit::Boxes;
use cloth_mesh::NONE;
use std::arch::x86_64::{
    __m256, __m256i, __m512, __m512i, _CMP_GT_OQ, _CMP_LT_OQ, _mm256_add_epi32, _mm256_castps_pd,
    _mm256_cmp_ps_mask, _mm256_cmpeq_epi32_mask, _mm256_load_ps, _mm256_loadu_si256, _mm256_mask_cmp_ps_mask,
    _mm256_maskz_compress_epi32, _mm256_set1_epi32, _mm256_set1_ps, _mm256_setr_epi32, _mm256_setzero_ps,
    _mm256_storeu_si256, _mm512_add_epi32, _mm512_castpd_ps, _mm512_castps_pd, _mm512_castps256_ps512,
    _mm512_castsi256_si512, _mm512_cmp_ps_mask, _mm512_cmpeq_epi32_mask, _mm512_cmpgt_epu32_mask,
    _mm512_cmplt_epu32_mask, _mm512_insertf64x4, _mm512_inserti64x4, _mm512_mask_blend_epi32,
    _mm512_mask_cmp_ps_mask, _mm512_maskz_compress_epi32, _mm512_set1_epi32, _mm512_set1_ps,
    _mm512_setr_epi32, _mm512_setzero_ps, _mm512_storeu_si512,
};

/// Lanes of two blocks.
const TWO: usize = 2 * LANES;

/// As [`super::Pairing::features`].
#[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
pub(super) fn features<const ENDS: usize>(
    tree: &Tree,
    boxes: &Boxes<ENDS>,
    a: u32,
    b: u32,
    out: &mut Places,
) {
    let sides = [(a, b), (b, a)];
    for &(leaf, other) in &sides[..if a == b { 1 } else { 2 }] {
        vertices_and_triangles(tree, boxes, leaf, other, &mut out.vertex_triangle);
    }
    edges(tree, boxes, a, b, &mut out.edge_edge);
}

/// The boxes of a block.
struct Eight<const ENDS: usize> {
    lo: [[__m256; 3]; ENDS],
    hi: [[__m256; 3]; ENDS],
}

impl<const ENDS: usize> Eight<ENDS> {
    #[inline]
    #[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
    fn load(block: &Block<ENDS>) -> Self {
        let zero = _mm256_setzero_ps();
        let mut out = Self { lo: [[zero; 3]; ENDS], hi: [[zero; 3]; ENDS] };
        for end in 0..ENDS {
            for axis in 0..3 {
                // SAFETY: a lane array is 32 bytes long and, as a multiple of that inside an aligned block, aligned to 32.
                unsafe {
                    out.lo[end][axis] = _mm256_load_ps(block.lo[end][axis].as_ptr());
                    out.hi[end][axis] = _mm256_load_ps(block.hi[end][axis].as_ptr());
                }
            }
        }
        out
    }

    /// Bit per lane: whether the box may touch the lane's box (closed).
    #[inline]
    #[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
    fn overlaps(&self, bounds: &impl Bounds<ENDS>) -> u32 {
        let mut apart = 0;
        for axis in 0..3 {
            let mut above =
                _mm256_cmp_ps_mask::<_CMP_LT_OQ>(self.hi[0][axis], _mm256_set1_ps(bounds.lo(0, axis)));
            let mut below =
                _mm256_cmp_ps_mask::<_CMP_GT_OQ>(self.lo[0][axis], _mm256_set1_ps(bounds.hi(0, axis)));
            for end in 1..ENDS {
                let (lo, hi) = (_mm256_set1_ps(bounds.lo(end, axis)), _mm256_set1_ps(bounds.hi(end, axis)));
                above = _mm256_mask_cmp_ps_mask::<_CMP_LT_OQ>(above, self.hi[end][axis], lo);
                below = _mm256_mask_cmp_ps_mask::<_CMP_GT_OQ>(below, self.lo[end][axis], hi);
            }
            apart |= above | below;
        }
        u32::from(!apart)
    }
}

#[inline]
#[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
fn load_eight(entries: &[u32; LANES]) -> __m256i {
    // SAFETY: 32 readable bytes.
    unsafe { _mm256_loadu_si256(entries.as_ptr().cast()) }
}

/// Bit per lane: the entry is a feature's number.
#[inline]
#[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
fn used_lanes(ids: &[u32; LANES]) -> u32 {
    u32::from(!_mm256_cmpeq_epi32_mask(load_eight(ids), _mm256_set1_epi32(NONE as i32)))
}

/// Bit per feature of the blocks of a leaf, at most 3 · [`LANES`]: its box may touch the hull.
#[inline]
#[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
fn near<const ENDS: usize>(
    bounds: &[Block<ENDS>],
    ids: &[[u32; LANES]],
    [first, end]: [u32; 2],
    hull: &MovingBox<ENDS>,
) -> u32 {
    let mut near = 0;
    for (k, block) in (first..end).enumerate() {
        let touching = Eight::load(&bounds[block as usize]).overlaps(hull);
        near |= (touching & used_lanes(&ids[block as usize])) << (k * LANES);
    }
    near
}

#[inline]
#[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
fn vertices_and_triangles<const ENDS: usize>(
    tree: &Tree,
    boxes: &Boxes<ENDS>,
    leaf: u32,
    other: u32,
    out: &mut PlacePairs,
) {
    let [first, end] = tree.leaves[leaf as usize].vertex_blocks;
    let (hull, used) = (&boxes.hulls[other as usize], boxes.lanes[other as usize].used);
    let near = near(&boxes.vertex_blocks, &tree.vertex_ids, [first, end], hull);
    if near == 0 {
        return;
    }
    let triangles = Eight::load(&boxes.blocks[other as usize]);
    let corners = &tree.corners[other as usize];
    let corners = [load_eight(&corners[0]), load_eight(&corners[1]), load_eight(&corners[2])];
    let order = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let places = _mm256_add_epi32(_mm256_set1_epi32((other * LANES as u32) as i32), order);
    out.reserve((end - first) as usize * LANES * LANES + LANES);
    for vertex in lanes(near) {
        let (block, lane) = (first + (vertex / LANES) as u32, vertex % LANES);
        let (vertices, ids) = (&boxes.vertex_blocks[block as usize], &tree.vertex_ids[block as usize]);
        let id = _mm256_set1_epi32(ids[lane] as i32);
        let shared = _mm256_cmpeq_epi32_mask(corners[0], id)
            | _mm256_cmpeq_epi32_mask(corners[1], id)
            | _mm256_cmpeq_epi32_mask(corners[2], id);
        let hits = (triangles.overlaps(&(vertices, lane)) & used) as u8 & !shared;
        let own = _mm256_set1_epi32((block * LANES as u32) as i32 + lane as i32);
        let end = out.first.len();
        // SAFETY: the reserved room holds all pairs of these leaves and the lanes written beyond the last one; the
        // entries that are kept are written here.
        unsafe {
            _mm256_storeu_si256(out.first.as_mut_ptr().add(end).cast(), own);
            let hit = _mm256_maskz_compress_epi32(hits, places);
            _mm256_storeu_si256(out.second.as_mut_ptr().add(end).cast(), hit);
            out.first.set_len(end + hits.count_ones() as usize);
            out.second.set_len(end + hits.count_ones() as usize);
        }
    }
}

/// The edges of up to two neighbouring blocks.
struct Sixteen<const ENDS: usize> {
    lo: [[__m512; 3]; ENDS],
    hi: [[__m512; 3]; ENDS],
    ids: __m512i,
    ends: [__m512i; 2],
}

#[inline]
#[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
fn both_singles(low: &[f32; LANES], high: &[f32; LANES]) -> __m512 {
    // SAFETY: 32 readable bytes each, aligned to 32 as the arrays of a block are.
    let (low, high) = unsafe { (_mm256_load_ps(low.as_ptr()), _mm256_load_ps(high.as_ptr())) };
    let low = _mm512_castps_pd(_mm512_castps256_ps512(low));
    _mm512_castpd_ps(_mm512_insertf64x4::<1>(low, _mm256_castps_pd(high)))
}

#[inline]
#[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
fn both_entries(low: &[u32; LANES], high: &[u32; LANES]) -> __m512i {
    _mm512_inserti64x4::<1>(_mm512_castsi256_si512(load_eight(low)), load_eight(high))
}

impl<const ENDS: usize> Sixteen<ENDS> {
    /// Block `first` and, if that is before `end`, the next one.
    #[inline]
    #[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
    fn load(tree: &Tree, boxes: &Boxes<ENDS>, first: u32, end: u32) -> Self {
        let first = first as usize;
        // A second block that is not of this leaf is the first one again, without its numbers.
        let is_pair = first + 1 < end as usize;
        let second = if is_pair { first + 1 } else { first };
        let (low, high) = (&boxes.edge_blocks[first], &boxes.edge_blocks[second]);
        let ids = if is_pair { &tree.edge_ids[second] } else { &[NONE; LANES] };
        let zero = _mm512_setzero_ps();
        let mut out = Self {
            lo: [[zero; 3]; ENDS],
            hi: [[zero; 3]; ENDS],
            ids: both_entries(&tree.edge_ids[first], ids),
            ends: [
                both_entries(&tree.edge_ends[first][0], &tree.edge_ends[second][0]),
                both_entries(&tree.edge_ends[first][1], &tree.edge_ends[second][1]),
            ],
        };
        for end in 0..ENDS {
            for axis in 0..3 {
                out.lo[end][axis] = both_singles(&low.lo[end][axis], &high.lo[end][axis]);
                out.hi[end][axis] = both_singles(&low.hi[end][axis], &high.hi[end][axis]);
            }
        }
        out
    }

    /// As [`Eight::overlaps`].
    #[inline]
    #[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
    fn overlaps(&self, bounds: &impl Bounds<ENDS>) -> u16 {
        let mut apart = 0;
        for axis in 0..3 {
            let mut above =
                _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.hi[0][axis], _mm512_set1_ps(bounds.lo(0, axis)));
            let mut below =
                _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.lo[0][axis], _mm512_set1_ps(bounds.hi(0, axis)));
            for end in 1..ENDS {
                let (lo, hi) = (_mm512_set1_ps(bounds.lo(end, axis)), _mm512_set1_ps(bounds.hi(end, axis)));
                above = _mm512_mask_cmp_ps_mask::<_CMP_LT_OQ>(above, self.hi[end][axis], lo);
                below = _mm512_mask_cmp_ps_mask::<_CMP_GT_OQ>(below, self.lo[end][axis], hi);
            }
            apart |= above | below;
        }
        !apart
    }

    /// Bit per lane: the edge has that vertex.
    #[inline]
    #[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
    fn has_end(&self, vertex: u32) -> u16 {
        let vertex = _mm512_set1_epi32(vertex as i32);
        _mm512_cmpeq_epi32_mask(self.ends[0], vertex) | _mm512_cmpeq_epi32_mask(self.ends[1], vertex)
    }
}

#[inline]
#[target_feature(enable = "avx512f,avx512vl,bmi1,bmi2,popcnt")]
fn edges<const ENDS: usize>(tree: &Tree, boxes: &Boxes<ENDS>, a: u32, b: u32, out: &mut PlacePairs) {
    let of_leaf = |leaf: u32, other: u32| {
        let blocks = tree.leaves[leaf as usize].edge_blocks;
        (blocks, near(&boxes.edge_blocks, &tree.edge_ids, blocks, &boxes.hulls[other as usize]))
    };
    let own = of_leaf(a, b);
    if own.1 == 0 {
        return;
    }
    let others = if a == b { own } else { of_leaf(b, a) };
    // The fewer edges one by one, the others in lanes.
    let swaps = others.1.count_ones() < own.1.count_ones();
    let (([first, end], near), ([first_other, end_other], near_others)) =
        if swaps { (others, own) } else { (own, others) };
    out.reserve((end - first) as usize * LANES * ((end_other - first_other) as usize + 1) * LANES + TWO);
    let order = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    for block_other in (first_other..end_other).step_by(2) {
        let near_others = (near_others >> ((block_other - first_other) as usize * LANES)) as u16;
        if near_others == 0 {
            continue;
        }
        let others = Sixteen::load(tree, boxes, block_other, end_other);
        let places = _mm512_add_epi32(_mm512_set1_epi32((block_other * LANES as u32) as i32), order);
        for edge in lanes(near) {
            let (block, lane) = (first + (edge / LANES) as u32, edge % LANES);
            let (bounds, ids) = (&boxes.edge_blocks[block as usize], &tree.edge_ids[block as usize]);
            let ends = &tree.edge_ends[block as usize];
            let own = _mm512_set1_epi32((block * LANES as u32) as i32 + lane as i32);
            let shared = others.has_end(ends[0][lane]) | others.has_end(ends[1][lane]);
            let mut hits = others.overlaps(&(bounds, lane)) & near_others & !shared;
            if a == b {
                hits &= _mm512_cmpgt_epu32_mask(places, own);
            }
            let lower = _mm512_cmplt_epu32_mask(others.ids, _mm512_set1_epi32(ids[lane] as i32));
            let first = _mm512_mask_blend_epi32(lower, own, places);
            let second = _mm512_mask_blend_epi32(lower, places, own);
            let end = out.first.len();
            // SAFETY: the reserved room holds all pairs of these leaves and the lanes written beyond the last one; the
            // entries that are kept are written here.
            unsafe {
                let first = _mm512_maskz_compress_epi32(hits, first);
                let second = _mm512_maskz_compress_epi32(hits, second);
                _mm512_storeu_si512(out.first.as_mut_ptr().add(end).cast(), first);
                _mm512_storeu_si512(out.second.as_mut_ptr().add(end).cast(), second);
                out.first.set_len(end + hits.count_ones() as usize);
                out.second.set_len(end + hits.count_ones() as usize);
            }
        }
    }
}
