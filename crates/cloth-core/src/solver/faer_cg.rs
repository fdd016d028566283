//! faer's conjugate gradient on the scalar matrix, with the same block-Jacobi preconditioner.
//!
//! Pinned rows and columns are those of the identity, so the iteration leaves them at zero without a filter.

use faer::{
    Accum, Mat, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack, StackReq},
    matrix_free::{
        InitialGuessStatus, LinOp, Precond,
        conjugate_gradient::{CgError, CgParams, conjugate_gradient, conjugate_gradient_scratch},
    },
    sparse::{SparseColMat, linalg::matmul::sparse_dense_matmul},
};

use super::{
    SolveError, SolveInfo,
    blocks::{apply, invert},
    scalar::{Part, Scalar, eliminated, scatter},
};
use crate::{
    assembly::{BlockMatrix, Lanes, Pattern},
    mesh::Vec3,
};

/// Work space for one pattern.
pub(crate) struct FaerCg {
    scalar: Scalar,
    jacobi: Jacobi,
    rhs: Mat<f64>,
    solution: Mat<f64>,
    buffer: MemBuffer,
}

/// The matrix as an operator.
#[derive(Debug)]
struct Operator<'a>(&'a SparseColMat<u32, f64>);

/// Inverse diagonal blocks.
#[derive(Debug)]
struct Jacobi(Vec<[f64; 9]>);

impl LinOp<f64> for Operator<'_> {
    fn apply_scratch(&self, _rhs_ncols: usize, _par: Par) -> StackReq {
        StackReq::EMPTY
    }

    fn nrows(&self) -> usize {
        self.0.nrows()
    }

    fn ncols(&self) -> usize {
        self.0.ncols()
    }

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, _stack: &mut MemStack) {
        sparse_dense_matmul(out, Accum::Replace, self.0.as_ref(), rhs, 1.0, par);
    }

    fn conj_apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
        self.apply(out, rhs, par, stack);
    }
}

impl LinOp<f64> for Jacobi {
    fn apply_scratch(&self, _rhs_ncols: usize, _par: Par) -> StackReq {
        StackReq::EMPTY
    }

    fn nrows(&self) -> usize {
        3 * self.0.len()
    }

    fn ncols(&self) -> usize {
        3 * self.0.len()
    }

    fn apply(&self, mut out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        for column in 0..rhs.ncols() {
            for (i, block) in self.0.iter().enumerate() {
                let r =
                    Lanes([rhs[(3 * i, column)], rhs[(3 * i + 1, column)], rhs[(3 * i + 2, column)], 0.0]);
                let z = apply(block, &r);
                for l in 0..3 {
                    out[(3 * i + l, column)] = z.0[l];
                }
            }
        }
    }

    fn conj_apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
        self.apply(out, rhs, par, stack);
    }
}

impl Precond<f64> for Jacobi {}

impl FaerCg {
    pub(crate) fn new(pattern: &Pattern) -> Self {
        let scalar = Scalar::new(pattern, Part::Full);
        let jacobi = Jacobi(vec![[0.0; 9]; pattern.rows]);
        let n = 3 * pattern.rows;
        let buffer =
            MemBuffer::new(conjugate_gradient_scratch(&jacobi, Operator(&scalar.matrix), 1, Par::Seq));
        Self { scalar, jacobi, rhs: Mat::zeros(n, 1), solution: Mat::zeros(n, 1), buffer }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.scalar.bytes()
            + size_of_val(self.jacobi.0.as_slice())
            + 16 * self.rhs.nrows()
            + self.buffer.len()
    }

    pub(crate) fn solve(
        &mut self,
        a: &BlockMatrix,
        b: &[Vec3],
        pinned: &[bool],
        x: &mut [Vec3],
        tolerance: f64,
        max_iterations: usize,
    ) -> Result<SolveInfo, SolveError> {
        for (row, inverse) in self.jacobi.0.iter_mut().enumerate() {
            *inverse = if pinned[row] {
                [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
            } else {
                invert(&a.diagonal[row])
                    .ok_or(SolveError::NotPositiveDefinite { iteration: 0, curvature: f64::NAN })?
            };
        }
        self.scalar.fill(a, pinned);
        eliminated(a, b, pinned, x, self.rhs.col_as_slice_mut(0));
        let first = self.rhs.norm_l2();
        if !first.is_finite() {
            return Err(SolveError::NotFinite { iteration: 0, value: first });
        }
        // `Zero` would leave the residual uninitialised (faer 0.24.4).
        let params = CgParams {
            initial_guess: InitialGuessStatus::MaybeNonZero,
            rel_tolerance: tolerance,
            max_iters: max_iterations,
            ..CgParams::default()
        };
        self.solution.fill(0.0);
        let operator = Operator(&self.scalar.matrix);
        let result = conjugate_gradient(
            self.solution.as_mut(),
            &self.jacobi,
            &operator,
            self.rhs.as_ref(),
            params,
            |_| {},
            Par::Seq,
            MemStack::new(&mut self.buffer),
        );
        let info = match result {
            Ok(info) => {
                SolveInfo { iterations: info.iter_count, residual: info.rel_residual, converged: true }
            }
            Err(CgError::NoConvergence { .. }) => {
                // The residual reported there is the initial one.
                let product = &self.scalar.matrix * &self.solution;
                let residual = (&self.rhs - product).norm_l2() / first;
                SolveInfo { iterations: max_iterations, residual, converged: residual <= tolerance }
            }
            Err(_) => {
                return Err(SolveError::NotPositiveDefinite { iteration: 0, curvature: f64::NAN });
            }
        };
        scatter(self.solution.col_as_slice(0), pinned, x);
        Ok(info)
    }
}
