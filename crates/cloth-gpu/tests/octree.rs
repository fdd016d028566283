//! What is the octrees' own: levels, room and portions, small bindings, and the twin. What all methods share: `methods.rs`.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_gpu::collision::{CollisionMesh, Detector, Mode, Query, Vec3};
use cloth_gpu::twin::octree::OctreeTwin;
use cloth_gpu::{Frame, GpuOptions, Levels, OctreeGpu, OctreeOptions};
use support::{Random, agree, device, moved, pool, sheet, soup};

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
        let found = agree([&mut octree], &mesh, &query, &format!("{options:?}"));
        assert!(found > 1000);
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
        let found = agree([&mut octree], &mesh, &query, &format!("{bytes} bytes"));
        assert!(found > 100);
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
        for _ in 0..2 {
            octree.detect(&mesh, &query, &pool(1)).unwrap();
        }
        let stats = octree.detect(&mesh, &query, &pool(1)).unwrap().stats;
        let active = |level: u32| stats.count(&format!("registrations_level_{level}")) > 0;
        let levels = octree.levels().unwrap();
        assert!(before != Some(levels) && levels.top > 0, "{before:?}, {levels:?}");
        assert!(active(levels.base) || active(levels.base - 1), "{levels:?}, {:?}", stats.counts);
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
            for pair in &mut pairs {
                pair.sort_unstable();
            }
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
