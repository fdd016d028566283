//! One implicit Euler step of 18,240 hanging triangles: whole, by stage, and by linear solver; two threads, no contact.
//!
//! Cotton of the library, 1 m × 1 m, 97 × 96 vertices, hanging by two corners, in the midst of its swing; relative residual
//! 1e-4. Each sample starts from the same state. The thesis's GPU needed 11.8 ms for a step of this size.

#![allow(missing_docs, reason = "criterion's macros make public items")]
#![allow(clippy::unwrap_used, reason = "a bench that cannot start has nothing to measure")]

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use cloth_core::{
    ClothPart, ClothSystem, Environment, Integrator, IntegratorParams, Method, Pins, SolverMethod,
    material::library,
    mesh::{RestShape, Topology, TriMesh, Vec3, generators},
};
use criterion::{Criterion, criterion_group, criterion_main};

const THREADS: usize = 2;
const CORNERS: [u32; 2] = [0, 96];
/// Time at which the state is taken [s]: the sheet is falling and swinging.
const SWING: f64 = 0.3;

fn mesh() -> TriMesh {
    generators::grid(1.0, 1.0, 97, 96).unwrap()
}

fn integrator(mesh: &TriMesh, solver: SolverMethod, method: Method) -> Integrator {
    let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
    let rest = RestShape::new(mesh, Vec3::x()).unwrap();
    let material = library::named("cotton").unwrap();
    let part = ClothPart {
        mesh,
        topology: &topology,
        rest: &rest,
        material: &material,
        first_vertex: 0,
        triangles: None,
    };
    let system = ClothSystem::new(&[part], &Environment::default(), mesh.vertices.len()).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(THREADS).build().unwrap();
    let mut params = IntegratorParams { method, ..IntegratorParams::default() };
    params.solver.method = solver;
    Integrator::new(system, params, Arc::new(pool)).unwrap()
}

struct Bench {
    integrator: Integrator,
    targets: [Vec3; 2],
    start: (Vec<Vec3>, Vec<Vec3>),
    state: (Vec<Vec3>, Vec<Vec3>),
}

impl Bench {
    /// The swinging sheet, brought there by the default solver.
    fn new(solver: SolverMethod, dt: f64) -> Self {
        let mesh = mesh();
        let targets = CORNERS.map(|v| mesh.vertices[v as usize]);
        let mut state = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
        let mut integrator = integrator(&mesh, SolverMethod::Pcg, Method::ImplicitEuler);
        for _ in 0..(SWING / dt).round() as usize {
            step(&mut integrator, &mut state, dt, &targets);
        }
        if solver != SolverMethod::Pcg {
            integrator = self::integrator(&mesh, solver, Method::ImplicitEuler);
        }
        Self { integrator, targets, start: state.clone(), state }
    }

    /// Seconds of one step from the start: of `stage`, or of the whole step.
    fn sample(&mut self, dt: f64, stage: Option<&str>) -> Duration {
        self.state.0.copy_from_slice(&self.start.0);
        self.state.1.copy_from_slice(&self.start.1);
        let start = Instant::now();
        let seconds = step(&mut self.integrator, &mut self.state, dt, &self.targets);
        let whole = start.elapsed();
        stage.map_or(whole, |stage| {
            let seconds = seconds.iter().find(|s| s.0 == stage).map_or(0.0, |s| s.1);
            Duration::from_secs_f64(seconds)
        })
    }
}

fn step(
    integrator: &mut Integrator,
    state: &mut (Vec<Vec3>, Vec<Vec3>),
    dt: f64,
    targets: &[Vec3; 2],
) -> Vec<(&'static str, f64)> {
    let pins = Pins { vertices: &CORNERS, x_t1: targets, v_t1: &[Vec3::zeros(); 2] };
    let info = integrator.step(&mut state.0, &mut state.1, 0.0, dt, &pins).unwrap();
    assert!(info.converged, "{info:?}");
    info.seconds
}

fn whole_step(c: &mut Criterion) {
    let mut group = c.benchmark_group("implicit-euler 18k");
    group.sample_size(40);
    for dt in [1e-3, 5e-3] {
        let mut bench = Bench::new(SolverMethod::Pcg, dt);
        for stage in [None, Some("linearise"), Some("assemble"), Some("solve")] {
            let name = format!("{} dt={}ms", stage.unwrap_or("step"), dt * 1e3);
            group.bench_function(name, |b| {
                b.iter_custom(|n| (0..n).map(|_| bench.sample(dt, stage)).sum());
            });
        }
    }
    group.finish();
}

fn solvers(c: &mut Criterion) {
    let mut group = c.benchmark_group("solve 18k dt=5ms");
    group.sample_size(10);
    for (name, solver) in [
        ("pcg", SolverMethod::Pcg),
        ("pcg-jacobi", SolverMethod::PcgJacobi),
        ("faer-cg", SolverMethod::FaerCg),
        ("faer-llt", SolverMethod::FaerLlt),
    ] {
        let mut bench = Bench::new(solver, 5e-3);
        group.bench_function(name, |b| {
            b.iter_custom(|n| (0..n).map(|_| bench.sample(5e-3, Some("solve"))).sum());
        });
    }
    group.finish();
}

fn explicit_step(c: &mut Criterion) {
    let mesh = mesh();
    let mut integrator = integrator(&mesh, SolverMethod::Pcg, Method::Midpoint);
    let targets = CORNERS.map(|v| mesh.vertices[v as usize]);
    let mut state = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
    let dt = 0.5 * integrator.stable_step(&state.0, &state.1);
    c.bench_function("midpoint 18k step", |b| {
        b.iter(|| step(&mut integrator, &mut state, dt, &targets));
    });
}

criterion_group!(benches, whole_step, solvers, explicit_step);
criterion_main!(benches);
