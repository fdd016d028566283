//! The grid on the device gives exactly the contacts of testing every pair: pairs and times.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_gpu::collision::{
    BruteForce, Bvh, CollisionMesh, Contacts, DetectError, Detector, Mode, Query, Vec3,
};
use cloth_gpu::twin::grid::GridTwin;
use cloth_gpu::{Frame, Gpu, GpuError, GpuOptions, GridGpu, GridOptions};
use std::sync::Arc;
use support::{Random, bodies, device, difference, moved, pool, sheet, soup, variants};

/// Asks twice (the second time with the room of the first), and compares with brute force; returns the contacts' number.
fn compare(grid: &mut GridGpu, mesh: &CollisionMesh, query: &Query<'_>, what: &str) -> usize {
    let pool = pool(2);
    let expected = BruteForce.detect(mesh, query, &pool).unwrap();
    for turn in ["first", "again"] {
        let got = grid.detect(mesh, query, &pool).unwrap();
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
    let mut methods =
        [GridGpu::new(gpu.clone(), mesh).unwrap(), GridGpu::virtual_subdivision(gpu.clone(), mesh).unwrap()];
    let mask: Vec<bool> = (0..mesh.vertex_count).map(|_| random.below(10) == 0).collect();
    let none = vec![false; mesh.vertex_count];
    for mode in [Mode::Continuous, Mode::Discrete] {
        for thickness in [0.0, 0.02] {
            for active in [None, Some(&mask[..]), Some(&none[..])] {
                let query = Query { x_t0, x_t1, thickness, mode, active };
                let what = format!("{what}, {mode:?}, {thickness}, {}", active.is_some());
                for grid in &mut methods {
                    let name = grid.name();
                    found += compare(grid, mesh, &query, &format!("{name}, {what}"));
                }
            }
        }
    }
    found
}

#[test]
fn soups_of_many_sizes_agree() {
    for options in variants() {
        let Some(device) = device(options) else { return };
        let mut found = 0;
        for (seed, count) in [0, 1, 2, 3, 8, 17, 40, 90].into_iter().enumerate() {
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
fn fine_soups_in_many_cells_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut found = 0;
    for seed in 0..6 {
        let mut random = Random(50 + seed);
        let (x_t0, triangles) = soup(600, 0.04, &mut random);
        let x_t1 = moved(&x_t0, 0.03, &mut random);
        // Loose ones only: a shared vertex makes a triangle as long as the scene.
        let triangles: Vec<[u32; 3]> = triangles.into_iter().filter(|t| t[0] + 2 == t[2]).collect();
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        found += compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, &format!("fine soup {seed}"));
    }
    assert!(found > 1000, "the scenes must hold contacts, found {found}");
}

#[test]
fn sheets_far_from_the_origin_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    for (seed, offset) in [(1, 0.0), (2, 1e3), (3, -1e6)] {
        let mut random = Random(seed);
        let (mut x_t0, triangles) = sheet(10, &mut random);
        for x in &mut x_t0 {
            *x += Vec3::repeat(offset);
        }
        let x_t1 = moved(&x_t0, 0.15, &mut random);
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        let found = compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, &format!("sheet at {offset}"));
        assert!(found > 10, "the scene must hold contacts, found {found}");
    }
}

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
                found +=
                    compare(&mut parts, &mesh, &query, &format!("{seed}, λ {lambda}, {mode:?}, {thickness}"));
                assert!(parts.parts() > triangles.len() as u64 || thickness > 0.1 || lambda > 2.0);
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
fn rules_of_bodies_and_attachments_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    for seed in 0..4 {
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
    for scale in [1e-280, 1e-40, 1e40, 1e160, 1e305] {
        let x_t0: Vec<Vec3> = x_t0.iter().map(|x| x * scale).collect();
        let x_t1 = moved(&x_t0, 0.3 * scale, &mut random);
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        let mut grid = GridGpu::new(device.gpu.clone(), &mesh).unwrap();
        for thickness in [0.0, 0.01 * scale, 1e306] {
            let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode: Mode::Continuous, active: None };
            assert!(compare(&mut grid, &mesh, &query, &format!("{scale}, {thickness}")) > 0);
        }
    }
}

#[test]
fn bad_scenes_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut random = Random(6);

    // All triangles in one point; then also at rest in continuous mode.
    let triangles: Vec<[u32; 3]> = (0..40).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let point = vec![Vec3::new(0.3, -2.0, 1e5); 120];
    let mesh = CollisionMesh::single(120, &triangles).unwrap();
    assert!(compare_all(&device.gpu, &mesh, &point, &point, &mut random, "one point") > 5000);

    // One triangle as large as the scene among many small ones, and one that crosses it in the step.
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
    let huge = triangles.len() as u32 - 1;
    assert!(expected.vertex_triangle.iter().filter(|p| p[1] == huge).count() > 50);
    let mut grid = GridGpu::virtual_subdivision(device.gpu.clone(), &mesh).unwrap();
    let got = grid.detect(&mesh, &query, &pool(2)).unwrap();
    assert_eq!(difference(&expected, &got), None);
    assert!(got.stats.broad_phase_tests < 50_000_000, "{}", got.stats.broad_phase_tests);
    // The traditional grid has all of them in one cell: five thousand million tests, so fewer triangles.
    let few = CollisionMesh::single(x_t0.len(), &triangles[triangles.len() - 4000..]).unwrap();
    let expected = Bvh::new(&few, &x_t0).unwrap().detect(&few, &query, &pool(2)).unwrap();
    let mut grid = GridGpu::new(device.gpu.clone(), &few).unwrap();
    let got = grid.detect(&few, &query, &pool(2)).unwrap();
    assert_eq!(difference(&expected, &got), None);
    assert!(got.stats.broad_phase_tests > 7_000_000);
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
                assert!(compare(&mut grid, &mesh, &query, &format!("{options:?}")) > 1000);
            }
        }
    }
}

#[test]
fn bad_input_is_named() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let x = vec![Vec3::zeros(), Vec3::x(), Vec3::y()];
    let mesh = CollisionMesh::single(3, &[[0, 1, 2]]).unwrap();
    let good = Query { x_t0: &x, x_t1: &x, thickness: 0.0, mode: Mode::Continuous, active: None };
    let empty = CollisionMesh::single(3, &[]).unwrap();
    let mut bad = x.clone();
    bad[2].z = f64::NAN;
    for (method, name) in [
        (GridGpu::new as fn(_, &CollisionMesh) -> Result<GridGpu, GpuError>, "grid"),
        (GridGpu::virtual_subdivision, "virtual-subdivision"),
    ] {
        let mut grid = method(device.gpu.clone(), &mesh).unwrap();
        assert_eq!(grid.name(), name);
        let mut ask = |query: &Query<'_>| grid.detect(&mesh, query, &pool(1)).map(|_| ());
        assert_eq!(ask(&good), Ok(()));
        assert!(matches!(
            ask(&Query { thickness: f64::NAN, ..good }),
            Err(DetectError::Parameter { parameter: "thickness", .. })
        ));
        assert!(matches!(
            ask(&Query { x_t1: &bad, ..good }),
            Err(DetectError::NotFinite { array: "x_t1", vertex: 2, .. })
        ));
        assert!(matches!(
            grid.detect(&empty, &good, &pool(1)),
            Err(DetectError::OtherMesh { expected: 1, got: 0 })
        ));
        let none = method(device.gpu.clone(), &empty).unwrap().detect(&empty, &good, &pool(1)).unwrap();
        assert_eq!(none, Contacts::default());
    }
    for lambda in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let options = GridOptions { subdivision: Some(lambda), ..GridOptions::default() };
        let refused = GridGpu::with_options(device.gpu.clone(), &mesh, options).map(|_| ());
        assert!(matches!(
            refused,
            Err(GpuError::Query(DetectError::Parameter { parameter: "subdivision", .. }))
        ));
    }
}

#[test]
fn a_lost_device_is_an_error_and_a_new_one_works() {
    let Some(lost) = device(GpuOptions::default()) else { return };
    let mut random = Random(11);
    let (x, triangles) = soup(50, 0.3, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let query = Query { x_t0: &x, x_t1: &x, thickness: 0.0, mode: Mode::Continuous, active: None };
    let mut grid = GridGpu::new(lost.gpu.clone(), &mesh).unwrap();
    let before = grid.detect(&mesh, &query, &pool(1)).unwrap();
    lost.gpu.close();
    for _ in 0..2 {
        match grid.detect(&mesh, &query, &pool(1)) {
            Err(DetectError::Device { detector: "grid", reason }) => {
                assert!(reason.contains("lost"), "{reason}");
            }
            other => panic!("{other:?}"),
        }
    }
    drop(lost);
    let Some(device) = device(GpuOptions::default()) else { return };
    let after = GridGpu::new(device.gpu.clone(), &mesh).unwrap().detect(&mesh, &query, &pool(1)).unwrap();
    assert_eq!(difference(&before, &after), None);
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

#[test]
fn a_missing_contact_is_noticed() {
    let mut random = Random(9);
    let (x_t0, triangles) = soup(30, 0.3, &mut random);
    let x_t1 = moved(&x_t0, 0.3, &mut random);
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    let good = BruteForce.detect(&mesh, &query, &pool(1)).unwrap();
    let mut bad = good.clone();
    bad.edge_edge.remove(bad.edge_edge.len() / 2);
    assert!(difference(&good, &bad).is_some_and(|d| d.contains("edge-edge")));
    let mut late = good.clone();
    late.time_vertex_triangle[0] += 1e-9;
    assert_eq!(difference(&good, &late).as_deref(), Some("times"));
}
