//! Bounding boxes that move: one box per end of the step, in single precision, rounded outward.

mod compare;
mod fit;

use crate::Vec3;
#[cfg(target_arch = "x86_64")]
pub(crate) use compare::avx;
pub(crate) use compare::{Bounds, Compare, Plain, lanes};
pub(crate) use fit::fit;

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
#[repr(C)]
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
#[repr(C, align(32))]
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
