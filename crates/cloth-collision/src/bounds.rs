//! Bounding boxes that move: one box per end of the step, in single precision, rounded outward.

use crate::Vec3;

/// Lanes of a [`Block`].
pub(crate) const LANES: usize = 8;
/// Bit per lane.
pub(crate) const ALL_LANES: u32 = (1 << LANES) - 1;

/// The boxes of one feature or of one subtree: at t0 and at t1 (two `ENDS`), or at rest (one).
///
/// Between the ends the box at t is the linear interpolation of both; it holds everything whose vertices move
/// linearly. Two such boxes are apart during the whole step if along one axis the same one lies above the other at
/// all ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MovingBox<const ENDS: usize> {
    /// `[end][axis]`
    pub(crate) lo: [[f32; 3]; ENDS],
    pub(crate) hi: [[f32; 3]; ENDS],
}

impl<const ENDS: usize> MovingBox<ENDS> {
    /// The box that holds nothing and overlaps nothing.
    pub(crate) const EMPTY: Self =
        Self { lo: [[f32::INFINITY; 3]; ENDS], hi: [[f32::NEG_INFINITY; 3]; ENDS] };

    /// The box around a vertex of those that are at `x` \[m\] at the ends, relative to `origin`, inflated by `margin`
    /// on all sides.
    #[inline]
    pub(crate) fn of_vertex(x: &[&[Vec3]; ENDS], vertex: usize, origin: &Vec3, margin: f64) -> Self {
        let mut out = Self::EMPTY;
        for end in 0..ENDS {
            for axis in 0..3 {
                let d = x[end][vertex][axis] - origin[axis];
                out.lo[end][axis] = round_down(d - margin, d);
                out.hi[end][axis] = -round_down(-d - margin, d);
            }
        }
        out
    }

    /// The box of this half side \[m\] around a point \[m\].
    #[inline]
    pub(crate) fn around(point: [f32; 3], half: f64) -> Self {
        let mut out = Self::EMPTY;
        for end in 0..ENDS {
            for axis in 0..3 {
                let d = f64::from(point[axis]);
                out.lo[end][axis] = round_down(d - half, d);
                out.hi[end][axis] = -round_down(-d - half, d);
            }
        }
        out
    }

    #[inline]
    pub(crate) fn grow(&mut self, other: &Self) {
        for end in 0..ENDS {
            for axis in 0..3 {
                // Not `f32::min`: no entry is NaN, and its care for that costs.
                let (lo, hi) = (other.lo[end][axis], other.hi[end][axis]);
                self.lo[end][axis] = if lo < self.lo[end][axis] { lo } else { self.lo[end][axis] };
                self.hi[end][axis] = if hi > self.hi[end][axis] { hi } else { self.hi[end][axis] };
            }
        }
    }

    /// Whether the boxes may touch at some time (closed).
    #[inline]
    #[allow(
        clippy::needless_bitwise_bool,
        reason = "a branch per comparison costs more than the comparisons"
    )]
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        let mut apart = false;
        for axis in 0..3 {
            let (mut above, mut below) = (true, true);
            for end in 0..ENDS {
                above &= self.lo[end][axis] > other.hi[end][axis];
                below &= self.hi[end][axis] < other.lo[end][axis];
            }
            apart |= above | below;
        }
        !apart
    }

    /// Whether `other` lies inside at all ends.
    pub(crate) fn contains(&self, other: &Self) -> bool {
        (0..ENDS).all(|e| (0..3).all(|a| self.lo[e][a] <= other.lo[e][a] && self.hi[e][a] >= other.hi[e][a]))
    }
}

/// A single-precision number below `value`, which itself carries rounding errors of a few 2⁻⁵³ of |value| and |d|.
///
/// Narrowing costs 2⁻²⁴ |value|; the margin of 2⁻²³ |value| + 2⁻⁵⁰ |d| covers that and the errors (2⁻²⁴ > a few 2⁻⁵³).
/// Values beyond the range of `f32` end at its largest finite numbers or at −∞, which is below them.
#[inline]
fn round_down(value: f64, d: f64) -> f32 {
    const NARROW: f64 = 1.0 / (1u64 << 23) as f64;
    const ERRORS: f64 = 1.0 / (1u64 << 50) as f64;
    let below = value - value.abs() * NARROW - d.abs() * ERRORS - f32::MIN_POSITIVE as f64;
    (below as f32).min(f32::MAX)
}

/// The boxes of [`LANES`] features or subtrees, by coordinate. Unused lanes hold [`MovingBox::EMPTY`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(crate) struct Block<const ENDS: usize> {
    /// `[end][axis][lane]`
    pub(crate) lo: [[[f32; LANES]; 3]; ENDS],
    pub(crate) hi: [[[f32; LANES]; 3]; ENDS],
}

impl<const ENDS: usize> Block<ENDS> {
    pub(crate) const EMPTY: Self =
        Self { lo: [[[f32::INFINITY; LANES]; 3]; ENDS], hi: [[[f32::NEG_INFINITY; LANES]; 3]; ENDS] };

    #[inline]
    pub(crate) fn set(&mut self, lane: usize, b: &MovingBox<ENDS>) {
        for end in 0..ENDS {
            for axis in 0..3 {
                self.lo[end][axis][lane] = b.lo[end][axis];
                self.hi[end][axis][lane] = b.hi[end][axis];
            }
        }
    }

    /// The box around all lanes.
    #[inline]
    pub(crate) fn hull(&self) -> MovingBox<ENDS> {
        let mut b = self.get(0);
        for lane in 1..LANES {
            b.grow(&self.get(lane));
        }
        b
    }

    #[inline(always)]
    pub(crate) fn get(&self, lane: usize) -> MovingBox<ENDS> {
        let mut b = MovingBox::EMPTY;
        for end in 0..ENDS {
            for axis in 0..3 {
                b.lo[end][axis] = self.lo[end][axis][lane];
                b.hi[end][axis] = self.hi[end][axis][lane];
            }
        }
        b
    }
}

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
    fn has_corner(self, vertex: u32, corners: &[[u32; LANES]; 3]) -> u32;
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
    fn has_corner(self, vertex: u32, corners: &[[u32; LANES]; 3]) -> u32 {
        let has = |lane: usize| corners.iter().any(|corner| corner[lane] == vertex);
        (0..LANES).map(|lane| u32::from(has(lane)) << lane).sum()
    }
}

/// All lanes at once. A value exists only in functions compiled for AVX2, which the methods are inlined into.
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx {
    use super::{ALL_LANES, Block, Bounds, Compare, LANES};
    use std::arch::x86_64::{
        _CMP_GT_OQ, _CMP_LT_OQ, _mm256_and_ps, _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cmpeq_epi32,
        _mm256_load_ps, _mm256_loadu_si256, _mm256_movemask_ps, _mm256_or_ps, _mm256_or_si256,
        _mm256_set1_epi32, _mm256_set1_ps, _mm256_setzero_ps,
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
        fn has_corner(self, vertex: u32, corners: &[[u32; LANES]; 3]) -> u32 {
            // SAFETY: `self` exists only where the processor has AVX2; 32 readable bytes per corner.
            unsafe {
                let vertex = _mm256_set1_epi32(vertex as i32);
                let mut equal = _mm256_cmpeq_epi32(vertex, _mm256_loadu_si256(corners[0].as_ptr().cast()));
                for k in 1..3 {
                    let corner = _mm256_loadu_si256(corners[k].as_ptr().cast());
                    equal = _mm256_or_si256(equal, _mm256_cmpeq_epi32(vertex, corner));
                }
                _mm256_movemask_ps(_mm256_castsi256_ps(equal)) as u32
            }
        }
    }
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

/// Middle of the positions' box: coordinates relative to it keep the most digits in single precision.
pub(crate) fn middle(x: &[Vec3]) -> Vec3 {
    let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in x {
        for axis in 0..3 {
            lo[axis] = if p[axis] < lo[axis] { p[axis] } else { lo[axis] };
            hi[axis] = if p[axis] > hi[axis] { p[axis] } else { hi[axis] };
        }
    }
    // Halves before the sum: no overflow.
    if x.is_empty() { Vec3::zeros() } else { Vec3::from(lo) * 0.5 + Vec3::from(hi) * 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;

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
                overlaps += by_box.count_ones();
            }
        }
        assert!(overlaps > 20_000 && overlaps < 100_000, "{overlaps} of 128000");
    }
}
