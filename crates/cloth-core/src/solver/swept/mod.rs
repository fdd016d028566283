//! Conjugate gradient preconditioned by symmetric sweeps and a coarse correction.
//!
//! The matrix is scaled by its diagonal blocks, Ã = G⁻¹ A G⁻ᵀ = I + U + Uᵀ with A_ii = G_i G_iᵀ (block-Jacobi), and
//! its rows are cut into fixed domains of consecutive vertices in an order that keeps neighbours close. With
//! T = σ I + Lᵒ, Lᵒ the lower part inside domains, one over-relaxed symmetric sweep is (T Tᵀ)⁻¹, and
//!
//! M⁻¹ = (T Tᵀ)⁻¹ + W E⁻¹ Wᵀ,   E = Wᵀ A W
//!
//! adds the exact solution for motions that are constant on each aggregate of vertices (W), which no local sweep
//! sees. The iteration runs on T⁻¹ Ã T⁻ᵀ, where the product needs only the two triangular sweeps,
//! Ã t = T t + Tᵀ t + (1 − 2σ) t + C t with C the blocks across domains (Eisenstat's trick): it reads the matrix as
//! often as plain conjugate gradient does.
//!
//! Prescribed vertices have G⁻¹ = 0, which takes their rows and columns out (the Baraff–Witkin filter).
//! The stopping test is on the true residual ‖b − A x‖ = ‖G T r̂‖, computed where r̂ suggests that it is met.
//!
//! Sources: Baraff and Witkin 1998, section 5.2; Eisenstat 1981; Nicolaides 1987 for the coarse space.

mod coarse;
mod kernels;
mod rows;

use rayon::prelude::*;

use self::{
    coarse::{Coarse, build_band},
    rows::{Rows, for_domains, oriented},
};
use super::{
    SolveError, SolveInfo,
    blocks::{apply, apply_transposed, inverse_factor, times, times_transposed},
    ordering::Graph,
};
use crate::{
    assembly::{BlockMatrix, Lanes, Pattern, ROWS_PER_CHUNK, for_parts},
    mesh::Vec3,
};

/// 1/ω with the relaxation ω = 1.4, the best of 1.0–1.6 on hanging cloth at steps of 1 and 5 ms.
const SIGMA: f64 = 1.0 / 1.4;
/// Vertices per aggregate that are aimed at.
const AGGREGATE_ROWS: usize = 32;
/// Most aggregates: bounds the coarse factorisation.
const MAX_AGGREGATES: usize = 600;
/// Iteration of the first look at the true residual.
const FIRST_CHECK: usize = 8;

/// Analysis and work space for one pattern.
pub(crate) struct Swept {
    rows: Rows,
    /// Inverse Cholesky factors G_i⁻¹ of the diagonal blocks, lower triangular; zero at pins.
    scale: Vec<[f64; 9]>,
    /// Scaled upper blocks, three values of padding at the end.
    upper: Vec<f64>,
    coarse: Coarse,
    r: Vec<Lanes>,
    p: Vec<Lanes>,
    t: Vec<Lanes>,
    s: Vec<Lanes>,
    x: Vec<Lanes>,
    partial: Vec<Partial>,
}

/// Sums of one domain.
struct Partial {
    dot: f64,
    /// Restricted residual of the aggregates in the domain's reach, lane by lane.
    coarse: Vec<[Lanes; 3]>,
}

impl Swept {
    pub(crate) fn new(pattern: &Pattern) -> Self {
        let graph = Graph::new(pattern);
        let rows = Rows::new(pattern, graph.close_order());
        let n = pattern.rows;
        let (aggregate, count) = graph.aggregates(&rows.order, (n / AGGREGATE_ROWS).clamp(1, MAX_AGGREGATES));
        let coarse = Coarse::new(&rows, &aggregate, count);
        let lanes = || vec![Lanes::ZERO; n];
        let partial = coarse
            .reach
            .iter()
            .map(|[low, high]| Partial { dot: 0.0, coarse: vec![[Lanes::ZERO; 3]; (high - low) as usize] })
            .collect();
        Self {
            scale: vec![[0.0; 9]; n],
            upper: vec![0.0; 9 * pattern.upper_count() + 3],
            r: lanes(),
            p: lanes(),
            t: lanes(),
            s: lanes(),
            x: lanes(),
            rows,
            coarse,
            partial,
        }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        self.rows.bytes()
            + self.coarse.bytes()
            + size_of_val(self.scale.as_slice())
            + 8 * self.upper.len()
            + 5 * size_of_val(self.x.as_slice())
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
        let first = self.right_hand_side(a, b, pinned, x);
        if !first.is_finite() {
            return Err(SolveError::NotFinite { iteration: 0, value: first });
        }
        let mut info = SolveInfo { iterations: 0, residual: 0.0, converged: true };
        if first == 0.0 {
            self.write(pinned, x);
            return Ok(info);
        }
        let corrected = self.prepare(a, pinned)?;
        // r holds b in the solver's order; r̂ = T⁻¹ G⁻¹ b.
        self.start();
        let mut rr = self.advance(0.0, corrected);
        let first_hat = rr.sqrt();
        let mut rho = self.correct(corrected, rr);
        let mut beta = 0.0;
        info = SolveInfo { iterations: 0, residual: 1.0, converged: false };
        // Estimate of (‖r‖/‖b‖) / (‖r̂‖/‖r̂_0‖), refreshed at every look at the true residual.
        let mut ratio = 1.0;
        let mut next_check = FIRST_CHECK;
        while info.iterations < max_iterations {
            let curvature = self.sweep(beta, corrected);
            if !curvature.is_finite() {
                return Err(SolveError::NotFinite { iteration: info.iterations, value: curvature });
            }
            if curvature <= 0.0 {
                return Err(SolveError::NotPositiveDefinite { iteration: info.iterations, curvature });
            }
            rr = self.advance(rho / curvature, corrected);
            info.iterations += 1;
            let estimate = rr.sqrt() / first_hat;
            if estimate * ratio <= tolerance
                || info.iterations >= next_check
                || info.iterations == max_iterations
            {
                info.residual = self.true_residual() / first;
                if info.residual <= tolerance {
                    info.converged = true;
                    break;
                }
                if estimate > 0.0 {
                    ratio = info.residual / estimate;
                }
                next_check = 2 * info.iterations;
            }
            let next = self.correct(corrected, rr);
            beta = next / rho;
            rho = next;
        }
        self.write(pinned, x);
        Ok(info)
    }

    /// r = b − A x_pinned at free vertices, zero at pins; its norm.
    fn right_hand_side(&mut self, a: &BlockMatrix, b: &[Vec3], pinned: &[bool], x: &[Vec3]) -> f64 {
        let mut moved = false;
        for (vertex, lanes) in self.s.iter_mut().enumerate() {
            *lanes = if pinned[vertex] { Lanes::from_vec(&x[vertex]) } else { Lanes::ZERO };
            moved |= *lanes != Lanes::ZERO;
        }
        // t = A x_pinned, in the original order.
        if moved {
            let known = &self.s;
            self.t
                .par_chunks_mut(ROWS_PER_CHUNK)
                .enumerate()
                .for_each(|(chunk, out)| a.multiply_rows(chunk * ROWS_PER_CHUNK, known, out));
        } else {
            self.t.fill(Lanes::ZERO);
        }
        let mut squares = 0.0;
        for (row, r) in self.r.iter_mut().enumerate() {
            let vertex = self.rows.order[row] as usize;
            *r = Lanes::ZERO;
            if !pinned[vertex] {
                for l in 0..3 {
                    r.0[l] = b[vertex][l] - self.t[vertex].0[l];
                }
            }
            squares += r.dot(r);
            self.x[row] = Lanes::ZERO;
        }
        squares.sqrt()
    }

    /// Scales the matrix and builds the coarse factor; whether there is one.
    fn prepare(&mut self, a: &BlockMatrix, pinned: &[bool]) -> Result<bool, SolveError> {
        let Self { rows, scale, upper, coarse, .. } = self;
        let Coarse { aggregate, offsets, columns: _, values, slots, band, .. } = coarse;
        let (corrected, scaled) = rayon::join(
            || build_band(band, aggregate, rows, a, pinned),
            || {
                scale.par_iter_mut().enumerate().with_min_len(ROWS_PER_CHUNK).try_for_each(
                    |(row, scale)| {
                        let vertex = rows.order[row] as usize;
                        *scale = if pinned[vertex] {
                            [0.0; 9]
                        } else {
                            inverse_factor(&a.diagonal[vertex]).ok_or(SolveError::NotPositiveDefinite {
                                iteration: 0,
                                curvature: f64::NAN,
                            })?
                        };
                        Ok(())
                    },
                )?;
                let scale = &*scale;
                let count = 9 * rows.columns.len();
                let end = |d: usize| 9 * rows.upper[rows.domains[d + 1]] as usize;
                for_parts(0..rows.domains(), &mut upper[..count], &end, &|d, out| {
                    let mut blocks = out.as_chunks_mut::<9>().0.iter_mut();
                    for i in rows.domains[d]..rows.domains[d + 1] {
                        for k in rows.upper[i] as usize..rows.upper[i + 1] as usize {
                            let scaled = times_transposed(
                                &times(&scale[i], &oriented(a, rows.source[k])),
                                &scale[rows.columns[k] as usize],
                            );
                            if let Some(block) = blocks.next() {
                                *block = scaled;
                            }
                        }
                    }
                });
                // T ᵀ W in scaled coordinates: row i has G_i⁻¹ (σ A_ii, and Σ U_ij per aggregate of j).
                let end = |d: usize| offsets[rows.domains[d + 1]] as usize;
                let count = offsets[rows.len()] as usize;
                for_parts(0..rows.domains(), &mut values[..count], &end, &|d, out| {
                    let base = offsets[rows.domains[d]] as usize;
                    for i in rows.domains[d]..rows.domains[d + 1] {
                        let mine = offsets[i] as usize - base..offsets[i + 1] as usize - base;
                        let vertex = rows.order[i] as usize;
                        for block in &mut out[mine.clone()] {
                            *block = [0.0; 9];
                        }
                        if pinned[vertex] {
                            continue;
                        }
                        out[mine.start] = a.diagonal[vertex].map(|value| SIGMA * value);
                        for k in rows.upper[i] as usize..rows.middle[i] as usize {
                            if pinned[rows.order[rows.columns[k] as usize] as usize] {
                                continue;
                            }
                            let block = oriented(a, rows.source[k]);
                            let sum = &mut out[slots[k] as usize - base];
                            for e in 0..9 {
                                sum[e] += block[e];
                            }
                        }
                        for block in &mut out[mine] {
                            *block = times(&scale[i], block);
                        }
                    }
                });
                Ok(())
            },
        );
        scaled?;
        Ok(corrected)
    }

    /// r̂ = T⁻¹ G⁻¹ r in place, and p = t = 0.
    fn start(&mut self) {
        let Self { rows, scale, upper, r, p, t, s, partial, .. } = self;
        p.fill(Lanes::ZERO);
        t.fill(Lanes::ZERO);
        s.par_iter_mut().zip(&*scale).zip(&*r).with_min_len(ROWS_PER_CHUNK).for_each(|((s, scale), r)| {
            *s = apply(scale, r);
        });
        let scaled = &*s;
        for_domains(&rows.domains, r.as_mut_slice(), partial, &|d, r, _| {
            kernels::forward(rows, upper, d, scaled, None, r);
        });
    }

    /// x += α t, r̂ −= α (s + t) (α = 0 at the start), the restriction (Tᵀ W)ᵀ r̂ if there is a coarse space; returns r̂·r̂.
    fn advance(&mut self, alpha: f64, corrected: bool) -> f64 {
        let Self { rows, coarse, r, t, s, x, partial, .. } = self;
        let (t, s, shared) = (&*t, &*s, &*coarse);
        for_domains(&rows.domains, (r.as_mut_slice(), x.as_mut_slice()), partial, &|d, (r, x), partial| {
            let first = rows.domains[d];
            // Lane by lane, so that no sum waits for the one before it in its row.
            let mut squares = [0.0; 4];
            let (t, s) = (&t[first..first + r.len()], &s[first..first + r.len()]);
            for ((r, x), (t, s)) in r.iter_mut().zip(x.iter_mut()).zip(t.iter().zip(s)) {
                for l in 0..4 {
                    x.0[l] += alpha * t.0[l];
                    r.0[l] -= alpha * (s.0[l] + t.0[l]);
                    squares[l] += r.0[l] * r.0[l];
                }
            }
            partial.dot = squares[0] + squares[1] + squares[2];
            if corrected {
                partial.coarse.fill([Lanes::ZERO; 3]);
                kernels::restrict(shared, rows, d, r, &mut partial.coarse);
            }
        });
        if corrected {
            coarse.residual.fill(0.0);
            for (part, [low, high]) in partial.iter().zip(&coarse.reach) {
                let residual = &mut coarse.residual[3 * *low as usize..3 * *high as usize];
                for (sum, columns) in residual.as_chunks_mut::<3>().0.iter_mut().zip(&part.coarse) {
                    for c in 0..3 {
                        sum[c] += columns[c].0[0] + columns[c].0[1] + columns[c].0[2];
                    }
                }
            }
        }
        partial.iter().map(|p| p.dot).sum()
    }

    /// Coarse solution; returns r̂·ẑ = r̂·r̂ + (restricted r̂)·y.
    fn correct(&mut self, corrected: bool, rr: f64) -> f64 {
        if corrected { rr + self.coarse.solve() } else { rr }
    }

    /// p = r̂ + Tᵀ W y + β p, t = T⁻ᵀ p, s = T⁻¹ (p + (1 − 2σ) t + C t); returns p·(s + t).
    fn sweep(&mut self, beta: f64, corrected: bool) -> f64 {
        let Self { rows, upper, coarse, r, p, t, s, partial, .. } = self;
        let (r, coarse) = (&*r, &*coarse);
        for_domains(&rows.domains, (p.as_mut_slice(), t.as_mut_slice()), partial, &|d, (p, t), _| {
            let (first, end) = (rows.domains[d], rows.domains[d + 1]);
            if corrected {
                kernels::prolong(coarse, first, &r[first..end], beta, p);
            } else {
                for (p, r) in p.iter_mut().zip(&r[first..end]) {
                    for l in 0..4 {
                        p.0[l] = r.0[l] + beta * p.0[l];
                    }
                }
            }
            kernels::backward(rows, upper, d, p, t);
        });
        let (p, t) = (&*p, &*t);
        for_domains(&rows.domains, s.as_mut_slice(), partial, &|d, s, partial| {
            partial.dot = kernels::forward(rows, upper, d, p, Some(t), s);
        });
        partial.iter().map(|p| p.dot).sum()
    }

    /// ‖G T r̂‖.
    fn true_residual(&mut self) -> f64 {
        let Self { rows, scale, upper, r, partial, .. } = self;
        let r = &*r;
        for_domains(&rows.domains, (), partial, &|d, (), partial| {
            partial.dot = kernels::residual(rows, upper, d, scale, r);
        });
        partial.iter().map(|p| p.dot).sum::<f64>().sqrt()
    }

    /// x = G⁻ᵀ x̃ at the free vertices, in the original order.
    fn write(&self, pinned: &[bool], out: &mut [Vec3]) {
        for (row, x) in self.x.iter().enumerate() {
            let vertex = self.rows.order[row] as usize;
            if !pinned[vertex] {
                out[vertex] = apply_transposed(&self.scale[row], x).to_vec();
            }
        }
    }
}
