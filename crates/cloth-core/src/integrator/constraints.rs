//! Directions in which a vertex's motion is prescribed: contact inside the implicit solve.
//!
//! A constraint holds the mean velocity of a vertex over the step, (x_t1 − x_t0)/dt, along one to three orthonormal
//! directions, and may push it along what is left: p = `impulse` − `drag` · (x_t1 − x_t0)/dt [N s]. With the system
//! A Δv = b of the scheme, the projectors P_i onto free directions and z the prescribed part of Δv,
//!
//! (P (A + D) P + s (I − P)) y = P (b + p − A z − …),   Δv = P y + z,
//!
//! and the rows of A Δv − b that were projected out are the impulses that hold the vertices there. Who chooses the
//! constraints is an [`ActiveSet`]: it sees those impulses and the motion, and may ask for another solve with other
//! constraints. A solve starts from the solution before it, so that one that changes little costs little; while the set
//! still changes, solves after the first are loose.
//!
//! Source: Baraff and Witkin 1998, sections 5 and 6.

use nalgebra::Matrix3;

use super::{IntegratorParams, Prescribed, implicit::Workspace};
use crate::{
    StepError,
    assembly::{Freedom, Lanes, Projection, ROWS_PER_CHUNK},
    mesh::Vec3,
    solver::{SolveInfo, SolverParams},
};
use rayon::prelude::*;

/// Part of the residual that is left where the constraints may not be the last ones yet.
const LOOSE: f64 = 0.1;
/// Deviation from orthonormal directions that is refused.
const ORTHONORMAL: f64 = 1e-9;

/// What holds and pushes one vertex during a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraint {
    /// The cloth vertex; not a pinned one.
    pub vertex: u32,
    /// How many of `directions` are held, 0 to 3.
    pub count: usize,
    /// Orthonormal directions; those from `count` on are not read.
    pub directions: [Vec3; 3],
    /// Mean velocity over the step whose components along the held directions the vertex gets [m/s].
    pub velocity: Vec3,
    /// Further impulse [N s]; what of it lies along held directions has no effect.
    pub impulse: Vec3,
    /// Further impulse −`drag` · mean velocity; symmetric, positive semi-definite [kg].
    pub drag: Matrix3<f64>,
}

impl Constraint {
    /// A vertex that moves with `velocity` [m/s].
    pub fn fixed(vertex: u32, velocity: Vec3) -> Self {
        Self {
            vertex,
            count: 3,
            directions: [Vec3::x(), Vec3::y(), Vec3::z()],
            velocity,
            impulse: Vec3::zeros(),
            drag: Matrix3::zeros(),
        }
    }

    /// Projector onto the free directions.
    fn free(&self) -> Matrix3<f64> {
        if self.count == 3 {
            return Matrix3::zeros();
        }
        self.directions[..self.count].iter().fold(Matrix3::identity(), |p, q| p - q * q.transpose())
    }

    /// `u` with the held components of `held` [both m/s].
    fn hold(&self, u: &Vec3, held: &Vec3) -> Vec3 {
        if self.count == 3 {
            return *held;
        }
        self.directions[..self.count].iter().fold(*u, |u, q| u + q * q.dot(&(held - u)))
    }

    /// `u` without its held components.
    fn project(&self, u: &Vec3) -> Vec3 {
        self.hold(u, &Vec3::zeros())
    }

    /// The further impulse at the mean velocity `u` [N s].
    fn push(&self, u: &Vec3) -> Vec3 {
        self.impulse - self.drag * u
    }
}

/// Chooses the constraints of a step's solves.
pub trait ActiveSet: Send {
    /// The constraints of the next solve, by ascending vertices.
    fn constraints(&mut self) -> &[Constraint];

    /// Sees what they led to: `motion`, the mean velocity of every cloth vertex over the step [m/s]; `impulses`, one per
    /// constraint, everything that constraint and push gave to its vertex [N s] (in free directions to the solver's
    /// tolerance). Returns whether to solve again.
    fn judge(&mut self, motion: &[Vec3], impulses: &[Vec3]) -> bool;
}

/// The constraints of the solve under way and work space.
#[derive(Default)]
pub(super) struct Held {
    pub(super) list: Vec<Constraint>,
    freedoms: Vec<Freedom>,
    /// Pins, and vertices that are held in all directions.
    pub(super) pinned: Vec<bool>,
    projection: Projection,
    /// Δv so far, and that of the solve before.
    sum: Vec<Vec3>,
    last: Vec<Vec3>,
    /// Its product with the matrix.
    lanes: Vec<Lanes>,
    product: Vec<Lanes>,
    rest: Vec<Vec3>,
    pub(super) motion: Vec<Vec3>,
    pub(super) impulses: Vec<Vec3>,
}

impl Held {
    /// Memory [B].
    pub(super) fn bytes(&self) -> usize {
        size_of::<Constraint>() * self.list.capacity()
            + size_of::<Freedom>() * self.freedoms.capacity()
            + self.pinned.capacity()
            + self.projection.bytes()
            + size_of::<Vec3>()
                * (self.sum.capacity()
                    + self.last.capacity()
                    + self.rest.capacity()
                    + self.motion.capacity()
                    + self.impulses.capacity())
            + size_of::<Lanes>() * (self.lanes.capacity() + self.product.capacity())
    }

    /// Takes over what `set` asks for.
    pub(super) fn take(&mut self, set: &mut dyn ActiveSet, pins: &Prescribed<'_>) -> Result<(), StepError> {
        self.list.clear();
        self.list.extend_from_slice(set.constraints());
        check(&self.list, pins)?;
        self.pinned.clear();
        self.pinned.extend_from_slice(pins.pinned);
        self.freedoms.clear();
        for c in &self.list {
            if c.count == 3 {
                self.pinned[c.vertex as usize] = true;
            } else {
                self.freedoms.push(Freedom { vertex: c.vertex, free: c.free(), added: c.drag });
            }
        }
        Ok(())
    }

    /// Gives the held components of `motion` to the vertices that are held.
    pub(super) fn hold(&self, motion: &mut [Vec3]) {
        for c in &self.list {
            let u = &mut motion[c.vertex as usize];
            *u = c.hold(u, &c.velocity);
        }
    }

    /// Takes the components along held directions out.
    pub(super) fn project(&self, u: &mut [Vec3]) {
        for c in &self.list {
            let u = &mut u[c.vertex as usize];
            *u = c.project(u);
        }
    }

    /// Notes the residual of Newton's method, what is missing in momentum, as what the constraints give, and leaves what
    /// is to be solved for; the potential of the pushes.
    pub(super) fn judge_residual(&mut self, residual: &mut [Vec3], motion: &[Vec3]) -> f64 {
        let mut potential = 0.0;
        self.impulses.clear();
        for c in &self.list {
            let (r, u) = (&mut residual[c.vertex as usize], &motion[c.vertex as usize]);
            self.impulses.push(*r);
            if c.count < 3 {
                potential += 0.5 * u.dot(&(c.drag * u)) - c.impulse.dot(u);
                *r = c.project(&(*r - c.push(u)));
            } else {
                *r = Vec3::zeros();
            }
        }
        potential
    }
}

fn check(list: &[Constraint], pins: &Prescribed<'_>) -> Result<(), StepError> {
    let finite = |v: &Vec3| v.iter().all(|c| c.is_finite());
    for (entry, c) in list.iter().enumerate() {
        let wrong = |expected| Err(StepError::Constraint { entry, expected });
        if pins.pinned.get(c.vertex as usize) != Some(&false) {
            return wrong("a cloth vertex that is not pinned");
        }
        if entry > 0 && list[entry - 1].vertex >= c.vertex {
            return wrong("ascending vertices");
        }
        if c.count > 3 {
            return wrong("at most 3 directions");
        }
        let held = &c.directions[..c.count];
        let orthonormal = held.iter().enumerate().all(|(k, q)| {
            (q.norm() - 1.0).abs() <= ORTHONORMAL && held[..k].iter().all(|p| p.dot(q).abs() <= ORTHONORMAL)
        });
        if !orthonormal {
            return wrong("orthonormal directions");
        }
        if !(finite(&c.velocity) && finite(&c.impulse) && c.drag.iter().all(|d| d.is_finite())) {
            return wrong("finite numbers");
        }
    }
    Ok(())
}

impl Workspace {
    /// Solves A Δv = b under the constraints that `set` chooses; `dv` holds Δv at pins on entry, the solution on return.
    /// `v` [m/s]: what Δv is added to.
    pub(super) fn solve_held(
        &mut self,
        params: &IntegratorParams,
        pins: &Prescribed<'_>,
        v: &[Vec3],
        set: &mut dyn ActiveSet,
    ) -> Result<SolveInfo, StepError> {
        let mut held = self.held.take().unwrap_or_default();
        let result = self.solve_active(&mut held, params, pins, v, set);
        self.held = Some(held);
        result
    }

    fn solve_active(
        &mut self,
        held: &mut Held,
        params: &IntegratorParams,
        pins: &Prescribed<'_>,
        v: &[Vec3],
        set: &mut dyn ActiveSet,
    ) -> Result<SolveInfo, StepError> {
        let n = v.len();
        for list in [&mut held.sum, &mut held.last, &mut held.rest, &mut held.motion] {
            list.resize(n, Vec3::zeros());
        }
        for i in 0..n {
            held.last[i] = if pins.pinned[i] { self.dv[i] } else { Vec3::zeros() };
        }
        let tolerance = params.solver.tolerance;
        // Whether the solve is to the tolerance, and not loose.
        let (mut tight, mut solves) = (true, 0);
        let mut total = SolveInfo { iterations: 0, residual: 0.0, converged: true };
        loop {
            held.take(set, pins)?;
            // Residuals are relative to what a solve from zero starts from; so does this one if the last solution is no
            // better.
            for i in 0..n {
                held.sum[i] = if pins.pinned[i] { held.last[i] } else { Vec3::zeros() };
            }
            let first = self.begin(held, v);
            let mut norm = first;
            if solves > 0 {
                std::mem::swap(&mut held.sum, &mut held.last);
                norm = self.begin(held, v);
                if norm.is_nan() || norm > first {
                    std::mem::swap(&mut held.sum, &mut held.last);
                    norm = self.begin(held, v);
                }
            }
            // Not a number goes on, to the solver's complaint.
            if norm <= tolerance * first && first.is_finite() {
                total.residual = if first > 0.0 { norm / first } else { 0.0 };
                total.converged = true;
            } else {
                let goal = tolerance * first / norm;
                let goal = if tight { goal } else { goal.max(LOOSE) };
                let params = SolverParams { tolerance: goal, ..params.solver };
                let solved = self.solve_rest(held, &params, pins)?;
                total.iterations += solved.iterations;
                total.residual = solved.residual * norm / first;
                total.converged = solved.converged && total.residual <= tolerance;
            }
            self.impulses(held);
            for i in 0..n {
                held.motion[i] = v[i] + held.sum[i];
            }
            held.last.copy_from_slice(&held.sum);
            solves += 1;
            let again = set.judge(&held.motion, &held.impulses);
            if !again && (tight || total.residual <= tolerance) {
                break;
            }
            tight = !again;
        }
        self.dv.copy_from_slice(&held.sum);
        Ok(total)
    }

    /// Gives Δv its held components; what is left to be solved for: P (b + p − A Δv) at free vertices; its norm.
    fn begin(&self, held: &mut Held, v: &[Vec3]) -> f64 {
        for c in &held.list {
            let i = c.vertex as usize;
            held.sum[i] = c.hold(&held.sum[i], &(c.velocity - v[i]));
        }
        self.multiply(held);
        let Held { rest, product, pinned, .. } = held;
        for (i, rest) in rest.iter_mut().enumerate() {
            *rest = if pinned[i] { Vec3::zeros() } else { self.b[i] - product[i].to_vec() };
        }
        for c in held.list.iter().filter(|c| c.count < 3) {
            let i = c.vertex as usize;
            held.rest[i] = c.project(&(held.rest[i] + c.push(&(v[i] + held.sum[i]))));
        }
        held.rest.iter().map(Vec3::norm_squared).sum::<f64>().sqrt()
    }

    /// A Δv.
    fn multiply(&self, held: &mut Held) {
        held.lanes.clear();
        held.lanes.extend(held.sum.iter().map(Lanes::from_vec));
        held.product.resize(held.lanes.len(), Lanes::ZERO);
        let (lanes, matrix) = (&held.lanes, &self.matrix);
        held.product
            .par_chunks_mut(ROWS_PER_CHUNK)
            .enumerate()
            .for_each(|(chunk, out)| matrix.multiply_rows(chunk * ROWS_PER_CHUNK, lanes, out));
    }

    /// Adds the solution of the projected system to Δv.
    fn solve_rest(
        &mut self,
        held: &mut Held,
        params: &SolverParams,
        pins: &Prescribed<'_>,
    ) -> Result<SolveInfo, StepError> {
        self.dv.fill(Vec3::zeros());
        std::mem::swap(&mut self.b, &mut held.rest);
        let solved = self.solve_projected(held, params, pins);
        std::mem::swap(&mut self.b, &mut held.rest);
        let solved = solved?;
        for (sum, dv) in held.sum.iter_mut().zip(&self.dv) {
            *sum += dv;
        }
        Ok(solved)
    }

    /// Solves the projected system for `dv`, whose values at pinned and held vertices are 0; the matrix is as before.
    pub(super) fn solve_projected(
        &mut self,
        held: &mut Held,
        params: &SolverParams,
        pins: &Prescribed<'_>,
    ) -> Result<SolveInfo, StepError> {
        held.projection.project(&mut self.matrix, &held.freedoms);
        let Prescribed { pins, .. } = *pins;
        let solved = self.solve(params, &Prescribed { pins, pinned: &held.pinned, mends: false });
        held.projection.restore(&mut self.matrix);
        held.project(&mut self.dv);
        solved
    }

    /// What the constraints gave to their vertices, A Δv − b.
    fn impulses(&self, held: &mut Held) {
        held.lanes.clear();
        held.lanes.extend(held.sum.iter().map(Lanes::from_vec));
        held.impulses.clear();
        for c in &held.list {
            let i = c.vertex as usize;
            let mut row = [Lanes::ZERO];
            self.matrix.multiply_rows(i, &held.lanes, &mut row);
            held.impulses.push(row[0].to_vec() - self.b[i]);
        }
    }
}

#[cfg(test)]
mod tests;
