//! Closest points against brute sampling, in every region, and for degenerate shapes.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_collision::Vec3;
use cloth_collision::distance::edge_edge::closest_points;
use cloth_collision::distance::vertex_triangle::closest_point;
use support::Random;

/// Steps of the sampling grid, refined about its best point until steps are below 1e-9.
const GRID: usize = 16;
/// What sampling leaves, relative to sizes of about 1.
const SAMPLING: f64 = 1e-7;

/// Smallest value of f on the square [0, 1]², f convex.
fn sampled_minimum(f: impl Fn(f64, f64) -> f64) -> f64 {
    let (mut centre, mut half, mut best) = ([0.5, 0.5], 0.5, f64::INFINITY);
    while half > 1e-9 {
        let mut next = centre;
        for i in 0..=GRID {
            for j in 0..=GRID {
                let at = |c: f64, k: usize| (c + half * (2.0 * k as f64 / GRID as f64 - 1.0)).clamp(0.0, 1.0);
                let (s, t) = (at(centre[0], i), at(centre[1], j));
                let value = f(s, t);
                if value < best {
                    best = value;
                    next = [s, t];
                }
            }
        }
        centre = next;
        half *= 0.4;
    }
    best
}

fn triangle_distance(p: &[Vec3; 4], w: &[f64; 3]) -> f64 {
    (p[1] * w[0] + p[2] * w[1] + p[3] * w[2] - p[0]).norm()
}

fn edge_distance(p: &[Vec3; 4], s: f64, t: f64) -> f64 {
    (p[0] * (1.0 - s) + p[1] * s - p[2] * (1.0 - t) - p[3] * t).norm()
}

fn check_triangle(p: &[Vec3; 4]) -> [f64; 3] {
    let w = closest_point(p);
    assert!(
        w.iter().all(|&w| (0.0..=1.0).contains(&w)) && (w.iter().sum::<f64>() - 1.0).abs() < 1e-12,
        "{w:?}"
    );
    let found = triangle_distance(p, &w);
    // The unit square onto the triangle: (s, t) -> s along the fan of t between b and c.
    let sampled = sampled_minimum(|s, t| triangle_distance(p, &[1.0 - s, s * (1.0 - t), s * t]));
    // (not convex in (s, t) near a: the corner is looked at by itself)
    let sampled = sampled.min((p[1] - p[0]).norm());
    assert!(found <= sampled + SAMPLING, "{found} but {sampled} was sampled: {p:?}");
    w
}

fn check_edges(p: &[Vec3; 4]) -> (f64, f64) {
    let (s, t) = closest_points(p);
    assert!((0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t));
    let found = edge_distance(p, s, t);
    let sampled = sampled_minimum(|s, t| edge_distance(p, s, t));
    assert!(found <= sampled + SAMPLING, "{found} but {sampled} was sampled: {p:?}");
    (s, t)
}

#[test]
fn the_seven_regions_of_a_triangle() {
    let [a, b, c] = [Vec3::new(0.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.3, 0.0, 0.9)];
    let centre = (a + b + c) / 3.0;
    let out = |p: Vec3| p + (p - centre);
    for height in [0.0, 1e-12, 0.5, -10.0] {
        let up = Vec3::new(0.0, height, 0.0);
        let zeros = |p: Vec3| check_triangle(&[p + up, a, b, c]).map(|w| w == 0.0);
        assert_eq!(zeros(centre), [false; 3], "face");
        assert_eq!(zeros(out((a + b) / 2.0)), [false, false, true], "side ab");
        assert_eq!(zeros(out((b + c) / 2.0)), [true, false, false], "side bc");
        assert_eq!(zeros(out((c + a) / 2.0)), [false, true, false], "side ca");
        assert_eq!(zeros(out(a)), [false, true, true], "corner a");
        assert_eq!(zeros(out(b)), [true, false, true], "corner b");
        assert_eq!(zeros(out(c)), [true, true, false], "corner c");
    }
}

#[test]
fn around_the_borders_of_the_regions() {
    let [a, b, c] = [Vec3::new(0.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.3, 0.0, 0.9)];
    for base in [a, b, c, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0] {
        for x in [-1e-9, 0.0, 1e-9] {
            for z in [-1e-9, 0.0, 1e-9] {
                check_triangle(&[base + Vec3::new(x, 0.1, z), a, b, c]);
            }
        }
    }
}

#[test]
fn random_pairs() {
    let mut random = Random(3);
    for _ in 0..1500 {
        let p: [Vec3; 4] = std::array::from_fn(|_| random.vector(1.0));
        check_triangle(&p);
        check_edges(&p);
    }
}

#[test]
fn triangles_without_area() {
    let mut random = Random(4);
    for _ in 0..200 {
        let (p, a, d) = (random.vector(1.0), random.vector(1.0), random.vector(1.0));
        check_triangle(&[p, a, a + d, a - d * 0.5]);
        check_triangle(&[p, a, a, a + d]);
        check_triangle(&[p, a, a, a]);
    }
}

#[test]
fn parallel_and_zero_length_edges() {
    let mut random = Random(5);
    for tilt in [0.0, 1e-14, 1e-9, 1e-5] {
        for _ in 0..200 {
            let (a, d, b) = (random.vector(1.0), random.vector(1.0), random.vector(1.0));
            check_edges(&[a, a + d, b, b + d * random.within(2.0) + random.vector(tilt)]);
            check_edges(&[a, a, b, b + d]);
            check_edges(&[a, a, b, b]);
        }
    }
}

#[test]
#[should_panic(expected = "was sampled")]
fn a_wrong_closest_point_is_noticed() {
    let p = [Vec3::y(), Vec3::zeros(), Vec3::x(), Vec3::z()];
    let sampled = sampled_minimum(|s, t| triangle_distance(&p, &[1.0 - s, s * (1.0 - t), s * t]));
    let found = triangle_distance(&p, &[0.0, 1.0, 0.0]);
    assert!(found <= sampled + SAMPLING, "{found} but {sampled} was sampled");
}
