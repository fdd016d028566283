//! Several pairs at once: the arithmetic of the filters and of the march over one or several lanes, bit for bit the same.

#[cfg(target_arch = "x86_64")]
pub(crate) mod avx;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx512;

use crate::Vec3;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

/// A yes or no per lane.
pub(crate) trait Mask:
    Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self>
{
    /// Bit per lane.
    fn bits(self) -> u32;
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

impl Mask for bool {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
}

/// Numbers in lanes. Only operations that IEEE 754 rounds correctly, so that a lane gives what one number gives.
pub(crate) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    type Mask: Mask;
    fn splat(x: f64) -> Self;
    fn abs(self) -> Self;
    fn sqrt(self) -> Self;
    /// The smaller one; `other` if a lane is not a number.
    fn min(self, other: Self) -> Self;
    /// The larger one; `other` if a lane is not a number.
    fn max(self, other: Self) -> Self;
    /// False where a lane is not a number.
    fn greater(self, other: Self) -> Self::Mask;
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
}

/// A point with a fourth entry of no meaning, so that it fills a register.
pub(crate) type Row = [f64; 4];

/// The points of a pair: four at t0, the same four at t1.
pub(crate) type Rows<'a> = [&'a Row; 8];

/// [`Lanes`] in double precision, and how they come from memory and go there.
pub(crate) trait Doubles: Lanes {
    const COUNT: usize;
    /// The first lanes of these.
    fn from_array(lanes: &[f64; MAX_DOUBLES]) -> Self;
    /// The first three entries of row `k` of the first lanes, by entry.
    fn gather(rows: &[Rows<'_>; MAX_DOUBLES], k: usize) -> Vector<Self>;
    /// The lanes, in order; entries past the last lane are 0.
    fn to_array(self) -> [f64; MAX_DOUBLES];
    /// The power of two whose exponent is the negative of that of a positive number (2⁰ for numbers from 1 to 2). Near
    /// the ends of the range, where that is no normal number, something smaller than 2⁻¹⁰⁰⁰ or larger than 2¹⁰⁰⁰.
    fn inverse_exponent(self) -> Self;
}

/// Both ends of a point's motion in single precision, with an entry of no meaning after each.
pub(crate) type SmallRow = [f32; 8];

/// [`Lanes`] in single precision, and how they come from memory.
pub(crate) trait Singles: Lanes {
    const COUNT: usize;
    /// Entries of row `k` of the first lanes: the point at t0 and at t1.
    fn gather(rows: &[[&SmallRow; 4]; MAX_SINGLES], k: usize) -> [Vector<Self>; 2];
    /// Writes the entries of the lanes whose bit is set, in their order; what comes behind them has no meaning.
    #[inline(always)]
    fn compress(set: u32, entries: &[u32; MAX_SINGLES], out: &mut [u32; MAX_SINGLES]) {
        // Every entry is written, and the next one over it if its bit is not set: no branch on what is hard to foresee.
        let mut kept = 0;
        for lane in 0..Self::COUNT {
            out[kept] = entries[lane];
            kept += (set >> lane & 1) as usize;
        }
    }
}

impl Singles for f32 {
    const COUNT: usize = 1;

    #[inline(always)]
    fn gather(rows: &[[&SmallRow; 4]; MAX_SINGLES], k: usize) -> [Vector<Self>; 2] {
        let row = rows[0][k];
        [Vector([row[0], row[1], row[2]]), Vector([row[4], row[5], row[6]])]
    }
}

/// Lanes of the longest [`Singles`].
pub(crate) const MAX_SINGLES: usize = 16;

/// Lanes of the longest [`Doubles`].
pub(crate) const MAX_DOUBLES: usize = 8;

/// The exponent's bits of a double, and the sum of those of a power of two and its inverse.
const EXPONENT: i64 = 0x7ff << 52;
const TWO_BIASES: i64 = 2046 << 52;

impl Doubles for f64 {
    const COUNT: usize = 1;

    #[inline(always)]
    fn from_array(lanes: &[f64; MAX_DOUBLES]) -> Self {
        lanes[0]
    }
    #[inline(always)]
    fn gather(rows: &[Rows<'_>; MAX_DOUBLES], k: usize) -> Vector<Self> {
        let row = rows[0][k];
        Vector([row[0], row[1], row[2]])
    }
    #[inline(always)]
    fn to_array(self) -> [f64; MAX_DOUBLES] {
        let mut out = [0.0; MAX_DOUBLES];
        out[0] = self;
        out
    }
    #[inline(always)]
    fn inverse_exponent(self) -> Self {
        f64::from_bits((TWO_BIASES - (self.to_bits() as i64 & EXPONENT)) as u64)
    }
}

macro_rules! one_lane {
    ($type:ident) => {
        impl Lanes for $type {
            type Mask = bool;

            #[inline(always)]
            fn splat(x: f64) -> Self {
                x as $type
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $type::abs(self)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $type::sqrt(self)
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if self < other { self } else { other }
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self > other { self } else { other }
            }
            #[inline(always)]
            fn greater(self, other: Self) -> bool {
                self > other
            }
            #[inline(always)]
            fn select(mask: bool, yes: Self, no: Self) -> Self {
                if mask { yes } else { no }
            }
        }
    };
}
one_lane!(f64);
one_lane!(f32);

/// Three coordinates in lanes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vector<L>(pub(crate) [L; 3]);

impl<L: Lanes> Vector<L> {
    #[inline(always)]
    pub(crate) fn dot(self, o: Self) -> L {
        self.0[0] * o.0[0] + self.0[1] * o.0[1] + self.0[2] * o.0[2]
    }
    #[inline(always)]
    pub(crate) fn cross(self, o: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, o.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }
    #[inline(always)]
    pub(crate) fn scale(self, s: L) -> Self {
        Self([self.0[0] * s, self.0[1] * s, self.0[2] * s])
    }
    #[inline(always)]
    pub(crate) fn splat(v: Vec3) -> Self {
        Self([L::splat(v.x), L::splat(v.y), L::splat(v.z)])
    }
    #[inline(always)]
    pub(crate) fn norm_squared(self) -> L {
        self.dot(self)
    }
    /// From the other side: 0 − v.
    #[inline(always)]
    pub(crate) fn negated(self) -> Self {
        Self::splat(Vec3::zeros()) - self
    }
    /// (1 − t) v + t o
    #[inline(always)]
    pub(crate) fn mix(self, o: Self, t: L) -> Self {
        self.scale(L::splat(1.0) - t) + o.scale(t)
    }
    /// Largest absolute coordinate.
    #[inline(always)]
    pub(crate) fn largest(self) -> L {
        self.0[0].abs().max(self.0[1].abs()).max(self.0[2].abs())
    }
    /// Sum of the absolute coordinates.
    #[inline(always)]
    pub(crate) fn sum_of_sizes(self) -> L {
        self.0[0].abs() + self.0[1].abs() + self.0[2].abs()
    }
    #[inline(always)]
    pub(crate) fn select(mask: L::Mask, yes: Self, no: Self) -> Self {
        Self([
            L::select(mask, yes.0[0], no.0[0]),
            L::select(mask, yes.0[1], no.0[1]),
            L::select(mask, yes.0[2], no.0[2]),
        ])
    }
}

impl<L: Lanes> Add for Vector<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self([self.0[0] + o.0[0], self.0[1] + o.0[1], self.0[2] + o.0[2]])
    }
}

impl<L: Lanes> Sub for Vector<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self([self.0[0] - o.0[0], self.0[1] - o.0[1], self.0[2] - o.0[2]])
    }
}

impl From<Vec3> for Vector<f64> {
    #[inline(always)]
    fn from(v: Vec3) -> Self {
        Self([v.x, v.y, v.z])
    }
}
