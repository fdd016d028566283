//! What is the grids' own: parts of triangles, room and portions, and the twin. What all methods share: `methods.rs`.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_gpu::collision::{BruteForce, CollisionMesh, Detector, Mode, Query};
use cloth_gpu::twin::grid::GridTwin;
use cloth_gpu::{Frame, GpuOptions, GridGpu, GridOptions};
use support::{Random, agree, device, difference, moved, pool, soup};

/// Triangles of very different sizes: most are registered in parts, in space and in time.
#[test]
fn subdivision_agrees_and_tests_less() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let (mut found, mut tests) = (0, [0u64; 2]);
    for seed in 0..4 {
        let mut random = Random(60 + seed);
        let (mut x_t0, mut triangles) = soup(500, 0.03, &mut random);
        triangles.retain(|t| t[0] + 2 == t[2]);
        let (x, mut large) = soup(6, 0.5, &mut random);
        for v in large.iter_mut().flatten() {
            *v += x_t0.len() as u32;
        }
        x_t0.extend(x);
        triangles.extend(large);
        let mut x_t1 = moved(&x_t0, 0.01, &mut random);
        // Some fly across the scene.
        for t in triangles.iter().step_by(50) {
            let by = random.vector(0.8);
            for &v in t {
                x_t1[v as usize] += by;
            }
        }
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        for lambda in [0.5, 1.0, 1.2, 3.0] {
            let options = GridOptions { subdivision: Some(lambda), ..GridOptions::default() };
            let mut parts = GridGpu::with_options(device.gpu.clone(), &mesh, options).unwrap();
            assert_eq!(parts.name(), "virtual-subdivision");
            for (mode, thickness) in
                [(Mode::Continuous, 0.0), (Mode::Discrete, 0.02), (Mode::Continuous, 0.3)]
            {
                let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode, active: None };
                let what = format!("{seed}, λ {lambda}, {mode:?}, {thickness}");
                found += agree([&mut parts], &mesh, &query, &what);
                let count = parts.detect(&mesh, &query, &pool(1)).unwrap().stats.count("parts");
                assert!(count > triangles.len() as u64 || thickness > 0.1 || lambda > 2.0);
            }
        }
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
        let methods = [GridGpu::new, GridGpu::virtual_subdivision];
        for (method, tests) in methods.iter().zip(&mut tests) {
            let mut detector = method(device.gpu.clone(), &mesh).unwrap();
            *tests += detector.detect(&mesh, &query, &pool(1)).unwrap().stats.broad_phase_tests;
        }
    }
    assert!(found > 1000, "the scenes must hold contacts, found {found}");
    assert!(tests[1] * 4 < tests[0], "{tests:?}");
}

#[test]
fn small_room_and_small_portions_change_nothing() {
    for options in [
        GpuOptions::default(),
        GpuOptions { max_workgroups_per_dimension: Some(64), ..GpuOptions::default() },
    ] {
        let Some(device) = device(options) else { return };
        let mut random = Random(7);
        let (x_t0, triangles) = soup(150, 0.2, &mut random);
        let x_t1 = moved(&x_t0, 0.1, &mut random);
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.01, mode: Mode::Continuous, active: None };
        for (first, most, tests) in [
            (Some(1), None, None),
            (Some(1), Some(64), None),
            (None, Some(300), Some(1 << 20)),
            (None, None, Some(777)),
            (Some(50), Some(1000), Some(5000)),
        ] {
            for subdivision in [None, Some(1.2)] {
                let options = GridOptions {
                    subdivision,
                    first_capacity: first,
                    max_capacity: most,
                    max_tests: tests,
                    ..GridOptions::default()
                };
                let mut grid = GridGpu::with_options(device.gpu.clone(), &mesh, options).unwrap();
                let found = agree([&mut grid], &mesh, &query, &format!("{options:?}"));
                assert!(found > 1000);
            }
        }
    }
}

/// The method itself, without a device.
#[test]
fn the_twin_agrees_and_needs_its_reach() {
    let mut lost = 0;
    for seed in 0..12 {
        let mut random = Random(70 + seed);
        let (x_t0, triangles) = soup(300, 0.1, &mut random);
        let triangles: Vec<[u32; 3]> = triangles.into_iter().filter(|t| t[0] + 2 == t[2]).collect();
        let x_t1 = moved(&x_t0, 0.02, &mut random);
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        for mode in [Mode::Continuous, Mode::Discrete] {
            let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.001, mode, active: None };
            let expected = BruteForce.detect(&mesh, &query, &pool(1)).unwrap();
            let got = GridTwin::default().detect(&mesh, &query, &pool(1)).unwrap();
            assert_eq!(difference(&expected, &got), None, "{seed}, {mode:?}");
            let (frame, count) = (Frame::new(&query, &pool(1)), |t: GridTwin, f: &Frame| {
                let (vertex_triangle, edge_edge, _) = t.candidates(&mesh, &query, f);
                vertex_triangle.len() + edge_edge.len()
            });
            lost += count(GridTwin::default(), &frame) - count(GridTwin { reach: 0.8 }, &frame);
        }
    }
    assert!(lost > 0, "too short a reach must show");
}
