//! Scenes that several tests share.

#![allow(dead_code, reason = "each test binary uses some of these")]
#![allow(clippy::result_large_err, reason = "an error ends the test: its size costs nothing")]

use cloth_sim::core::mesh::Vec3;
use cloth_sim::{Assets, Scene, SimError, Simulation, SimulationOptions};
use std::ops::ControlFlow;

/// A cloth that is soft enough for explicit steps of a millisecond.
pub(crate) const MATERIAL: &str = r#"material = { areal_density = 0.2, in_plane = { model = "baraff-witkin", warp = 200.0, weft = 200.0, shear = 20.0, damping = 0.002 }, bending = { model = "hinge", rigidity = 1e-5, damping = 0.002 } }"#;

pub(crate) fn scene(text: &str) -> Scene {
    Scene::parse_toml(text, "test.toml").unwrap_or_else(|e| panic!("{e}"))
}

pub(crate) fn build(scene: &Scene, threads: usize) -> Simulation {
    let options = SimulationOptions { threads: Some(threads), ..SimulationOptions::default() };
    Simulation::new(scene, Assets::default(), options).unwrap_or_else(|e| panic!("{e}"))
}

pub(crate) fn simulation(text: &str) -> Simulation {
    build(&scene(text), 1)
}

pub(crate) fn advance(sim: &mut Simulation, seconds: f64) -> Result<(), SimError> {
    sim.advance(seconds, &mut || ControlFlow::Continue(())).map(|_| ())
}

/// Bits of all positions and velocities.
pub(crate) fn bits(sim: &Simulation) -> Vec<u64> {
    let points = sim.all_positions().iter().chain(sim.velocities());
    points.flat_map(|p: &Vec3| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits()]).collect()
}

/// A small tablecloth over a ball that turns after half a second.
pub(crate) fn drape(n: usize) -> String {
    format!(
        r#"
duration = 1.0
[time]
dt = 0.005
[contact]
thickness = 0.005
friction = 0.5
[[cloth]]
name = "cloth"
mesh = {{ generator = "grid", width = 1.0, height = 1.0, nx = {n}, ny = {n} }}
{MATERIAL}
position = [0.013, 0.26, 0.007]
[[collider]]
name = "ball"
shape = {{ type = "sphere", radius = 0.25, tolerance = 4e-3 }}
keyframes = [{{ time = 0.5 }}, {{ time = 1.0, rotation = {{ axis = [0, 1, 0], angle = 1.0 }} }}]
"#
    )
}

/// A cloth hanging from two corners, without contact.
pub(crate) fn hanging(n: usize, integrator: &str, dt: f64) -> String {
    format!(
        r#"
duration = 1.0
[time]
dt = {dt}
integrator = "{integrator}"
[solver]
tolerance = 1e-8
[[cloth]]
name = "cloth"
mesh = {{ generator = "grid", width = 1.0, height = 1.0, nx = {n}, ny = {n} }}
{MATERIAL}
pins = [{{ vertices = [0, {last}] }}]
"#,
        last = n - 1
    )
}
