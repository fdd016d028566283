//! Bending explicitly in α sub-steps of h_e = h_i/α, everything else by one linearised backward Euler step of h_i.
//!
//! The sub-steps move a copy of the state by bending and inertia alone (v_{k+1} = v_k + h_e M⁻¹ f_b(x_k, v_k), then
//! x_{k+1} = x_k + h_e v_{k+1}) and end at (x_α, v_α). The implicit step starts at x_t0 with the mean velocity
//! w = (x_α − x_t0)/h_i of that motion and finds the change Δv that everything else makes:
//!
//! x_t1 = x_t0 + h_i (w + Δv),   v_t1 = v_α + Δv.
//!
//! Bending alone is then symplectic Euler with h_e, everything else alone backward Euler with h_i. What laws with
//! memory remember does not move in the sub-steps: their moments are those of one motion from the last accepted state.
//!
//! Source: thesis 4.3, which leaves open whether positions move in the sub-steps; with positions held, the limit of
//! stability would be that of h_i. Schroeder et al. 2011.

use std::time::Instant;

use super::{ActiveSet, IntegratorParams, Prescribed, StepInfo, implicit::Workspace, implicit_euler};
use crate::{ClothSystem, StepError, assembly::Corners, mesh::Vec3};

/// Work space of the sub-steps.
pub(super) struct SubSteps {
    corners: Corners,
    force: Vec<Vec3>,
    x: Vec<Vec3>,
    v: Vec<Vec3>,
    /// w, then w + Δv.
    mean: Vec<Vec3>,
}

impl SubSteps {
    pub(super) fn new(bending: &ClothSystem) -> Self {
        let vectors = || vec![Vec3::zeros(); bending.vertex_count()];
        Self {
            corners: Corners::new(bending.models()),
            force: vectors(),
            x: vectors(),
            v: vectors(),
            mean: vectors(),
        }
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<Vec3>() * (self.corners.forces.len() + 4 * self.x.len())
    }

    pub(super) fn step(
        &mut self,
        work: &mut Workspace,
        system: &mut ClothSystem,
        params: &IntegratorParams,
        x: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pins: &Prescribed<'_>,
        set: Option<&mut dyn ActiveSet>,
    ) -> Result<StepInfo, StepError> {
        let constrained = set.is_some();
        let start = Instant::now();
        self.corners.clock.reset();
        self.x.copy_from_slice(x);
        self.v.copy_from_slice(v);
        for k in 0..params.bending_substeps {
            self.sub_step(system.apart(), x, dt, [k, params.bending_substeps], pins);
        }
        for ((mean, to), from) in self.mean.iter_mut().zip(&self.x).zip(x.iter()) {
            *mean = (to - from) / dt;
        }
        let sub_steps = start.elapsed().as_secs_f64();

        // v_α − w, to which the implicit step adds w + Δv.
        for (end, mean) in self.v.iter_mut().zip(&self.mean) {
            *end -= mean;
        }
        let mut info = implicit_euler::step(work, system, params, x, &mut self.mean, dt, pins, set)?;
        for ((v, end), mean) in v.iter_mut().zip(&self.v).zip(&self.mean) {
            *v = end + mean;
        }
        if constrained && let Some(held) = &work.held {
            // Along held directions v_t1 is the mean velocity: bending in the sub-steps does not push past what holds.
            held.hold(v);
        }
        pins.place(x, v);
        info.seconds.insert(0, ("bending sub-steps", sub_steps));
        if let Some(bending) = system.apart() {
            info.forces.extend(bending.seconds(&self.corners.clock));
        }
        Ok(info)
    }

    /// Sub-step `k` of `count` of a step of `dt` from `x_t0`.
    fn sub_step(
        &mut self,
        bending: Option<&ClothSystem>,
        x_t0: &[Vec3],
        dt: f64,
        [k, count]: [usize; 2],
        pins: &Prescribed<'_>,
    ) {
        let Self { corners, force, x, v, .. } = self;
        let size = dt / count as f64;
        for (&vertex, x_t1) in pins.pins.vertices.iter().zip(pins.pins.x_t1) {
            v[vertex as usize] = (x_t1 - x_t0[vertex as usize]) / dt;
        }
        if let Some(bending) = bending {
            bending.evaluate(corners, x, v, force);
            for (((v, f), m), pinned) in v.iter_mut().zip(force).zip(bending.masses()).zip(pins.pinned) {
                if !pinned {
                    *v += *f * (size / m);
                }
            }
        }
        for (x, v) in x.iter_mut().zip(v.iter()) {
            *x += v * size;
        }
        let part = (k + 1) as f64 / count as f64;
        for (&vertex, x_t1) in pins.pins.vertices.iter().zip(pins.pins.x_t1) {
            let from = x_t0[vertex as usize];
            x[vertex as usize] = from + (x_t1 - from) * part;
        }
    }
}
