//! The octree on the device gives exactly the contacts of testing every pair: pairs and times.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_gpu::collision::{
    BruteForce, Bvh, CollisionMesh, Contacts, DetectError, Detector, Mode, Query, Vec3,
};
use cloth_gpu::twin::octree::OctreeTwin;
use cloth_gpu::{Frame, Gpu, GpuError, GpuOptions, Levels, OctreeGpu, OctreeOptions};
use std::sync::Arc;
use support::{Random, bodies, device, difference, pool, sheet, soup, variants};

fn moved(x: &[Vec3], by: f64, random: &mut Random) -> Vec<Vec3> {
    x.iter().map(|x| x + random.vector(by)).collect()
}

/// Asks three times (then with the room and the levels of the times before), and compares with brute force; returns the contacts'
/// number.
fn compare(octree: &mut OctreeGpu, mesh: &CollisionMesh, query: &Query<'_>, what: &str) -> usize {
    let pool = pool(2);
    let expected = BruteForce.detect(mesh, query, &pool).unwrap();
    for turn in ["first", "again", "once more"] {
        let got = octree.detect(mesh, query, &pool).unwrap();
        assert_eq!(difference(&expected, &got), None, "{what}, {turn}");
        assert!(got.stats.candidates_edge_edge >= got.edge_edge.len() as u64);
    }
    expected.vertex_triangle.len() + expected.edge_edge.len()
}

fn compare_all(
    gpu: &Arc<Gpu>,
    mesh: &CollisionMesh,
    x_t0: &[Vec3],
    x_t1: &[Vec3],
    random: &mut Random,
    what: &str,
) -> usize {
    let mut found = 0;
    let mut methods = [OctreeGpu::new, OctreeGpu::single].map(|new| new(gpu.clone(), mesh).unwrap());
    let mask: Vec<bool> = (0..mesh.vertex_count).map(|_| random.below(10) == 0).collect();
    for (mode, thickness, active) in [
        (Mode::Continuous, 0.0, None),
        (Mode::Continuous, 0.02, Some(&mask[..])),
        (Mode::Discrete, 0.0, None),
        (Mode::Discrete, 0.02, None),
        (Mode::Discrete, 0.02, Some(&mask[..])),
    ] {
        let query = Query { x_t0, x_t1, thickness, mode, active };
        for octree in &mut methods {
            let what = format!("{}, {what}, {mode:?}, {thickness}, {}", octree.name(), active.is_some());
            found += compare(octree, mesh, &query, &what);
        }
    }
    found
}

#[test]
fn soups_of_many_sizes_agree() {
    for options in variants() {
        let Some(device) = device(options) else { return };
        let mut found = 0;
        for (seed, count) in [0, 1, 2, 8, 40, 90].into_iter().enumerate() {
            let mut random = Random(seed as u64);
            let (x_t0, triangles) = soup(count, 0.25, &mut random);
            let x_t1 = moved(&x_t0, 0.3, &mut random);
            let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
            found += compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, &format!("soup of {count}"));
        }
        assert!(found > 1000, "the scenes must hold contacts, found {found}");
    }
}

#[test]
fn fine_soups_and_sheets_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut found = 0;
    for (seed, offset) in [(1, 0.0), (2, 1e3), (3, -1e6)] {
        let mut random = Random(seed);
        let (mut x_t0, triangles) = sheet(12, &mut random);
        for x in &mut x_t0 {
            *x += Vec3::repeat(offset);
        }
        let x_t1 = moved(&x_t0, 0.12, &mut random);
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        found += compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, &format!("sheet at {offset}"));

        let (x_t0, triangles) = soup(600, 0.04, &mut random);
        let x_t1 = moved(&x_t0, 0.03, &mut random);
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        found += compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, &format!("fine soup {seed}"));
    }
    assert!(found > 1000, "the scenes must hold contacts, found {found}");
}

#[test]
fn rules_of_bodies_and_attachments_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    for seed in 0..2 {
        let mut random = Random(100 + seed);
        let (mesh, x_t0) = bodies(&mut random);
        let x_t1 = moved(&x_t0, 0.4, &mut random);
        assert!(compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, "bodies") > 100);
    }
}

#[test]
fn huge_and_tiny_scenes_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut random = Random(5);
    let (x_t0, triangles) = soup(10, 0.4, &mut random);
    for scale in [1e-280, 1e-40, 1e40, 1e305] {
        let x_t0: Vec<Vec3> = x_t0.iter().map(|x| x * scale).collect();
        let x_t1 = moved(&x_t0, 0.3 * scale, &mut random);
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        let mut octree = OctreeGpu::new(device.gpu.clone(), &mesh).unwrap();
        for thickness in [0.0, 0.01 * scale, 1e306] {
            let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode: Mode::Continuous, active: None };
            assert!(compare(&mut octree, &mesh, &query, &format!("{scale}, {thickness}")) > 0);
        }
    }
}

#[test]
fn bad_scenes_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut random = Random(6);

    // All triangles in one point.
    let triangles: Vec<[u32; 3]> = (0..40).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let point = vec![Vec3::new(0.3, -2.0, 1e5); 120];
    let mesh = CollisionMesh::single(120, &triangles).unwrap();
    assert!(compare_all(&device.gpu, &mesh, &point, &point, &mut random, "one point") > 5000);

    // A flat sheet at rest and one that moves along itself: the scene has no height.
    let (mut x_t0, triangles) = sheet(12, &mut random);
    for x in &mut x_t0 {
        x.y = 0.0;
    }
    let x_t1: Vec<Vec3> = x_t0.iter().map(|x| x + Vec3::new(0.1 * x.z, 0.0, 0.1 * x.x)).collect();
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, "flat");

    // One triangle as large as the scene among many small ones.
    let (mut x_t0, mut triangles) = soup(400, 0.02, &mut random);
    triangles.retain(|t| t[0] + 2 == t[2]);
    let n = x_t0.len() as u32;
    x_t0.extend([Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 0.0, -1.0), Vec3::new(0.0, 0.1, 1.0)]);
    triangles.push([n, n + 1, n + 2]);
    let x_t1 = moved(&x_t0, 0.02, &mut random);
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    assert!(compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, "one large") > 20);

    // Motion by the scene's size in one step.
    let (x_t0, triangles) = soup(60, 0.05, &mut random);
    let x_t1 = moved(&x_t0, 1.0, &mut random);
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    assert!(compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, "large motion") > 100);
}

/// One triangle as large as the scene among 100,000 small ones, of which it cuts some.
#[test]
fn one_huge_triangle_among_many_small_ones_agrees() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut random = Random(21);
    let (mut x_t0, mut triangles) = soup(100_000, 0.002, &mut random);
    for (t, corners) in triangles.iter_mut().enumerate() {
        corners[0] = 3 * t as u32;
    }
    let n = x_t0.len() as u32;
    x_t0.extend([Vec3::new(-0.5, 0.4, -0.5), Vec3::new(0.5, -0.4, -0.5), Vec3::new(0.0, 0.0, 0.5)]);
    triangles.push([n, n + 1, n + 2]);
    let x_t1 = moved(&x_t0, 0.002, &mut random);
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    let expected = Bvh::new(&mesh, &x_t0).unwrap().detect(&mesh, &query, &pool(2)).unwrap();
    assert!(expected.vertex_triangle.iter().filter(|p| p[1] == triangles.len() as u32 - 1).count() > 50);
    let mut octree = OctreeGpu::new(device.gpu.clone(), &mesh).unwrap();
    for turn in ["first", "again"] {
        let got = octree.detect(&mesh, &query, &pool(2)).unwrap();
        assert_eq!(difference(&expected, &got), None, "{turn}");
        assert!(got.stats.broad_phase_tests < 2_000_000, "{turn}: {}", got.stats.broad_phase_tests);
    }
}

#[test]
fn levels_room_and_portions_change_nothing() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut random = Random(7);
    let (x_t0, triangles) = soup(150, 0.2, &mut random);
    let x_t1 = moved(&x_t0, 0.1, &mut random);
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.01, mode: Mode::Continuous, active: None };
    let plain = OctreeOptions::default();
    let fixed = OctreeOptions { thresholds: None, ..plain };
    for options in [
        OctreeOptions { first_capacity: Some(1), ..plain },
        OctreeOptions { first_capacity: Some(1), max_capacity: Some(64), ..plain },
        OctreeOptions { max_capacity: Some(300), max_tests: Some(1 << 20), ..plain },
        OctreeOptions { max_tests: Some(777), two_stage: false, ..plain },
        OctreeOptions { max_registrations: Some(1000), ..plain },
        OctreeOptions { max_registrations: Some(10), ..plain },
        OctreeOptions { max_triangles: Some(50), ..plain },
        OctreeOptions { levels: Some(1), ..fixed },
        OctreeOptions { levels: Some(2), ..fixed },
        OctreeOptions { levels: Some(5), two_stage: false, ..fixed },
        OctreeOptions { levels: Some(10), max_registrations: Some(1 << 18), ..fixed },
    ] {
        let mut octree = OctreeGpu::with_options(device.gpu.clone(), &mesh, options).unwrap();
        assert!(compare(&mut octree, &mesh, &query, &format!("{options:?}")) > 1000);
        let levels = octree.levels().map(|l| l.base);
        match options {
            OctreeOptions { max_registrations: Some(10), .. } => assert_eq!(levels, Some(0)),
            OctreeOptions { max_triangles: Some(_), .. } => assert_eq!(levels, None),
            OctreeOptions { levels: Some(wanted), max_registrations: None, .. } => {
                assert_eq!(levels, Some(wanted));
            }
            _ => {}
        }
    }
}

/// What no single binding holds: fewer levels, then fewer triangles at a time.
#[test]
fn small_bindings_agree() {
    let mut random = Random(8);
    let (x_t0, triangles) = soup(500, 0.05, &mut random);
    let x_t1 = moved(&x_t0, 0.05, &mut random);
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    for (bytes, finest) in [(1 << 20, 8), (200_000, 7), (100_000, 7)] {
        let options = GpuOptions { max_binding_bytes: Some(bytes), ..GpuOptions::default() };
        let Some(device) = device(options) else { return };
        let options = OctreeOptions { levels: Some(10), thresholds: None, ..OctreeOptions::default() };
        let mut octree = OctreeGpu::with_options(device.gpu.clone(), &mesh, options).unwrap();
        assert!(octree.levels().is_none_or(|l| l.base == finest), "{:?}", octree.levels());
        assert!(compare(&mut octree, &mesh, &query, &format!("{bytes} bytes")) > 100);
    }
}

#[test]
fn bad_input_is_named() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let x = vec![Vec3::zeros(), Vec3::x(), Vec3::y()];
    let mesh = CollisionMesh::single(3, &[[0, 1, 2]]).unwrap();
    let mut octree = OctreeGpu::new(device.gpu.clone(), &mesh).unwrap();
    assert_eq!(octree.name(), "octree");
    assert_eq!(OctreeGpu::single(device.gpu.clone(), &mesh).unwrap().name(), "octree-single");
    let good = Query { x_t0: &x, x_t1: &x, thickness: 0.0, mode: Mode::Continuous, active: None };
    let mut ask = |query: &Query<'_>| octree.detect(&mesh, query, &pool(1)).map(|_| ());
    assert_eq!(ask(&good), Ok(()));
    let mut bad = x.clone();
    bad[2].z = f64::NAN;
    assert!(matches!(
        ask(&Query { x_t1: &bad, ..good }),
        Err(DetectError::NotFinite { array: "x_t1", vertex: 2, .. })
    ));
    for levels in [0, 11] {
        let options = OctreeOptions { levels: Some(levels), ..OctreeOptions::default() };
        let refused = OctreeGpu::with_options(device.gpu.clone(), &mesh, options).map(|_| ());
        assert!(matches!(refused, Err(GpuError::Query(DetectError::Parameter { parameter: "levels", .. }))));
    }
    let empty = CollisionMesh::single(3, &[]).unwrap();
    assert!(matches!(
        octree.detect(&empty, &good, &pool(1)),
        Err(DetectError::OtherMesh { expected: 1, got: 0 })
    ));
    let none = OctreeGpu::new(device.gpu.clone(), &empty).unwrap().detect(&empty, &good, &pool(1)).unwrap();
    assert_eq!(none, Contacts::default());
}

#[test]
fn a_lost_device_is_an_error() {
    let Some(lost) = device(GpuOptions::default()) else { return };
    let (x, triangles) = soup(50, 0.3, &mut Random(11));
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let query = Query { x_t0: &x, x_t1: &x, thickness: 0.0, mode: Mode::Continuous, active: None };
    let mut octree = OctreeGpu::new(lost.gpu.clone(), &mesh).unwrap();
    octree.detect(&mesh, &query, &pool(1)).unwrap();
    lost.gpu.close();
    match octree.detect(&mesh, &query, &pool(1)) {
        Err(DetectError::Device { detector: "octree", reason }) => {
            assert!(reason.contains("lost"), "{reason}");
        }
        other => panic!("{other:?}"),
    }
}

/// Two dense sheets and a few triangles in the wide between.
fn uneven(random: &mut Random) -> (CollisionMesh, Vec<Vec3>, Vec<Vec3>) {
    let (mut x_t0, mut triangles) = soup(60, 0.1, random);
    triangles.retain(|t| t[0] + 2 == t[2]);
    for at in [Vec3::new(0.4, 0.4, 0.4), Vec3::new(-0.5, 0.1, 0.0)] {
        let (x, sheet) = sheet(25, random);
        let first = x_t0.len() as u32;
        x_t0.extend(x.iter().map(|x| x * 0.08 + at));
        triangles.extend(sheet.iter().map(|t| t.map(|v| v + first)));
    }
    let x_t1 = moved(&x_t0, 0.002, random);
    (CollisionMesh::single(x_t0.len(), &triangles).unwrap(), x_t0, x_t1)
}

#[test]
fn two_stage_never_tests_more_and_levels_follow_the_scene() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let (mut gained, mut tests) = (0, [0; 2]);
    for seed in 0..3 {
        let (mesh, x_t0, x_t1) = uneven(&mut Random(20 + seed));
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
        for levels in [3, 5, 7] {
            for two_stage in [true, false] {
                let options = OctreeOptions {
                    two_stage,
                    levels: Some(levels),
                    thresholds: None,
                    ..OctreeOptions::default()
                };
                let mut octree = OctreeGpu::with_options(device.gpu.clone(), &mesh, options).unwrap();
                let got = octree.detect(&mesh, &query, &pool(1)).unwrap();
                tests[usize::from(two_stage)] = got.stats.broad_phase_tests;
                let twin = OctreeTwin {
                    is_two_stage: two_stage,
                    levels: Levels { top: 0, base: levels },
                    has_token: true,
                };
                if levels < 7 {
                    let (_, expected) = twin.pairs(&mesh, &query, &Frame::new(&query, &pool(1)));
                    assert_eq!(got.stats.broad_phase_tests, expected, "{levels}");
                }
            }
            assert!(tests[1] <= tests[0], "{levels}: {tests:?}");
            gained += usize::from(tests[1] < tests[0]);
        }
        let mut octree = OctreeGpu::new(device.gpu.clone(), &mesh).unwrap();
        let before = octree.levels();
        for _ in 0..3 {
            octree.detect(&mesh, &query, &pool(1)).unwrap();
        }
        let active = |level: u32| octree.per_level()[level as usize] > 0;
        let levels = octree.levels().unwrap();
        assert!(before != Some(levels) && levels.top > 0, "{before:?}, {levels:?}");
        assert!(active(levels.base) || active(levels.base - 1), "{levels:?}, {:?}", octree.per_level());
    }
    assert!(gained > 0, "some scene must show the difference");
}

/// The method itself, without a device: pairs come up once, and the token is what sees to it.
#[test]
fn the_twin_finds_each_pair_once_and_needs_its_token() {
    let mut twice = 0;
    for seed in 0..4 {
        let (mesh, x_t0, x_t1) = uneven(&mut Random(30 + seed));
        let query =
            Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.001, mode: Mode::Continuous, active: None };
        let frame = Frame::new(&query, &pool(1));
        let levels = Levels { top: 0, base: 5 };
        let pairs = |is_two_stage, levels, has_token| {
            let twin = OctreeTwin { is_two_stage, levels, has_token };
            let mut pairs = twin.pairs(&mesh, &query, &frame).0;
            pairs.iter_mut().for_each(|p| p.sort_unstable());
            pairs.sort_unstable();
            pairs
        };
        // The root alone tests every pair.
        let all = pairs(true, Levels { top: 0, base: 0 }, true);
        assert!(all.len() > 5000 && all.windows(2).all(|w| w[0] != w[1]));
        for is_two_stage in [true, false] {
            assert_eq!(pairs(is_two_stage, levels, true), all);
            let mut without = pairs(is_two_stage, levels, false);
            twice += without.len() - all.len();
            without.dedup();
            assert_eq!(without, all);
        }
    }
    assert!(twice > 100, "without the token pairs must come up twice: {twice}");
}
