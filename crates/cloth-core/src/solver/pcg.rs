//! Conjugate gradient with a block-Jacobi preconditioner and the Baraff–Witkin filter.
//!
//! Prescribed vertices keep the values that x comes with; the residual, the search direction and the product are zero
//! there, which is the filter S of the modified conjugate gradient applied once per row. Dot products are summed per
//! fixed chunk of rows, chunks in order.
//!
//! Source: Baraff and Witkin 1998, section 5.2.

use rayon::prelude::*;

use super::{
    SolveError, SolveInfo,
    blocks::{apply, determinant, invert},
};
use crate::{
    assembly::{BlockMatrix, Lanes, ROWS_PER_CHUNK},
    mesh::Vec3,
};

/// Work space for systems of one size.
pub(crate) struct Pcg {
    inverse: Vec<[f64; 9]>,
    x: Vec<Lanes>,
    r: Vec<Lanes>,
    z: Vec<Lanes>,
    p: Vec<Lanes>,
    q: Vec<Lanes>,
    /// Partial dot products per chunk.
    partial: Vec<[f64; 2]>,
}

impl Pcg {
    pub(crate) fn new(rows: usize) -> Self {
        let lanes = || vec![Lanes::ZERO; rows];
        Self {
            inverse: vec![[0.0; 9]; rows],
            x: lanes(),
            r: lanes(),
            z: lanes(),
            p: lanes(),
            q: lanes(),
            partial: vec![[0.0; 2]; rows.div_ceil(ROWS_PER_CHUNK)],
        }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.inverse.as_slice()) + 5 * size_of_val(self.x.as_slice())
    }

    fn total(&self) -> [f64; 2] {
        self.partial.iter().fold([0.0; 2], |s, p| [s[0] + p[0], s[1] + p[1]])
    }

    /// Solves A x = b for the free vertices; `x` holds the prescribed values on entry (others are ignored: the iteration
    /// starts from zero) and the solution on return. Call on the pool.
    pub(crate) fn solve(
        &mut self,
        a: &BlockMatrix,
        b: &[Vec3],
        pinned: &[bool],
        x: &mut [Vec3],
        tolerance: f64,
        max_iterations: usize,
    ) -> Result<SolveInfo, SolveError> {
        let bad = self.start(a, b, pinned, x);
        let [mut rz, rr] = self.total();
        if !rr.is_finite() {
            return Err(SolveError::NotFinite { iteration: 0, value: rr });
        }
        if let Some(row) = bad {
            return Err(SolveError::NotPositiveDefinite {
                iteration: 0,
                curvature: determinant(&a.diagonal[row]),
            });
        }
        let first = rr.sqrt();
        let mut info = SolveInfo { iterations: 0, residual: 0.0, converged: true };
        if first > 0.0 {
            info.residual = 1.0;
            info.converged = false;
        }
        while !info.converged && info.iterations < max_iterations {
            self.product(a, pinned);
            let [curvature, _] = self.total();
            if !curvature.is_finite() {
                return Err(SolveError::NotFinite { iteration: info.iterations, value: curvature });
            }
            if curvature <= 0.0 {
                return Err(SolveError::NotPositiveDefinite { iteration: info.iterations, curvature });
            }
            self.advance(rz / curvature);
            info.iterations += 1;
            let [next, rr] = self.total();
            info.residual = rr.sqrt() / first;
            info.converged = info.residual <= tolerance;
            if !info.converged {
                let beta = next / rz;
                self.p.par_chunks_mut(ROWS_PER_CHUNK).zip(self.z.par_chunks(ROWS_PER_CHUNK)).for_each(
                    |(p, z)| {
                        for (p, z) in p.iter_mut().zip(z) {
                            for l in 0..4 {
                                p.0[l] = z.0[l] + beta * p.0[l];
                            }
                        }
                    },
                );
            }
            rz = next;
        }
        for (out, x) in x.iter_mut().zip(&self.x) {
            *out = x.to_vec();
        }
        Ok(info)
    }

    /// x, r = filtered b − A x, preconditioner, z, p and the first dot products; returns a row whose diagonal block is
    /// not positive definite.
    fn start(&mut self, a: &BlockMatrix, b: &[Vec3], pinned: &[bool], x: &[Vec3]) -> Option<usize> {
        let mut moved = false;
        for (row, lanes) in self.x.iter_mut().enumerate() {
            *lanes = if pinned[row] { Lanes::from_vec(&x[row]) } else { Lanes::ZERO };
            moved |= *lanes != Lanes::ZERO;
        }
        let known = &self.x;
        self.r
            .par_chunks_mut(ROWS_PER_CHUNK)
            .zip(self.z.par_chunks_mut(ROWS_PER_CHUNK))
            .zip(self.p.par_chunks_mut(ROWS_PER_CHUNK))
            .zip(self.inverse.par_chunks_mut(ROWS_PER_CHUNK))
            .zip(self.partial.par_iter_mut())
            .enumerate()
            .filter_map(|(chunk, ((((r, z), p), inverse), partial))| {
                let first = chunk * ROWS_PER_CHUNK;
                let mut bad = None;
                if moved {
                    a.multiply_rows(first, known, r);
                } else {
                    r.fill(Lanes::ZERO);
                }
                let mut sums = [0.0; 2];
                for k in 0..r.len() {
                    let row = first + k;
                    if pinned[row] {
                        r[k] = Lanes::ZERO;
                        inverse[k] = [0.0; 9];
                    } else {
                        for l in 0..3 {
                            r[k].0[l] = b[row][l] - r[k].0[l];
                        }
                        match invert(&a.diagonal[row]) {
                            Some(block) => inverse[k] = block,
                            None => bad = bad.or(Some(row)),
                        }
                    }
                    z[k] = apply(&inverse[k], &r[k]);
                    p[k] = z[k];
                    sums[0] += r[k].dot(&z[k]);
                    sums[1] += r[k].dot(&r[k]);
                }
                *partial = sums;
                bad
            })
            .min()
    }

    /// q = filtered A p and the partial sums of p·q.
    fn product(&mut self, a: &BlockMatrix, pinned: &[bool]) {
        let p = &self.p;
        self.q.par_chunks_mut(ROWS_PER_CHUNK).zip(self.partial.par_iter_mut()).enumerate().for_each(
            |(chunk, (q, partial))| {
                let first = chunk * ROWS_PER_CHUNK;
                a.multiply_rows(first, p, q);
                let mut sum = 0.0;
                for (k, q) in q.iter_mut().enumerate() {
                    if pinned[first + k] {
                        *q = Lanes::ZERO;
                    }
                    sum += p[first + k].dot(q);
                }
                *partial = [sum, 0.0];
            },
        );
    }

    /// x += α p, r −= α q, z = D⁻¹ r and the partial sums of r·z and r·r.
    fn advance(&mut self, alpha: f64) {
        self.x
            .par_chunks_mut(ROWS_PER_CHUNK)
            .zip(self.r.par_chunks_mut(ROWS_PER_CHUNK))
            .zip(self.z.par_chunks_mut(ROWS_PER_CHUNK))
            .zip(self.partial.par_iter_mut())
            .enumerate()
            .for_each(|(chunk, (((x, r), z), partial))| {
                let first = chunk * ROWS_PER_CHUNK;
                let (p, q) = (&self.p[first..][..x.len()], &self.q[first..][..x.len()]);
                let inverse = &self.inverse[first..][..x.len()];
                let mut sums = [0.0; 2];
                for k in 0..p.len() {
                    for l in 0..4 {
                        x[k].0[l] += alpha * p[k].0[l];
                        r[k].0[l] -= alpha * q[k].0[l];
                    }
                    z[k] = apply(&inverse[k], &r[k]);
                    sums[0] += r[k].dot(&z[k]);
                    sums[1] += r[k].dot(&r[k]);
                }
                *partial = sums;
            });
    }
}
