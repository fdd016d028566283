//! The first filter of a batch: the questions of [`super::filter`] in single precision, which is twice as fast.
//!
//! Coordinates are relative to the scene's middle and scaled by a power of two, so that none is larger than 1
//! ([`super::motions`]); errors are bounded for all pairs at once. With u = 2⁻²⁴, first order in u:
//!
//! * A coordinate q, narrowed from a double of size ≤ 1, is off by u (2⁻⁵³ |q| of the double itself and 2⁻¹⁵⁰ of underflow
//!   are nothing beside the room below); a difference of two, of size ≤ 2, by 2u for these and 2u for its rounding: e = 4u.
//! * n·d is off by e|n|₁ and by its own rounding, 3u · 2|n|₁: together 10u|n|₁. |n| carries 4u, the thickness u, their product
//!   and the difference u each: 7u of thickness |n|. [`ROUNDING`] = 16u leaves room for the higher orders.
//! * A coefficient of the cubic is a mean of determinants of six products. With X, Y, Z the largest coordinates of the three
//!   vectors: the entries' errors add 6e (XY + YZ + ZX) = 24u (XY + YZ + ZX), the arithmetic 44u XYZ (28u a determinant, 16u
//!   the mean, as in [`super::filter::determinant`]). The higher orders of the entries' errors, 6e² (X + Y + Z) + 6e³, are
//!   below 32u (X′Y′ + Y′Z′ + Z′X′) − 24u (XY + YZ + ZX) with X′ = X + 16u and so on.
//! * What underflows is below 2⁻¹⁴⁰ in all: the least normal number covers it.
//!
//! The other way round, a pair with two points nearer than the thickness at the start is in contact, from time 0 on, and no
//! question in double precision can say anything else. The vector r between two points is a mean of differences with weights ≥ 0:
//!
//! * A coordinate of r is off by 4u for the differences, 8u for the evaluation, and 6u to 8u because the weights add up to 1 only to
//!   3u to 4u: 20u, and |r| by 35u. Its square is off by 4u of itself.
//! * With |r| ≤ (1 − 16u) thickness − 64u the distance is below the thickness by 29u and by 12u of the thickness: far more than the
//!   error bounds of any question in double precision, a few hundred 2⁻⁵³.

use super::filter::{
    Errors, Points, coefficients, edge_edge_differences, rootless, separated, vertex_triangle_differences,
};
use super::lanes::{Lanes, Vector};
use crate::StencilKind;
use crate::distance::edge_edge::parameters;
use crate::distance::vertex_triangle::weights;

/// Directions of Gilbert's algorithm that are tried on all pairs, and on those that are left, by measurement.
const FIRST: usize = 1;
const MORE: usize = 7;
/// u, the unit of the error bounds.
pub(crate) const UNIT: f64 = 1.0 / (1 << 24) as f64;

/// Where the features certainly stay farther than `thickness` apart during the step. The points and the thickness are
/// those of [`super::motions::Motions`], `unit` is [`UNIT`].
#[inline(always)]
pub(crate) fn apart<S: Lanes>(kind: StencilKind, p: &Points<S>, thickness: f64, unit: f64) -> S::Mask {
    let errors = errors(unit);
    let is_thin = thickness == 0.0;
    match kind {
        StencilKind::VertexTriangle => {
            let d = vertex_triangle_differences(p);
            let apart = separated::<S, 6, FIRST>(&d, thickness, errors);
            if !is_thin {
                return apart;
            }
            apart | never_coplanar([d[0], d[3]], [d[1], d[4]], [d[2], d[5]], unit)
        }
        StencilKind::EdgeEdge => {
            let d = edge_edge_differences(p);
            let apart = separated::<S, 8, FIRST>(&d, thickness, errors);
            if !is_thin {
                return apart;
            }
            let (u, v) = ([p[1] - p[0], p[5] - p[4]], [p[3] - p[2], p[7] - p[6]]);
            apart | never_coplanar([d[0], d[4]], u, v, unit)
        }
    }
}

/// [`apart`] by more directions, without the cubic: for the pairs that it leaves.
#[inline(always)]
pub(crate) fn apart_by_more<S: Lanes>(
    kind: StencilKind,
    p: &Points<S>,
    thickness: f64,
    unit: f64,
) -> S::Mask {
    match kind {
        StencilKind::VertexTriangle => {
            separated::<S, 6, MORE>(&vertex_triangle_differences(p), thickness, errors(unit))
        }
        StencilKind::EdgeEdge => separated::<S, 8, MORE>(&edge_edge_differences(p), thickness, errors(unit)),
    }
}

/// Where two points of the features are certainly nearer than `thickness` at the start of the step.
#[inline(always)]
pub(crate) fn touching<S: Lanes>(kind: StencilKind, p: &Points<S>, thickness: f64, unit: f64) -> S::Mask {
    let between = match kind {
        StencilKind::VertexTriangle => {
            let w = weights([p[0], p[1], p[2], p[3]]);
            (p[1] - p[0]).scale(w[0]) + (p[2] - p[0]).scale(w[1]) + (p[3] - p[0]).scale(w[2])
        }
        StencilKind::EdgeEdge => {
            let (s, t) = parameters([p[0], p[1], p[2], p[3]]);
            let (from, to) = ((p[0] - p[2]).mix(p[0] - p[3], t), (p[1] - p[2]).mix(p[1] - p[3], t));
            from.mix(to, s)
        }
    };
    let reach = (thickness * (1.0 - 16.0 * unit) - 64.0 * unit).max(0.0);
    S::splat(reach * reach).greater(between.norm_squared())
}

#[inline(always)]
fn errors<S: Lanes>(unit: f64) -> Errors<S> {
    Errors { extent: S::splat(1.0), rounding: 16.0 * unit, least: f64::from(f32::MIN_POSITIVE) }
}

/// Where det(x, y, z) certainly has no root.
#[inline(always)]
fn never_coplanar<S: Lanes>(x: [Vector<S>; 2], y: [Vector<S>; 2], z: [Vector<S>; 2], unit: f64) -> S::Mask {
    let more = S::splat(16.0 * UNIT);
    let a = x[0].largest().max(x[1].largest()) + more;
    let b = y[0].largest().max(y[1].largest()) + more;
    let c = z[0].largest().max(z[1].largest()) + more;
    let error = (a * b * c) * S::splat(64.0 * unit)
        + (a * b + b * c + c * a) * S::splat(32.0 * unit)
        + S::splat(f64::from(f32::MIN_POSITIVE));
    rootless((coefficients(x, y, z), error))
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{MAX_SINGLES, Singles};
    use super::super::motions::Motions;
    use super::*;
    use crate::Vec3;

    /// How many of the pairs at rest (4 points each) each filter rejects, and how many touch.
    fn verdicts(kind: StencilKind, x: &[Vec3], thickness: f64, unit: f64) -> [usize; 3] {
        let motions = Motions::new(x, x, thickness);
        let points = |pair: u32| {
            let rows = motions.small_rows(&[0, 1, 2, 3].map(|k| 4 * pair + k));
            let mut points = [Vector([0.0_f32; 3]); 8];
            for k in 0..4 {
                [points[k], points[k + 4]] = f32::gather(&[rows; MAX_SINGLES], k);
            }
            points
        };
        let (pairs, small) = (|| (0..x.len() as u32 / 4).map(points), motions.small_thickness);
        [
            pairs().filter(|p| apart(kind, p, small, unit)).count(),
            pairs().filter(|p| apart_by_more(kind, p, small, unit)).count(),
            pairs().filter(|p| touching(kind, p, small, unit)).count(),
        ]
    }

    /// How many each filter rejects.
    fn rejected(kind: StencilKind, x: &[Vec3], thickness: f64, unit: f64) -> [usize; 2] {
        let [first, second, _] = verdicts(kind, x, thickness, unit);
        [first, second]
    }

    /// How many touch.
    fn touches(kind: StencilKind, x: &[Vec3], thickness: f64, unit: f64) -> usize {
        verdicts(kind, x, thickness, unit)[2]
    }

    /// Pairs that are `height` apart at their middles: four points each.
    fn pairs(kind: StencilKind, height: f64) -> Vec<Vec3> {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut x = vec![];
        for _ in 0..4000 {
            let [a, b, c]: [Vec3; 3] = std::array::from_fn(|_| Vec3::new(random(), random(), random()));
            let n = (b - a).cross(&(c - a)).normalize() * height;
            match kind {
                StencilKind::VertexTriangle => x.extend([(a + b + c) / 3.0 + n, a, b, c]),
                StencilKind::EdgeEdge => x.extend([a + n, b + c - a + n, b, c]),
            }
        }
        x
    }

    #[test]
    fn touching_pairs_stay_and_would_be_lost_without_the_error_bound() {
        for kind in [StencilKind::VertexTriangle, StencilKind::EdgeEdge] {
            for thickness in [0.0, 0.01] {
                // To rounding: a little below the thickness.
                let x = pairs(kind, thickness * (1.0 - 1e-12));
                assert_eq!(rejected(kind, &x, thickness, UNIT), [0, 0], "{kind:?} {thickness}");
                let lost = rejected(kind, &x, thickness, 0.0);
                assert!(lost.iter().sum::<usize>() > 5, "{kind:?} {thickness}: {lost:?} would be lost");
            }
        }
    }

    #[test]
    fn pairs_apart_are_rejected() {
        for kind in [StencilKind::VertexTriangle, StencilKind::EdgeEdge] {
            let x = pairs(kind, 0.011);
            for thickness in [0.0, 0.01] {
                let rejected = rejected(kind, &x, thickness, UNIT);
                assert!(rejected.iter().all(|&n| n > 1000), "{kind:?} {thickness}: {rejected:?} of 4000");
            }
        }
    }

    #[test]
    fn pairs_just_apart_do_not_touch_and_would_without_the_error_bound() {
        for kind in [StencilKind::VertexTriangle, StencilKind::EdgeEdge] {
            for thickness in [0.01, 1.0] {
                // To rounding: a little above the thickness.
                let x = pairs(kind, thickness * (1.0 + 1e-12));
                assert_eq!(touches(kind, &x, thickness, UNIT), 0, "{kind:?} {thickness}");
                let wrong = touches(kind, &x, thickness, 0.0);
                assert!(wrong > 5, "{kind:?} {thickness}: {wrong} would touch");
            }
        }
    }

    #[test]
    fn pairs_nearer_than_the_thickness_touch() {
        for kind in [StencilKind::VertexTriangle, StencilKind::EdgeEdge] {
            for height in [0.0, 0.0099] {
                let touching = touches(kind, &pairs(kind, height), 0.01, UNIT);
                assert_eq!(touching, 4000, "{kind:?} {height}");
            }
            assert_eq!(touches(kind, &pairs(kind, 0.0), 0.0, UNIT), 0, "{kind:?}: no thickness");
        }
    }

    #[test]
    fn coordinates_out_of_range_say_nothing() {
        let mut x = pairs(StencilKind::VertexTriangle, 0.1);
        for v in &mut x {
            *v = *v * 3e307 - Vec3::repeat(1.5e308);
        }
        x.extend([Vec3::repeat(1.7e308), Vec3::repeat(-1.7e308), Vec3::zeros(), Vec3::zeros()]);
        for thickness in [0.0, 1e308] {
            assert_eq!(verdicts(StencilKind::VertexTriangle, &x, thickness, UNIT), [0, 0, 0], "{thickness}");
        }
    }
}
