//! Single pairs: named degenerate cases, and times against dense sampling.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_collision::distance::{edge_edge, vertex_triangle};
use cloth_collision::{Vec3, edge_edge_ccd, vertex_triangle_ccd};
use support::Random;

/// A returned time is at most this much earlier than the true one, in fractions of the step.
const TIME_TOLERANCE: f64 = 1e-6;

type Ccd = fn(&[Vec3; 8], f64) -> Option<f64>;

fn at(p: &[Vec3; 8], t: f64) -> [Vec3; 4] {
    [0, 1, 2, 3].map(|k| p[k] * (1.0 - t) + p[k + 4] * t)
}

fn v(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Four points and their displacements.
fn moving(start: [Vec3; 4], by: [Vec3; 4]) -> [Vec3; 8] {
    let end = [0, 1, 2, 3].map(|k| start[k] + by[k]);
    [start[0], start[1], start[2], start[3], end[0], end[1], end[2], end[3]]
}

const O: Vec3 = Vec3::new(0.0, 0.0, 0.0);

/// Name, pair, true first time (None: no contact). All coordinates are exact after the shifts below.
fn vertex_triangle_cases() -> Vec<(&'static str, [Vec3; 8], Option<f64>)> {
    let tri = [v(0.0, 0.0, 0.0), v(4.0, 0.0, 0.0), v(0.0, 0.0, 4.0)];
    let with = |p: Vec3| [p, tri[0], tri[1], tri[2]];
    let only = |by: Vec3| [by, O, O, O];
    vec![
        ("through the face", moving(with(v(1.0, 1.0, 1.0)), only(v(0.0, -2.0, 0.0))), Some(0.5)),
        ("stops on the face", moving(with(v(1.0, 1.0, 1.0)), only(v(0.0, -1.0, 0.0))), Some(1.0)),
        ("stops above the face", moving(with(v(1.0, 1.0, 1.0)), only(v(0.0, -0.875, 0.0))), None),
        ("leaves the face", moving(with(v(1.0, 0.0, 1.0)), only(v(0.0, 1.0, 0.0))), Some(0.0)),
        ("through a side", moving(with(v(2.0, 1.0, 0.0)), only(v(0.0, -2.0, 0.0))), Some(0.5)),
        ("through the slanted side", moving(with(v(2.0, 1.0, 2.0)), only(v(0.0, -2.0, 0.0))), Some(0.5)),
        ("through a corner", moving(with(v(4.0, 1.0, 0.0)), only(v(0.0, -2.0, 0.0))), Some(0.5)),
        ("past a side", moving(with(v(2.0, 1.0, -0.0625)), only(v(0.0, -2.0, 0.0))), None),
        ("past a corner", moving(with(v(4.0625, 1.0, 0.0)), only(v(0.0, -2.0, 0.0))), None),
        ("in the plane, into a side", moving(with(v(1.0, 0.0, -1.0)), only(v(0.0, 0.0, 4.0))), Some(0.25)),
        ("in the plane, into a corner", moving(with(v(5.0, 0.0, 0.0)), only(v(-2.0, 0.0, 0.0))), Some(0.5)),
        ("in the plane, past a corner", moving(with(v(6.0, 0.0, -1.0)), only(v(-4.0, 0.0, 0.0))), None),
        ("in the plane, along a side", moving(with(v(-1.0, 0.0, 0.0)), only(v(8.0, 0.0, 0.0))), Some(0.125)),
        ("in the plane, inside", moving(with(v(1.0, 0.0, 1.0)), only(v(0.5, 0.0, 0.0))), Some(0.0)),
        ("at rest, apart", moving(with(v(1.0, 1.0, 1.0)), [O; 4]), None),
        ("at rest, beside, in the plane", moving(with(v(3.0, 0.0, 3.0)), [O; 4]), None),
        ("at rest on the face", moving(with(v(1.0, 0.0, 1.0)), [O; 4]), Some(0.0)),
        ("at rest on a corner", moving(with(tri[1]), [O; 4]), Some(0.0)),
        ("moves together, apart", moving(with(v(1.0, 0.007_812_5, 1.0)), [v(64.0, -8.0, 32.0); 4]), None),
        (
            "teleport through",
            moving(with(v(1.0, 524_288.0, 1.0)), only(v(0.0, -1_048_576.0, 0.0))),
            Some(0.5),
        ),
        ("teleport past", moving(with(v(-0.0625, 524_288.0, 1.0)), only(v(0.0, -1_048_576.0, 0.0))), None),
        (
            "triangle sweeps over the vertex",
            moving(with(v(1.0, 1.0, 1.0)), [O, v(0.0, 4.0, 0.0), v(0.0, 4.0, 0.0), v(0.0, 4.0, 0.0)]),
            Some(0.25),
        ),
        (
            "triangle turns inside out beside the vertex",
            moving(with(v(8.0, 0.0, 0.0)), [O, v(0.0, 0.0, 4.0), O, v(0.0, 0.0, -4.0)]),
            None,
        ),
        (
            "triangle without area, a segment, hit",
            moving([v(2.0, 1.0, 0.0), O, v(2.0, 0.0, 0.0), v(4.0, 0.0, 0.0)], only(v(0.0, -2.0, 0.0))),
            Some(0.5),
        ),
        (
            "triangle without area, a segment, missed",
            moving([v(2.0, 1.0, 0.5), O, v(2.0, 0.0, 0.0), v(4.0, 0.0, 0.0)], only(v(0.0, -2.0, 0.0))),
            None,
        ),
        (
            "triangle without area, a point, hit",
            moving([v(0.0, 1.0, 0.0), O, O, O], only(v(0.0, -4.0, 0.0))),
            Some(0.25),
        ),
        ("all points one", moving([O; 4], [O; 4]), Some(0.0)),
        (
            "touches the tilting plane at the end",
            moving(
                with(v(1.0, 1.0, 1.0)),
                [v(0.0, -1.0, 0.0), v(0.0, -1.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 1.0, 0.0)],
            ),
            Some(1.0),
        ),
    ]
}

fn edge_edge_cases() -> Vec<(&'static str, [Vec3; 8], Option<f64>)> {
    let a = [v(-2.0, 0.0, 0.0), v(2.0, 0.0, 0.0)];
    let with = |b0: Vec3, b1: Vec3| [a[0], a[1], b0, b1];
    let second = |by: Vec3| [O, O, by, by];
    vec![
        ("crossing", moving(with(v(0.0, 1.0, -2.0), v(0.0, 1.0, 2.0)), second(v(0.0, -2.0, 0.0))), Some(0.5)),
        ("stops short", moving(with(v(0.0, 1.0, -2.0), v(0.0, 1.0, 2.0)), second(v(0.0, -0.875, 0.0))), None),
        (
            "touches at the end",
            moving(with(v(0.0, 1.0, -2.0), v(0.0, 1.0, 2.0)), second(v(0.0, -1.0, 0.0))),
            Some(1.0),
        ),
        (
            "end on edge",
            moving(with(v(0.0, 1.0, 0.0), v(0.0, 1.0, 2.0)), second(v(0.0, -2.0, 0.0))),
            Some(0.5),
        ),
        (
            "end on end",
            moving(with(v(2.0, 1.0, 0.0), v(4.0, 1.0, 2.0)), second(v(0.0, -2.0, 0.0))),
            Some(0.5),
        ),
        (
            "past the end",
            moving(with(v(2.0625, 1.0, -2.0), v(2.0625, 1.0, 2.0)), second(v(0.0, -2.0, 0.0))),
            None,
        ),
        (
            "parallel, meet",
            moving(with(v(-1.0, 1.0, 0.0), v(3.0, 1.0, 0.0)), second(v(0.0, -4.0, 0.0))),
            Some(0.25),
        ),
        (
            "parallel, pass",
            moving(with(v(-1.0, 1.0, 0.5), v(3.0, 1.0, 0.5)), second(v(0.0, -4.0, 0.0))),
            None,
        ),
        (
            "parallel, ends meet",
            moving(with(v(2.0, 1.0, 0.0), v(4.0, 1.0, 0.0)), second(v(0.0, -4.0, 0.0))),
            Some(0.25),
        ),
        (
            "one line, meet",
            moving(with(v(3.0, 0.0, 0.0), v(5.0, 0.0, 0.0)), second(v(-2.0, 0.0, 0.0))),
            Some(0.5),
        ),
        (
            "one line, apart",
            moving(with(v(3.0, 0.0, 0.0), v(5.0, 0.0, 0.0)), second(v(-0.5, 0.0, 0.0))),
            None,
        ),
        ("one line, at rest, overlap", moving(with(v(1.0, 0.0, 0.0), v(5.0, 0.0, 0.0)), [O; 4]), Some(0.0)),
        (
            "one plane, meet",
            moving(with(v(1.0, 0.0, 1.0), v(1.0, 0.0, 3.0)), second(v(0.0, 0.0, -2.0))),
            Some(0.5),
        ),
        (
            "one plane, pass",
            moving(with(v(3.0, 0.0, 1.0), v(3.0, 0.0, 3.0)), second(v(0.0, 0.0, -4.0))),
            None,
        ),
        ("at rest, crossing", moving(with(v(0.0, 0.0, -2.0), v(0.0, 0.0, 2.0)), [O; 4]), Some(0.0)),
        ("at rest, apart", moving(with(v(0.0, 0.5, -2.0), v(0.0, 0.5, 2.0)), [O; 4]), None),
        (
            "a point on an edge",
            moving(with(v(1.0, 1.0, 0.0), v(1.0, 1.0, 0.0)), second(v(0.0, -2.0, 0.0))),
            Some(0.5),
        ),
        (
            "a point beside an edge",
            moving(with(v(1.0, 1.0, 0.5), v(1.0, 1.0, 0.5)), second(v(0.0, -2.0, 0.0))),
            None,
        ),
        (
            "moves together",
            moving(with(v(0.0, 0.007_812_5, -2.0), v(0.0, 0.007_812_5, 2.0)), [v(64.0, 8.0, -32.0); 4]),
            None,
        ),
        (
            "teleport through",
            moving(with(v(0.0, 524_288.0, -2.0), v(0.0, 524_288.0, 2.0)), second(v(0.0, -1_048_576.0, 0.0))),
            Some(0.5),
        ),
        (
            "scissors in one plane",
            moving(with(v(0.0, 0.0, 1.0), v(4.0, 0.0, 1.0)), [O, O, v(0.0, 0.0, -0.5), v(0.0, 0.0, -2.0)]),
            Some(0.8),
        ),
    ]
}

fn check(cases: Vec<(&'static str, [Vec3; 8], Option<f64>)>, ccd: Ccd) {
    for (name, pair, expected) in cases {
        // The shift keeps all coordinates exact: 2²⁰ + k/128 has 28 bits, teleports end below 2²².
        for shift in [0.0, 1_048_576.0] {
            for scale in [1.0, (0.5f64).powi(30), (2.0f64).powi(40), (0.5f64).powi(400)] {
                let p = pair.map(|x| (x + Vec3::new(shift, -shift, shift)) * scale);
                let got = ccd(&p, 0.0);
                match (expected, got) {
                    (None, None) => {}
                    (Some(t), Some(found)) => {
                        assert!(found <= t, "{name}: {found} comes after {t}");
                        assert!(t - found <= TIME_TOLERANCE, "{name}: {found} is too early for {t}");
                    }
                    _ => panic!("{name}, shift {shift}, scale {scale}: expected {expected:?}, got {got:?}"),
                }
            }
        }
    }
}

#[test]
fn named_vertex_triangle_cases() {
    check(vertex_triangle_cases(), vertex_triangle_ccd);
}

#[test]
fn named_edge_edge_cases() {
    check(edge_edge_cases(), edge_edge_ccd);
}

#[test]
#[should_panic(expected = "too early")]
fn an_early_time_is_noticed() {
    check(vertex_triangle_cases(), |p, h| vertex_triangle_ccd(p, h).map(|t| t * 0.9));
}

#[test]
fn what_is_not_a_number_is_a_contact() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for k in 0..8 {
            let mut p = vertex_triangle_cases()[0].1;
            p[k].y = bad;
            assert_eq!(vertex_triangle_ccd(&p, 0.0), Some(0.0));
            assert_eq!(edge_edge_ccd(&p, 1e-3), Some(0.0));
        }
    }
    let huge = vertex_triangle_cases()[0].1.map(|x| x * 1e307);
    assert!(vertex_triangle_ccd(&huge, 0.0).is_some(), "overflow must not lose a contact");
}

fn distance_vertex_triangle(p: &[Vec3; 4]) -> f64 {
    let w = vertex_triangle::closest_point(p);
    (p[0] - p[1] * w[0] - p[2] * w[1] - p[3] * w[2]).norm()
}

fn distance_edge_edge(p: &[Vec3; 4]) -> f64 {
    let (s, t) = edge_edge::closest_points(p);
    (p[0] * (1.0 - s) + p[1] * s - p[2] * (1.0 - t) - p[3] * t).norm()
}

/// First time at which `inside` holds, by dense sampling and bisection.
fn first_time(inside: impl Fn(f64) -> bool) -> Option<f64> {
    const SAMPLES: usize = 4000;
    let k = (0..=SAMPLES).find(|&k| inside(k as f64 / SAMPLES as f64))?;
    if k == 0 {
        return Some(0.0);
    }
    let (mut lo, mut hi) = ((k - 1) as f64 / SAMPLES as f64, k as f64 / SAMPLES as f64);
    for _ in 0..60 {
        let mid = 0.5 * (lo + hi);
        if inside(mid) { hi = mid } else { lo = mid }
    }
    Some(hi)
}

#[test]
fn times_at_a_thickness_agree_with_dense_sampling() {
    let (mut hits, mut misses, mut worst) = (0, 0, 0.0f64);
    for (ccd, distance) in [
        (vertex_triangle_ccd as Ccd, distance_vertex_triangle as fn(&[Vec3; 4]) -> f64),
        (edge_edge_ccd, distance_edge_edge),
    ] {
        let mut random = Random(11);
        for _ in 0..3000 {
            let p: [Vec3; 8] = std::array::from_fn(|_| random.vector(1.0));
            let thickness = [1e-3, 0.05, 0.3][random.below(3)];
            let sampled = first_time(|t| distance(&at(&p, t)) <= thickness);
            match (sampled, ccd(&p, thickness)) {
                (None, _) => misses += 1,
                (Some(t), None) => panic!("missed a contact at {t}: {p:?}"),
                (Some(t), Some(found)) => {
                    hits += 1;
                    // The distance here is known to about 1e-15, its time to about 1e-12 of it.
                    assert!(found <= t + 1e-11, "{found} comes after {t}");
                    worst = worst.max(t - found);
                }
            }
        }
    }
    assert!(hits > 1000 && misses > 500, "{hits} hits, {misses} misses");
    assert!(worst <= TIME_TOLERANCE, "a time is {worst} too early");
}

#[test]
fn times_of_thin_contacts_agree_with_sign_changes() {
    const SAMPLES: usize = 1000;
    // A sign change of the volume at which the point is well inside is a contact; the first one bounds the time.
    let volume_vt = |p: &[Vec3; 4]| (p[1] - p[0]).cross(&(p[2] - p[0])).dot(&(p[3] - p[0]));
    let volume_ee = |p: &[Vec3; 4]| (p[1] - p[0]).cross(&(p[3] - p[2])).dot(&(p[2] - p[0]));
    let mut hits = [0, 0];
    let mut random = Random(12);
    for round in 0..6000 {
        let vt = round % 2 == 0;
        let p: [Vec3; 8] = std::array::from_fn(|_| random.vector(1.0));
        let volume = |t: f64| if vt { volume_vt(&at(&p, t)) } else { volume_ee(&at(&p, t)) };
        let distance =
            |t: f64| if vt { distance_vertex_triangle(&at(&p, t)) } else { distance_edge_edge(&at(&p, t)) };
        let mut first = None;
        for k in 0..SAMPLES {
            let (mut lo, mut hi) = (k as f64 / SAMPLES as f64, (k + 1) as f64 / SAMPLES as f64);
            let sign = volume(lo).signum();
            if volume(hi).signum() == sign {
                continue;
            }
            for _ in 0..60 {
                let mid = 0.5 * (lo + hi);
                if volume(mid).signum() == sign { lo = mid } else { hi = mid }
            }
            if distance(lo) < 1e-9 {
                first = Some(lo);
                break;
            }
        }
        let got = if vt { vertex_triangle_ccd(&p, 0.0) } else { edge_edge_ccd(&p, 0.0) };
        match (first, got) {
            (Some(t), None) => panic!("missed a contact at {t}: {p:?}"),
            (Some(t), Some(found)) => {
                hits[round % 2] += 1;
                assert!(found <= t + 1e-11 && t - found <= TIME_TOLERANCE, "{found} for {t}");
            }
            (None, Some(t)) => assert!(distance(t) < 1e-6, "a contact at {t} with distance {}", distance(t)),
            (None, None) => {}
        }
    }
    assert!(hits.iter().all(|&h| h > 200), "{hits:?}");
}

#[test]
fn slow_and_grazing_motion_is_decided() {
    // A vertex slides at height h over a face, an edge's end over another edge: apart at any height above rounding.
    for height in [1e-3, 1e-9, 1e-13] {
        let p = moving(
            [v(-1.0, height, 0.5), O, v(4.0, 0.0, 0.0), v(0.0, 0.0, 4.0)],
            [v(3.0, 0.0, 0.0), O, O, O],
        );
        assert_eq!(vertex_triangle_ccd(&p, 0.0), None, "height {height}");
        assert!(vertex_triangle_ccd(&p, 2.0 * height).is_some());
        let p = moving(
            [v(-2.0, 0.0, 0.0), v(2.0, 0.0, 0.0), v(0.5, height, -3.0), v(0.5, height, -1.0)],
            [O, O, v(0.0, 0.0, 2.0), v(0.0, 0.0, 2.0)],
        );
        assert_eq!(edge_edge_ccd(&p, 0.0), None, "height {height}");
        assert!(edge_edge_ccd(&p, 2.0 * height).is_some());
    }
}
