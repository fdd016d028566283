//! Scenes in chunks have the contacts of the whole.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
#![allow(clippy::print_stdout, reason = "a run says its times")]

mod support;

use cloth_gpu::collision::{BruteForce, Bvh, CollisionMesh, DetectError, Detector, Mode, Query, Vec3};
use cloth_gpu::{GpuOptions, GridGpu, GridOptions};
use std::time::Instant;
use support::{Random, bodies, device, difference, moved, pool, sheet, soup};

/// Compares with brute force, at most `most` triangles at a time; returns contacts and chunks.
fn compare(
    device: &support::Device,
    mesh: &CollisionMesh,
    ends: [&[Vec3]; 2],
    random: &mut Random,
    most: u32,
) -> [u64; 2] {
    let mut found = [0; 2];
    let mask: Vec<bool> = (0..mesh.vertex_count).map(|_| random.below(10) == 0).collect();
    for subdivision in [None, Some(1.2)] {
        let options = GridOptions { subdivision, max_triangles: Some(most), ..GridOptions::default() };
        let mut grid = GridGpu::with_options(device.gpu.clone(), mesh, options).unwrap();
        for (mode, thickness, active) in [
            (Mode::Continuous, 0.0, None),
            (Mode::Continuous, 0.02, Some(&mask[..])),
            (Mode::Discrete, 0.02, None),
        ] {
            let query = Query { x_t0: ends[0], x_t1: ends[1], thickness, mode, active };
            let expected = BruteForce.detect(mesh, &query, &pool(1)).unwrap();
            let got = grid.detect(mesh, &query, &pool(1)).unwrap();
            assert_eq!(difference(&expected, &got), None, "{most}, {mode:?}, {thickness}");
            found[0] += (got.vertex_triangle.len() + got.edge_edge.len()) as u64;
            found[1] = found[1].max(got.stats.count("chunks"));
        }
    }
    found
}

#[test]
fn chunks_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut random = Random(1);
    let (x, triangles) = sheet(12, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let [contacts, chunks] = compare(&device, &mesh, [&x, &moved(&x, 0.15, &mut random)], &mut random, 100);
    assert!(contacts > 100 && chunks > 3, "{contacts} contacts, {chunks} chunks");

    let (x, triangles) = soup(150, 0.1, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let [contacts, chunks] = compare(&device, &mesh, [&x, &moved(&x, 0.1, &mut random)], &mut random, 60);
    assert!(contacts > 100 && chunks > 3, "{contacts} contacts, {chunks} chunks");

    let (mesh, x) = bodies(&mut random);
    let [contacts, chunks] = compare(&device, &mesh, [&x, &moved(&x, 0.2, &mut random)], &mut random, 30);
    assert!(contacts > 100 && chunks > 3, "{contacts} contacts, {chunks} chunks");

    // No plane parts them.
    let (x, triangles) =
        (vec![Vec3::new(0.3, -2.0, 1e5); 120], (0..40).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]));
    let mesh = CollisionMesh::single(120, &triangles.collect::<Vec<_>>()).unwrap();
    let [contacts, chunks] = compare(&device, &mesh, [&x, &x], &mut random, 25);
    assert!(contacts > 1000 && chunks > 3, "{contacts} contacts, {chunks} chunks");
}

/// Bindings that hold a part of the scene only: what does not fit is split until it does.
#[test]
fn small_bindings_make_chunks() {
    let mut random = Random(2);
    let (x_t0, triangles) = soup(400, 0.1, &mut random);
    let x_t1 = moved(&x_t0, 0.1, &mut random);
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    let expected = BruteForce.detect(&mesh, &query, &pool(1)).unwrap();
    // The second holds the triangles, but not their registrations: that is known only in the middle of the call.
    for (bytes, max_triangles) in [(20_000, None), (30_000, Some(1000))] {
        let options = GpuOptions { max_binding_bytes: Some(bytes), ..GpuOptions::default() };
        let Some(device) = device(options) else { return };
        for subdivision in [None, Some(1.2)] {
            let options = GridOptions { subdivision, max_triangles, ..GridOptions::default() };
            let mut grid = GridGpu::with_options(device.gpu.clone(), &mesh, options).unwrap();
            for _ in 0..2 {
                let got = grid.detect(&mesh, &query, &pool(1)).unwrap();
                assert_eq!(difference(&expected, &got), None, "{bytes}");
                assert!(got.stats.count("chunks") > 1, "{bytes}, {subdivision:?}");
            }
        }
    }
}

#[test]
fn bindings_too_small_for_anything_say_so() {
    let options = GpuOptions { max_binding_bytes: Some(256), ..GpuOptions::default() };
    let Some(device) = device(options) else { return };
    let (x, triangles) = soup(40, 0.3, &mut Random(3));
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let query = Query { x_t0: &x, x_t1: &x, thickness: 0.0, mode: Mode::Continuous, active: None };
    match GridGpu::new(device.gpu.clone(), &mesh).unwrap().detect(&mesh, &query, &pool(1)) {
        Err(DetectError::Device { detector: "grid", reason }) => {
            assert!(reason.contains("bytes"), "{reason}");
        }
        other => panic!("{other:?}"),
    }
}

/// Four million triangles: a sheet that five hundred loose ones fall through.
#[test]
#[ignore = "takes minutes on a software adapter: run with --ignored"]
fn four_million_triangles_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut random = Random(4);
    let (mut x_t0, mut triangles) = sheet(1416, &mut random);
    assert!(triangles.len() > 4_000_000);
    let mut x_t1 = x_t0.clone();
    let size = 2.0 / 1415.0;
    for _ in 0..500 {
        let place = x_t0[random.below(1416 * 1416)];
        let first = x_t0.len() as u32;
        triangles.push([first, first + 1, first + 2]);
        for _ in 0..3 {
            let corner = place + random.vector(size);
            x_t0.push(corner + Vec3::y() * (2.0 * size));
            x_t1.push(corner - Vec3::y() * (2.0 * size));
        }
    }
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    let expected = Bvh::new(&mesh, &x_t0).unwrap().detect(&mesh, &query, &pool(2)).unwrap();
    assert!(expected.edge_edge.len() > 1000);
    let mut grid = GridGpu::new(device.gpu.clone(), &mesh).unwrap();
    let clock = Instant::now();
    let got = grid.detect(&mesh, &query, &pool(2)).unwrap();
    println!("{:.1} s, {:?}", clock.elapsed().as_secs_f64(), got.stats);
    assert_eq!(difference(&expected, &got), None);
}
