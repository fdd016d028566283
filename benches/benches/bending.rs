//! What bending laws cost: 27,169 hinges of 18,240 hanging triangles, implicit Euler at 5 ms, two threads, no contact.
//!
//! "kernel": moment, force and coupling of every hinge, once per step. "accept": the step's commitment to what the law
//! remembers. "step": the whole step, accept included. "independent": the linear law, hinges of a triangle not coupled.
//! Laws take turns within one sample, so that a busy machine slows all of them; medians and least times, and their ratios
//! to the linear law, are printed after the criterion rows, at 5 ms and at 1 ms.
//!
//! The thesis adds 51 % to its bending component and about 6 % to the step (Table 4.1, α = 1).

#![allow(missing_docs, reason = "criterion's macros make public items")]
#![allow(clippy::unwrap_used, reason = "a bench that cannot start has nothing to measure")]
#![allow(clippy::print_stdout, reason = "a bench prints what it measures")]

use std::{sync::Arc, time::Instant};

use cloth_core::{
    Bending, ClothPart, ClothSystem, Environment, HingeCoupling, Integrator, IntegratorParams, Material,
    Pins,
    material::{HysteresisBending, NonlinearBending, PlasticBending, library},
    mesh::{RestShape, Topology, Vec3, generators},
};
use criterion::{Criterion, criterion_group, criterion_main};

const THREADS: usize = 2;
const CORNERS: [u32; 2] = [0, 96];
/// Seconds of a step: in the criterion rows, and in a second comparison.
const DT: [f64; 2] = [5e-3, 1e-3];
/// Steps before the first sample: the sheet falls and swings.
const SWING: usize = 60;
/// Turns of the comparison.
const TURNS: usize = 200;

/// Laws of about the stiffness of cotton whose transition lies within the curvatures of the swing.
fn laws() -> [(&'static str, Bending); 5] {
    let (b1, b2, c1) = (Some(2e-5), Some(1e-5), Some(-5e-7));
    [
        ("hinge", Bending::Hinge { rigidity: 1e-5, damping: 0.0, hinges: HingeCoupling::Coupled }),
        ("independent", Bending::Hinge { rigidity: 1e-5, damping: 0.0, hinges: HingeCoupling::Independent }),
        ("nonlinear", Bending::Nonlinear(NonlinearBending { b1, b2, c1, ..NonlinearBending::default() })),
        (
            "plastic",
            Bending::Plastic(PlasticBending {
                rigidity: 1e-5,
                elastic_limit: 10.0,
                hardening: 0.0,
                damping: 0.0,
                hinges: HingeCoupling::Coupled,
            }),
        ),
        (
            "hysteresis",
            Bending::Hysteresis(HysteresisBending {
                b1,
                b2,
                c1,
                plasticity: 0.2,
                fatigue: 0.02,
                ..HysteresisBending::default()
            }),
        ),
    ]
}

struct Swing {
    name: &'static str,
    /// Name of the effect that is timed.
    effect: &'static str,
    integrator: Integrator,
    targets: [Vec3; 2],
    x: Vec<Vec3>,
    v: Vec<Vec3>,
    dt: f64,
}

/// Seconds of one step.
#[derive(Clone, Copy)]
struct Sample {
    kernel: f64,
    accept: f64,
    step: f64,
}

impl Swing {
    fn new(name: &'static str, bending: Bending) -> Self {
        let mesh = generators::grid(1.0, 1.0, 97, 96).unwrap();
        let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
        let rest = RestShape::new(&mesh, Vec3::x()).unwrap();
        let material = Material { bending, ..library::named("cotton").unwrap() };
        let part = ClothPart {
            mesh: &mesh,
            topology: &topology,
            rest: &rest,
            material: &material,
            first_vertex: 0,
            triangles: None,
        };
        let system = ClothSystem::new(&[part], &Environment::default(), mesh.vertices.len()).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(THREADS).build().unwrap();
        let integrator = Integrator::new(system, IntegratorParams::default(), Arc::new(pool)).unwrap();
        let targets = CORNERS.map(|v| mesh.vertices[v as usize]);
        let v = vec![Vec3::zeros(); mesh.vertices.len()];
        let effect = if name == "independent" { "hinge" } else { name };
        let mut swing = Self { name, effect, integrator, targets, x: mesh.vertices, v, dt: DT[0] };
        for _ in 0..SWING {
            swing.step();
        }
        swing
    }

    fn step(&mut self) -> Sample {
        let pins = Pins { vertices: &CORNERS, x_t1: &self.targets, v_t1: &[Vec3::zeros(); 2] };
        let start = Instant::now();
        let info = self.integrator.step(&mut self.x, &mut self.v, 0.0, self.dt, &pins).unwrap();
        let middle = Instant::now();
        self.integrator.accept();
        let kernel = info.forces.iter().find(|(name, _)| *name == self.effect).unwrap().1;
        Sample { kernel, accept: middle.elapsed().as_secs_f64(), step: start.elapsed().as_secs_f64() }
    }
}

/// The middle value and the least.
fn middle_and_least(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [values[values.len() / 2], values[0]]
}

fn bending(c: &mut Criterion) {
    let mut swings: Vec<Swing> = laws().into_iter().map(|(name, law)| Swing::new(name, law)).collect();
    let mut group = c.benchmark_group("bending 18k");
    group.sample_size(20);
    for swing in &mut swings {
        group.bench_function(format!("kernel {}", swing.name), |b| {
            b.iter_custom(|n| std::time::Duration::from_secs_f64((0..n).map(|_| swing.step().kernel).sum()));
        });
    }
    group.finish();

    for dt in DT {
        let mut samples = vec![Vec::new(); swings.len()];
        for _ in 0..TURNS {
            for (swing, samples) in swings.iter_mut().zip(&mut samples) {
                swing.dt = dt;
                samples.push(swing.step());
            }
        }
        compare(&swings, &samples, dt);
    }
}

/// Prints what each law takes.
fn compare(swings: &[Swing], samples: &[Vec<Sample>], dt: f64) {
    let of = |law: usize, part: fn(&Sample) -> f64| middle_and_least(samples[law].iter().map(part).collect());
    for (which, what) in ["medians", "least"].into_iter().enumerate() {
        println!(
            "{what:8} of {TURNS} turns at {dt} s   kernel ms   accept ms     step ms   (to the linear law)"
        );
        for (law, swing) in swings.iter().enumerate() {
            let [kernel, accept, step] = [of(law, |s| s.kernel), of(law, |s| s.accept), of(law, |s| s.step)];
            let base = [of(0, |s| s.kernel)[which], of(0, |s| s.step)[which]];
            println!(
                "{:12} {:>29.3} {:>11.3} {:>11.3}   kernel {:+.1} %, kernel and accept {:+.1} %, step {:+.1} %",
                swing.name,
                kernel[which] * 1e3,
                accept[which] * 1e3,
                step[which] * 1e3,
                100.0 * (kernel[which] / base[0] - 1.0),
                100.0 * ((kernel[which] + accept[which]) / base[0] - 1.0),
                100.0 * (step[which] / base[1] - 1.0),
            );
        }
    }
}

criterion_group!(benches, bending);
criterion_main!(benches);
