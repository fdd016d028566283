//! Backward Euler to a tolerance: r(v_t1) = M (v_t1 − v_t0) − dt f(x_t0 + dt v_t1, v_t1) = 0.
//!
//! Newton's method from v_t0 with A = M − dt K_v − dt² K_x at each iterate and a step-halving line search. Without
//! dissipation r is the gradient of the incremental potential ½ Δvᵀ M Δv + E(x_t1) and the search makes it fall.
//!
//! Stops when ‖r‖ ≤ tolerance · ‖r at the start‖ over the free vertices, or at the rounding error of r, estimated as
//! machine epsilon times the diagonal of A times |x|/dt.

use std::time::Instant;

use super::{
    ActiveSet, IntegratorParams, Prescribed, StepInfo,
    constraints::Held,
    implicit::Workspace,
    line_search::{Merit, accepted},
};
use crate::{ClothSystem, StepError, mesh::Vec3};

/// Rounding errors that one entry of r collects, in units of its largest term.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

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
    let conservative = !system.dissipates();
    let (mut x1, mut v1) = (std::mem::take(&mut work.x), std::mem::take(&mut work.v));
    v1.copy_from_slice(v);
    for (&vertex, x_t1) in pins.pins.vertices.iter().zip(pins.pins.x_t1) {
        v1[vertex as usize] = (x_t1 - x[vertex as usize]) / dt;
    }
    let result = match set {
        None => {
            iterate(work, system, params, x, v, &mut x1, &mut v1, dt, pins, conservative, None, &mut None)
        }
        Some(set) => {
            let mut held = work.held.take().unwrap_or_default();
            let result = iterate_active(
                work,
                system,
                params,
                x,
                v,
                &mut x1,
                &mut v1,
                dt,
                pins,
                conservative,
                &mut held,
                set,
            );
            work.held = Some(held);
            result
        }
    };
    if result.is_ok() {
        x.copy_from_slice(&x1);
        v.copy_from_slice(&v1);
        pins.place(x, v);
    }
    (work.x, work.v) = (x1, v1);
    result
}

/// Newton's method for one set of constraints after the other, each from the solution before it.
fn iterate_active(
    work: &mut Workspace,
    system: &mut ClothSystem,
    params: &IntegratorParams,
    x: &[Vec3],
    v: &[Vec3],
    x1: &mut [Vec3],
    v1: &mut [Vec3],
    dt: f64,
    pins: &Prescribed<'_>,
    conservative: bool,
    held: &mut Held,
    set: &mut dyn ActiveSet,
) -> Result<StepInfo, StepError> {
    let (mut total, mut first) = (StepInfo::default(), None);
    loop {
        held.take(set, pins)?;
        held.hold(v1);
        let now = Some(&mut *held);
        let info = iterate(work, system, params, x, v, x1, v1, dt, pins, conservative, now, &mut first)?;
        let before = (total.newton_iterations, total.linear_iterations);
        total = info;
        total.newton_iterations += before.0;
        total.linear_iterations += before.1;
        if !set.judge(v1, &held.impulses) {
            return Ok(total);
        }
    }
}

fn iterate(
    work: &mut Workspace,
    system: &mut ClothSystem,
    params: &IntegratorParams,
    x: &[Vec3],
    v: &[Vec3],
    x1: &mut [Vec3],
    v1: &mut [Vec3],
    dt: f64,
    pins: &Prescribed<'_>,
    conservative: bool,
    mut held: Option<&mut Held>,
    first: &mut Option<f64>,
) -> Result<StepInfo, StepError> {
    let mut info = StepInfo::default();
    let mut floor = 0.0;
    advance(x, v1, dt, x1);
    let start = Instant::now();
    let mut merit = evaluate(work, system, v, x1, v1, dt, pins, held.as_deref_mut());
    work.clock.forces += start.elapsed().as_secs_f64();
    // What a further set of constraints starts from is small where it changes little.
    let first = *first.get_or_insert(merit.residual);
    loop {
        info.residual = if first > 0.0 { merit.residual / first } else { 0.0 };
        info.converged = merit.residual <= (params.newton_tolerance * first).max(floor);
        if info.converged || info.newton_iterations == params.newton_max_iterations {
            break;
        }
        work.linearise(system, params.psd, x1, v1, dt, 0.0);
        if info.newton_iterations == 0 {
            floor = rounding(work, x1, dt, pins);
        }
        for (b, r) in work.b.iter_mut().zip(&work.residual) {
            *b = -r;
        }
        for &vertex in pins.pins.vertices {
            work.dv[vertex as usize] = Vec3::zeros();
        }
        let solved = match held.as_deref_mut() {
            None => work.solve(&params.solver, pins)?,
            Some(held) => {
                for c in held.list.iter().filter(|c| c.count == 3) {
                    work.dv[c.vertex as usize] = Vec3::zeros();
                }
                work.solve_projected(held, &params.solver, pins)?
            }
        };
        info.linear_iterations += solved.iterations;
        info.newton_iterations += 1;

        let start = Instant::now();
        let slope: f64 = work.residual.iter().zip(&work.dv).map(|(r, d)| r.dot(d)).sum();
        let mut alpha = 1.0;
        let mut taken = 0.0;
        let mut found = None;
        for _ in 0..=params.line_search_max_halvings {
            for (v1, d) in v1.iter_mut().zip(&work.dv) {
                *v1 += d * (alpha - taken);
            }
            taken = alpha;
            advance(x, v1, dt, x1);
            let trial = evaluate(work, system, v, x1, v1, dt, pins, held.as_deref_mut());
            if accepted(&merit, &trial, alpha, slope, conservative) {
                found = Some(trial);
                break;
            }
            alpha *= 0.5;
        }
        work.clock.line_search += start.elapsed().as_secs_f64();
        if let Some(trial) = found {
            merit = trial;
        } else {
            // No step along this direction helps: keep the last iterate and say so.
            for (v1, d) in v1.iter_mut().zip(&work.dv) {
                *v1 -= d * taken;
            }
            advance(x, v1, dt, x1);
            if held.is_some() {
                evaluate(work, system, v, x1, v1, dt, pins, held);
            }
            info.converged = merit.residual <= floor;
            break;
        }
    }
    info.seconds = work.clock.seconds();
    info.forces = system.seconds(&work.corners.clock);
    Ok(info)
}

/// x_t1 = x_t0 + dt v_t1.
fn advance(x: &[Vec3], v1: &[Vec3], dt: f64, x1: &mut [Vec3]) {
    for ((x1, x), v1) in x1.iter_mut().zip(x).zip(v1) {
        *x1 = x + v1 * dt;
    }
}

/// Residual r into the work space (zero at pins), and what the line search judges by.
fn evaluate(
    work: &mut Workspace,
    system: &ClothSystem,
    v0: &[Vec3],
    x1: &[Vec3],
    v1: &[Vec3],
    dt: f64,
    pins: &Prescribed<'_>,
    held: Option<&mut Held>,
) -> Merit {
    work.corners.evaluate(system.models(), system.settled_memory(), x1, v1);
    system.gather(&mut work.corners, v1, -dt, &mut work.residual);
    let mut potential = system.potential(x1, v1, dt, &mut work.corners);
    let mut squares = 0.0;
    for (i, (r, m)) in work.residual.iter_mut().zip(system.masses()).enumerate() {
        let dv = v1[i] - v0[i];
        potential += 0.5 * m * dv.norm_squared();
        if pins.pinned[i] {
            *r = Vec3::zeros();
        } else {
            *r += dv * *m;
        }
        squares += r.norm_squared();
    }
    if let Some(held) = held {
        potential += held.judge_residual(&mut work.residual, v1);
        squares = work.residual.iter().map(Vec3::norm_squared).sum();
    }
    Merit { potential, residual: squares.sqrt() }
}

/// Estimate of the rounding error of ‖r‖.
fn rounding(work: &Workspace, x1: &[Vec3], dt: f64, pins: &Prescribed<'_>) -> f64 {
    let squares: f64 = work
        .matrix
        .diagonal
        .iter()
        .zip(x1)
        .zip(pins.pinned)
        .filter(|(_, pinned)| !**pinned)
        .map(|((d, x), _)| ((d[0] + d[4] + d[8]) * x.norm() / dt).powi(2))
        .sum();
    ROUNDING * squares.sqrt()
}
