//! Things against the lanes of a block of boxes, by the instructions that the processor has.

use super::{ALL_LANES, Block, LANES, MovingBox};
use crate::bvh::places::PlacePairs;

/// A box, or the box of a lane where it lies: copied out of there, it would go through memory once more.
pub(crate) trait Bounds<const ENDS: usize> {
    fn lo(&self, end: usize, axis: usize) -> f32;
    fn hi(&self, end: usize, axis: usize) -> f32;
}

impl<const ENDS: usize> Bounds<ENDS> for MovingBox<ENDS> {
    #[inline(always)]
    fn lo(&self, end: usize, axis: usize) -> f32 {
        self.lo[end][axis]
    }
    #[inline(always)]
    fn hi(&self, end: usize, axis: usize) -> f32 {
        self.hi[end][axis]
    }
}

/// The box of a lane of a block.
impl<const ENDS: usize> Bounds<ENDS> for (&Block<ENDS>, usize) {
    #[inline(always)]
    fn lo(&self, end: usize, axis: usize) -> f32 {
        self.0.lo[end][axis][self.1]
    }
    #[inline(always)]
    fn hi(&self, end: usize, axis: usize) -> f32 {
        self.0.hi[end][axis][self.1]
    }
}

/// Compares things with the lanes of a block, by the instructions that the processor has.
pub(crate) trait Compare: Copy {
    /// Bit per lane: whether the box may touch the lane's box (closed). Unused lanes never do, except against boxes that
    /// reach to infinity.
    fn overlaps<const ENDS: usize>(self, bounds: &impl Bounds<ENDS>, block: &Block<ENDS>) -> u32;
    /// Bit per lane: the vertex is one of its corners.
    fn has_corner<const N: usize>(self, vertex: u32, corners: &[[u32; LANES]; N]) -> u32;
    /// Appends a pair for each bit of `hits`, ascending: `first` and the lane's entry of `ids`.
    fn push(self, hits: u32, first: u32, ids: &[u32; LANES], out: &mut Vec<[u32; 2]>);
    /// Bit per lane: the entry is below `bound`.
    fn below(self, bound: u32, ids: &[u32; LANES]) -> u32;
    /// Appends a pair of places for each bit of `hits`, ascending: `own` and `first` plus the lane, the other way round for
    /// those of `lower`.
    fn push_places(self, hits: u32, lower: u32, own: u32, first: u32, out: &mut PlacePairs);
}

/// On any processor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain;

impl Compare for Plain {
    #[inline(always)]
    fn overlaps<const ENDS: usize>(self, bounds: &impl Bounds<ENDS>, block: &Block<ENDS>) -> u32 {
        let mut apart = [false; LANES];
        for axis in 0..3 {
            for lane in 0..LANES {
                let (mut above, mut below) = (true, true);
                for end in 0..ENDS {
                    above &= bounds.lo(end, axis) > block.hi[end][axis][lane];
                    below &= bounds.hi(end, axis) < block.lo[end][axis][lane];
                }
                apart[lane] |= above | below;
            }
        }
        apart.iter().enumerate().map(|(lane, &apart)| u32::from(!apart) << lane).sum()
    }

    #[inline(always)]
    fn has_corner<const N: usize>(self, vertex: u32, corners: &[[u32; LANES]; N]) -> u32 {
        let has = |lane: usize| corners.iter().any(|corner| corner[lane] == vertex);
        (0..LANES).map(|lane| u32::from(has(lane)) << lane).sum()
    }

    #[inline(always)]
    fn push(self, hits: u32, first: u32, ids: &[u32; LANES], out: &mut Vec<[u32; 2]>) {
        for lane in lanes(hits) {
            out.push([first, ids[lane]]);
        }
    }

    #[inline(always)]
    fn below(self, bound: u32, ids: &[u32; LANES]) -> u32 {
        (0..LANES).map(|lane| u32::from(ids[lane] < bound) << lane).sum()
    }

    #[inline(always)]
    fn push_places(self, hits: u32, lower: u32, own: u32, first: u32, out: &mut PlacePairs) {
        for lane in lanes(hits) {
            let other = first + lane as u32;
            let pair = if lower >> lane & 1 == 1 { [other, own] } else { [own, other] };
            out.first.push(pair[0]);
            out.second.push(pair[1]);
        }
    }
}

/// All lanes at once. A value exists only in functions compiled for AVX2, which the methods are inlined into.
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx {
    use super::{ALL_LANES, Block, Bounds, Compare, LANES, PlacePairs};
    use std::arch::x86_64::{
        _CMP_GT_OQ, _CMP_LT_OQ, _mm_loadl_epi64, _mm256_add_epi32, _mm256_and_ps, _mm256_and_si256,
        _mm256_blendv_epi8, _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cmpeq_epi32, _mm256_cmpgt_epi32,
        _mm256_cvtepu8_epi32, _mm256_load_ps, _mm256_loadu_si256, _mm256_movemask_ps, _mm256_or_ps,
        _mm256_or_si256, _mm256_permute2x128_si256, _mm256_permutevar8x32_epi32, _mm256_set1_epi32,
        _mm256_set1_ps, _mm256_setr_epi32, _mm256_setzero_ps, _mm256_storeu_si256, _mm256_unpackhi_epi32,
        _mm256_unpacklo_epi32, _mm256_xor_si256,
    };

    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Avx2(());

    impl Avx2 {
        /// # Safety
        /// The processor has AVX2.
        #[inline(always)]
        pub(crate) unsafe fn new() -> Self {
            Self(())
        }
    }

    impl Compare for Avx2 {
        #[inline(always)]
        fn overlaps<const ENDS: usize>(self, bounds: &impl Bounds<ENDS>, block: &Block<ENDS>) -> u32 {
            // SAFETY: `self` exists only where the processor has AVX2. A lane array is 32 bytes long and, as a multiple
            // of that inside an aligned block, aligned to 32.
            unsafe {
                let mut apart = _mm256_setzero_ps();
                for axis in 0..3 {
                    let mut above = _mm256_cmp_ps::<_CMP_GT_OQ>(
                        _mm256_set1_ps(bounds.lo(0, axis)),
                        _mm256_load_ps(block.hi[0][axis].as_ptr()),
                    );
                    let mut below = _mm256_cmp_ps::<_CMP_LT_OQ>(
                        _mm256_set1_ps(bounds.hi(0, axis)),
                        _mm256_load_ps(block.lo[0][axis].as_ptr()),
                    );
                    for end in 1..ENDS {
                        let hi = _mm256_load_ps(block.hi[end][axis].as_ptr());
                        let lo = _mm256_load_ps(block.lo[end][axis].as_ptr());
                        let (own_lo, own_hi) = (bounds.lo(end, axis), bounds.hi(end, axis));
                        above = _mm256_and_ps(above, _mm256_cmp_ps::<_CMP_GT_OQ>(_mm256_set1_ps(own_lo), hi));
                        below = _mm256_and_ps(below, _mm256_cmp_ps::<_CMP_LT_OQ>(_mm256_set1_ps(own_hi), lo));
                    }
                    apart = _mm256_or_ps(apart, _mm256_or_ps(above, below));
                }
                !_mm256_movemask_ps(apart) as u32 & ALL_LANES
            }
        }

        #[inline(always)]
        fn has_corner<const N: usize>(self, vertex: u32, corners: &[[u32; LANES]; N]) -> u32 {
            // SAFETY: `self` exists only where the processor has AVX2; 32 readable bytes per corner.
            unsafe {
                let vertex = _mm256_set1_epi32(vertex as i32);
                let mut equal = _mm256_cmpeq_epi32(vertex, _mm256_loadu_si256(corners[0].as_ptr().cast()));
                for k in 1..N {
                    let corner = _mm256_loadu_si256(corners[k].as_ptr().cast());
                    equal = _mm256_or_si256(equal, _mm256_cmpeq_epi32(vertex, corner));
                }
                _mm256_movemask_ps(_mm256_castsi256_ps(equal)) as u32
            }
        }

        #[inline(always)]
        fn push(self, hits: u32, first: u32, ids: &[u32; LANES], out: &mut Vec<[u32; 2]>) {
            // All lanes are written, those of the set bits first, and as many are kept: without a branch per pair.
            out.reserve(LANES);
            let order = &SET_BITS_FIRST[(hits & ALL_LANES) as usize];
            // SAFETY: `self` exists only where the processor has AVX2. There is room for all lanes behind the list's end,
            // and the entries that are kept are written here.
            unsafe {
                let order = _mm256_cvtepu8_epi32(_mm_loadl_epi64(order.as_ptr().cast()));
                let ids = _mm256_loadu_si256(ids.as_ptr().cast());
                let ids = _mm256_permutevar8x32_epi32(ids, order);
                let first = _mm256_set1_epi32(first as i32);
                // Pairs 0, 1, 4, 5 and 2, 3, 6, 7.
                let (low, high) = (_mm256_unpacklo_epi32(first, ids), _mm256_unpackhi_epi32(first, ids));
                let end = out.as_mut_ptr().add(out.len());
                _mm256_storeu_si256(end.cast(), _mm256_permute2x128_si256::<0x20>(low, high));
                _mm256_storeu_si256(end.add(LANES / 2).cast(), _mm256_permute2x128_si256::<0x31>(low, high));
                out.set_len(out.len() + (hits & ALL_LANES).count_ones() as usize);
            }
        }

        #[inline(always)]
        fn below(self, bound: u32, ids: &[u32; LANES]) -> u32 {
            // SAFETY: `self` exists only where the processor has AVX2; 32 readable bytes.
            unsafe {
                // The comparison is that of signed numbers.
                let sign = _mm256_set1_epi32(i32::MIN);
                let ids = _mm256_xor_si256(_mm256_loadu_si256(ids.as_ptr().cast()), sign);
                let bound = _mm256_xor_si256(_mm256_set1_epi32(bound as i32), sign);
                _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(bound, ids))) as u32
            }
        }

        #[inline(always)]
        fn push_places(self, hits: u32, lower: u32, own: u32, first: u32, out: &mut PlacePairs) {
            // As `push`: all lanes are written.
            out.reserve(LANES);
            let hits = hits & ALL_LANES;
            let order = &SET_BITS_FIRST[hits as usize];
            // SAFETY: `self` exists only where the processor has AVX2. There is room for all lanes behind the lists' ends, and
            // the entries that are kept are written here.
            unsafe {
                let order = _mm256_cvtepu8_epi32(_mm_loadl_epi64(order.as_ptr().cast()));
                let lane_bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
                let lower = _mm256_and_si256(_mm256_set1_epi32(lower as i32), lane_bits);
                let lower = _mm256_permutevar8x32_epi32(_mm256_cmpeq_epi32(lower, lane_bits), order);
                let other = _mm256_add_epi32(_mm256_set1_epi32(first as i32), order);
                let own = _mm256_set1_epi32(own as i32);
                let end = out.first.len();
                let (low, high) =
                    (_mm256_blendv_epi8(own, other, lower), _mm256_blendv_epi8(other, own, lower));
                _mm256_storeu_si256(out.first.as_mut_ptr().add(end).cast(), low);
                _mm256_storeu_si256(out.second.as_mut_ptr().add(end).cast(), high);
                out.first.set_len(end + hits.count_ones() as usize);
                out.second.set_len(end + hits.count_ones() as usize);
            }
        }
    }

    /// For each set of lanes, its lanes ascending.
    static SET_BITS_FIRST: [[u8; LANES]; 1 << LANES] = {
        let mut table = [[0; LANES]; 1 << LANES];
        let mut hits = 0;
        while hits < 1 << LANES {
            let (mut lane, mut count) = (0, 0);
            while lane < LANES {
                if hits >> lane & 1 == 1 {
                    table[hits][count] = lane as u8;
                    count += 1;
                }
                lane += 1;
            }
            hits += 1;
        }
        table
    };
}

/// The set bits, ascending.
#[inline(always)]
pub(crate) fn lanes(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            lane
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::MovingBox;

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn all_lanes_at_once_answer_as_one_by_one() {
        if !std::arch::is_x86_feature_detected!("avx2") {
            return;
        }
        // SAFETY: the processor has AVX2.
        let avx = unsafe { avx::Avx2::new() };
        let mut state = 1u32;
        let mut small = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 28
        };
        let mut overlaps = 0;
        for _ in 0..2000 {
            // Small whole numbers: many sides touch.
            let mut block = Block::<2>::EMPTY;
            for lane in 0..LANES - 1 {
                let lo = [[(); 3]; 2].map(|end| end.map(|()| small() as f32));
                block.set(lane, &MovingBox { lo, hi: lo.map(|end| end.map(|x| x + small() as f32)) });
            }
            let corners = [[(); LANES]; 3].map(|lanes| lanes.map(|()| small()));
            for lane in 0..LANES {
                let by_box: u32 = (0..LANES)
                    .map(|other| u32::from(block.get(lane).overlaps(&block.get(other))) << other)
                    .sum();
                assert_eq!(Plain.overlaps(&(&block, lane), &block), by_box);
                assert_eq!(avx.overlaps(&(&block, lane), &block), by_box);
                assert_eq!(avx.overlaps(&block.get(lane), &block), by_box);
                assert_eq!(avx.has_corner(lane as u32, &corners), Plain.has_corner(lane as u32, &corners));
                let (mut by_one, mut at_once) = (vec![[9; 2]], vec![[9; 2]]);
                Plain.push(by_box, 7, &corners[0], &mut by_one);
                avx.push(by_box, 7, &corners[0], &mut at_once);
                assert_eq!(by_one.len(), 1 + by_box.count_ones() as usize);
                assert_eq!(by_one, at_once);
                assert_eq!(avx.below(lane as u32, &corners[1]), Plain.below(lane as u32, &corners[1]));
                let [mut by_one, mut at_once] = [(); 2].map(|()| PlacePairs::default());
                let lower = small() << 4 | small();
                Plain.push_places(by_box, lower, 3, 80, &mut by_one);
                avx.push_places(by_box, lower, 3, 80, &mut at_once);
                assert_eq!((&by_one.first, &by_one.second), (&at_once.first, &at_once.second));
                overlaps += by_box.count_ones();
            }
        }
        assert!(overlaps > 20_000 && overlaps < 100_000, "{overlaps} of 128000");
    }
}
