//! One step of a draped cloth with both contact methods; two threads.
//!
//! A sheet of 51 × 51 vertices at rest on a ball of radius 0.25 m, friction 0.5, implicit Euler, 5 ms. Each sample goes on from
//! the one before: the cloth hangs and moves little.

#![allow(missing_docs, reason = "criterion's macros make public items")]
#![allow(clippy::unwrap_used, reason = "a bench that cannot start has nothing to measure")]

use cloth_sim::{Assets, Scene, Simulation, SimulationOptions};
use criterion::{Criterion, criterion_group, criterion_main};

/// Steps until the cloth hangs.
const SETTLING: usize = 400;

fn draped(method: &str) -> Simulation {
    let text = format!(
        r#"
duration = 10.0
[time]
dt = 0.005
[air]
damping = 2.0
[contact]
method = "{method}"
thickness = 0.005
friction = 0.5
[[cloth]]
name = "cloth"
mesh = {{ generator = "grid", width = 1.0, height = 1.0, nx = 51, ny = 51 }}
material = "cotton"
position = [0.013, 0.26, 0.007]
[[collider]]
name = "ball"
shape = {{ type = "sphere", radius = 0.25, tolerance = 1e-3 }}
"#
    );
    let scene = Scene::parse_toml(&text, "bench.toml").unwrap();
    let options = SimulationOptions { threads: Some(2), ..SimulationOptions::default() };
    let mut sim = Simulation::new(&scene, Assets::default(), options).unwrap();
    (0..SETTLING).for_each(|_| sim.step().unwrap());
    sim
}

fn draped_step(c: &mut Criterion) {
    let mut group = c.benchmark_group("draped 5k dt=5ms");
    group.sample_size(20);
    for method in ["velocity-filter", "constraints"] {
        let mut sim = draped(method);
        group.bench_function(method, |b| b.iter(|| sim.step().unwrap()));
    }
    group.finish();
}

criterion_group!(benches, draped_step);
criterion_main!(benches);
