//! Every method of the GPU gives exactly the contacts of testing every pair, pairs and times, names bad input, and survives a lost
//! device.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_gpu::collision::{
    BruteForce, Bvh, CollisionMesh, Contacts, DetectError, Detector, Mode, Query, Vec3,
};
use cloth_gpu::{Gpu, GpuError, GpuOptions, GridGpu, GridOptions, OctreeGpu, OctreeOptions};
use std::sync::Arc;
use support::{Random, agree, bodies, device, difference, moved, pool, sheet, soup, variants};

/// A method, built for a topology.
type Build = fn(Arc<Gpu>, &CollisionMesh) -> Result<Box<dyn Detector>, GpuError>;

const METHODS: [(&str, Build); 4] = [
    ("grid", |gpu, mesh| Ok(Box::new(GridGpu::new(gpu, mesh)?))),
    ("virtual-subdivision", |gpu, mesh| Ok(Box::new(GridGpu::virtual_subdivision(gpu, mesh)?))),
    ("octree-single", |gpu, mesh| Ok(Box::new(OctreeGpu::single(gpu, mesh)?))),
    ("octree", |gpu, mesh| Ok(Box::new(OctreeGpu::new(gpu, mesh)?))),
];

fn methods(gpu: &Arc<Gpu>, mesh: &CollisionMesh) -> [Box<dyn Detector>; 4] {
    METHODS.map(|(_, build)| build(gpu.clone(), mesh).unwrap())
}

/// Compares all methods in both modes, without and with a thickness, without and with masks; returns the contacts' number.
fn compare_all(
    gpu: &Arc<Gpu>,
    mesh: &CollisionMesh,
    x_t0: &[Vec3],
    x_t1: &[Vec3],
    random: &mut Random,
    what: &str,
) -> usize {
    let mut found = 0;
    let mut methods = methods(gpu, mesh);
    let mask: Vec<bool> = (0..mesh.vertex_count).map(|_| random.below(10) == 0).collect();
    let none = vec![false; mesh.vertex_count];
    for mode in [Mode::Continuous, Mode::Discrete] {
        for thickness in [0.0, 0.02] {
            for active in [None, Some(&mask[..]), Some(&none[..])] {
                let query = Query { x_t0, x_t1, thickness, mode, active };
                let what = format!("{what}, {mode:?}, {thickness}, {}", active.is_some());
                found += agree(methods.iter_mut().map(AsMut::as_mut), mesh, &query, &what);
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
        let (x_t0, mut triangles) = soup(600, 0.04, &mut random);
        let x_t1 = moved(&x_t0, 0.03, &mut random);
        if seed < 4 {
            // Loose ones only: a shared vertex makes a triangle as long as the scene.
            triangles.retain(|t| t[0] + 2 == t[2]);
        }
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        found += compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, &format!("fine soup {seed}"));
    }
    assert!(found > 1000, "the scenes must hold contacts, found {found}");
}

#[test]
fn sheets_far_from_the_origin_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    for (seed, offset, n) in [(1, 0.0, 10), (2, 1e3, 12), (3, -1e6, 10), (4, -1e6, 12)] {
        let mut random = Random(seed);
        let (mut x_t0, triangles) = sheet(n, &mut random);
        for x in &mut x_t0 {
            *x += Vec3::repeat(offset);
        }
        let x_t1 = moved(&x_t0, 0.15, &mut random);
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        let found = compare_all(&device.gpu, &mesh, &x_t0, &x_t1, &mut random, &format!("sheet at {offset}"));
        assert!(found > 10, "the scene must hold contacts, found {found}");
    }
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
        let mut methods = methods(&device.gpu, &mesh);
        for thickness in [0.0, 0.01 * scale, 1e306] {
            let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode: Mode::Continuous, active: None };
            let what = format!("{scale}, {thickness}");
            assert!(agree(methods.iter_mut().map(AsMut::as_mut), &mesh, &query, &what) > 0);
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

    // A flat sheet that moves along itself: the scene has no height.
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
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    let all = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    // The traditional grid has all of them in one cell: five thousand million tests, so fewer triangles.
    let few = CollisionMesh::single(x_t0.len(), &triangles[triangles.len() - 4000..]).unwrap();
    let [of_all, of_few] =
        [&all, &few].map(|m| Bvh::new(m, &x_t0).unwrap().detect(m, &query, &pool(2)).unwrap());
    let huge = triangles.len() as u32 - 1;
    assert!(of_all.vertex_triangle.iter().filter(|p| p[1] == huge).count() > 50);
    for (name, build) in METHODS {
        let (mesh, expected, tests) = match name {
            "grid" => (&few, &of_few, 7_000_000..u64::MAX),
            "virtual-subdivision" => (&all, &of_all, 0..50_000_000),
            _ => (&all, &of_all, 0..2_000_000),
        };
        let mut method = build(device.gpu.clone(), mesh).unwrap();
        // An octree's levels are others then.
        let turns = if name == "octree" { 2 } else { 1 };
        for turn in 0..turns {
            let got = method.detect(mesh, &query, &pool(2)).unwrap();
            assert_eq!(difference(expected, &got), None, "{name}, {turn}");
            let got = got.stats.broad_phase_tests;
            assert!(tests.contains(&got), "{name}, {turn}: {got}");
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
    for (name, build) in METHODS {
        let mut method = build(device.gpu.clone(), &mesh).unwrap();
        assert_eq!(method.name(), name);
        let mut ask = |query: &Query<'_>| method.detect(&mesh, query, &pool(1)).map(|_| ());
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
            method.detect(&empty, &good, &pool(1)),
            Err(DetectError::OtherMesh { expected: 1, got: 0 })
        ));
        let mut none = build(device.gpu.clone(), &empty).unwrap().detect(&empty, &good, &pool(1)).unwrap();
        let registrations = none.stats.counts.iter().find(|c| c.0 == "registrations");
        assert_eq!(registrations, Some(&("registrations", 0)), "{name}");
        none.stats.counts.clear();
        assert_eq!(none, Contacts::default(), "{name}");
    }
    for lambda in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let options = GridOptions { subdivision: Some(lambda), ..GridOptions::default() };
        let refused = GridGpu::with_options(device.gpu.clone(), &mesh, options).map(|_| ());
        assert!(matches!(
            refused,
            Err(GpuError::Query(DetectError::Parameter { parameter: "subdivision", .. }))
        ));
    }
    for levels in [0, 11] {
        let options = OctreeOptions { levels: Some(levels), ..OctreeOptions::default() };
        let refused = OctreeGpu::with_options(device.gpu.clone(), &mesh, options).map(|_| ());
        assert!(matches!(refused, Err(GpuError::Query(DetectError::Parameter { parameter: "levels", .. }))));
    }
}

#[test]
fn a_lost_device_is_an_error_and_a_new_one_works() {
    let Some(lost) = device(GpuOptions::default()) else { return };
    let mut random = Random(11);
    let (x, triangles) = soup(50, 0.3, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let query = Query { x_t0: &x, x_t1: &x, thickness: 0.0, mode: Mode::Continuous, active: None };
    let mut built = methods(&lost.gpu, &mesh);
    let before = built.each_mut().map(|method| method.detect(&mesh, &query, &pool(1)).unwrap());
    lost.gpu.close();
    for method in &mut built {
        for _ in 0..2 {
            match method.detect(&mesh, &query, &pool(1)) {
                Err(DetectError::Device { detector, reason }) => {
                    assert_eq!(detector, method.name());
                    assert!(reason.contains("lost"), "{reason}");
                }
                other => panic!("{}: {other:?}", method.name()),
            }
        }
    }
    drop(lost);
    let Some(device) = device(GpuOptions::default()) else { return };
    for (method, before) in methods(&device.gpu, &mesh).iter_mut().zip(&before) {
        let after = method.detect(&mesh, &query, &pool(1)).unwrap();
        assert_eq!(difference(before, &after), None, "{}", method.name());
    }
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
