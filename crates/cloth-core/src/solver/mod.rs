//! The linear solvers of the implicit schemes: Params, Info, Error.
//!
//! All three solve the same system: prescribed vertices are eliminated, A_ff x_f = b_f − A_fp x_p, and residuals are
//! those of that system relative to its right-hand side.

mod band;
mod blocks;
mod faer_cg;
mod faer_llt;
mod ordering;
mod pcg;
mod scalar;
mod swept;

use crate::{
    assembly::{BlockMatrix, Pattern},
    mesh::Vec3,
};

/// Which solver.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum SolverMethod {
    /// Preconditioned conjugate gradient on 3×3 blocks: block-Jacobi scaling, symmetric sweeps and a coarse correction.
    #[default]
    Pcg,
    /// The same with block-Jacobi alone.
    PcgJacobi,
    /// faer's conjugate gradient on the same matrix.
    FaerCg,
    /// faer's sparse Cholesky factorisation, analysed once.
    FaerLlt,
}

/// How to solve A x = b.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SolverParams {
    /// Solver.
    pub method: SolverMethod,
    /// Iterative solvers stop at this residual, ‖b − A x‖ / ‖b‖ over the free vertices.
    pub tolerance: f64,
    /// Iterative solvers stop after this many iterations.
    pub max_iterations: usize,
}

impl Default for SolverParams {
    fn default() -> Self {
        Self { method: SolverMethod::Pcg, tolerance: 1e-4, max_iterations: 500 }
    }
}

/// What happened in a solve.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SolveInfo {
    /// Iterations done (0 for a direct solver).
    pub iterations: usize,
    /// Relative residual reached.
    pub residual: f64,
    /// Whether the tolerance was met.
    pub converged: bool,
}

/// Why a solve broke down.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// A direction of non-positive curvature was met, or a pivot was not positive.
    #[error(
        "linear solver: expected a positive definite matrix, iteration {iteration} found curvature {curvature:e}"
    )]
    NotPositiveDefinite {
        /// Iteration, or index of the scalar row for a factorisation.
        iteration: usize,
        /// pᵀAp, or NaN where the solver does not tell.
        curvature: f64,
    },
    /// A value was NaN or infinite.
    #[error("linear solver: expected finite values, iteration {iteration} met {value}")]
    NotFinite {
        /// Iteration.
        iteration: usize,
        /// What was met.
        value: f64,
    },
    /// The factorisation does not fit in memory.
    #[error("linear solver: expected the factorisation to fit in memory")]
    OutOfMemory,
}

/// A solver with its work space, for one sparsity pattern.
pub(crate) enum Solver {
    Swept(Box<swept::Swept>),
    Jacobi(Box<pcg::Pcg>),
    FaerCg(Box<faer_cg::FaerCg>),
    FaerLlt(Box<faer_llt::FaerLlt>),
}

impl Solver {
    pub(crate) fn new(method: SolverMethod, pattern: &Pattern) -> Self {
        match method {
            SolverMethod::Pcg => Self::Swept(Box::new(swept::Swept::new(pattern))),
            SolverMethod::PcgJacobi => Self::Jacobi(Box::new(pcg::Pcg::new(pattern.rows))),
            SolverMethod::FaerCg => Self::FaerCg(Box::new(faer_cg::FaerCg::new(pattern))),
            SolverMethod::FaerLlt => Self::FaerLlt(Box::new(faer_llt::FaerLlt::new(pattern))),
        }
    }

    /// Memory of its work space [B].
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Swept(pcg) => pcg.bytes(),
            Self::Jacobi(pcg) => pcg.bytes(),
            Self::FaerCg(cg) => cg.bytes(),
            Self::FaerLlt(llt) => llt.bytes(),
        }
    }

    /// Solves A x = b for the free vertices; `x` holds the prescribed values on entry, the solution on return. Call on
    /// the pool.
    pub(crate) fn solve(
        &mut self,
        a: &BlockMatrix,
        b: &[Vec3],
        pinned: &[bool],
        x: &mut [Vec3],
        params: &SolverParams,
    ) -> Result<SolveInfo, SolveError> {
        let SolverParams { tolerance, max_iterations, .. } = *params;
        match self {
            Self::Swept(pcg) => pcg.solve(a, b, pinned, x, tolerance, max_iterations),
            Self::Jacobi(pcg) => pcg.solve(a, b, pinned, x, tolerance, max_iterations),
            Self::FaerCg(cg) => cg.solve(a, b, pinned, x, tolerance, max_iterations),
            Self::FaerLlt(llt) => llt.solve(a, b, pinned, x, tolerance),
        }
    }
}
