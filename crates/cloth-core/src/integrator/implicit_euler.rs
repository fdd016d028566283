//! One linearised backward Euler step: (M − dt K_v − dt² K_x) Δv = dt (f + dt K_x v), x_t1 = x_t0 + dt v_t1.
//!
//! Source: thesis (3.20)–(3.25), with dt K_x v in the right-hand side; Baraff and Witkin 1998 for the pins.

use super::{ActiveSet, IntegratorParams, Prescribed, StepInfo, implicit::Workspace};
use crate::{ClothSystem, StepError, mesh::Vec3};

pub(super) fn step(
    work: &mut Workspace,
    system: &mut ClothSystem,
    params: &IntegratorParams,
    x: &mut [Vec3],
    v: &mut [Vec3],
    dt: f64,
    pins: &Prescribed<'_>,
    set: Option<&mut dyn ActiveSet>,
) -> Result<StepInfo, StepError> {
    work.start();
    work.linearise(system, params.psd, x, v, dt, dt);
    work.gather(system, v, dt);
    for (&vertex, x_t1) in pins.pins.vertices.iter().zip(pins.pins.x_t1) {
        let i = vertex as usize;
        work.dv[i] = (x_t1 - x[i]) / dt - v[i];
    }
    let solved = match set {
        None => work.solve(&params.solver, pins)?,
        Some(set) => work.solve_held(params, pins, v, set)?,
    };
    for ((x, v), dv) in x.iter_mut().zip(v.iter_mut()).zip(&work.dv) {
        *v += dv;
        *x += *v * dt;
    }
    pins.place(x, v);
    Ok(StepInfo {
        newton_iterations: 1,
        linear_iterations: solved.iterations,
        residual: solved.residual,
        converged: solved.converged,
        seconds: work.clock.seconds(),
        forces: system.seconds(&work.corners.clock),
    })
}
