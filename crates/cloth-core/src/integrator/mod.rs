//! From one state to the next.

use std::sync::Arc;

use crate::{ClothSystem, CoreError, Psd, SolverParams, StepError, mesh::Vec3};

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
}

impl Method {
    /// Whether the scheme is explicit, so that its step is limited by stability.
    pub fn is_explicit(self) -> bool {
        matches!(self, Self::ExplicitEuler | Self::Midpoint | Self::Rk4)
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
    /// Newton iterations (1 for the linearised scheme, 0 for explicit ones).
    pub newton_iterations: usize,
    /// Iterations of the linear solver, summed (0 for a direct solver).
    pub linear_iterations: usize,
    /// Relative residual reached: of the linear system, or of Newton's method.
    pub residual: f64,
    /// Whether every tolerance was met before its cap.
    pub converged: bool,
    /// Seconds per stage.
    pub seconds: Vec<(&'static str, f64)>,
}

/// Advances the state of a [`ClothSystem`]. Holds work space only: a step depends on its arguments alone.
pub struct Integrator {
    system: ClothSystem,
}

impl Integrator {
    /// Prepares work space, and for implicit schemes the sparsity pattern, once.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] for a tolerance that is not positive or a cap of zero.
    pub fn new(
        _system: ClothSystem,
        _params: IntegratorParams,
        _pool: Arc<rayon::ThreadPool>,
    ) -> Result<Self, CoreError> {
        todo!()
    }

    /// The system that is stepped.
    pub fn system(&self) -> &ClothSystem {
        &self.system
    }

    /// Advances the cloth vertices of `x` [m] and `v` [m/s] from `time` to `time + dt` [s] without contact. Entries
    /// past the cloth vertices are not touched.
    ///
    /// Pinned vertices end exactly at their targets. After an implicit step x_t1 = x_t0 + dt v_t1 at all others.
    ///
    /// # Errors
    /// [`StepError`]; the state is then unchanged. Reaching a cap is no error: see [`StepInfo::converged`].
    pub fn step(
        &mut self,
        _x: &mut [Vec3],
        _v: &mut [Vec3],
        _time: f64,
        _dt: f64,
        _pins: &Pins<'_>,
    ) -> Result<StepInfo, StepError> {
        todo!()
    }

    /// Estimate of the largest stable step of the explicit scheme at a state [s]; infinite for implicit schemes.
    pub fn stable_step(&self, _x: &[Vec3], _v: &[Vec3]) -> f64 {
        todo!()
    }
}
