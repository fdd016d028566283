//! Detection by stage: topology and tree, continuous and discrete detection, proximity, intersections; one and two threads.
//!
//! Two scenes by formula. `folded`: a sheet of 25,088 triangles folded onto itself 3 mm apart, with waves, that moves
//! and shivers, as a draped cloth does. `tangle`: a sheet of 99,856 triangles whose layers pass through each other within one step, with
//! many contacts. `frame pair`: that scene with 10,082 to 999,698 triangles, everything from nothing. `session`: the coherent sequences of `cloth_benches::sequences`, 100,000 triangles, sessions against frames alone;
//! an iteration is so many frames. The scenes of the published ground truth are timed by `compare_ipctk.py`, beside another library.

#![allow(missing_docs, reason = "criterion's macros make public items")]
#![allow(clippy::unwrap_used, reason = "a bench that cannot start has nothing to measure")]

use cloth_benches::sequences::{folding, spinning_ball};
use cloth_collision::mesh::{Vec3, generators};
use cloth_collision::{
    BruteForce, Bvh, CollisionMesh, Detector, Mode, Query, SessionOptions, SkippingSession, Variant,
    edge_edge_ccd, self_intersections, vertex_triangle_ccd,
};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use std::hint::black_box;

/// Thickness of a cloth in contact [m].
const THICKNESS: f64 = 0.004;

struct Scene {
    triangles: Vec<[u32; 3]>,
    x_t0: Vec<Vec3>,
    x_t1: Vec<Vec3>,
}

/// A 2 m sheet of n × n vertices folded in the middle, its layers `gap` apart [m]; during the step the upper layer sinks by
/// `sink` [m] and all of it moves on.
fn folded(n: usize, gap: f64, sink: f64) -> Scene {
    let sheet = generators::grid(2.0, 2.0, n, n).unwrap();
    let fold = |p: &Vec3, lift: f64| {
        let wave = 0.01 * (12.0 * p.z).sin() * (9.0 * p.x.abs()).cos();
        let upper = if p.x > 0.0 { lift } else { 0.0 };
        Vec3::new(p.x.abs() + 0.0013 * p.z, upper + wave, p.z + 0.0007 * p.x)
    };
    let x_t0: Vec<Vec3> = sheet.vertices.iter().map(|p| fold(p, gap)).collect();
    let x_t1 = sheet
        .vertices
        .iter()
        .map(|p| {
            fold(p, gap - sink * (7.0 * p.z).sin().abs()) + Vec3::new(0.01, -0.03, 0.002 * (20.0 * p.x).sin())
        })
        .collect();
    Scene { triangles: sheet.triangles, x_t0, x_t1 }
}

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

fn query(scene: &Scene, thickness: f64, mode: Mode) -> Query<'_> {
    Query { x_t0: &scene.x_t0, x_t1: &scene.x_t1, thickness, mode, active: None }
}

fn scenes(c: &mut Criterion) {
    for (name, scene) in [("folded", folded(113, 0.003, 0.0)), ("tangle", folded(224, 0.003, 0.012))] {
        let mesh = CollisionMesh::single(scene.x_t0.len(), &scene.triangles).unwrap();
        let mut group = c.benchmark_group(name);
        group.sample_size(20);
        group.bench_function("topology", |b| {
            b.iter(|| CollisionMesh::single(scene.x_t0.len(), black_box(&scene.triangles)).unwrap());
        });
        group.bench_function("tree", |b| b.iter(|| Bvh::new(&mesh, black_box(&scene.x_t0)).unwrap()));
        for threads in [1, 2] {
            let pool = pool(threads);
            let mut bvh = Bvh::new(&mesh, &scene.x_t0).unwrap();
            for (what, thickness, mode) in [
                ("continuous", 0.0, Mode::Continuous),
                ("continuous, 4 mm", THICKNESS, Mode::Continuous),
                ("discrete, 4 mm", THICKNESS, Mode::Discrete),
            ] {
                group.bench_function(format!("{what}, {threads} threads"), |b| {
                    b.iter(|| bvh.detect(&mesh, black_box(&query(&scene, thickness, mode)), &pool).unwrap());
                });
            }
            group.bench_function(format!("proximity, {threads} threads"), |b| {
                b.iter(|| bvh.proximity(&mesh, black_box(&scene.x_t0), THICKNESS, None, &pool).unwrap());
            });
            group.bench_function(format!("intersections, {threads} threads"), |b| {
                b.iter(|| self_intersections(&scene.triangles, black_box(&scene.x_t1), &pool).unwrap());
            });
        }
        group.finish();
    }
}

/// One frame pair from nothing (topology, tree, detection), as `clothsim.collision.detect` does it, against the size: the tangle with
/// finer and finer triangles.
fn sizes(c: &mut Criterion) {
    let mut group = c.benchmark_group("frame pair");
    group.sample_size(10);
    for n in [72, 224, 708] {
        let scene = folded(n, 0.003, 0.012);
        for threads in [1, 2] {
            let pool = pool(threads);
            let name = format!("{} triangles, {threads} threads", scene.triangles.len());
            group.bench_function(name, |b| {
                b.iter(|| {
                    let mesh = CollisionMesh::single_in(scene.x_t0.len(), &scene.triangles, &pool).unwrap();
                    let mut bvh = Bvh::new_in(&mesh, black_box(&scene.x_t0), &pool).unwrap();
                    bvh.detect(&mesh, &query(&scene, 0.0, Mode::Continuous), &pool).unwrap()
                });
            });
        }
    }
    group.finish();
}

/// Frames of a sequence, and vertices of a side of its cloth.
const FRAMES: u32 = 32;
const SIDE: usize = 221;

fn sessions(c: &mut Criterion) {
    for (name, sequence) in [("spinning ball", spinning_ball(SIDE)), ("folding", folding(SIDE))] {
        let sequence = sequence.unwrap();
        let frames: Vec<Vec<Vec3>> = (0..=FRAMES).map(|k| sequence.at(k)).collect();
        let mut group = c.benchmark_group(format!("session, {name}, {FRAMES} frames"));
        group.sample_size(10);
        for threads in [1, 2] {
            let pool = pool(threads);
            for variant in [Variant::NoDup, Variant::RTri, Variant::NSwD, Variant::SwD] {
                let options = SessionOptions { variant, ..SessionOptions::default() };
                group.bench_function(format!("{variant:?}, {threads} threads"), |b| {
                    let start = || SkippingSession::new(&sequence.mesh, &sequence.rest, options).unwrap();
                    let run = |mut session: SkippingSession| {
                        for step in frames.windows(2) {
                            let (x_t0, x_t1) = (&step[0], &step[1]);
                            let mode = Mode::Continuous;
                            let query = Query { x_t0, x_t1, thickness: 0.001, mode, active: None };
                            black_box(session.detect(&sequence.mesh, &query, &pool).unwrap());
                        }
                    };
                    b.iter_batched(start, run, BatchSize::PerIteration);
                });
            }
        }
        group.finish();
    }
}

/// The oracle, on a mesh that it can do.
fn brute(c: &mut Criterion) {
    let scene = folded(25, 0.003, 0.012);
    let mesh = CollisionMesh::single(scene.x_t0.len(), &scene.triangles).unwrap();
    let pool = pool(1);
    c.bench_function("brute force, 1152 triangles", |b| {
        b.iter(|| BruteForce.detect(&mesh, black_box(&query(&scene, 0.0, Mode::Continuous)), &pool).unwrap());
    });
}

/// One pair each: rejected by the filter, and in contact.
fn pairs(c: &mut Criterion) {
    let still = [Vec3::zeros(), Vec3::x(), Vec3::z()];
    let falling = |from: f64, to: f64| {
        let p = |y: f64| Vec3::new(0.2, y, 0.3);
        [p(from), still[0], still[1], still[2], p(to), still[0], still[1], still[2]]
    };
    let crossing = |from: f64, to: f64| {
        let e = |y: f64| [Vec3::new(0.5, y, -1.0), Vec3::new(0.4, y, 1.0)];
        let ([a, b], [p, q]) = (e(from), e(to));
        [a, b, still[0], still[1], p, q, still[0], still[1]]
    };
    for (name, to) in [("apart", 0.1), ("hit", -1.0)] {
        let (vt, ee) = (falling(1.0, to), crossing(1.0, to));
        c.bench_function(&format!("vertex-triangle, {name}"), |b| {
            b.iter_batched(|| vt, |p| vertex_triangle_ccd(black_box(&p), 0.0), BatchSize::SmallInput);
        });
        c.bench_function(&format!("edge-edge, {name}"), |b| {
            b.iter_batched(|| ee, |p| edge_edge_ccd(black_box(&p), 0.0), BatchSize::SmallInput);
        });
    }
}

criterion_group!(detection, scenes, sizes, sessions, brute, pairs);
criterion_main!(detection);
