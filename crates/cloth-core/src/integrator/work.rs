//! What pins and air do to the cloth over a step.
//!
//! W = Σ F · (x_t1 − x_t0)   [J]: of pins over the pinned vertices with F = m (v_t1 − v_t0)/dt − f(x_t1, v_t1), the force that
//! holds them against all others f; of air over all vertices with its drag, lift and damping at the end of the step.
//!
//! Positive work goes into the cloth. With forces of the step's end, as in backward Euler, the work of a step bounds what its
//! mechanical energy gains wherever the elastic energy is convex: E_t1 − E_t0 ≤ W + what contact did. It is right to the order of dt.

use super::Integrator;
use crate::mesh::Vec3;

/// Work on the cloth over a step [J].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Work {
    /// Of pins.
    pub pins: f64,
    /// Of air: wind, drag, lift, damping.
    pub air: f64,
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.pins += other.pins;
        self.air += other.air;
    }
}

/// Positions [m] and velocities [m/s] of at least the cloth vertices.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// Positions [m].
    pub x: &'a [Vec3],
    /// Velocities [m/s].
    pub v: &'a [Vec3],
}

impl Integrator {
    /// The work of a step of `dt` [s] that has been taken from one state to another, before it is accepted. `pinned`: its pins.
    ///
    /// Costs an evaluation of all forces where a pin has moved, and one of the air where there is any; else nothing.
    pub fn work(&self, from: Motion<'_>, to: Motion<'_>, dt: f64, pinned: &[u32]) -> Work {
        let Self { system, pool, .. } = self;
        let n = system.vertex_count();
        let way = |i: usize| to.x[i] - from.x[i];
        let mut work = Work::default();
        if pinned.iter().any(|&i| way(i as usize) != Vec3::zeros()) {
            let mut forces = vec![Vec3::zeros(); n];
            system.forces(&to.x[..n], &to.v[..n], &mut forces, pool);
            for i in pinned.iter().map(|&i| i as usize) {
                let inertia = (to.v[i] - from.v[i]) * (system.masses()[i] / dt);
                work.pins += (inertia - forces[i]).dot(&way(i));
            }
        }
        if system.has_air() {
            let ways: Vec<Vec3> = (0..n).map(way).collect();
            work.air = pool.install(|| system.air_work(&to.x[..n], &to.v[..n], &ways));
        }
        work
    }
}
