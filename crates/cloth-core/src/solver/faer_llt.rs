//! faer's sparse Cholesky factorisation: ordered and analysed once per pattern, factorised every solve.
//!
//! One thread: the supernodal loop is sequential and cloth fronts are too small to gain from parallel dense kernels.

use faer::{
    Conj, Mat, Par, Side, Spec,
    dyn_stack::{MemBuffer, MemStack},
    linalg::cholesky::llt::factor::{LltError, LltRegularization},
    sparse::linalg::cholesky::{
        CholeskySymbolicParams, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
    },
};

use super::{
    SolveError, SolveInfo,
    scalar::{Part, Scalar, eliminated, scatter},
};
use crate::{
    assembly::{BlockMatrix, Pattern},
    mesh::Vec3,
};

/// Analysis and work space for one pattern.
pub(crate) struct FaerLlt {
    scalar: Scalar,
    /// None if the analysis failed, for want of memory.
    symbolic: Option<SymbolicCholesky<u32>>,
    values: Vec<f64>,
    rhs: Mat<f64>,
    residual: Vec<f64>,
    buffer: MemBuffer,
}

impl FaerLlt {
    pub(crate) fn new(pattern: &Pattern) -> Self {
        let scalar = Scalar::new(pattern, Part::Lower);
        let symbolic = factorize_symbolic_cholesky(
            scalar.matrix.symbolic(),
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .ok();
        let n = 3 * pattern.rows;
        let (length, buffer) =
            symbolic.as_ref().map_or((0, MemBuffer::new(faer::dyn_stack::StackReq::EMPTY)), |s| {
                let need = s
                    .factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default())
                    .or(s.solve_in_place_scratch::<f64>(1, Par::Seq));
                (s.len_val(), MemBuffer::new(need))
            });
        Self {
            scalar,
            symbolic,
            values: vec![0.0; length],
            rhs: Mat::zeros(n, 1),
            residual: vec![0.0; n],
            buffer,
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.scalar.bytes() + 8 * (self.values.len() + 2 * self.residual.len()) + self.buffer.len()
    }

    pub(crate) fn solve(
        &mut self,
        a: &BlockMatrix,
        b: &[Vec3],
        pinned: &[bool],
        x: &mut [Vec3],
        tolerance: f64,
    ) -> Result<SolveInfo, SolveError> {
        let Some(symbolic) = &self.symbolic else { return Err(SolveError::OutOfMemory) };
        self.scalar.fill(a, pinned);
        eliminated(a, b, pinned, x, &mut self.residual);
        let first = norm(&self.residual);
        if !first.is_finite() {
            return Err(SolveError::NotFinite { iteration: 0, value: first });
        }
        if first == 0.0 {
            scatter(&self.residual, pinned, x);
            return Ok(SolveInfo { iterations: 0, residual: 0.0, converged: true });
        }
        self.rhs.col_as_slice_mut(0).copy_from_slice(&self.residual);
        let factor = symbolic
            .factorize_numeric_llt(
                &mut self.values,
                self.scalar.matrix.as_ref(),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut self.buffer),
                Spec::default(),
            )
            .map_err(|LltError::NonPositivePivot { index }| SolveError::NotPositiveDefinite {
                iteration: index,
                curvature: f64::NAN,
            })?;
        factor.solve_in_place_with_conj(
            Conj::No,
            self.rhs.as_mut(),
            Par::Seq,
            MemStack::new(&mut self.buffer),
        );
        scatter(self.rhs.col_as_slice(0), pinned, x);
        let residual = residual_norm(a, b, pinned, x) / first;
        Ok(SolveInfo { iterations: 0, residual, converged: residual <= tolerance })
    }
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// ‖b − A x‖ over the free vertices.
fn residual_norm(a: &BlockMatrix, b: &[Vec3], pinned: &[bool], x: &[Vec3]) -> f64 {
    use crate::assembly::Lanes;
    let lanes: Vec<Lanes> = x.iter().map(Lanes::from_vec).collect();
    let mut product = vec![Lanes::ZERO; x.len()];
    a.multiply_rows(0, &lanes, &mut product);
    (0..x.len())
        .filter(|&i| !pinned[i])
        .map(|i| (b[i] - product[i].to_vec()).norm_squared())
        .sum::<f64>()
        .sqrt()
}
