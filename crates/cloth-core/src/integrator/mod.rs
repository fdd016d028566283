//! From one state to the next.

mod constraints;
mod explicit;
mod implicit;
mod implicit_euler;
mod line_search;
mod newton;
mod overshoot;
mod semi_implicit;
mod stability;
mod work;

use std::sync::Arc;

use crate::{ClothSystem, CoreError, Psd, SolverParams, StepError, mesh::Vec3};

pub use constraints::{ActiveSet, Constraint};
pub use work::{Motion, Work};

/// Time integration scheme.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// (3.12), (3.13): both ends from the state at the start. Order 1.
    ExplicitEuler,
    /// (3.16)–(3.19): second-order Runge–Kutta. Order 2.
    Midpoint,
    /// Classical fourth-order Runge–Kutta. Order 4.
    Rk4,
    /// (3.25) with b = dt (f + dt K_x v): one linearised backward Euler step. Order 1.
    #[default]
    ImplicitEuler,
    /// Backward Euler solved to a tolerance by Newton's method with a line search. Order 1.
    ImplicitNewton,
    /// Bending explicitly in sub-steps, everything else by one linearised backward Euler step (thesis 4.3). Order 1.
    SemiImplicit,
}

impl Method {
    /// Whether all of the scheme is explicit: it solves no linear system.
    pub fn is_explicit(self) -> bool {
        matches!(self, Self::ExplicitEuler | Self::Midpoint | Self::Rk4)
    }

    /// Whether any of the scheme is explicit, so that its step is limited by stability.
    pub fn has_stability_limit(self) -> bool {
        self.is_explicit() || self == Self::SemiImplicit
    }
}

/// How to step.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct IntegratorParams {
    /// Scheme.
    pub method: Method,
    /// Linear solver of the implicit schemes.
    pub solver: SolverParams,
    /// What is done about indefinite Hessian blocks in the implicit schemes.
    pub psd: Psd,
    /// Newton stops at this residual relative to the first one.
    pub newton_tolerance: f64,
    /// Newton stops after this many iterations.
    pub newton_max_iterations: usize,
    /// Step halvings of one line search.
    pub line_search_max_halvings: usize,
    /// α: explicit sub-steps for bending in one step of the semi-implicit scheme.
    pub bending_substeps: usize,
}

impl Default for IntegratorParams {
    fn default() -> Self {
        Self {
            method: Method::default(),
            solver: SolverParams::default(),
            psd: Psd::default(),
            newton_tolerance: 1e-6,
            newton_max_iterations: 50,
            line_search_max_halvings: 20,
            bending_substeps: 1,
        }
    }
}

/// Prescribed motion of pinned cloth vertices over one step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pins<'a> {
    /// Pinned vertices, ascending.
    pub vertices: &'a [u32],
    /// Their positions at the end of the step [m].
    pub x_t1: &'a [Vec3],
    /// Their velocities at the end of the step [m/s].
    pub v_t1: &'a [Vec3],
}

/// What happened in a step.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepInfo {
    /// Newton iterations (0 for explicit schemes; the linearised one has 1, more where [`Integrator::mend_overshoots`] did).
    pub newton_iterations: usize,
    /// Iterations of the linear solver, summed (0 for a direct solver).
    pub linear_iterations: usize,
    /// Relative residual reached: of the linear system, or of Newton's method.
    pub residual: f64,
    /// Whether every tolerance was met before its cap.
    pub converged: bool,
    /// Wall-clock seconds per stage.
    pub seconds: Vec<(&'static str, f64)>,
    /// Wall-clock seconds per force model, named and ordered as [`ClothSystem::effects`]; a part of the stages'.
    ///
    /// Counts what is done element by element (forces, couplings, energies). What all models share, summing corner
    /// forces at vertices and couplings into matrix blocks, stays with the stage: "assemble", "forces", "line search".
    pub forces: Vec<(&'static str, f64)>,
}

/// Advances the state of a [`ClothSystem`]. A step depends on its arguments and on what laws with memory remember,
/// which only [`Integrator::accept`] moves.
pub struct Integrator {
    system: ClothSystem,
    params: IntegratorParams,
    pool: Arc<rayon::ThreadPool>,
    /// Which vertices are pinned in the step under way; all false between steps.
    pinned: Vec<bool>,
    work: Scheme,
    /// Whether linearised steps that would make energy are solved to their end.
    mends: bool,
}

/// Work space of the scheme in use.
enum Scheme {
    Explicit(explicit::Buffers),
    Implicit(Box<implicit::Workspace>),
    SemiImplicit(Box<(semi_implicit::SubSteps, implicit::Workspace)>),
}

impl Integrator {
    /// Prepares work space, and for implicit schemes the sparsity pattern, once.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] for a tolerance that is not positive or a cap of zero.
    pub fn new(
        mut system: ClothSystem,
        params: IntegratorParams,
        pool: Arc<rayon::ThreadPool>,
    ) -> Result<Self, CoreError> {
        for (name, got) in
            [("solver.tolerance", params.solver.tolerance), ("newton_tolerance", params.newton_tolerance)]
        {
            if !(got.is_finite() && got > 0.0) {
                return Err(CoreError::Parameter { name, expected: "a value > 0", got });
            }
        }
        for (name, got) in [
            ("solver.max_iterations", params.solver.max_iterations),
            ("newton_max_iterations", params.newton_max_iterations),
            ("bending_substeps", params.bending_substeps),
        ] {
            if got == 0 {
                return Err(CoreError::Parameter { name, expected: "a count ≥ 1", got: 0.0 });
            }
        }
        if params.method == Method::SemiImplicit {
            system.split_bending();
        }
        let work = if params.method.is_explicit() {
            Scheme::Explicit(explicit::Buffers::new(&system))
        } else {
            let implicit = implicit::Workspace::new(&system, &params);
            match system.apart() {
                Some(bending) => {
                    Scheme::SemiImplicit(Box::new((semi_implicit::SubSteps::new(bending), implicit)))
                }
                None => Scheme::Implicit(Box::new(implicit)),
            }
        };
        let pinned = vec![false; system.vertex_count()];
        Ok(Self { system, params, pool, pinned, work, mends: false })
    }

    /// Whether a linearised step that would make energy is solved by Newton's method instead; off at first.
    ///
    /// Not for steps with impulses of contact in their velocities: what these make of single vertices is no motion of the cloth.
    pub fn mend_overshoots(&mut self, on: bool) {
        self.mends = on;
    }

    /// The system that is stepped.
    pub fn system(&self) -> &ClothSystem {
        &self.system
    }

    /// Says at which time \[s\] forces and energy are asked for from here on: seams close over time.
    pub fn set_time(&mut self, time: f64) {
        self.system.set_time(time);
    }

    /// The parameters it steps with.
    pub fn params(&self) -> &IntegratorParams {
        &self.params
    }

    /// Memory of work space, matrix and slot maps [B].
    pub fn bytes(&self) -> usize {
        match &self.work {
            Scheme::Explicit(buffers) => buffers.bytes(),
            Scheme::Implicit(work) => work.bytes(),
            Scheme::SemiImplicit(work) => work.0.bytes() + work.1.bytes(),
        }
    }

    /// Advances the cloth vertices of `x` [m] and `v` [m/s] from `time` to `time + dt` [s] without contact. Entries
    /// past the cloth vertices are not touched.
    ///
    /// Pinned vertices end exactly at their targets; in between, implicit schemes move them at
    /// (x_t1 − x_t0)/dt and stages of explicit schemes along the cubic with the positions and velocities of both
    /// ends. After an implicit step x_t1 = x_t0 + dt v_t1 at all others.
    ///
    /// # Errors
    /// [`StepError`]; the state is then unchanged. Reaching a cap is no error: see [`StepInfo::converged`].
    pub fn step(
        &mut self,
        x: &mut [Vec3],
        v: &mut [Vec3],
        _time: f64,
        dt: f64,
        pins: &Pins<'_>,
    ) -> Result<StepInfo, StepError> {
        self.run(x, v, dt, pins, None)
    }

    /// [`Integrator::step`] of an implicit scheme under the constraints that `set` chooses.
    ///
    /// Constraints hold (x_t1 − x_t0)/dt, and along held directions v_t1 is the same. The semi-implicit scheme's
    /// sub-steps know nothing of them: there the impulses that `set` sees hold bending at its mean over the sub-steps.
    ///
    /// # Errors
    /// As [`Integrator::step`]; [`StepError::Constraint`] naming the first wrong entry, or for an explicit scheme.
    pub fn step_with(
        &mut self,
        x: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pins: &Pins<'_>,
        set: &mut dyn ActiveSet,
    ) -> Result<StepInfo, StepError> {
        if self.params.method.is_explicit() {
            return Err(StepError::Constraint { entry: 0, expected: "an implicit scheme" });
        }
        self.run(x, v, dt, pins, Some(set))
    }

    fn run(
        &mut self,
        x: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pins: &Pins<'_>,
        set: Option<&mut dyn ActiveSet>,
    ) -> Result<StepInfo, StepError> {
        if !(dt.is_finite() && dt > 0.0) {
            return Err(StepError::TimeStep { got: dt });
        }
        let n = self.system.vertex_count();
        for (name, got) in [("x", x.len()), ("v", v.len())] {
            if got < n {
                return Err(StepError::Length { name, expected: n, got });
            }
        }
        pins.check(n)?;
        for &vertex in pins.vertices {
            self.pinned[vertex as usize] = true;
        }
        let (x, v) = (&mut x[..n], &mut v[..n]);
        let Self { system, params, pool, pinned, work, mends } = self;
        if params.method != Method::ImplicitEuler {
            // That one moves memory on as it linearises at x, in one pass.
            pool.install(|| system.settle(x));
        }
        let prescribed = Prescribed { pins, pinned, mends: *mends };
        let result = pool.install(|| match work {
            Scheme::Explicit(buffers) => Ok(buffers.step(system, params.method, x, v, dt, &prescribed)),
            Scheme::Implicit(work) => {
                let step =
                    if params.method == Method::ImplicitNewton { newton::step } else { implicit_euler::step };
                step(work, system, params, x, v, dt, &prescribed, set)
            }
            Scheme::SemiImplicit(work) => {
                let (sub_steps, work) = &mut **work;
                sub_steps.step(work, system, params, x, v, dt, &prescribed, set)
            }
        });
        for &vertex in pins.vertices {
            self.pinned[vertex as usize] = false;
        }
        result
    }

    /// Takes the motion to the positions at which the next step starts as done: laws with memory move on. Once per
    /// accepted step; without it a step, a retry or a response leaves no trace.
    pub fn accept(&mut self) {
        self.system.accept();
    }

    /// Puts back what [`ClothSystem::memory`] gave.
    ///
    /// # Errors
    /// As [`ClothSystem::set_memory`].
    pub fn set_memory(&mut self, memory: &[f64]) -> Result<(), CoreError> {
        self.system.set_memory(memory)
    }

    /// Estimate of the largest stable step of the explicit part of a scheme at a state [s]; infinite for schemes without.
    ///
    /// The largest vibration modes of the linearised system come from a Lanczos iteration; the estimate is the largest
    /// step at which none of them grows, or grows by less than a factor e per second: without damping, explicit Euler
    /// and midpoint amplify every mode a little at any step.
    pub fn stable_step(&self, x: &[Vec3], v: &[Vec3]) -> f64 {
        let method = self.params.method;
        if !method.has_stability_limit() {
            return f64::INFINITY;
        }
        let system = self.system.apart().unwrap_or(&self.system);
        let sub_steps = if method == Method::SemiImplicit { self.params.bending_substeps } else { 1 };
        sub_steps as f64 * self.pool.install(|| stability::stable_step(system, method, x, v))
    }
}

impl Pins<'_> {
    fn check(&self, vertex_count: usize) -> Result<(), StepError> {
        let n = self.vertices.len();
        if self.x_t1.len() != n || self.v_t1.len() != n {
            return Err(StepError::Pins { entry: n.min(self.x_t1.len()).min(self.v_t1.len()) });
        }
        let wrong = (0..n).find(|&i| {
            self.vertices[i] as usize >= vertex_count || (i > 0 && self.vertices[i - 1] >= self.vertices[i])
        });
        wrong.map_or(Ok(()), |entry| Err(StepError::Pins { entry }))
    }
}

/// Pins of the step under way with their mask.
struct Prescribed<'a> {
    pins: &'a Pins<'a>,
    pinned: &'a [bool],
    /// See [`Integrator::mend_overshoots`].
    mends: bool,
}

impl Prescribed<'_> {
    /// Puts the pinned vertices at their targets.
    fn place(&self, x: &mut [Vec3], v: &mut [Vec3]) {
        for ((&vertex, x_t1), v_t1) in self.pins.vertices.iter().zip(self.pins.x_t1).zip(self.pins.v_t1) {
            x[vertex as usize] = *x_t1;
            v[vertex as usize] = *v_t1;
        }
    }
}
