//! Rejects, with derived error bounds, pairs that certainly stay apart: many at once, without branches.
//!
//! Two questions. Are the four points never coplanar (the Bernstein coefficients of the cubic all have one sign)? Does one
//! fixed direction separate the features during the whole step? The direction comes from Gilbert's algorithm for
//! the point nearest to the origin in the hull of the differences at both ends of the step.
//!
//! Source: E. G. Gilbert, "An Iterative Procedure for Computing the Minimum of a Quadratic Form on a Convex Set", 1966.

use super::ROUNDING;
pub(crate) use super::lanes::Row;
use super::lanes::{Lanes, Vector};
use crate::{StencilKind, Vec3};

/// Directions of Gilbert's algorithm that are tried: more cost more than the exact searches that they save.
pub(crate) const MANY: usize = 5;

/// Directions for features at rest.
const AT_REST: usize = 3;

/// Eight points (four at t0, the same four at t1) of as many pairs as there are lanes.
pub(crate) type Points<L> = [Vector<L>; 8];

/// Bernstein coefficients on \[0, 1\] of det(x, y, z) of three vectors that move linearly from `[0]` to `[1]`, and an
/// error bound for the polynomial and its restrictions to a part of \[0, 1\].
///
/// Error, with u = 2⁻⁵³ and M the product of the largest coordinates, first order in u: a determinant has six products
/// of size ≤ M; evaluation costs 28uM, the relative u of each entry 18uM; the mean of three determinants for an inner
/// coefficient 16uM more; each of up to three restrictions in a row (three rounds of interpolation between values ≤ 6M)
/// 54uM, and the rounding of a time (slope ≤ 36M), twice, 36uM. Together 296uM < 10 [`ROUNDING`] M. A product that overflows gives an
/// infinite bound.
#[inline(always)]
pub(crate) fn determinant<L: Lanes>(x: [Vector<L>; 2], y: [Vector<L>; 2], z: [Vector<L>; 2]) -> ([L; 4], L) {
    let b = coefficients(x, y, z);
    let size = x[0].largest().max(x[1].largest())
        * y[0].largest().max(y[1].largest())
        * z[0].largest().max(z[1].largest());
    // 64 M overflows before a coefficient (≤ 6M) does.
    let error = size * L::splat(64.0) * L::splat(10.0 / 64.0 * ROUNDING) + L::splat(f64::MIN_POSITIVE);
    (b, error)
}

/// The Bernstein coefficients of [`determinant`].
#[inline(always)]
pub(crate) fn coefficients<L: Lanes>(x: [Vector<L>; 2], y: [Vector<L>; 2], z: [Vector<L>; 2]) -> [L; 4] {
    let yz0 = y[0].cross(z[0]);
    let yz1 = y[1].cross(z[1]);
    // Mixed part of the product: y0×z1 + y1×z0.
    let mixed = y[0].cross(z[1]) + y[1].cross(z[0]);
    let third = L::splat(1.0 / 3.0);
    [
        x[0].dot(yz0),
        (x[0].dot(mixed) + x[1].dot(yz0)) * third,
        (x[1].dot(mixed) + x[0].dot(yz1)) * third,
        x[1].dot(yz1),
    ]
}

/// Where the features certainly stay farther than `thickness` apart during the step, as [`MANY`] directions or the cubic
/// show.
#[inline(always)]
pub(crate) fn apart<L: Lanes>(kind: StencilKind, p: &Points<L>, thickness: f64) -> L::Mask {
    match kind {
        StencilKind::VertexTriangle => {
            let d = vertex_triangle_differences(p);
            let apart = separated::<L, 6, MANY>(&d, thickness, Errors::of_doubles(&d));
            if thickness > 0.0 {
                return apart;
            }
            apart | rootless(determinant([d[0], d[3]], [d[1], d[4]], [d[2], d[5]]))
        }
        StencilKind::EdgeEdge => {
            let d = edge_edge_differences(p);
            let apart = separated::<L, 8, MANY>(&d, thickness, Errors::of_doubles(&d));
            if thickness > 0.0 {
                return apart;
            }
            apart
                | rootless(determinant([d[0], d[4]], [p[1] - p[0], p[5] - p[4]], [p[3] - p[2], p[7] - p[6]]))
        }
    }
}

/// The triangle's corners less the vertex, at t0 and at t1.
#[inline(always)]
pub(crate) fn vertex_triangle_differences<L: Lanes>(p: &Points<L>) -> [Vector<L>; 6] {
    [p[1] - p[0], p[2] - p[0], p[3] - p[0], p[5] - p[4], p[6] - p[4], p[7] - p[4]]
}

/// The ends of the first edge less those of the second, at t0 and at t1.
#[inline(always)]
pub(crate) fn edge_edge_differences<L: Lanes>(p: &Points<L>) -> [Vector<L>; 8] {
    [p[0] - p[2], p[0] - p[3], p[1] - p[2], p[1] - p[3], p[4] - p[6], p[4] - p[7], p[5] - p[6], p[5] - p[7]]
}

/// Where the coefficients, known to ± the error, have one sign.
#[inline(always)]
pub(crate) fn rootless<L: Lanes>((b, error): ([L; 4], L)) -> L::Mask {
    let below = L::splat(0.0) - error;
    let lowest = b[0].min(b[1]).min(b[2]).min(b[3]);
    let highest = b[0].max(b[1]).max(b[2]).max(b[3]);
    // A coefficient that is not a number is lost in the minimum only beside an infinite error bound.
    lowest.greater(error) | below.greater(highest)
}

/// How far n·d − thickness |n| may be off: `rounding` (|n|₁ `extent` + thickness |n|) + `least`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Errors<L> {
    pub(crate) extent: L,
    pub(crate) rounding: f64,
    pub(crate) least: f64,
}

impl<L: Lanes> Errors<L> {
    /// In double precision: with u = 2⁻⁵³, differences carry u per coordinate, the dot product 3u, |n| 4u and its product
    /// with the thickness u: in all less than [`ROUNDING`] (|n|₁ max|d| + thickness |n|).
    #[inline(always)]
    fn of_doubles<const N: usize>(d: &[Vector<L>; N]) -> Self {
        let mut extent = d[0].largest();
        for k in 1..N {
            extent = extent.max(d[k].largest());
        }
        Self { extent, rounding: ROUNDING, least: f64::MIN_POSITIVE }
    }
}

/// Where a direction is found along which all differences lie beyond the thickness, at both ends and so in between.
#[inline(always)]
pub(crate) fn separated<L: Lanes, const N: usize, const STEPS: usize>(
    d: &[Vector<L>; N],
    thickness: f64,
    errors: Errors<L>,
) -> L::Mask {
    let mut sum = d[0];
    for k in 1..N {
        sum = sum + d[k];
    }
    let mut n = sum.scale(L::splat(1.0 / N as f64));
    let zero = L::splat(0.0);
    let mut apart = zero.greater(zero);
    for step in 0..STEPS {
        let (mut lowest, mut corner) = (n.dot(d[0]), d[0]);
        for k in 1..N {
            let g = n.dot(d[k]);
            let lower = lowest.greater(g);
            corner = Vector::select(lower, d[k], corner);
            lowest = L::select(lower, g, lowest);
        }
        let mut size = n.sum_of_sizes() * errors.extent;
        let mut needed = L::splat(errors.least);
        if thickness > 0.0 {
            let offset = n.dot(n).sqrt() * L::splat(thickness);
            size = size + offset;
            needed = needed + offset;
        }
        apart = apart | lowest.greater(needed + size * L::splat(errors.rounding));
        if step + 1 < STEPS {
            // Nearest point to the origin on the segment from n to the corner.
            let back = n - corner;
            let along = (n.dot(back) / back.dot(back)).max(zero).min(L::splat(1.0));
            n = n - back.scale(along);
        }
    }
    apart
}

/// Where a vertex (first point) is certainly farther than `thickness` from a triangle (last three), all at rest.
#[inline(always)]
fn vertex_triangle_beyond<L: Lanes>(p: &[Vector<L>; 4], thickness: f64) -> L::Mask {
    let d = [p[0] - p[1], p[0] - p[2], p[0] - p[3]];
    separated::<L, 3, AT_REST>(&d, thickness, Errors::of_doubles(&d))
}

/// Where an edge (first two points) is certainly farther than `thickness` from another (last two), all at rest.
#[inline(always)]
fn edge_edge_beyond<L: Lanes>(p: &[Vector<L>; 4], thickness: f64) -> L::Mask {
    let d = [p[0] - p[2], p[0] - p[3], p[1] - p[2], p[1] - p[3]];
    separated::<L, 4, AT_REST>(&d, thickness, Errors::of_doubles(&d))
}

/// Copies positions into rows.
pub(crate) fn row(x: &Vec3) -> Row {
    [x.x, x.y, x.z, 0.0]
}

macro_rules! four_at_once {
    ($name:ident, $avx:ident, $one:ident, $points:literal) => {
        /// Bit per pair (`rows[pair][point]`): it is certainly apart.
        #[inline]
        pub(crate) fn $name(rows: &[[&Row; $points]; 4], thickness: f64) -> u32 {
            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has AVX2.
                return unsafe { $avx(rows, thickness) };
            }
            let mut bits = 0;
            for (lane, points) in rows.iter().enumerate() {
                let points = points.map(|row| Vector([row[0], row[1], row[2]]));
                bits |= u32::from($one(&points, thickness)) << lane;
            }
            bits
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn $avx(rows: &[[&Row; $points]; 4], thickness: f64) -> u32 {
            use super::lanes::Mask;
            use super::lanes::avx::Four;
            let mut points = [Vector([Four::splat(0.0); 3]); $points];
            for k in 0..$points {
                // SAFETY: this function runs only where the processor has AVX2.
                points[k] = Vector(unsafe {
                    Four::load_transposed([rows[0][k], rows[1][k], rows[2][k], rows[3][k]])
                });
            }
            $one(&points, thickness).bits()
        }
    };
}
four_at_once!(four_vertex_triangles_beyond, four_vertex_triangles_beyond_avx2, vertex_triangle_beyond, 4);
four_at_once!(four_edge_edges_beyond, four_edge_edges_beyond_avx2, edge_edge_beyond, 4);

/// Calls `survivor` with each item that the filter does not reject: `points` names an item's rows, `apart` answers for
/// `LANES` items.
#[inline]
pub(crate) fn filter<'a, T: Copy, R: 'a, const N: usize, const LANES: usize>(
    items: &[T],
    points: impl Fn(&T) -> [&'a R; N],
    apart: impl Fn(&[[&'a R; N]; LANES]) -> u32,
    mut survivor: impl FnMut(T),
) {
    in_lanes(items, points, apart, |item, apart, lane| {
        if apart >> lane & 1 == 0 {
            survivor(item);
        }
    });
}

/// Calls `each` with each item, the answer for its group of `LANES` items and its lane there.
#[inline]
pub(crate) fn in_lanes<'a, T: Copy, R: 'a, A: Copy, const N: usize, const LANES: usize>(
    items: &[T],
    points: impl Fn(&T) -> [&'a R; N],
    answer: impl Fn(&[[&'a R; N]; LANES]) -> A,
    mut each: impl FnMut(T, A, usize),
) {
    let (full, rest) = items.as_chunks::<LANES>();
    for items in full {
        let mut rows = [points(&items[0]); LANES];
        for lane in 1..LANES {
            rows[lane] = points(&items[lane]);
        }
        let answer = answer(&rows);
        for lane in 0..LANES {
            each(items[lane], answer, lane);
        }
    }
    let Some(last) = rest.last() else { return };
    let mut rows = [points(last); LANES];
    for (lane, item) in rest.iter().enumerate() {
        rows[lane] = points(item);
    }
    let answer = answer(&rows);
    for (lane, &item) in rest.iter().enumerate() {
        each(item, answer, lane);
    }
}
