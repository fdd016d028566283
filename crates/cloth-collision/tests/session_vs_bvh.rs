//! A session finds in every frame exactly what the oracle finds, whatever the motion.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_collision::{
    Adapt, Body, BruteForce, Bvh, CollisionMesh, Contacts, Detector, FrameKind, Frames, Mode, Query,
    SessionOptions, SkippingSession, Variant, Vec3,
};
use support::{Random, along, bodies, layers, pool, sheet, soup, waves};

/// None if equal, else what differs.
fn difference(a: &Contacts, b: &Contacts) -> Option<&'static str> {
    if a.vertex_triangle != b.vertex_triangle {
        return Some("vertex-triangle");
    }
    if a.edge_edge != b.edge_edge {
        return Some("edge-edge");
    }
    (a.time_vertex_triangle != b.time_vertex_triangle || a.time_edge_edge != b.time_edge_edge)
        .then_some("times")
}

fn fixed(frames: u32) -> SessionOptions {
    SessionOptions { frames: Frames::Fixed { frames, alpha: None }, ..SessionOptions::default() }
}

fn variants() -> Vec<SessionOptions> {
    let plain = |variant| SessionOptions { variant, ..SessionOptions::default() };
    let narrow = SessionOptions { beta: 0.0, gamma: 0.0, ..fixed(6) };
    let alpha = Frames::Fixed { frames: 5, alpha: Some(0.5) };
    vec![
        plain(Variant::NoDup),
        plain(Variant::RTri),
        plain(Variant::NSwD),
        plain(Variant::SwD),
        fixed(4),
        narrow,
        SessionOptions { frames: alpha, ..fixed(1) },
        SessionOptions { low_curvature: false, ..fixed(9) },
        SessionOptions { adapt: Adapt::Time, ..SessionOptions::default() },
    ]
}

/// What the frames of a sequence did.
#[derive(Debug, Default, Clone, Copy)]
struct Seen {
    contacts: usize,
    skipping: usize,
    first: usize,
    alone: usize,
    dangling: u64,
    one_by_one: usize,
    all_at_once: usize,
    flat: u64,
}

impl Seen {
    fn add(&mut self, session: &SkippingSession) {
        let stats = session.stats();
        match stats.kind {
            FrameKind::Alone => self.alone += 1,
            FrameKind::First => self.first += 1,
            FrameKind::Skipping => self.skipping += 1,
        }
        self.dangling += stats.dangling_triangles;
        self.flat += stats.flat_triangles;
        if stats.dangling_vertices > 0 {
            self.one_by_one += usize::from(stats.one_by_one);
            self.all_at_once += usize::from(!stats.one_by_one);
        }
    }
}

/// Every variant against the oracle over a sequence of (x_t0, x_t1).
fn compare(mesh: &CollisionMesh, frames: &[[Vec<Vec3>; 2]], small: bool, what: &str) -> Seen {
    compare_from(mesh, &frames[0][0], frames, small, what)
}

/// [`compare`] with trees in the shape of `x`.
fn compare_from(
    mesh: &CollisionMesh,
    x: &[Vec3],
    frames: &[[Vec<Vec3>; 2]],
    small: bool,
    what: &str,
) -> Seen {
    let (one, two) = (pool(1), pool(2));
    let mut seen = Seen::default();
    for (thickness, mode) in [(0.0, Mode::Continuous), (0.02, Mode::Continuous), (0.02, Mode::Discrete)] {
        let mut bvh = Bvh::new(mesh, x).unwrap();
        let expected: Vec<Contacts> = frames
            .iter()
            .map(|[x_t0, x_t1]| {
                let query = Query { x_t0, x_t1, thickness, mode, active: None };
                if small {
                    BruteForce.detect(mesh, &query, &one).unwrap()
                } else {
                    bvh.detect(mesh, &query, &one).unwrap()
                }
            })
            .collect();
        for options in variants() {
            let mut session = SkippingSession::new(mesh, x, options).unwrap();
            for (k, [x_t0, x_t1]) in frames.iter().enumerate() {
                let query = Query { x_t0, x_t1, thickness, mode, active: None };
                let got = session.detect(mesh, &query, if k % 2 == 0 { &one } else { &two }).unwrap();
                assert_eq!(
                    difference(&expected[k], &got),
                    None,
                    "{what}, {options:?}, frame {k}, {thickness}, {mode:?}: {:?}",
                    session.stats()
                );
                seen.add(&session);
                seen.contacts += got.vertex_triangle.len() + got.edge_edge.len();
            }
        }
    }
    seen
}

#[test]
fn coherent_motion_agrees_with_brute_force() {
    let mut random = Random(11);
    let (x, triangles) = layers(9, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let seen = compare(&mesh, &along(14, waves(&x, 0.002)), true, "waves");
    assert!(seen.contacts > 1000 && seen.skipping > 80 && seen.first > 40, "{seen:?}");
}

#[test]
fn coherent_motion_agrees_with_the_tree() {
    let mut random = Random(12);
    let (x, triangles) = layers(28, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let seen = compare(&mesh, &along(16, waves(&x, 0.0005)), false, "waves");
    assert!(seen.contacts > 10_000 && seen.skipping > 100, "{seen:?}");
}

/// A sheet whose right half turns over onto the left one, with waves.
fn folding(x: &[Vec3], k: usize, speed: f64) -> Vec<Vec3> {
    let angle = (3.06 + speed * k as f64).min(3.13);
    let fold = |p: &Vec3| {
        let (wave, side) =
            (0.01 * (20.0 * p.x + 2.0 * k as f64 * speed).sin() * (15.0 * p.z).cos(), p.x - 0.5);
        if side < 0.0 {
            Vec3::new(-side, wave, p.z)
        } else {
            Vec3::new(-side * angle.cos(), side * angle.sin() - wave * angle.cos(), p.z)
        }
    };
    x.iter().map(fold).collect()
}

#[test]
fn folding_cloth_agrees_with_its_flat_parts_left_out() {
    for (seed, n, small) in [(21, 26, true), (22, 40, false)] {
        let (x, triangles) = sheet(n, &mut Random(seed));
        let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
        let seen = compare_from(&mesh, &x, &along(7, |k| folding(&x, k, 0.005)), small, "folding");
        assert!(seen.flat > 5_000 && seen.contacts > 100, "{seen:?}");
    }
}

#[test]
fn random_jumps_reversals_and_teleports_agree() {
    let mut random = Random(13);
    let (x, triangles) = layers(7, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let wave = waves(&x, 0.002);
    let mut frames = vec![];
    let mut now = wave(0);
    for k in 0..40 {
        let mut next = wave(k + 1);
        match k % 10 {
            // A few vertices jump; all turn round; one crosses the scene; the scene jumps by its own size.
            3 => (0..3).for_each(|_| next[random.below(x.len())] += random.vector(0.3)),
            5 => next = wave(k.saturating_sub(1)),
            6 => next[random.below(x.len())] = random.vector(2.0),
            8 => next.iter_mut().for_each(|p| *p += Vec3::new(1.0, 0.7, -0.4)),
            9 => next.iter_mut().for_each(|p| *p += random.vector(0.5)),
            _ => {}
        }
        frames.push([now, next.clone()]);
        // Sometimes the next step starts elsewhere.
        now = if k % 7 == 2 { wave(k + 3) } else { next };
    }
    let seen = compare(&mesh, &frames, true, "jumps");
    assert!(seen.contacts > 1000 && seen.dangling > 100 && seen.skipping > 100, "{seen:?}");
    assert!(seen.alone > 0 && seen.first > 0, "{seen:?}");
}

#[test]
fn dangling_triangles_agree_in_both_ways() {
    let mut random = Random(14);
    let (x, triangles) = layers(20, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let wave = waves(&x, 0.0005);
    let mut frames = vec![];
    let mut now = wave(0);
    for k in 0..16 {
        let mut next = wave(k + 1);
        for _ in 0..[0, 1, 20, 150][k % 4] {
            next[random.below(x.len())] += random.vector(0.05);
        }
        frames.push([now, next.clone()]);
        now = next;
    }
    let seen = compare(&mesh, &frames, false, "dangling");
    assert!(seen.one_by_one > 5 && seen.all_at_once > 5 && seen.contacts > 1000, "{seen:?}");
}

/// Features get boxes only where bodies meet: what comes near later, as all slide and some vertices jump, is found none the less.
#[test]
fn bodies_that_do_not_meet_themselves_agree() {
    let mut random = Random(15);
    let (x, triangles) = layers(20, &mut random);
    let (half, count) = (x.len() / 2, triangles.len() / 2);
    let upper: Vec<[u32; 3]> = triangles[count..].iter().map(|t| t.map(|v| v - half as u32)).collect();
    let body = |dynamic| Body { dynamic, self_collision: false };
    let mesh =
        CollisionMesh::new(&[(body(true), half, &triangles[..count]), (body(false), half, &upper)]).unwrap();
    // The upper sheet covers a third of the lower one.
    let wave = waves(&x, 0.002);
    let path = |k: usize| {
        let mut x = wave(k);
        x[half..].iter_mut().for_each(|p| p.x += 0.65 - 0.004 * k as f64);
        x
    };
    let mut frames = vec![];
    let mut now = path(0);
    for k in 0..24 {
        let mut next = path(k + 1);
        for _ in 0..[0, 1, 20, 150][k % 4] {
            next[random.below(x.len())] += random.vector(0.4);
        }
        frames.push([now, next.clone()]);
        now = next;
    }
    let seen = compare(&mesh, &frames, false, "bodies apart from themselves");
    assert!(seen.one_by_one > 5 && seen.all_at_once > 5 && seen.contacts > 1000, "{seen:?}");
}

#[test]
fn soups_rules_and_attachments_agree() {
    for seed in 0..3 {
        let mut random = Random(200 + seed);
        let (mesh, x) = bodies(&mut random);
        let drift: Vec<Vec3> = x.iter().map(|_| random.vector(0.02)).collect();
        let path = |k: usize| x.iter().zip(&drift).map(|(p, d)| p + d * k as f64).collect();
        assert!(compare(&mesh, &along(8, path), true, "bodies").contacts > 1000);
    }
    let mut random = Random(300);
    for count in [0, 1, 2, 9, 30] {
        let (x, triangles) = soup(count, 0.3, &mut random);
        let drift: Vec<Vec3> = x.iter().map(|_| random.vector(0.03)).collect();
        let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
        compare(
            &mesh,
            &along(6, |k| x.iter().zip(&drift).map(|(p, d)| p + d * k as f64).collect()),
            true,
            "soup",
        );
    }
}

#[test]
fn masks_and_repeated_calls_of_a_frame_agree() {
    let mut random = Random(15);
    let (x, triangles) = layers(8, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let mask: Vec<bool> = x.iter().map(|_| random.below(12) == 0).collect();
    let pool = pool(1);
    let mut session = SkippingSession::new(&mesh, &x, fixed(6)).unwrap();
    let (mut first, mut skipping) = (0, 0);
    for [x_t0, x_t1] in along(12, waves(&x, 0.002)) {
        // The passes of a response: the end of the step changes a little, the thickness too.
        for (pass, thickness) in [(0, 0.01), (1, 0.01), (2, 0.005)] {
            let x_t1: Vec<Vec3> = x_t1.iter().map(|p| p + random.vector(1e-3 * f64::from(pass))).collect();
            for active in [None, Some(&mask[..])] {
                let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode: Mode::Continuous, active };
                let expected = BruteForce.detect(&mesh, &query, &pool).unwrap();
                let got = session.detect(&mesh, &query, &pool).unwrap();
                assert_eq!(difference(&expected, &got), None, "{:?}", session.stats());
                first += usize::from(session.stats().kind == FrameKind::First);
                skipping += usize::from(session.stats().kind == FrameKind::Skipping);
            }
        }
    }
    assert_eq!(first, 2, "12 frames are two sessions of six, however often they are looked at");
    assert_eq!(skipping, 12 * 6 - 2);
}

#[test]
fn sizes_out_of_the_ordinary_agree() {
    let mut random = Random(16);
    let (x, triangles) = soup(12, 0.4, &mut random);
    let drift: Vec<Vec3> = x.iter().map(|_| random.vector(0.02)).collect();
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    for (scale, offset) in [(1e-20, 0.0), (1e-9, 0.0), (1.0, 1e6), (1e12, 0.0), (1e40, 0.0), (1e300, 0.0)] {
        let path = |k: usize| -> Vec<Vec3> {
            let at = |(p, d): (&Vec3, &Vec3)| (p + d * k as f64) * scale + Vec3::repeat(offset);
            x.iter().zip(&drift).map(at).collect()
        };
        let frames = along(6, path);
        for options in [fixed(3), SessionOptions::default()] {
            let mut found = 0;
            let mut session = SkippingSession::new(&mesh, &x, options).unwrap();
            for [x_t0, x_t1] in &frames {
                let query = Query { x_t0, x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
                let expected = BruteForce.detect(&mesh, &query, &pool(1)).unwrap();
                let got = session.detect(&mesh, &query, &pool(1)).unwrap();
                assert_eq!(difference(&expected, &got), None, "{scale}, {offset}, {:?}", session.stats());
                found += got.edge_edge.len();
            }
            assert!(found > 0, "{scale}, {offset}");
        }
    }
}

#[test]
fn runs_repeat_to_the_bit_and_sessions_may_start_anywhere() {
    let mut random = Random(17);
    let (x, triangles) = layers(24, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let frames = along(40, waves(&x, 0.001));
    let run = |threads: usize, from: usize| {
        let pool = pool(threads);
        let mut session = SkippingSession::new(&mesh, &x, SessionOptions::default()).unwrap();
        frames[from..]
            .iter()
            .map(|[x_t0, x_t1]| {
                let query = Query { x_t0, x_t1, thickness: 0.01, mode: Mode::Continuous, active: None };
                let mut contacts = session.detect(&mesh, &query, &pool).unwrap();
                contacts.stats.seconds.clear();
                let stats = session.stats();
                (contacts, stats.frames, stats.pending, stats.admissible, stats.work, stats.kind)
            })
            .collect::<Vec<_>>()
    };
    let whole = run(1, 0);
    assert!(whole.iter().any(|f| f.5 == FrameKind::Skipping));
    assert_eq!(whole, run(1, 0));
    assert_eq!(whole, run(2, 0));
    // Resumed, as from a checkpoint that knows nothing of the session.
    for (later, now) in whole[13..].iter().zip(run(2, 13)) {
        assert_eq!(difference(&later.0, &now.0), None);
    }
}

#[test]
fn planted_faults_are_noticed() {
    let mut random = Random(18);
    let (x, triangles) = layers(10, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let query = Query { x_t0: &x, x_t1: &x, thickness: 0.02, mode: Mode::Continuous, active: None };
    let mut session = SkippingSession::new(&mesh, &x, fixed(4)).unwrap();
    let good = session.detect(&mesh, &query, &pool(1)).unwrap();
    let mut bad = good.clone();
    bad.vertex_triangle.pop();
    assert_eq!(difference(&good, &bad), Some("vertex-triangle"));
    let mut bad = good.clone();
    bad.time_edge_edge[0] += 1e-12;
    assert_eq!(difference(&good, &bad), Some("times"));
}
