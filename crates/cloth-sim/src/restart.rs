//! Starts a simulation in mid-scene, from where a frame shows the cloth.

use crate::bodies::Bodies;
use crate::pins::PinSet;
use crate::step::State;
use crate::{Assets, Scene, SimError, Simulation, SimulationOptions, Vec3};

impl Simulation {
    /// The scene at `time` \[s\] with the cloth's vertices at `x` \[m\], moving at `v` \[m/s\]; colliders and pins are where the
    /// scene has them then.
    ///
    /// The scene's meshes stay the undeformed shape. Pins hold what they hold at the scene's own start. What bending laws
    /// and contact remember of the steps before is not in a frame: both begin anew.
    ///
    /// # Errors
    /// [`SimError::InvalidArgument`] for a time that is negative or not finite, or another number of vertices than the cloth has, or a
    /// vertex that is not finite; else as [`Simulation::new`].
    pub fn start_from(
        scene: &Scene,
        assets: Assets,
        options: SimulationOptions,
        time: f64,
        x: &[Vec3],
        v: &[Vec3],
    ) -> Result<Self, SimError> {
        let bad = |name, expected, got| Err(SimError::InvalidArgument { name, expected, got });
        if !(time.is_finite() && time >= 0.0) {
            return bad("time", "a finite number ≥ 0 [s]", time.to_string());
        }
        scene.check()?;
        let bodies = Bodies::new(scene, &assets)?;
        for (name, list) in [("positions", x), ("velocities", v)] {
            if list.len() != bodies.cloth_vertices {
                let got = format!("{} for {} vertices", list.len(), bodies.cloth_vertices);
                return bad(name, "one row for each cloth vertex of the scene", got);
            }
            if let Some(i) = list.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
                return bad(name, "finite numbers", format!("{:?} at vertex {i}", list[i]));
            }
        }
        // Pins take hold at the scene's start.
        let start = State::start(&bodies);
        let pins = PinSet::new(scene, &bodies, &start.x)?;
        let mut state = State::start_at(&bodies, time);
        state.x[..x.len()].copy_from_slice(x);
        state.v[..v.len()].copy_from_slice(v);
        state.place_pins(&bodies, &pins);
        let mut sim = Self::build(scene, assets, options, Some(state))?;
        sim.check_start()?;
        Ok(sim)
    }
}
