//! Both distributions of the tests, and both ways to find superfluous registrations, have the same pairs.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_gpu::collision::{BruteForce, CollisionMesh, Detector, Mode, Query, Vec3};
use cloth_gpu::limits::status;
use cloth_gpu::stages::bounds::Scene;
use cloth_gpu::stages::subdivision::{self, Subdivision};
use cloth_gpu::stages::{cells::Cells, pairs::Pairs};
use cloth_gpu::twin::pairs::{pairs_count, pairs_owners};
use cloth_gpu::{Distribution, Duplicates, Frame, Gpu, GpuOptions, GridGpu, GridOptions, Recorder};
use support::{Random, device, difference, moved, pool, soup, variants};

/// Loose triangles of which some are large.
fn scene(n: usize, random: &mut Random) -> (CollisionMesh, Vec<Vec3>, Vec<Vec3>) {
    let (mut x_t0, mut triangles) = soup(n, 0.05, random);
    for (t, corners) in triangles.iter_mut().enumerate() {
        corners[0] = 3 * t as u32;
    }
    for x in x_t0.iter_mut().step_by(31) {
        *x += random.vector(0.3);
    }
    let x_t1 = moved(&x_t0, 0.05, random);
    (CollisionMesh::single(x_t0.len(), &triangles).unwrap(), x_t0, x_t1)
}

/// What a portion of the tests left: the pairs, sorted, the keys of the registrations and the owners of the tests.
struct Portion {
    pairs: Vec<[u32; 2]>,
    keys: Vec<u32>,
    owners: Vec<u32>,
    tests: u64,
}

fn portion(
    gpu: &Gpu,
    mesh: &CollisionMesh,
    query: &Query<'_>,
    by_scan: bool,
    start: u64,
    count: u32,
) -> Portion {
    let n = mesh.triangles.len();
    let mut scene = Scene::new(gpu, mesh).unwrap();
    scene.upload(gpu, query, &Frame::new(query, &pool(1)));
    let mut cells = Cells::new(gpu, n as u32, 8 * n).unwrap();
    let mut pairs = Pairs::new(gpu, 1 << 16, by_scan).unwrap();
    let mut recorder = Recorder::new(gpu);
    scene.record(&mut recorder);
    cells.record_setup(&mut recorder, &scene);
    cells.record(&mut recorder, scene.registered(), &scene.spheres, 32).unwrap();
    pairs.record_counts(&mut recorder, &cells).unwrap();
    pairs.record_tests(&mut recorder, &scene, &cells, start, count).unwrap();
    let words = recorder.download(&scene.status, 0..status::LENGTH as usize);
    let found = recorder.download(&pairs.found, 0..pairs.found.capacity());
    let keys = recorder.download(&cells.keys, 0..cells.keys.capacity());
    let owners = pairs.owners().map(|owners| recorder.download(owners, 0..count as usize + 1));
    let answer = recorder.run().unwrap();
    let words: Vec<u32> = answer.read(words);
    let word = |k: u32| words[k as usize] as usize;
    let mut pairs: Vec<[u32; 2]> = answer.read(found)[..word(status::TRIANGLE_PAIRS)].to_vec();
    pairs.sort_unstable();
    Portion {
        pairs,
        keys: answer.read::<u32>(keys)[..word(status::REGISTRATIONS)].to_vec(),
        owners: owners.map_or(vec![], |copy| answer.read::<u32>(copy)[1..].to_vec()),
        tests: word(status::PAIRS) as u64,
    }
}

#[test]
fn both_distributions_find_the_same_pairs() {
    for options in variants() {
        let Some(device) = device(options) else { return };
        let mut random = Random(1);
        for n in [1, 2, 300] {
            let (mesh, x_t0, x_t1) = scene(n, &mut random);
            let query =
                Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
            let tests = portion(&device.gpu, &mesh, &query, false, 0, 1).tests;
            assert!(n < 100 || tests > 5000);
            for (start, count) in [(0, tests as u32 + 7), (0, 1), (tests / 2, 3000), (tests.max(1) - 1, 100)]
            {
                let [searched, scanned] =
                    [false, true].map(|by_scan| portion(&device.gpu, &mesh, &query, by_scan, start, count));
                let what = format!("{n}: {count} of {tests} from {start}");
                assert_eq!(searched.pairs, scanned.pairs, "{what}");
                assert!(n < 100 || count < 3000 || !searched.pairs.is_empty(), "{what}");
                let expected = pairs_owners(&pairs_count(&scanned.keys), start, count);
                let mut owners = scanned.owners;
                owners.truncate(expected.len());
                assert_eq!(owners, expected, "{what}");
                // A test that is given to the registration before is noticed.
                if let Some(last) = owners.last_mut() {
                    *last = last.wrapping_sub(1);
                    assert_ne!(owners, expected);
                }
            }
        }
    }
}

#[test]
fn variants_of_the_methods_agree() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut random = Random(2);
    let (mesh, x_t0, x_t1) = scene(300, &mut random);
    for (mode, thickness) in [(Mode::Continuous, 0.0), (Mode::Discrete, 0.02)] {
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode, active: None };
        let expected = BruteForce.detect(&mesh, &query, &pool(1)).unwrap();
        assert!(expected.edge_edge.len() > 50);
        for subdivision in [None, Some(1.2)] {
            let mut tests = vec![];
            for distribution in [Distribution::BinarySearch, Distribution::SegmentedScan] {
                for duplicates in [Duplicates::OneSort, Duplicates::All] {
                    for (first_capacity, max_tests) in [(None, None), (Some(1), Some(999))] {
                        let options = GridOptions {
                            subdivision,
                            first_capacity,
                            max_tests,
                            distribution,
                            duplicates,
                            ..GridOptions::default()
                        };
                        let mut grid = GridGpu::with_options(device.gpu.clone(), &mesh, options).unwrap();
                        for _ in 0..2 {
                            let got = grid.detect(&mesh, &query, &pool(1)).unwrap();
                            assert_eq!(difference(&expected, &got), None, "{options:?}");
                            tests.push((got.stats.broad_phase_tests, got.stats.leaf_pairs));
                        }
                    }
                }
            }
            assert!(tests.iter().all(|t| *t == tests[0]), "{tests:?}");
        }
    }
}

/// Keys and registered parts after the sorts of either kind, and whether each is kept.
fn registrations(gpu: &Gpu, mesh: &CollisionMesh, query: &Query<'_>, all: bool) -> Vec<(u32, u32, u32)> {
    let (n, room) = (mesh.triangles.len() as u32, 1 << 14);
    let frame = Frame::new(query, &pool(1));
    let mut scene = Scene::new(gpu, mesh).unwrap();
    scene.upload(gpu, query, &frame);
    let mut cells = Cells::new(gpu, room, 4 * room as usize).unwrap();
    cells.sorts_roots = all;
    let mut stage = Subdivision::new(gpu, n, room as usize).unwrap();
    let params = subdivision::params(&scene, &frame, room, 1.2);
    let mut recorder = Recorder::new(gpu);
    scene.record(&mut recorder);
    stage.record(&mut recorder, &scene, &cells, &params).unwrap();
    cells.record(&mut recorder, stage.registered(n), &scene.spheres, 32).unwrap();
    let copies =
        [&cells.keys, &cells.registered, &cells.marks].map(|a| recorder.download(a, 0..a.capacity()));
    let count = recorder.download(&cells.offsets, room as usize..room as usize + 1);
    let answer = recorder.run().unwrap();
    let [keys, registered, marks] = copies.map(|c| answer.read::<u32>(c));
    let count = answer.read::<u32>(count)[0] as usize;
    (0..count).map(|r| (keys[r], registered[r], marks[r])).collect()
}

#[test]
fn both_kinds_of_sorts_keep_the_same_registrations() {
    for options in variants() {
        let Some(device) = device(options) else { return };
        let mut random = Random(3);
        let (mesh, x_t0, x_t1) = scene(200, &mut random);
        for mode in [Mode::Continuous, Mode::Discrete] {
            let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode, active: None };
            let [one, all] = [false, true].map(|all| registrations(&device.gpu, &mesh, &query, all));
            assert_eq!(one, all);
            let kept = one.iter().filter(|r| r.2 != 0).count();
            assert!(kept > 200 && kept < one.len(), "{kept} of {}", one.len());
        }
    }
}

/// Seconds of each stage on the device where it can tell, else of the whole; and kernels are compiled once.
#[test]
fn stages_are_timed_and_kernels_compiled_once() {
    for timestamps in [true, false] {
        let Some(device) = device(GpuOptions { timestamps, ..GpuOptions::default() }) else { return };
        let (mesh, x_t0, x_t1) = scene(100, &mut Random(4));
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
        let mut compiled = vec![];
        for _ in 0..2 {
            let mut grid = GridGpu::virtual_subdivision(device.gpu.clone(), &mesh).unwrap();
            let seconds = grid.detect(&mesh, &query, &pool(1)).unwrap().stats.seconds;
            let of = |name: &str| seconds.iter().find(|s| s.0 == name).map(|s| s.1);
            for name in ["upload", "device", "narrow phase", "merge"] {
                assert!(of(name).is_some_and(|s| s >= 0.0), "{name}: {seconds:?}");
            }
            let stages = ["bounds", "subdivision", "sort", "gather", "workload", "triangle pairs"];
            for name in stages.into_iter().chain(["feature pairs", "narrow filter"]) {
                assert_eq!(of(name).is_some(), device.gpu.has_timestamps(), "{name}: {seconds:?}");
            }
            let total: f64 = stages.into_iter().filter_map(of).sum();
            assert!(Some(total) <= of("device"), "{seconds:?}");
            compiled.push(device.gpu.compiled());
        }
        assert!(compiled[0] > 15 && compiled[0] == compiled[1], "{compiled:?}");
    }
}
