//! What a session refuses, and what it holds.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_collision::{
    Bvh, CollisionMesh, DetectError, Detector, FrameKind, Frames, Mode, Query, SessionOptions,
    SkippingSession, Vec3,
};
use support::{Random, along, layers, pool, waves};

fn fixed(frames: u32) -> SessionOptions {
    SessionOptions { frames: Frames::Fixed { frames, alpha: None }, ..SessionOptions::default() }
}

#[test]
fn bad_input_is_named() {
    let x = vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()];
    let mesh = CollisionMesh::single(4, &[[0, 1, 2], [1, 2, 3]]).unwrap();
    let refused = |options: SessionOptions| match SkippingSession::new(&mesh, &x, options) {
        Err(DetectError::Parameter { parameter, .. }) => parameter,
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(fixed(0)), "frames");
    assert_eq!(refused(fixed(1001)), "frames");
    let adaptive = |first, most| SessionOptions { frames: Frames::Adaptive { first, most }, ..fixed(1) };
    assert_eq!(refused(adaptive(9, 8)), "frames");
    assert_eq!(refused(adaptive(1, 0)), "frames");
    let alpha = Frames::Fixed { frames: 2, alpha: Some(f64::NAN) };
    assert_eq!(refused(SessionOptions { frames: alpha, ..fixed(1) }), "alpha");
    assert_eq!(refused(SessionOptions { beta: -0.1, ..fixed(1) }), "beta");
    assert_eq!(refused(SessionOptions { gamma: f64::INFINITY, ..fixed(1) }), "gamma");

    let mut session = SkippingSession::new(&mesh, &x, fixed(5)).unwrap();
    let query = Query { x_t0: &x, x_t1: &x, thickness: 0.0, mode: Mode::Continuous, active: None };
    session.detect(&mesh, &query, &pool(1)).unwrap();
    // A NaN inside a session is refused, and the session goes on.
    let mut y = x.clone();
    y[1].y = f64::NAN;
    assert!(matches!(
        session.detect(&mesh, &Query { x_t1: &y, ..query }, &pool(1)),
        Err(DetectError::NotFinite { array: "x_t1", vertex: 1, .. })
    ));
    let other = CollisionMesh::single(4, &[[0, 1, 2], [1, 3, 2]]).unwrap();
    assert_eq!(
        session.detect(&other, &query, &pool(1)).unwrap_err(),
        DetectError::ChangedTopology { triangle: 1 }
    );
    let fewer = CollisionMesh::single(4, &[[0, 1, 2]]).unwrap();
    assert!(matches!(session.detect(&fewer, &query, &pool(1)), Err(DetectError::OtherMesh { .. })));
    let mut still = mesh.clone();
    still.bodies[0].self_collision = false;
    assert_eq!(session.detect(&still, &query, &pool(1)).unwrap_err(), DetectError::ChangedBodies);
    session.detect(&mesh, &query, &pool(1)).unwrap();
    assert_eq!(session.stats().kind, FrameKind::Skipping);
}

#[test]
fn a_stored_pair_takes_at_most_48_bytes() {
    let mut random = Random(19);
    let (x, triangles) = layers(50, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let mut session = SkippingSession::new(&mesh, &x, fixed(20)).unwrap();
    for (k, [x_t0, x_t1]) in along(20, waves(&x, 0.0003)).iter().enumerate() {
        let mut x_t1 = x_t1.clone();
        (0..k).for_each(|_| x_t1[random.below(x.len())] += random.vector(0.02));
        let query = Query { x_t0, x_t1: &x_t1, thickness: 0.01, mode: Mode::Continuous, active: None };
        session.detect(&mesh, &query, &pool(1)).unwrap();
        let stats = session.stats();
        assert!(stats.pending > 10_000, "{stats:?}");
        assert!(stats.pair_bytes <= 48 * stats.pending, "{stats:?}");
        assert!(stats.pair_bytes >= 28 * stats.pending, "{stats:?}");
    }
}

#[test]
fn a_frame_that_jumps_by_the_scenes_size_is_answered_and_a_session_follows() {
    let mut random = Random(23);
    let (x, triangles) = layers(16, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let mut session = SkippingSession::new(&mesh, &x, fixed(8)).unwrap();
    let mut bvh = Bvh::new(&mesh, &x).unwrap();
    let wave = waves(&x, 0.0003);
    let away =
        |x: Vec<Vec3>| -> Vec<Vec3> { x.iter().map(|p| p * 1.2 + Vec3::new(3.0, 5.0, -4.0)).collect() };
    let mut kinds = vec![];
    for k in 0..12 {
        let (x_t0, x_t1) = match k {
            4 => (wave(k), away(wave(k + 1))),
            5.. => (away(wave(k)), away(wave(k + 1))),
            _ => (wave(k), wave(k + 1)),
        };
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.02, mode: Mode::Continuous, active: None };
        let mut found = session.detect(&mesh, &query, &pool(1)).unwrap();
        let mut expected = bvh.detect(&mesh, &query, &pool(1)).unwrap();
        (found.stats, expected.stats) = Default::default();
        assert!(found == expected, "frame {k}");
        assert!(!found.edge_edge.is_empty());
        kinds.push(session.stats().kind);
    }
    assert_eq!(kinds[3], FrameKind::Skipping);
    assert_ne!(kinds[4], FrameKind::Skipping, "no ball holds the jump");
    assert_eq!(kinds[5..7], [FrameKind::First, FrameKind::Skipping]);
}
