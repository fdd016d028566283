//! Lower bounds of the distance of two features at rest: eight pairs at once, in single precision.
//!
//! Every direction n gives one: the features' differences d_k have n·d_k ≥ m, so the features are m/|n| apart. Gilbert's
//! algorithm turns n towards the shortest difference. With u = 2⁻²⁴ and the largest coordinate M of the differences: those
//! carry u each, the dot product 3u|n|₁M, |n| 4u, the quotient u: in all less than 4u √3 M + 6u √3 M < 2⁻¹⁹ M, which is
//! taken off. The rest of that, over 1e-6 M, is more than the width within which the narrow phase may call a pair that is
//! not quite in contact one (1e-9 of its size), so that it cannot see a contact in a pair that this bound rejects.
//!
//! Source: E. G. Gilbert, "An Iterative Procedure for Computing the Minimum of a Quadratic Form on a Convex Set", 1966.

use crate::ccd::lanes::{Lanes, Vector};

/// A position in single precision, and an entry of no meaning.
pub(crate) type Row = [f32; 4];
/// Pairs at once.
pub(super) const PAIRS: usize = 8;

/// Directions tried; more sharpen the bound by less than they cost, by measurement.
const STEPS: usize = 4;
/// Of the largest coordinate.
const ERROR: f64 = 1.0 / (1 << 19) as f64;
/// Directions shorter than the root of this [m] are passed over: their products may lose digits to underflow.
const SHORTEST_SQUARED: f64 = 1e-24;

/// The bound for differences `d`, ≥ 0, rounded down by far more than sums of such bounds round.
#[inline(always)]
fn bound<L: Lanes, const N: usize>(d: &[Vector<L>; N]) -> L {
    let mut extent = d[0].largest();
    let mut sum = d[0];
    for k in 1..N {
        extent = extent.max(d[k].largest());
        sum = sum + d[k];
    }
    let zero = L::splat(0.0);
    let mut n = sum.scale(L::splat(1.0 / N as f64));
    let mut best = zero;
    for step in 0..STEPS {
        let (mut lowest, mut corner) = (n.dot(d[0]), d[0]);
        for k in 1..N {
            let g = n.dot(d[k]);
            let lower = lowest.greater(g);
            corner = Vector::select(lower, d[k], corner);
            lowest = L::select(lower, g, lowest);
        }
        let square = n.dot(n);
        let along_n = lowest / square.sqrt();
        best = L::select(square.greater(L::splat(SHORTEST_SQUARED)), along_n.max(best), best);
        if step + 1 < STEPS {
            // Nearest point to the origin on the segment from n to the corner.
            let back = n - corner;
            let along = (n.dot(back) / back.dot(back)).max(zero).min(L::splat(1.0));
            n = n - back.scale(along);
        }
    }
    let below = best * L::splat(1.0 - ERROR) - extent * L::splat(ERROR);
    // What overflowed is no number or infinite: it bounds nothing.
    let is_bound = below.greater(zero) & L::splat(f64::from(f32::MAX)).greater(below);
    L::select(is_bound, below, zero)
}

#[inline(always)]
fn vertex_triangle<L: Lanes>(p: &[Vector<L>; 4]) -> L {
    bound(&[p[0] - p[1], p[0] - p[2], p[0] - p[3]])
}

#[inline(always)]
fn edge_edge<L: Lanes>(p: &[Vector<L>; 4]) -> L {
    bound(&[p[0] - p[2], p[0] - p[3], p[1] - p[2], p[1] - p[3]])
}

macro_rules! eight_at_once {
    ($name:ident, $avx:ident, $one:ident) => {
        /// For each pair (`rows[pair][point]`) a length [m] that its features are certainly apart, or zero.
        #[inline]
        pub(super) fn $name(rows: &[[&Row; 4]; PAIRS]) -> [f32; PAIRS] {
            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has AVX2.
                return unsafe { $avx(rows) };
            }
            plain(rows, $one::<f32>)
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn $avx(rows: &[[&Row; 4]; PAIRS]) -> [f32; PAIRS] {
            use crate::ccd::lanes::avx::Eight;
            let mut points = [Vector([Eight::splat(0.0); 3]); 4];
            for k in 0..4 {
                let of_pair = |pair: usize| rows[pair][k];
                // SAFETY: this function runs only where the processor has AVX2.
                points[k] = Vector(unsafe {
                    Eight::load_transposed([
                        of_pair(0),
                        of_pair(1),
                        of_pair(2),
                        of_pair(3),
                        of_pair(4),
                        of_pair(5),
                        of_pair(6),
                        of_pair(7),
                    ])
                });
            }
            $one(&points).to_array()
        }
    };
}
eight_at_once!(eight_vertex_triangles, eight_vertex_triangles_avx2, vertex_triangle);
eight_at_once!(eight_edge_edges, eight_edge_edges_avx2, edge_edge);

#[inline]
fn plain(rows: &[[&Row; 4]; PAIRS], one: impl Fn(&[Vector<f32>; 4]) -> f32) -> [f32; PAIRS] {
    rows.map(|points| one(&points.map(|row| Vector([row[0], row[1], row[2]]))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::distance::{edge_edge as exact_edges, vertex_triangle as exact_triangle};

    fn random(state: &mut u64) -> f32 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((*state >> 40) as f32) / (1 << 23) as f32 - 1.0
    }

    fn scene(state: &mut u64) -> [Row; 4] {
        let size = [1.0, 1e-3, 1e6][(state.wrapping_mul(31) >> 60) as usize % 3];
        [(); 4].map(|()| [random(state) * size, random(state) * size, random(state) * size, 0.0])
    }

    fn distances(rows: &[Row; 4]) -> [f64; 2] {
        let p = rows.map(|r| Vec3::new(f64::from(r[0]), f64::from(r[1]), f64::from(r[2])));
        let w = exact_triangle::closest_point(&p);
        let of_triangle = (p[0] - p[1] * w[0] - p[2] * w[1] - p[3] * w[2]).norm();
        let (s, t) = exact_edges::closest_points(&p);
        let of_edges = (p[0] * (1.0 - s) + p[1] * s - p[2] * (1.0 - t) - p[3] * t).norm();
        [of_triangle, of_edges]
    }

    #[test]
    fn bounds_are_below_the_distance_and_near_it() {
        const SCENES: usize = 4000;
        let mut state = 7;
        let mut share = [0.0, 0.0];
        for _ in 0..SCENES {
            let rows = scene(&mut state);
            let points = [[&rows[0], &rows[1], &rows[2], &rows[3]]; PAIRS];
            let bounds = [eight_vertex_triangles(&points)[0], eight_edge_edges(&points)[3]];
            for (k, exact) in distances(&rows).into_iter().enumerate() {
                assert!(f64::from(bounds[k]) <= exact * (1.0 - 1e-6), "{} > {exact}", bounds[k]);
                share[k] += f64::from(bounds[k]) / exact;
            }
        }
        assert!(share.iter().all(|s| *s > 0.8 * SCENES as f64), "{share:?}");
    }

    #[test]
    fn all_lanes_at_once_answer_as_one_by_one() {
        let mut state = 3;
        for _ in 0..500 {
            let scenes = [(); PAIRS].map(|()| scene(&mut state));
            let rows = scenes.each_ref().map(|r| [&r[0], &r[1], &r[2], &r[3]]);
            assert_eq!(eight_vertex_triangles(&rows), plain(&rows, vertex_triangle::<f32>));
            assert_eq!(eight_edge_edges(&rows), plain(&rows, edge_edge::<f32>));
        }
    }

    #[test]
    fn what_overflows_or_vanishes_bounds_nothing() {
        for size in [1e-30f32, 1e25, 3e38] {
            let rows = [[0.0, size, 0.0, 0.0], [size, 0.0, 0.0, 0.0], [0.0, 0.0, size, 0.0], [0.0; 4]];
            let points = [[&rows[0], &rows[1], &rows[2], &rows[3]]; PAIRS];
            for bound in [eight_vertex_triangles(&points)[0], eight_edge_edges(&points)[0]] {
                assert!(bound >= 0.0 && bound <= size, "{bound}");
            }
        }
    }
}
