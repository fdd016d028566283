//! Bounding boxes that move: one box per end of the step, in single precision, rounded outward.

use crate::Vec3;

/// Lanes of a [`Block`].
pub(crate) const LANES: usize = 8;

/// The boxes of one feature or of one subtree at t0 and at t1.
///
/// Between the ends the box at t is the linear interpolation of both; it holds everything whose vertices move
/// linearly. Two such boxes are apart during the whole step if along one axis the same one lies above the other at
/// both ends. In a still query both ends are equal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MovingBox {
    /// `[end][axis]`
    pub(crate) lo: [[f32; 3]; 2],
    pub(crate) hi: [[f32; 3]; 2],
}

impl MovingBox {
    /// The box that holds nothing and overlaps nothing.
    pub(crate) const EMPTY: Self = Self { lo: [[f32::INFINITY; 3]; 2], hi: [[f32::NEG_INFINITY; 3]; 2] };

    /// The box around a vertex that is at `x0` and `x1` \[m\] at the ends, relative to `origin`, inflated by
    /// `margin` on all sides.
    #[inline]
    pub(crate) fn of_vertex(x0: &Vec3, x1: &Vec3, origin: &Vec3, margin: f64) -> Self {
        let mut out = Self::EMPTY;
        for (end, x) in [x0, x1].into_iter().enumerate() {
            for axis in 0..3 {
                let d = x[axis] - origin[axis];
                out.lo[end][axis] = round_down(d - margin, d);
                out.hi[end][axis] = -round_down(-d - margin, d);
            }
        }
        out
    }

    /// [`MovingBox::of_vertex`] of a vertex at rest.
    #[inline]
    pub(crate) fn of_still_vertex(x: &Vec3, origin: &Vec3, margin: f64) -> Self {
        let (mut lo, mut hi) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let d = x[axis] - origin[axis];
            lo[axis] = round_down(d - margin, d);
            hi[axis] = -round_down(-d - margin, d);
        }
        Self { lo: [lo; 2], hi: [hi; 2] }
    }

    #[inline]
    pub(crate) fn grow(&mut self, other: &Self) {
        for end in 0..2 {
            for axis in 0..3 {
                self.lo[end][axis] = self.lo[end][axis].min(other.lo[end][axis]);
                self.hi[end][axis] = self.hi[end][axis].max(other.hi[end][axis]);
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
            apart |= (self.lo[0][axis] > other.hi[0][axis]) & (self.lo[1][axis] > other.hi[1][axis]);
            apart |= (self.hi[0][axis] < other.lo[0][axis]) & (self.hi[1][axis] < other.lo[1][axis]);
        }
        !apart
    }

    /// Whether `other` lies inside at both ends.
    pub(crate) fn contains(&self, other: &Self) -> bool {
        (0..2).all(|e| (0..3).all(|a| self.lo[e][a] <= other.lo[e][a] && self.hi[e][a] >= other.hi[e][a]))
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

/// The boxes of [`LANES`] features, by coordinate. Unused lanes hold [`MovingBox::EMPTY`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(crate) struct Block {
    /// `[end][axis][lane]`
    pub(crate) lo: [[[f32; LANES]; 3]; 2],
    pub(crate) hi: [[[f32; LANES]; 3]; 2],
}

impl Block {
    pub(crate) const EMPTY: Self =
        Self { lo: [[[f32::INFINITY; LANES]; 3]; 2], hi: [[[f32::NEG_INFINITY; LANES]; 3]; 2] };

    #[inline]
    pub(crate) fn set(&mut self, lane: usize, b: &MovingBox) {
        for end in 0..2 {
            for axis in 0..3 {
                self.lo[end][axis][lane] = b.lo[end][axis];
                self.hi[end][axis][lane] = b.hi[end][axis];
            }
        }
    }

    /// The box around all lanes.
    #[inline]
    pub(crate) fn hull(&self) -> MovingBox {
        let mut b = MovingBox::EMPTY;
        for end in 0..2 {
            for axis in 0..3 {
                b.lo[end][axis] = self.lo[end][axis].iter().fold(f32::INFINITY, |m, &x| m.min(x));
                b.hi[end][axis] = self.hi[end][axis].iter().fold(f32::NEG_INFINITY, |m, &x| m.max(x));
            }
        }
        b
    }

    #[inline(always)]
    pub(crate) fn get(&self, lane: usize) -> MovingBox {
        let mut b = MovingBox::EMPTY;
        for end in 0..2 {
            for axis in 0..3 {
                b.lo[end][axis] = self.lo[end][axis][lane];
                b.hi[end][axis] = self.hi[end][axis][lane];
            }
        }
        b
    }
}
