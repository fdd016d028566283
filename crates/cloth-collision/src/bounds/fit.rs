//! The boxes of a block's features, from those of their vertices.

use super::{Block, LANES, MovingBox};
use cloth_mesh::NONE;

/// Fits a block to the boxes of its features' vertices, `[corner][lane]`; lanes without a feature stay as they are, empty.
#[inline]
pub(crate) fn fit<const ENDS: usize, const N: usize>(
    block: &mut Block<ENDS>,
    corners: &[[u32; LANES]; N],
    vertices: &[MovingBox<ENDS>],
) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { avx::fit(block, corners, vertices) };
    }
    fit_plain(block, corners, vertices);
}

/// On any processor.
fn fit_plain<const ENDS: usize, const N: usize>(
    block: &mut Block<ENDS>,
    corners: &[[u32; LANES]; N],
    vertices: &[MovingBox<ENDS>],
) {
    for lane in (0..LANES).filter(|&lane| corners[0][lane] != NONE) {
        let mut bounds = vertices[corners[0][lane] as usize];
        for corner in &corners[1..] {
            bounds.grow(&vertices[corner[lane] as usize]);
        }
        block.set(lane, &bounds);
    }
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use super::{Block, LANES, MovingBox, NONE};
    use std::arch::x86_64::{
        _mm_loadu_ps, _mm256_add_epi32, _mm256_blendv_ps, _mm256_castps128_ps256, _mm256_castsi256_ps,
        _mm256_cmpgt_epi32, _mm256_insertf128_ps, _mm256_max_ps, _mm256_min_ps, _mm256_set1_epi32,
        _mm256_setr_epi32, _mm256_setzero_ps, _mm256_shuffle_ps, _mm256_storeu_ps, _mm256_unpackhi_ps,
        _mm256_unpacklo_ps,
    };

    /// As [`super::fit`]: four coordinates of eight boxes at a time, transposed.
    #[target_feature(enable = "avx2")]
    pub(super) fn fit<const ENDS: usize, const N: usize>(
        block: &mut Block<ENDS>,
        corners: &[[u32; LANES]; N],
        vertices: &[MovingBox<ENDS>],
    ) {
        // Loops, no closures: what is not inlined here knows nothing of the vector instructions.
        let empty = MovingBox::EMPTY;
        let mut boxes = [[std::ptr::null::<f32>(); LANES]; N];
        for corner in 0..N {
            for lane in 0..LANES {
                let v = corners[corner][lane];
                let bounds = if v == NONE { &empty } else { &vertices[v as usize] };
                boxes[corner][lane] = std::ptr::from_ref(bounds).cast();
            }
        }
        let out = std::ptr::from_mut(block).cast::<f32>();
        let last_low = _mm256_set1_epi32(3 * ENDS as i32 - 1);
        let order = _mm256_setr_epi32(0, 1, 2, 3, 0, 1, 2, 3);
        // A box has 6 · ENDS coordinates, the low ones first; the last four of them may have been done in part before.
        for quarter in 0..=ENDS {
            let first = (4 * quarter).min(6 * ENDS - 4);
            let is_high =
                _mm256_cmpgt_epi32(_mm256_add_epi32(_mm256_set1_epi32(first as i32), order), last_low);
            let is_high = _mm256_castsi256_ps(is_high);
            let mut rows = [_mm256_setzero_ps(); 4];
            for lane in 0..LANES / 2 {
                for corner in 0..N {
                    // Lanes `lane` and `lane` + 4.
                    let [low, high] = [boxes[corner][lane], boxes[corner][lane + LANES / 2]];
                    // SAFETY: `repr(C)` boxes of 6 · ENDS coordinates, of which these are four.
                    let (low, high) =
                        unsafe { (_mm_loadu_ps(low.add(first)), _mm_loadu_ps(high.add(first))) };
                    let both = _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(low), high);
                    let (least, most) = (_mm256_min_ps(both, rows[lane]), _mm256_max_ps(both, rows[lane]));
                    rows[lane] = if corner == 0 { both } else { _mm256_blendv_ps(least, most, is_high) };
                }
            }
            let [a, b, c, d] = rows;
            let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
            let columns = [
                _mm256_shuffle_ps::<0x44>(ab_low, cd_low),
                _mm256_shuffle_ps::<0xee>(ab_low, cd_low),
                _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
                _mm256_shuffle_ps::<0xee>(ab_high, cd_high),
            ];
            for k in 0..4 {
                // SAFETY: a `repr(C)` block has as many lists of eight lanes as a box has coordinates, in their order.
                unsafe { _mm256_storeu_ps(out.add(LANES * (first + k)), columns[k]) };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks<const ENDS: usize, const N: usize>(random: &mut impl FnMut(u32) -> u32) -> usize {
        let mut coordinates = || [[(); 3]; ENDS].map(|end| end.map(|()| random(8) as f32 - 4.0));
        let vertices: Vec<_> = (0..20).map(|_| MovingBox { lo: coordinates(), hi: coordinates() }).collect();
        let mut corners = [[NONE; LANES]; N];
        let used = random(LANES as u32 + 1) as usize;
        for corner in &mut corners {
            corner[..used].fill_with(|| random(20));
        }
        let (mut expected, mut found) = (Block::EMPTY, Block::EMPTY);
        fit_plain(&mut expected, &corners, &vertices);
        fit(&mut found, &corners, &vertices);
        assert!(found == expected, "{ENDS} ends, {N} corners, {used} lanes");
        // One corner of one lane is another vertex.
        let (corner, lane) = (random(N as u32) as usize, random(LANES as u32) as usize);
        if lane >= used {
            return 0;
        }
        corners[corner][lane] = (corners[corner][lane] + 1) % 20;
        let mut other = Block::EMPTY;
        fit(&mut other, &corners, &vertices);
        usize::from(other != expected)
    }

    #[test]
    fn blocks_are_those_of_one_lane_after_the_other_and_another_vertex_is_noticed() {
        let mut state = 1_u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        let mut noticed = 0;
        for _ in 0..300 {
            noticed +=
                blocks::<1, 1>(&mut random) + blocks::<1, 2>(&mut random) + blocks::<1, 3>(&mut random);
            noticed +=
                blocks::<2, 1>(&mut random) + blocks::<2, 2>(&mut random) + blocks::<2, 3>(&mut random);
        }
        assert!(noticed > 600, "{noticed} of 1800");
    }
}
