//! A state kept in single precision, for studies of what that costs.

use crate::{Simulation, Vec3};

impl Simulation {
    /// Rounds positions and velocities of the cloth to f32, to nearest: with this after each step the state is one that was kept in
    /// single precision, while everything within a step is still computed in f64. What is pinned goes on along its motion.
    pub fn round_state(&mut self) {
        let cloth = ..self.bodies.cloth_vertices;
        for row in [&mut self.state.x[cloth], &mut self.state.v[cloth]] {
            for value in row {
                *value = rounded(value);
            }
        }
    }
}

fn rounded(value: &Vec3) -> Vec3 {
    value.map(|c| f64::from(c as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Assets, Scene, SimulationOptions};

    const SCENE: &str = r#"
duration = 1.0
[time]
dt = 0.01
[[cloth]]
name = "cloth"
mesh = { generator = "grid", width = 1.0, height = 1.0, nx = 5, ny = 5 }
material = "cotton"
pins = [{ vertices = [0, 4] }]
"#;

    #[test]
    fn a_rounded_state_fits_f32_and_is_near() {
        let scene = Scene::parse_toml(SCENE, "test.toml").unwrap();
        let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
        let mut sim = Simulation::new(&scene, Assets::default(), options).unwrap();
        let fits = |points: &[Vec3]| points.iter().flatten().all(|&c| f64::from(c as f32) == c);
        for _ in 0..5 {
            sim.step().unwrap();
            let (x, v) = (sim.positions().to_vec(), sim.velocities().to_vec());
            assert!(!fits(&x) && !fits(&v), "a step is computed in f64");
            sim.round_state();
            assert!(fits(sim.positions()) && fits(sim.velocities()));
            for (before, after) in [(&x, sim.positions()), (&v, sim.velocities())] {
                for (a, b) in before.iter().flatten().zip(after.iter().flatten()) {
                    assert!((a - b).abs() <= 0.5 * f64::from(f32::EPSILON) * a.abs().max(1e-30), "{a}, {b}");
                }
            }
        }
    }
}
