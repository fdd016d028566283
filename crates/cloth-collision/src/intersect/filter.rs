//! Pairs of triangles whose meeting is certain, one way or the other, in single precision: eight at once.
//!
//! Positions are taken relative to their middle, in units of a power of two that leaves no coordinate beyond 1. A
//! direction separates two sets of points if the lowest of the one lies above the highest of the other by more than the
//! errors. What is not decided here goes to the exact predicates.

use crate::Vec3;
use crate::bounds::middle;
use crate::ccd::lanes::{Lanes, Mask, Vector};

/// Bound of the error of a difference of two heights along n, per |n|₁.
///
/// With v = 2⁻²⁴ and coordinates ≤ 1 (+ v): a coordinate carries v from its rounding, a height n·p then v |n|₁, and 3v
/// |n|₁ from its three products and two sums; the difference of two heights, ≤ 2 |n|₁, carries 2v |n|₁ more: in all
/// 10v |n|₁. The sum |n|₁ and the bound itself carry 4v of that. Direction n itself needs no precision.
const HEIGHTS: f64 = 16.0 / (1u64 << 24) as f64;

/// Directions of Gilbert's algorithm for pairs that the first filter leaves, by measurement.
const MANY: usize = 4;
/// Directions for triangles with a common vertex, by measurement.
const JOINED: usize = 3;

/// A position in the filter's units, with a fourth entry of no meaning.
pub(crate) type Row = [f32; 4];

/// Positions \[m\] (of an extent that [`crate::intersections`] has brought into range) in the filter's units.
pub(crate) fn rows(x: &[Vec3]) -> Vec<Row> {
    let origin = middle(x);
    let extent = x.iter().fold(0.0f64, |extent, p| extent.max((p - origin).amax()));
    let unit = if extent > 0.0 { (-extent.log2().ceil()).exp2() } else { 1.0 };
    let coordinate = |p: &Vec3, axis: usize| ((p[axis] - origin[axis]) * unit) as f32;
    x.iter().map(|p| [coordinate(p, 0), coordinate(p, 1), coordinate(p, 2), 0.0]).collect()
}

#[inline(always)]
fn bound<L: Lanes>(n: Vector<L>) -> L {
    // Products below the normal numbers lose less than the second term.
    n.sum_of_sizes() * L::splat(HEIGHTS) + L::splat(f32::MIN_POSITIVE as f64)
}

/// Where the direction has the first three points on one side and the others on the other side.
#[inline(always)]
fn separates<L: Lanes>(n: Vector<L>, p: &[Vector<L>; 6]) -> L::Mask {
    let [a, b, c] = [n.dot(p[0]), n.dot(p[1]), n.dot(p[2])];
    let [d, e, f] = [n.dot(p[3]), n.dot(p[4]), n.dot(p[5])];
    let bound = bound(n);
    let above = a.min(b).min(c) - d.max(e).max(f);
    let below = d.min(e).min(f) - a.max(b).max(c);
    above.greater(bound) | below.greater(bound)
}

/// Where two triangles (three points each) are certainly apart along the line of their centroids or beside the plane of
/// one of them.
#[inline(always)]
fn triangles_maybe_apart<L: Lanes>(p: &[Vector<L>; 6]) -> L::Mask {
    let between_centroids = (p[0] + p[1] + p[2]) - (p[3] + p[4] + p[5]);
    separates(between_centroids, p)
        | separates((p[1] - p[0]).cross(p[2] - p[0]), p)
        | separates((p[4] - p[3]).cross(p[5] - p[3]), p)
}

/// Where two triangles are certainly apart, by Gilbert's directions.
#[inline(always)]
fn triangles_apart<L: Lanes>(p: &[Vector<L>; 6]) -> L::Mask {
    let mut n = ((p[0] + p[1] + p[2]) - (p[3] + p[4] + p[5])).scale(L::splat(1.0 / 3.0));
    let mut apart = never::<L>();
    for _ in 0..MANY {
        let (low, first) = lowest(n, &[p[0], p[1], p[2]]);
        let (high, second) = highest(n, &[p[3], p[4], p[5]]);
        apart = apart | (low - high).greater(bound(n));
        n = nearest(n, first - second);
    }
    apart
}

/// Bound of the error of a coordinate's difference: each end carries v = 2⁻²⁴, the subtraction of coordinates ≤ 1 (+ v)
/// 2v.
const DIFFERENCE: f64 = 4.0 / (1u64 << 24) as f64;

/// Where two triangles are certainly apart, and where a side of one certainly passes through the other's inside.
///
/// By the signs of the heights of each corner over the other's plane, and of the volumes of each two sides. Error of a
/// determinant of three differences whose coordinates are ≤ x, y, z as computed: with δ = [`DIFFERENCE`] and primes for
/// "plus δ", its six products move by 6 (x'y'z' − xyz) ≤ 6δ (x'y' + y'z' + z'x'); evaluation costs 28v xyz. The
/// bounds here are larger by more than their own rounding.
#[inline(always)]
fn triangles_decided<L: Lanes>(p: &[Vector<L>; 6]) -> (L::Mask, L::Mask) {
    let (a, b) = ([p[0], p[1], p[2]], [p[3], p[4], p[5]]);
    let sides_a = [a[1] - a[0], a[2] - a[1], a[0] - a[2]];
    let sides_b = [b[1] - b[0], b[2] - b[1], b[0] - b[2]];
    let (normal_a, normal_b) = (sides_a[0].cross(sides_a[1]), sides_b[0].cross(sides_b[1]));
    let between = [
        [a[0] - b[0], a[0] - b[1], a[0] - b[2]],
        [a[1] - b[0], a[1] - b[1], a[1] - b[2]],
        [a[2] - b[0], a[2] - b[1], a[2] - b[2]],
    ];
    let delta = L::splat(DIFFERENCE);
    let size_a = sides_a[0].largest().max(sides_a[1].largest()).max(sides_a[2].largest()) + delta;
    let size_b = sides_b[0].largest().max(sides_b[1].largest()).max(sides_b[2].largest()) + delta;
    let mut size = delta;
    for row in between {
        size = size.max(row[0].largest()).max(row[1].largest()).max(row[2].largest());
    }
    size = size + delta;
    let over_b = determinant_error(size_b, size_b, size);
    let over_a = determinant_error(size_a, size_a, size);
    let of_sides = determinant_error(size_a, size_b, size);
    let heights_a = [
        sign(normal_b.dot(between[0][0]), over_b),
        sign(normal_b.dot(between[1][0]), over_b),
        sign(normal_b.dot(between[2][0]), over_b),
    ];
    let heights_b = [
        sign(normal_a.dot(between[0][0]), over_a),
        sign(normal_a.dot(between[0][1]), over_a),
        sign(normal_a.dot(between[0][2]), over_a),
    ];
    let mut volumes = [[heights_a[0]; 3]; 3];
    for i in 0..3 {
        for k in 0..3 {
            volumes[i][k] = sign(between[i][k].dot(sides_a[i].cross(sides_b[k])), of_sides);
        }
    }

    let never = L::splat(0.0).greater(L::splat(0.0));
    let (mut all_apart, mut any_meets) = (L::splat(1.0).greater(L::splat(0.0)), never);
    for k in 0..3 {
        let turns_a = [volumes[k][0], volumes[k][1], volumes[k][2]];
        let turns_b = [volumes[0][k], volumes[1][k], volumes[2][k]];
        for (heights, turns) in [(heights_a, turns_a), (heights_b, turns_b)] {
            let (p, q) = (heights[k], heights[(k + 1) % 3]);
            let crosses = (p.0 & q.1) | (p.1 & q.0);
            let beside = (p.0 & q.0) | (p.1 & q.1);
            let around = (turns[0].0 & turns[1].0 & turns[2].0) | (turns[0].1 & turns[1].1 & turns[2].1);
            let outside = (turns[0].0 | turns[1].0 | turns[2].0) & (turns[0].1 | turns[1].1 | turns[2].1);
            any_meets = any_meets | (crosses & around);
            all_apart = all_apart & (beside | outside);
        }
    }
    (all_apart, any_meets)
}

/// See [`triangles_decided`].
#[inline(always)]
fn determinant_error<L: Lanes>(x: L, y: L, z: L) -> L {
    const EVALUATION: f64 = 40.0 / (1u64 << 24) as f64;
    (x * y + y * z + z * x) * L::splat(8.0 * DIFFERENCE)
        + x * y * z * L::splat(EVALUATION)
        + L::splat(f32::MIN_POSITIVE as f64)
}

/// Whether a number is certainly positive; whether it is certainly negative.
#[inline(always)]
fn sign<L: Lanes>(value: L, error: L) -> (L::Mask, L::Mask) {
    (value.greater(error), (L::splat(0.0) - error).greater(value))
}

/// Where a plane through the common vertex (first point) of two triangles certainly has the other corners of the one
/// (next two) on one side of it and those of the other (last two) on the other side: they meet at that vertex only.
#[inline(always)]
fn joined_triangles_apart<L: Lanes>(p: &[Vector<L>; 5]) -> L::Mask {
    let mut n = ((p[1] + p[2]) - (p[3] + p[4])).scale(L::splat(0.25));
    let mut apart = never::<L>();
    for _ in 0..JOINED {
        let common = n.dot(p[0]);
        let (low, first) = lowest(n, &[p[1], p[2]]);
        let (high, second) = highest(n, &[p[3], p[4]]);
        let bound = bound(n);
        apart = apart | (low - common).greater(bound) & (common - high).greater(bound);
        // The lower one of first − common and common − second.
        let is_first = (common - high).greater(low - common);
        n = nearest(n, Vector::select(is_first, first - p[0], p[0] - second));
    }
    apart
}

#[inline(always)]
fn never<L: Lanes>() -> L::Mask {
    L::splat(0.0).greater(L::splat(0.0))
}

/// The point nearest to the origin on the segment between two.
#[inline(always)]
fn nearest<L: Lanes>(n: Vector<L>, corner: Vector<L>) -> Vector<L> {
    let back = n - corner;
    let along = (n.dot(back) / back.dot(back)).max(L::splat(0.0)).min(L::splat(1.0));
    n - back.scale(along)
}

/// The point that lies lowest along n, and its height.
#[inline(always)]
fn lowest<L: Lanes, const N: usize>(n: Vector<L>, p: &[Vector<L>; N]) -> (L, Vector<L>) {
    let (mut height, mut point) = (n.dot(p[0]), p[0]);
    for k in 1..N {
        let h = n.dot(p[k]);
        let better = height.greater(h);
        height = L::select(better, h, height);
        point = Vector::select(better, p[k], point);
    }
    (height, point)
}

/// The point that lies highest along n, and its height.
#[inline(always)]
fn highest<L: Lanes, const N: usize>(n: Vector<L>, p: &[Vector<L>; N]) -> (L, Vector<L>) {
    let (mut height, mut point) = (n.dot(p[0]), p[0]);
    for k in 1..N {
        let h = n.dot(p[k]);
        let better = h.greater(height);
        height = L::select(better, h, height);
        point = Vector::select(better, p[k], point);
    }
    (height, point)
}

macro_rules! eight_at_once {
    (
        $(#[$doc:meta])* $name:ident, $avx:ident, $one:ident, $points:literal, $bits:ty, $add_lane:expr,
        $of_lanes:expr
    ) => {
        $(#[$doc])*
        #[inline]
        pub(crate) fn $name(rows: &[[&Row; $points]; 8]) -> $bits {
            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has AVX2.
                return unsafe { $avx(rows) };
            }
            let mut bits = <$bits>::default();
            for (lane, points) in rows.iter().enumerate() {
                let points = points.map(|row| Vector([row[0], row[1], row[2]]));
                $add_lane(&mut bits, lane, $one(&points));
            }
            bits
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn $avx(rows: &[[&Row; $points]; 8]) -> $bits {
            use crate::ccd::lanes::avx::Eight;
            let mut points = [Vector([Eight::splat(0.0); 3]); $points];
            for k in 0..$points {
                // SAFETY: this function runs only where the processor has AVX2.
                points[k] = Vector(unsafe {
                    Eight::load_transposed([
                        rows[0][k], rows[1][k], rows[2][k], rows[3][k], rows[4][k], rows[5][k], rows[6][k],
                        rows[7][k],
                    ])
                });
            }
            $of_lanes($one(&points))
        }
    };
    ($(#[$doc:meta])* $name:ident, $avx:ident, $one:ident, $points:literal) => {
        eight_at_once!(
            $(#[$doc])* $name, $avx, $one, $points, u32,
            |bits: &mut u32, lane: usize, apart| *bits |= u32::from(apart) << lane,
            Mask::bits
        );
    };
}
eight_at_once!(
    /// Bit per pair (`rows[pair][point]`): it is certainly apart.
    eight_triangles_maybe_apart, eight_triangles_maybe_apart_avx2, triangles_maybe_apart, 6
);
eight_at_once!(
    /// As [`eight_triangles_maybe_apart`], with other directions.
    eight_triangles_apart, eight_triangles_apart_avx2, triangles_apart, 6
);
eight_at_once!(
    /// As [`eight_triangles_maybe_apart`], for two triangles with a common vertex (the first point).
    eight_joined_triangles_apart, eight_joined_triangles_apart_avx2, joined_triangles_apart, 5
);
eight_at_once!(
    /// Bit per pair: it is certainly apart; it certainly meets.
    eight_triangles_decided, eight_triangles_decided_avx2, triangles_decided, 6, [u32; 2],
    |bits: &mut [u32; 2], lane: usize, (apart, meet): (bool, bool)| {
        bits[0] |= u32::from(apart) << lane;
        bits[1] |= u32::from(meet) << lane;
    },
    |(apart, meet): (crate::ccd::lanes::avx::EightMask, crate::ccd::lanes::avx::EightMask)| {
        [apart.bits(), meet.bits()]
    }
);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intersect::{segment_meets_triangle, triangles_meet};

    /// SplitMix64.
    struct Random(u64);

    impl Random {
        fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        }
        fn vector(&mut self, half: f64) -> Vec3 {
            Vec3::new(self.unit() - 0.5, self.unit() - 0.5, self.unit() - 0.5) * (2.0 * half)
        }
    }

    /// Two triangles of some size somewhere in the unit box; every other time they touch but for an offset of
    /// the order of the coordinates' rounding: corner on face, side on side, coplanar.
    fn pair(random: &mut Random) -> [Vec3; 6] {
        let centre = random.vector(0.9);
        let size = 0.1 * 0.5f64.powi((random.unit() * 12.0) as i32);
        let mut p = [(); 6].map(|()| centre + random.vector(size));
        let between = |a: Vec3, b: Vec3, t: f64| a + (b - a) * t;
        let (s, t) = (random.unit(), random.unit());
        let onto = match (random.unit() * 8.0) as u32 {
            0 | 1 => Some((between(between(p[0], p[1], s), p[2], t), p[3])),
            2 => Some((between(p[0], p[1], s), between(p[3], p[4], t))),
            3 => {
                for k in 3..6 {
                    p[k] =
                        p[0] + (p[1] - p[0]) * (random.unit() - 0.3) + (p[2] - p[0]) * (random.unit() - 0.3);
                }
                Some((p[0], p[0]))
            }
            _ => None,
        };
        if let Some((target, from)) = onto {
            let offset = 1e-7 * 0.1f64.powi((random.unit() * 5.0) as i32);
            let shift = target - from + random.vector(offset);
            p[3..].iter_mut().for_each(|p| *p += shift);
        }
        p
    }

    /// Eight pairs: positions and rows.
    type Group = ([[Vec3; 6]; 8], [[Row; 6]; 8]);

    /// Pairs in one unit box.
    fn groups(count: usize) -> Vec<Group> {
        let mut random = Random(3);
        let mut x: Vec<Vec3> = (0..8 * count).flat_map(|_| pair(&mut random)).collect();
        // The box's corners, so that the units are metres.
        x.extend([Vec3::repeat(-1.0), Vec3::repeat(1.0)]);
        let rows = rows(&x);
        (0..count)
            .map(|g| {
                let at = |lane: usize, k: usize| 6 * (8 * g + lane) + k;
                let positions = std::array::from_fn(|lane| std::array::from_fn(|k| x[at(lane, k)]));
                (positions, std::array::from_fn(|lane| std::array::from_fn(|k| rows[at(lane, k)])))
            })
            .collect()
    }

    #[test]
    fn verdicts_agree_with_the_exact_predicates() {
        let (mut apart_count, mut meet_count, mut open_count) = (0, 0, 0);
        for (positions, rows) in groups(40_000) {
            let rows = rows.each_ref().map(<[Row; 6]>::each_ref);
            let joined = rows.map(|[common, a, b, _, p, q]| [common, a, b, p, q]);
            let apart = [eight_triangles_maybe_apart(&rows), eight_triangles_apart(&rows)];
            let [decided_apart, decided_meet] = eight_triangles_decided(&rows);
            let joined_apart = eight_joined_triangles_apart(&joined);
            for lane in 0..8 {
                let is = |bits: u32| bits >> lane & 1 == 1;
                let p = positions[lane];
                let meets = triangles_meet(&[p[0], p[1], p[2]], &[p[3], p[4], p[5]]);
                let says_apart = is(apart[0]) || is(apart[1]) || is(decided_apart);
                assert!(!(says_apart && meets), "{apart:?} {decided_apart} {p:?}");
                assert!(!is(decided_meet) || meets, "{p:?}");
                let joined_meet = segment_meets_triangle(&[p[1], p[2]], &[p[0], p[4], p[5]])
                    || segment_meets_triangle(&[p[4], p[5]], &[p[0], p[1], p[2]]);
                assert!(!(is(joined_apart) && joined_meet), "joined {p:?}");
                apart_count += usize::from(says_apart);
                meet_count += usize::from(is(decided_meet));
                open_count += usize::from(!says_apart && !is(decided_meet));
            }
        }
        let counts = (apart_count, meet_count, open_count);
        assert!(apart_count > 50_000 && meet_count > 5_000 && open_count > 5_000, "{counts:?}");
    }

    #[test]
    fn one_lane_answers_as_eight() {
        for (_, rows) in groups(500) {
            let references = rows.each_ref().map(<[Row; 6]>::each_ref);
            let decided = eight_triangles_decided(&references);
            let (maybe, apart) =
                (eight_triangles_maybe_apart(&references), eight_triangles_apart(&references));
            for lane in 0..8 {
                let p = rows[lane].map(|row| Vector([row[0], row[1], row[2]]));
                let (is_apart, meets) = triangles_decided(&p);
                assert_eq!([is_apart, meets], decided.map(|bits| bits >> lane & 1 == 1));
                assert_eq!(triangles_maybe_apart(&p), maybe >> lane & 1 == 1);
                assert_eq!(triangles_apart(&p), apart >> lane & 1 == 1);
            }
        }
    }
}
