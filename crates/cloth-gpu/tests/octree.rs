//! The octree on the device gives exactly the contacts of testing every pair: pairs and times.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_gpu::collision::{BruteForce, CollisionMesh, Contacts, DetectError, Detector, Mode, Query, Vec3};
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
