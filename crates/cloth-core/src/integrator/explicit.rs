//! Explicit Euler (3.12, 3.13), midpoint (3.16–3.19) and the classical fourth-order Runge–Kutta scheme.

use std::time::Instant;

use super::{Method, Prescribed, StepInfo};
use crate::{ClothSystem, assembly::Corners, mesh::Vec3};

/// Work space: one stage's state, its forces, and the weighted sum of stages.
pub(super) struct Buffers {
    corners: Corners,
    x: Vec<Vec3>,
    v: Vec<Vec3>,
    force: Vec<Vec3>,
    sum_v: Vec<Vec3>,
    sum_a: Vec<Vec3>,
}

/// Stages of a scheme: (fraction of the step at which the stage lies, weight of its derivative). Each stage starts from
/// the step's start and uses the previous stage's derivative.
fn stages(method: Method) -> &'static [(f64, f64)] {
    match method {
        Method::Midpoint => &[(0.0, 0.0), (0.5, 1.0)],
        Method::Rk4 => &[(0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0)],
        _ => &[(0.0, 1.0)],
    }
}

impl Buffers {
    pub(super) fn new(system: &ClothSystem) -> Self {
        let vectors = || vec![Vec3::zeros(); system.vertex_count()];
        Self {
            corners: Corners::new(system.models()),
            x: vectors(),
            v: vectors(),
            force: vectors(),
            sum_v: vectors(),
            sum_a: vectors(),
        }
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<Vec3>() * (self.corners.forces.len() + 5 * self.x.len())
    }

    pub(super) fn step(
        &mut self,
        system: &ClothSystem,
        method: Method,
        x: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pins: &Prescribed<'_>,
    ) -> StepInfo {
        let start = Instant::now();
        self.corners.clock.reset();
        let masses = system.masses();
        self.sum_v.fill(Vec3::zeros());
        self.sum_a.fill(Vec3::zeros());
        for &(fraction, weight) in stages(method) {
            // The previous stage's derivative is (self.v, self.force / m).
            for i in 0..x.len() {
                let (dx, dv) = (self.v[i], self.force[i] / masses[i]);
                if fraction == 0.0 {
                    (self.x[i], self.v[i]) = (x[i], v[i]);
                } else {
                    self.x[i] = x[i] + dx * (fraction * dt);
                    self.v[i] = v[i] + dv * (fraction * dt);
                }
            }
            pins.interpolate(fraction, dt, x, v, &mut self.x, &mut self.v);
            system.evaluate(&mut self.corners, &self.x, &self.v, &mut self.force);
            for i in 0..x.len() {
                self.sum_v[i] += self.v[i] * weight;
                self.sum_a[i] += self.force[i] * (weight / masses[i]);
            }
        }
        for i in 0..x.len() {
            x[i] += self.sum_v[i] * dt;
            v[i] += self.sum_a[i] * dt;
        }
        pins.place(x, v);
        StepInfo {
            converged: true,
            seconds: vec![("forces", start.elapsed().as_secs_f64())],
            forces: system.seconds(&self.corners.clock),
            ..StepInfo::default()
        }
    }
}

impl Prescribed<'_> {
    /// Pinned vertices at a fraction s of the step: the cubic with positions and velocities of both ends.
    fn interpolate(&self, s: f64, dt: f64, x_t0: &[Vec3], v_t0: &[Vec3], x: &mut [Vec3], v: &mut [Vec3]) {
        if s == 0.0 {
            return;
        }
        for ((&vertex, x_t1), v_t1) in self.pins.vertices.iter().zip(self.pins.x_t1).zip(self.pins.v_t1) {
            let i = vertex as usize;
            let (x0, v0) = (x_t0[i], v_t0[i]);
            let moved = x_t1 - x0;
            x[i] = x0
                + moved * (s * s * (3.0 - 2.0 * s))
                + (v0 * (s * (1.0 - s) * (1.0 - s)) - v_t1 * (s * s * (1.0 - s))) * dt;
            v[i] = moved * (6.0 * s * (1.0 - s) / dt)
                + v0 * ((1.0 - s) * (1.0 - 3.0 * s))
                + v_t1 * (s * (3.0 * s - 2.0));
        }
    }
}
