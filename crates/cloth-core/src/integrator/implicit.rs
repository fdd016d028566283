//! What the implicit schemes share: matrix, right-hand side, solver.

use std::{sync::Arc, time::Instant};

use nalgebra::Matrix3;

use super::{IntegratorParams, Prescribed, constraints::Held};
use crate::{
    ClothSystem, Psd, StepError,
    assembly::{Assembler, BlockMatrix, Corners},
    forces::Linear,
    mesh::Vec3,
    solver::{SolveInfo, Solver, SolverParams},
};

/// Work space of the implicit schemes.
pub(super) struct Workspace {
    pub(super) corners: Corners,
    pub(super) assembler: Assembler,
    pub(super) matrix: BlockMatrix,
    pub(super) solver: Solver,
    pub(super) b: Vec<Vec3>,
    pub(super) dv: Vec<Vec3>,
    pub(super) clock: Clock,
    /// Trial state of Newton's method; none before its first step.
    pub(super) x: Vec<Vec3>,
    pub(super) v: Vec<Vec3>,
    pub(super) residual: Vec<Vec3>,
    /// What a step with constraints needs; none before the first one.
    pub(super) held: Option<Box<Held>>,
}

/// Seconds per stage of one step.
#[derive(Default)]
pub(super) struct Clock {
    /// Forces at the start of Newton's method.
    pub(super) forces: f64,
    linearise: f64,
    assemble: f64,
    solve: f64,
    pub(super) line_search: f64,
}

impl Clock {
    pub(super) fn seconds(&self) -> Vec<(&'static str, f64)> {
        let newton = |(_, seconds): &(&str, f64)| *seconds > 0.0;
        let mut seconds: Vec<_> = [("forces", self.forces)].into_iter().filter(newton).collect();
        seconds.extend([("linearise", self.linearise), ("assemble", self.assemble), ("solve", self.solve)]);
        seconds.extend([("line search", self.line_search)].into_iter().filter(newton));
        seconds
    }
}

impl Workspace {
    pub(super) fn new(system: &ClothSystem, params: &IntegratorParams) -> Self {
        let (assembler, pattern) = Assembler::new(system.vertex_count(), system.models(), params.psd);
        let solver = Solver::new(params.solver.method, &pattern);
        let newton = params.method == super::Method::ImplicitNewton;
        let trial = || vec![Vec3::zeros(); if newton { system.vertex_count() } else { 0 }];
        Self {
            corners: Corners::new(system.models()),
            assembler,
            matrix: BlockMatrix::new(Arc::new(pattern)),
            solver,
            b: vec![Vec3::zeros(); system.vertex_count()],
            dv: vec![Vec3::zeros(); system.vertex_count()],
            clock: Clock::default(),
            x: trial(),
            v: trial(),
            residual: trial(),
            held: None,
        }
    }

    /// Makes room for trial states of Newton's method.
    pub(super) fn hold_trials(&mut self, count: usize) {
        for list in [&mut self.x, &mut self.v, &mut self.residual] {
            list.resize(count, Vec3::zeros());
        }
    }

    pub(super) fn bytes(&self) -> usize {
        self.assembler.bytes()
            + self.matrix.bytes()
            + self.solver.bytes()
            + self.held.as_ref().map_or(0, |h| h.bytes())
            + size_of::<Vec3>()
                * (self.corners.forces.len() + self.b.len() + self.dv.len() + 3 * self.x.len())
    }

    /// A = M − dt K_v − dt² K_x at (x, v), and the corner forces f + `ahead` K_x v.
    pub(super) fn linearise(
        &mut self,
        system: &mut ClothSystem,
        psd: Psd,
        x: &[Vec3],
        v: &[Vec3],
        dt: f64,
        ahead: f64,
    ) {
        let start = Instant::now();
        // Newton's method alone asks for forces with no step ahead of them.
        let iterates = ahead == 0.0;
        let linear = Linear { damping: dt, stiffness: dt * dt, ahead, iterates, accept: false, psd };
        system.linearise(&mut self.assembler.elements, &mut self.corners, x, v, linear);
        let middle = Instant::now();
        let masses = system.masses();
        let scale = 1.0 + dt * system.air_damping();
        self.assembler.gather(&mut self.matrix, &|row| scale * masses[row]);
        self.clock.linearise += (middle - start).as_secs_f64();
        self.clock.assemble += middle.elapsed().as_secs_f64();
    }

    /// Sets the clocks to zero.
    pub(super) fn start(&mut self) {
        self.clock = Clock::default();
        self.corners.clock.reset();
    }

    /// b = dt times the forces at the vertices, from the corner forces.
    pub(super) fn gather(&mut self, system: &ClothSystem, v: &[Vec3], dt: f64) {
        let start = Instant::now();
        system.gather(&mut self.corners, v, dt, &mut self.b);
        self.clock.assemble += start.elapsed().as_secs_f64();
    }

    /// Solves A dv = b; `dv` holds the prescribed values on entry.
    pub(super) fn solve(
        &mut self,
        params: &SolverParams,
        pins: &Prescribed<'_>,
    ) -> Result<SolveInfo, StepError> {
        let start = Instant::now();
        let info = self.solver.solve(&self.matrix, &self.b, pins.pinned, &mut self.dv, params);
        self.clock.solve += start.elapsed().as_secs_f64();
        info.map_err(|error| StepError::Solver { error, vertices: self.suspects(pins.pinned) })
    }

    /// The free vertices at which a solve that failed went wrong, see [`StepError::Solver`].
    fn suspects(&self, pinned: &[bool]) -> Vec<u32> {
        /// At most this many vertices are named.
        const NAMED: usize = 64;
        /// Where none stands out, this many.
        const LEAST_BOUND: usize = 8;
        let free = || (0..self.b.len()).filter(|&i| !pinned[i]);
        let name = |list: &mut dyn Iterator<Item = usize>| -> Vec<u32> {
            list.take(NAMED).map(|i| i as u32).collect()
        };
        let finite = |i: &usize| {
            self.b[*i].iter().all(|c| c.is_finite()) && self.matrix.diagonal[*i].iter().all(|c| c.is_finite())
        };
        let bad = name(&mut free().filter(|i| !finite(i)));
        if !bad.is_empty() {
            return bad;
        }
        let definite = |i: &usize| Matrix3::from_column_slice(&self.matrix.diagonal[*i]).cholesky().is_some();
        let bad = name(&mut free().filter(|i| !definite(i)));
        if !bad.is_empty() {
            return bad;
        }
        // Gershgorin: the least eigenvalue of a vertex's block against the size of its couplings.
        let pattern = &self.matrix.pattern;
        let size = |k: usize| self.matrix.upper[9 * k..9 * k + 9].iter().map(|c| c * c).sum::<f64>().sqrt();
        let surplus = |i: usize| {
            let least = Matrix3::from_column_slice(&self.matrix.diagonal[i]).symmetric_eigenvalues().min();
            let upper: f64 = pattern.upper_of(i).map(size).sum();
            let lower: f64 = pattern.lower_of(i).iter().map(|&[_, k]| size(k as usize)).sum();
            least / (upper + lower).max(f64::MIN_POSITIVE)
        };
        let mut order: Vec<(f64, usize)> = free().map(|i| (surplus(i), i)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut weakest: Vec<u32> = order.iter().take(LEAST_BOUND).map(|o| o.1 as u32).collect();
        weakest.sort_unstable();
        weakest
    }
}
