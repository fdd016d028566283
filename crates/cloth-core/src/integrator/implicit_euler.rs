//! One linearised backward Euler step: (M − dt K_v − dt² K_x) Δv = dt (f + dt K_x v), x_t1 = x_t0 + dt v_t1.
//!
//! A step that would make energy, see [`super::overshoot`], is solved by Newton's method instead where that is asked for.
//!
//! Source: thesis (3.20)–(3.25), with dt K_x v in the right-hand side; Baraff and Witkin 1998 for the pins.

use super::{
    ActiveSet, IntegratorParams, Prescribed, StepInfo,
    implicit::Workspace,
    newton,
    overshoot::{Candidate, overshoots},
};
use crate::{ClothSystem, StepError, mesh::Vec3};

pub(super) fn step(
    work: &mut Workspace,
    system: &mut ClothSystem,
    params: &IntegratorParams,
    x: &mut [Vec3],
    v: &mut [Vec3],
    dt: f64,
    pins: &Prescribed<'_>,
    mut set: Option<&mut dyn ActiveSet>,
) -> Result<StepInfo, StepError> {
    work.start();
    work.linearise(system, params.psd, x, v, dt, dt);
    work.gather(system, v, dt);
    for (&vertex, x_t1) in pins.pins.vertices.iter().zip(pins.pins.x_t1) {
        let i = vertex as usize;
        work.dv[i] = (x_t1 - x[i]) / dt - v[i];
    }
    let solved = match set.as_deref_mut() {
        None => work.solve(&params.solver, pins)?,
        Some(set) => work.solve_held(params, pins, v, set)?,
    };
    let candidate = Candidate { x, v, dv: &work.dv, dt, masses: system.masses() };
    if pins.mends && overshoots(&work.matrix, &candidate) {
        let (seconds, forces) = (work.clock.seconds(), system.seconds(&work.corners.clock));
        work.hold_trials(system.vertex_count());
        let mut info = newton::step(work, system, params, x, v, dt, pins, set)?;
        info.linear_iterations += solved.iterations;
        info.newton_iterations += 1;
        add(&mut info.seconds, &seconds);
        add(&mut info.forces, &forces);
        return Ok(info);
    }
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

/// Adds seconds to those of the same name.
fn add(sum: &mut Vec<(&'static str, f64)>, more: &[(&'static str, f64)]) {
    for &(name, seconds) in more {
        match sum.iter_mut().find(|(known, _)| *known == name) {
            Some(entry) => entry.1 += seconds,
            None => sum.push((name, seconds)),
        }
    }
}
