//! The published scenes: the contacts of the grid are those of the tree on the CPU.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
#![allow(clippy::print_stderr, clippy::print_stdout, reason = "a skipped test says so, a run its times")]

mod support;

use cloth_gpu::collision::{Bvh, CollisionMesh, Detector, Mode, Query, Vec3};
use cloth_gpu::{Distribution, Duplicates, GpuOptions, GridGpu, GridOptions, OctreeGpu};
use std::time::Instant;
use support::{device, difference, npz, pool};

struct Scene {
    x_t0: Vec<Vec3>,
    x_t1: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// A scene of `../shared/data/ccd` beside the repository; None, with the reason, if it is not there.
fn scene(name: &str) -> Option<Scene> {
    let path = format!("{}/../../../shared/data/ccd/{name}.npz", env!("CARGO_MANIFEST_DIR"));
    let Ok(archive) = std::fs::read(&path) else {
        eprintln!("skipped: no file {path}");
        return None;
    };
    let positions = |member: &str| {
        let rows = npz::rows(&npz::array(&archive, member).unwrap(), f64::from_le_bytes);
        rows.into_iter().map(Vec3::from).collect()
    };
    let triangles = npz::rows(&npz::array(&archive, "F.npy").unwrap(), u32::from_le_bytes);
    Some(Scene { x_t0: positions("V0.npy"), x_t1: positions("V1.npy"), triangles })
}

fn agrees(method: &str, name: &str, modes: &[Mode], turns: &[&str]) {
    let Some(device) = device(GpuOptions::default()) else { return };
    let Some(Scene { x_t0, x_t1, triangles }) = scene(name) else { return };
    let pool = pool(2);
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    let mut bvh = Bvh::new(&mesh, &x_t0).unwrap();
    let mut grid = match method {
        "grid" => GridGpu::new(device.gpu.clone(), &mesh).unwrap(),
        _ => GridGpu::virtual_subdivision(device.gpu.clone(), &mesh).unwrap(),
    };
    for &mode in modes {
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode, active: None };
        let expected = bvh.detect(&mesh, &query, &pool).unwrap();
        for turn in turns {
            let clock = Instant::now();
            let got = grid.detect(&mesh, &query, &pool).unwrap();
            println!(
                "{method}, {name}, {mode:?}, {turn}: {:.2} s, {} MiB, {:?}",
                clock.elapsed().as_secs_f64(),
                grid.bytes() >> 20,
                got.stats
            );
            assert_eq!(difference(&expected, &got), None, "{method}, {name}, {mode:?}, {turn}");
        }
        assert!(!expected.edge_edge.is_empty() || mode == Mode::Discrete);
    }
}

#[test]
fn cloth_ball_agrees() {
    agrees("grid", "cloth-ball", &[Mode::Continuous, Mode::Discrete], &["first"]);
}

#[test]
fn funnel_agrees() {
    agrees("grid", "cloth-funnel", &[Mode::Continuous, Mode::Discrete], &["first"]);
}

#[test]
fn n_body_at_rest_agrees() {
    agrees("grid", "n-body-simulation", &[Mode::Discrete], &["first"]);
}

#[test]
#[ignore = "two thousand million tests: minutes on a software adapter"]
fn n_body_in_motion_agrees() {
    agrees("grid", "n-body-simulation", &[Mode::Continuous], &["first"]);
}

#[test]
fn subdivision_agrees_on_all() {
    let both = [Mode::Continuous, Mode::Discrete];
    for name in ["cloth-ball", "cloth-funnel", "n-body-simulation"] {
        agrees("virtual-subdivision", name, &both, &["first"]);
    }
}

/// What 18-DOPs and the filter save, and the other variants; the contacts of all are the same.
fn variants_agree(name: &str) {
    let Some(device) = device(GpuOptions::default()) else { return };
    let Some(Scene { x_t0, x_t1, triangles }) = scene(name) else { return };
    let pool = pool(2);
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    for mode in [Mode::Continuous, Mode::Discrete] {
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode, active: None };
        let expected = Bvh::new(&mesh, &x_t0).unwrap().detect(&mesh, &query, &pool).unwrap();
        let plain = GridOptions { subdivision: Some(1.2), ..GridOptions::default() };
        for options in [
            GridOptions { dops: false, device_filter: false, ..plain },
            GridOptions { dops: true, device_filter: false, ..plain },
            GridOptions { dops: false, ..plain },
            GridOptions { dops: true, ..plain },
            GridOptions { distribution: Distribution::SegmentedScan, ..plain },
            GridOptions { duplicates: Duplicates::All, ..plain },
        ] {
            let mut grid = GridGpu::with_options(device.gpu.clone(), &mesh, options).unwrap();
            let got = grid.detect(&mesh, &query, &pool).unwrap();
            assert_eq!(difference(&expected, &got), None, "{name}, {mode:?}, {options:?}");
            println!("{name}, {mode:?}, {options:?}: {:?}", got.stats);
        }
    }
}

#[test]
fn variants_agree_on_the_funnel() {
    variants_agree("cloth-funnel");
}

#[test]
#[ignore = "each scene twelve times: minutes on a software adapter"]
fn variants_agree_on_the_others() {
    variants_agree("cloth-ball");
    variants_agree("n-body-simulation");
}

/// The octree's contacts are those of the tree on the CPU, with at least 39 % fewer tests than virtual subdivision takes, and no more
/// than single-stage (thesis 6.4.2).
fn octree_agrees(name: &str, mode: Mode, turns: &[&str]) {
    let Some(device) = device(GpuOptions::default()) else { return };
    let Some(Scene { x_t0, x_t1, triangles }) = scene(name) else { return };
    let pool = pool(2);
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode, active: None };
    let expected = Bvh::new(&mesh, &x_t0).unwrap().detect(&mesh, &query, &pool).unwrap();
    let mut subdivision = GridGpu::virtual_subdivision(device.gpu.clone(), &mesh).unwrap();
    let tests = subdivision.detect(&mesh, &query, &pool).unwrap().stats.broad_phase_tests;
    drop(subdivision);
    let mut single = 0;
    for new in [OctreeGpu::single, OctreeGpu::new] {
        let mut octree = new(device.gpu.clone(), &mesh).unwrap();
        let (method, mut first) = (octree.name(), None);
        for turn in turns {
            let clock = Instant::now();
            let got = octree.detect(&mesh, &query, &pool).unwrap();
            println!(
                "{method}, {name}, {mode:?}, {turn}: {:.2} s, {} MiB, {:?}",
                clock.elapsed().as_secs_f64(),
                octree.bytes() >> 20,
                got.stats
            );
            assert_eq!(difference(&expected, &got), None, "{method}, {name}, {mode:?}, {turn}");
            let got = got.stats.broad_phase_tests;
            assert!(got * 100 <= tests * 61, "{method}, {name}, {mode:?}, {turn}: {got} of {tests}");
            first.get_or_insert(got);
        }
        // The first trees have the same levels.
        match method {
            "octree" => assert!(first <= Some(single), "{first:?}, {single}"),
            _ => single = first.unwrap_or(0),
        }
    }
}

#[test]
fn octree_agrees_on_the_funnel() {
    for mode in [Mode::Continuous, Mode::Discrete] {
        octree_agrees("cloth-funnel", mode, &["first", "again"]);
    }
}

#[test]
fn octree_agrees_on_the_others() {
    for name in ["cloth-ball", "n-body-simulation"] {
        for mode in [Mode::Continuous, Mode::Discrete] {
            octree_agrees(name, mode, &["first"]);
        }
    }
}
