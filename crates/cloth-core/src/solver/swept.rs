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

use rayon::prelude::*;

use super::{
    SolveError, SolveInfo,
    coarse::Band,
    ordering::Graph,
    pcg::apply,
};
use crate::{
    assembly::{BlockMatrix, Lanes, Pattern, for_parts, simd},
    mesh::Vec3,
};

/// 1/ω with the relaxation ω = 1.4, the best of 1.0–1.6 on hanging cloth at steps of 1 and 5 ms.
const SIGMA: f64 = 1.0 / 1.4;
/// Rows per domain: few enough domains that their borders do not weaken the sweeps, enough for the threads.
const DOMAIN_ROWS: usize = 1200;
/// Most domains.
const MAX_DOMAINS: usize = 64;
/// Vertices per aggregate that are aimed at.
const AGGREGATE_ROWS: usize = 48;
/// Most aggregates: bounds the coarse factorisation.
const MAX_AGGREGATES: usize = 600;
/// Iteration of the first look at the true residual.
const FIRST_CHECK: usize = 4;

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
    coarse: Vec<f64>,
}

/// The pattern in the solver's order.
struct Rows {
    /// Original vertex of each row.
    order: Vec<u32>,
    /// First row of each domain, and the number of rows.
    domains: Vec<usize>,
    /// Upper blocks of row i: `upper[i]..middle[i]` inside its domain, `middle[i]..upper[i + 1]` across.
    upper: Vec<u32>,
    middle: Vec<u32>,
    columns: Vec<u32>,
    /// Original upper block × 2, plus 1 where its transpose is taken.
    source: Vec<u32>,
    /// Lower entries (column, upper block) of row i, inside its domain and across.
    lower: Vec<u32>,
    lower_middle: Vec<u32>,
    lower_entries: Vec<[u32; 2]>,
}

/// The coarse space.
struct Coarse {
    /// Aggregate of each row.
    aggregate: Vec<u32>,
    /// Entries of T ᵀW of row i: `offsets[i]..offsets[i + 1]`, the row's own aggregate first.
    offsets: Vec<u32>,
    columns: Vec<u32>,
    values: Vec<[f64; 9]>,
    /// Entry that each upper block inside a domain counts to.
    slots: Vec<u32>,
    band: Band,
    /// Restricted residual and its solution, three values per aggregate.
    residual: Vec<f64>,
    solution: Vec<f64>,
}

impl Rows {
    fn new(pattern: &Pattern, order: Vec<u32>) -> Self {
        let n = pattern.rows;
        let mut place = vec![0u32; n];
        for (i, &v) in order.iter().enumerate() {
            place[v as usize] = i as u32;
        }
        let count = n.div_ceil(DOMAIN_ROWS).clamp(1, MAX_DOMAINS);
        let domains: Vec<usize> = (0..=count).map(|d| d * n / count).collect();
        let mut domain_of = vec![0u32; n];
        for d in 0..count {
            domain_of[domains[d]..domains[d + 1]].fill(d as u32);
        }
        // (row, across, column, source), sorted.
        let mut blocks = Vec::with_capacity(pattern.upper_count());
        for i in 0..n {
            for k in pattern.upper_of(i) {
                let (a, b) = (place[i], place[pattern.columns[k] as usize]);
                let across = domain_of[a as usize] != domain_of[b as usize];
                blocks.push((a.min(b), across, a.max(b), 2 * k as u32 + u32::from(a > b)));
            }
        }
        blocks.sort_unstable();
        let mut upper = vec![0u32; n + 1];
        let mut inside = vec![0u32; n];
        let mut entries = Vec::with_capacity(blocks.len());
        for (k, &(row, across, column, _)) in blocks.iter().enumerate() {
            upper[row as usize + 1] += 1;
            inside[row as usize] += u32::from(!across);
            entries.push((column, across, row, k as u32));
        }
        entries.sort_unstable();
        let mut lower = vec![0u32; n + 1];
        let mut lower_inside = vec![0u32; n];
        for &(column, across, ..) in &entries {
            lower[column as usize + 1] += 1;
            lower_inside[column as usize] += u32::from(!across);
        }
        for i in 0..n {
            upper[i + 1] += upper[i];
            lower[i + 1] += lower[i];
        }
        Self {
            middle: (0..n).map(|i| upper[i] + inside[i]).collect(),
            lower_middle: (0..n).map(|i| lower[i] + lower_inside[i]).collect(),
            columns: blocks.iter().map(|b| b.2).collect(),
            source: blocks.iter().map(|b| b.3).collect(),
            lower_entries: entries.iter().map(|e| [e.2, e.3]).collect(),
            order,
            domains,
            upper,
            lower,
        }
    }

    fn len(&self) -> usize {
        self.order.len()
    }

    fn domains(&self) -> usize {
        self.domains.len() - 1
    }

    fn bytes(&self) -> usize {
        4 * (self.order.len()
            + self.upper.len()
            + self.middle.len()
            + self.columns.len()
            + self.source.len()
            + self.lower.len()
            + self.lower_middle.len())
            + 8 * self.lower_entries.len()
    }
}

impl Coarse {
    fn new(rows: &Rows, aggregate_of_vertex: &[u32], count: usize) -> Self {
        // Aggregates numbered in the order in which rows meet them, which keeps the band narrow.
        let mut number = vec![u32::MAX; count];
        let mut next = 0;
        let aggregate: Vec<u32> = rows
            .order
            .iter()
            .map(|&v| {
                let slot = &mut number[aggregate_of_vertex[v as usize] as usize];
                if *slot == u32::MAX {
                    *slot = next;
                    next += 1;
                }
                *slot
            })
            .collect();
        let (mut offsets, mut columns) = (vec![0u32], Vec::new());
        let mut slots = vec![0u32; rows.columns.len()];
        let mut reach = 0;
        for i in 0..rows.len() {
            let first = columns.len();
            columns.push(aggregate[i]);
            for k in rows.upper[i] as usize..rows.upper[i + 1] as usize {
                let other = aggregate[rows.columns[k] as usize];
                reach = reach.max(other.abs_diff(aggregate[i]));
                if k < rows.middle[i] as usize {
                    let known = columns[first..].iter().position(|&c| c == other);
                    slots[k] = (first + known.unwrap_or(columns.len() - first)) as u32;
                    if known.is_none() {
                        columns.push(other);
                    }
                }
            }
            offsets.push(columns.len() as u32);
        }
        let size = 3 * count;
        Self {
            aggregate,
            offsets,
            values: vec![[0.0; 9]; columns.len()],
            columns,
            slots,
            band: Band::new(size, 3 * reach as usize + 2),
            residual: vec![0.0; size],
            solution: vec![0.0; size],
        }
    }

    fn bytes(&self) -> usize {
        4 * (self.aggregate.len() + self.offsets.len() + self.columns.len() + self.slots.len())
            + size_of_val(self.values.as_slice())
            + self.band.bytes()
    }
}

/// Factor of E = Wᵀ A W over the free vertices, into `band`; false if it is not positive definite.
fn build_band(band: &mut Band, aggregate: &[u32], rows: &Rows, a: &BlockMatrix, pinned: &[bool]) -> bool {
    band.clear();
    for i in 0..rows.len() {
        let vertex = rows.order[i] as usize;
        if pinned[vertex] {
            continue;
        }
        let own = 3 * aggregate[i] as usize;
        let mut diagonal = a.diagonal[vertex];
        for k in rows.upper[i] as usize..rows.upper[i + 1] as usize {
            let j = rows.columns[k] as usize;
            if pinned[rows.order[j] as usize] {
                continue;
            }
            let block = oriented(a, rows.source[k]);
            let other = 3 * aggregate[j] as usize;
            if other == own {
                for i in 0..9 {
                    diagonal[i] += block[i] + block[3 * (i % 3) + i / 3];
                }
            } else {
                for c in 0..3 {
                    for r in 0..3 {
                        // The lower part of E: the row is the later aggregate.
                        if other > own {
                            band.add(other + c, own + r, block[3 * c + r]);
                        } else {
                            band.add(own + r, other + c, block[3 * c + r]);
                        }
                    }
                }
            }
        }
        for c in 0..3 {
            for r in c..3 {
                band.add(own + r, own + c, diagonal[3 * c + r]);
            }
        }
    }
    band.factorise()
}

/// Original block, or its transpose.
#[inline]
fn oriented(a: &BlockMatrix, source: u32) -> [f64; 9] {
    let k = 9 * (source >> 1) as usize;
    let values = &a.upper[k..k + 9];
    let mut block = [0.0; 9];
    if source & 1 == 0 {
        block.copy_from_slice(values);
    } else {
        for i in 0..9 {
            block[i] = values[3 * (i % 3) + i / 3];
        }
    }
    block
}

/// Inverse of the lower Cholesky factor of a symmetric block; none if it is not positive definite.
fn inverse_factor(m: &[f64; 9]) -> Option<[f64; 9]> {
    let positive = |v: f64| (v > 0.0).then(|| v.sqrt());
    let g00 = positive(m[0])?;
    let (g10, g20) = (m[1] / g00, m[2] / g00);
    let g11 = positive(m[4] - g10 * g10)?;
    let g21 = (m[5] - g20 * g10) / g11;
    let g22 = positive(m[8] - g20 * g20 - g21 * g21)?;
    let (h00, h11, h22) = (1.0 / g00, 1.0 / g11, 1.0 / g22);
    let h10 = -g10 * h00 * h11;
    let h21 = -g21 * h11 * h22;
    let h20 = -(g20 * h00 + g21 * h10) * h22;
    Some([h00, h10, h20, 0.0, h11, h21, 0.0, 0.0, h22])
}

/// Lower triangular `l` times `m`.
#[inline]
fn times(l: &[f64; 9], m: &[f64; 9]) -> [f64; 9] {
    let mut out = [0.0; 9];
    for c in 0..3 {
        let (a, b, d) = (m[3 * c], m[3 * c + 1], m[3 * c + 2]);
        out[3 * c] = l[0] * a;
        out[3 * c + 1] = l[1] * a + l[4] * b;
        out[3 * c + 2] = (l[2] * a + l[5] * b) + l[8] * d;
    }
    out
}

/// `m` times the transpose of lower triangular `l`.
#[inline]
fn times_transposed(m: &[f64; 9], l: &[f64; 9]) -> [f64; 9] {
    let mut out = [0.0; 9];
    for r in 0..3 {
        let (a, b, d) = (m[r], m[3 + r], m[6 + r]);
        out[r] = a * l[0];
        out[3 + r] = a * l[1] + b * l[4];
        out[6 + r] = (a * l[2] + b * l[5]) + d * l[8];
    }
    out
}

/// Transpose of `block` times a vector.
#[inline]
fn apply_transposed(block: &[f64; 9], v: &Lanes) -> Lanes {
    let mut out = [0.0; 4];
    for c in 0..3 {
        out[c] = (block[3 * c] * v.0[0] + block[3 * c + 1] * v.0[1]) + block[3 * c + 2] * v.0[2];
    }
    Lanes(out)
}

impl Swept {
    pub(crate) fn new(pattern: &Pattern) -> Self {
        let graph = Graph::new(pattern);
        let rows = Rows::new(pattern, graph.close_order());
        let n = pattern.rows;
        let (aggregate, count) = graph.aggregates((n / AGGREGATE_ROWS).clamp(1, MAX_AGGREGATES));
        let coarse = Coarse::new(&rows, &aggregate, count);
        let lanes = || vec![Lanes::ZERO; n];
        let partial = (0..rows.domains()).map(|_| Partial { dot: 0.0, coarse: vec![0.0; 3 * count] }).collect();
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
            if estimate * ratio <= tolerance || info.iterations >= next_check || info.iterations == max_iterations {
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
                .par_chunks_mut(crate::assembly::ROWS_PER_CHUNK)
                .enumerate()
                .for_each(|(chunk, out)| a.multiply_rows(chunk * crate::assembly::ROWS_PER_CHUNK, known, out));
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
                for (row, scale) in scale.iter_mut().enumerate() {
                    let vertex = rows.order[row] as usize;
                    *scale = if pinned[vertex] {
                        [0.0; 9]
                    } else {
                        inverse_factor(&a.diagonal[vertex])
                            .ok_or(SolveError::NotPositiveDefinite { iteration: 0, curvature: f64::NAN })?
                    };
                }
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
                for_parts(0..rows.domains(), values, &end, &|d, out| {
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
        for ((s, scale), r) in s.iter_mut().zip(&*scale).zip(&*r) {
            *s = apply(scale, r);
        }
        let scaled = &*s;
        for_domains(&rows.domains, r.as_mut_slice(), partial, &|d, r, _| {
            kernels::forward(rows, upper, d, scaled, None, r);
        });
    }

    /// x += α t, r̂ −= α (s + t) (not at the start), the restriction (Tᵀ W)ᵀ r̂ if there is a coarse space; returns r̂·r̂.
    fn advance(&mut self, alpha: f64, corrected: bool) -> f64 {
        let Self { rows, coarse, r, t, s, x, partial, .. } = self;
        let (t, s) = (&*t, &*s);
        let Coarse { offsets, columns, values, residual, .. } = coarse;
        for_domains(&rows.domains, (r.as_mut_slice(), x.as_mut_slice()), partial, &|d, (r, x), partial| {
            let first = rows.domains[d];
            partial.dot = 0.0;
            partial.coarse.fill(0.0);
            for i in 0..r.len() {
                let (t, s) = (&t[first + i].0, &s[first + i].0);
                if alpha != 0.0 {
                    for l in 0..4 {
                        x[i].0[l] += alpha * t[l];
                        r[i].0[l] -= alpha * (s[l] + t[l]);
                    }
                }
                partial.dot += r[i].dot(&r[i]);
                if corrected {
                    for e in offsets[first + i] as usize..offsets[first + i + 1] as usize {
                        let add = apply_transposed(&values[e], &r[i]);
                        let sum = &mut partial.coarse[3 * columns[e] as usize..][..3];
                        for l in 0..3 {
                            sum[l] += add.0[l];
                        }
                    }
                }
            }
        });
        if corrected {
            residual.fill(0.0);
            for part in &*partial {
                for (sum, value) in residual.iter_mut().zip(&part.coarse) {
                    *sum += value;
                }
            }
        }
        partial.iter().map(|p| p.dot).sum()
    }

    /// Coarse solution y; returns r̂·ẑ = r̂·r̂ + (restricted r̂)·y.
    fn correct(&mut self, corrected: bool, rr: f64) -> f64 {
        if !corrected {
            return rr;
        }
        let Coarse { band, residual, solution, .. } = &mut self.coarse;
        solution.copy_from_slice(residual);
        band.solve(solution);
        rr + residual.iter().zip(&*solution).map(|(r, y)| r * y).sum::<f64>()
    }

    /// p = r̂ + Tᵀ W y + β p, t = T⁻ᵀ p, s = T⁻¹ (p + (1 − 2σ) t + C t); returns p·(s + t).
    fn sweep(&mut self, beta: f64, corrected: bool) -> f64 {
        let Self { rows, upper, coarse, r, p, t, s, partial, .. } = self;
        let (r, coarse) = (&*r, &*coarse);
        for_domains(&rows.domains, (p.as_mut_slice(), t.as_mut_slice()), partial, &|d, (p, t), _| {
            let first = rows.domains[d];
            for (i, p) in p.iter_mut().enumerate() {
                let mut z = r[first + i];
                if corrected {
                    for e in coarse.offsets[first + i] as usize..coarse.offsets[first + i + 1] as usize {
                        let y = &coarse.solution[3 * coarse.columns[e] as usize..][..3];
                        let add = apply(&coarse.values[e], &Lanes([y[0], y[1], y[2], 0.0]));
                        for l in 0..4 {
                            z.0[l] += add.0[l];
                        }
                    }
                }
                for l in 0..4 {
                    p.0[l] = z.0[l] + beta * p.0[l];
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
            partial.dot = 0.0;
            for i in rows.domains[d]..rows.domains[d + 1] {
                let mut y = r[i].0.map(|value| SIGMA * value);
                for &[j, k] in &rows.lower_entries[rows.lower[i] as usize..rows.lower_middle[i] as usize] {
                    if let Some(block) = upper[9 * k as usize..].first_chunk::<9>() {
                        let add = apply_transposed(block, &r[j as usize]);
                        for l in 0..3 {
                            y[l] += add.0[l];
                        }
                    }
                }
                let h = &scale[i];
                if h[0] > 0.0 {
                    let a = y[0] / h[0];
                    let b = (y[1] - h[1] * a) / h[4];
                    let c = (y[2] - h[2] * a - h[5] * b) / h[8];
                    partial.dot += a * a + b * b + c * c;
                }
            }
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

/// Slices with one entry per row that are cut at the same rows.
trait Parts: Send {
    fn split(self, at: usize) -> (Self, Self)
    where
        Self: Sized;
}

impl Parts for () {
    fn split(self, _at: usize) -> (Self, Self) {
        ((), ())
    }
}

impl<T: Send> Parts for &mut [T] {
    fn split(self, at: usize) -> (Self, Self) {
        self.split_at_mut(at)
    }
}

impl<A: Parts, B: Parts> Parts for (A, B) {
    fn split(self, at: usize) -> (Self, Self) {
        let ((a, c), (b, d)) = (self.0.split(at), self.1.split(at));
        ((a, b), (c, d))
    }
}

/// Runs `f(domain, its rows of parts, its partial sums)` for all domains, in parallel.
fn for_domains<P: Parts>(
    bounds: &[usize],
    parts: P,
    partial: &mut [Partial],
    f: &(impl Fn(usize, P, &mut Partial) + Sync),
) {
    fn recurse<P: Parts>(
        bounds: &[usize],
        first: usize,
        parts: P,
        partial: &mut [Partial],
        f: &(impl Fn(usize, P, &mut Partial) + Sync),
    ) {
        match partial {
            [] => {}
            [one] => f(first, parts, one),
            _ => {
                let half = partial.len() / 2;
                let (a, b) = parts.split(bounds[first + half] - bounds[first]);
                let (left, right) = partial.split_at_mut(half);
                rayon::join(
                    || recurse(bounds, first, a, left, f),
                    || recurse(bounds, first + half, b, right, f),
                );
            }
        }
    }
    recurse(bounds, 0, parts, partial, f);
}

/// The triangular sweeps.
mod kernels {
    use super::{Lanes, Rows, SIGMA, simd};
    use crate::assembly::simd::Four;

    /// Solves (σ I + U) t = p inside domain `d`; `p` and `t` are the domain's rows.
    pub(super) fn backward(rows: &Rows, upper: &[f64], d: usize, p: &[Lanes], t: &mut [Lanes]) {
        let (first, end) = (rows.domains[d], rows.domains[d + 1]);
        assert!(p.len() == end - first && t.len() == p.len() && upper.len() >= 9 * rows.columns.len() + 3);
        #[cfg(target_arch = "x86_64")]
        if simd::has_avx() {
            #[target_feature(enable = "avx")]
            unsafe fn with_avx(rows: &Rows, upper: &[f64], d: usize, p: &[Lanes], t: &mut [Lanes]) {
                // SAFETY: this function is compiled for AVX; the lengths are the caller's to check.
                unsafe { backward_with::<simd::Avx>(rows, upper, d, p, t) };
            }
            // SAFETY: the processor has AVX; lengths are asserted above.
            unsafe { with_avx(rows, upper, d, p, t) };
            return;
        }
        // SAFETY: the portable lanes need no feature; lengths are asserted above.
        unsafe { backward_with::<simd::Array>(rows, upper, d, p, t) };
    }

    /// s = (σ I + Uᵀ)⁻¹ w inside domain `d`, with w = p, or p + (1 − 2σ) t + C t where `t` is given; `p` and `t` are
    /// all rows, `s` the domain's. Returns p·(s + t).
    pub(super) fn forward(
        rows: &Rows,
        upper: &[f64],
        d: usize,
        p: &[Lanes],
        t: Option<&[Lanes]>,
        s: &mut [Lanes],
    ) -> f64 {
        let (first, end) = (rows.domains[d], rows.domains[d + 1]);
        assert!(s.len() == end - first && p.len() == rows.len() && upper.len() >= 9 * rows.columns.len() + 3);
        assert!(t.is_none_or(|t| t.len() == rows.len()));
        #[cfg(target_arch = "x86_64")]
        if simd::has_avx() {
            #[target_feature(enable = "avx")]
            unsafe fn with_avx(
                rows: &Rows,
                upper: &[f64],
                d: usize,
                p: &[Lanes],
                t: Option<&[Lanes]>,
                s: &mut [Lanes],
            ) -> f64 {
                // SAFETY: this function is compiled for AVX; the lengths are the caller's to check.
                unsafe { forward_with::<simd::Avx>(rows, upper, d, p, t, s) }
            }
            // SAFETY: the processor has AVX; lengths are asserted above.
            return unsafe { with_avx(rows, upper, d, p, t, s) };
        }
        // SAFETY: the portable lanes need no feature; lengths are asserted above.
        unsafe { forward_with::<simd::Array>(rows, upper, d, p, t, s) }
    }

    /// # Safety
    /// The processor has `F`'s features; lengths as asserted by `backward`. Columns and blocks of `rows` are in range by
    /// construction, those before `middle` inside the domain.
    #[inline(always)]
    unsafe fn backward_with<F: Four>(rows: &Rows, upper: &[f64], d: usize, p: &[Lanes], t: &mut [Lanes]) {
        let first = rows.domains[d];
        let minus = -1.0 / SIGMA;
        for i in (0..p.len()).rev() {
            let row = first + i;
            // SAFETY: by contract.
            unsafe {
                let mut sum = F::zero();
                // Farthest columns first: the nearest ones were solved last and are still on their way.
                for k in (rows.upper[row] as usize..rows.middle[row] as usize).rev() {
                    let column = *rows.columns.get_unchecked(k) as usize - first;
                    sum = sum.add(product::<F>(upper.as_ptr().add(9 * k), t.get_unchecked(column)));
                }
                let sum = sum.lanes();
                let out = t.get_unchecked_mut(i);
                for l in 0..3 {
                    out.0[l] = (sum.0[l] - p.get_unchecked(i).0[l]) * minus;
                }
            }
        }
    }

    /// # Safety
    /// The processor has `F`'s features; lengths as asserted by `forward`. Columns and blocks of `rows` are in range by
    /// construction, those before `lower_middle` inside the domain.
    #[inline(always)]
    unsafe fn forward_with<F: Four>(
        rows: &Rows,
        upper: &[f64],
        d: usize,
        p: &[Lanes],
        t: Option<&[Lanes]>,
        s: &mut [Lanes],
    ) -> f64 {
        let first = rows.domains[d];
        let blocks = upper.as_ptr();
        let mut dot = 0.0;
        for i in 0..s.len() {
            let row = first + i;
            // SAFETY: by contract.
            unsafe {
                let mut w = *p.get_unchecked(row);
                let mut columns = [F::zero(); 3];
                let mut present = Lanes::ZERO;
                if let Some(t) = t {
                    present = *t.get_unchecked(row);
                    let mut across = F::zero();
                    for k in rows.middle[row] as usize..rows.upper[row + 1] as usize {
                        let column = *rows.columns.get_unchecked(k) as usize;
                        across = across.add(product::<F>(blocks.add(9 * k), t.get_unchecked(column)));
                    }
                    let across = across.lanes();
                    for l in 0..3 {
                        w.0[l] = (w.0[l] + (1.0 - 2.0 * SIGMA) * present.0[l]) + across.0[l];
                    }
                    // The lower blocks across domains count with the opposite sign of those inside.
                    let mut opposite = [F::zero(); 3];
                    for e in rows.lower_middle[row] as usize..rows.lower[row + 1] as usize {
                        let [j, k] = *rows.lower_entries.get_unchecked(e);
                        transposed::<F>(blocks.add(9 * k as usize), t.get_unchecked(j as usize), &mut opposite);
                    }
                    let sums = total(opposite);
                    for l in 0..3 {
                        w.0[l] += sums[l];
                    }
                }
                for e in rows.lower[row] as usize..rows.lower_middle[row] as usize {
                    let [j, k] = *rows.lower_entries.get_unchecked(e);
                    let value = s.get_unchecked(j as usize - first);
                    transposed::<F>(blocks.add(9 * k as usize), value, &mut columns);
                }
                let sums = total(columns);
                let out = s.get_unchecked_mut(i);
                let p = p.get_unchecked(row);
                for l in 0..3 {
                    out.0[l] = (w.0[l] - sums[l]) * (1.0 / SIGMA);
                    dot += p.0[l] * (out.0[l] + present.0[l]);
                }
            }
        }
        dot
    }

    /// Block times vector.
    ///
    /// # Safety
    /// The processor has `F`'s features; ten values can be read at `block`.
    #[inline(always)]
    unsafe fn product<F: Four>(block: *const f64, x: &Lanes) -> F {
        // SAFETY: by contract; the last lane is not used.
        unsafe {
            let a = F::load(block).multiply(F::splat(x.0[0]));
            let b = F::load(block.add(3)).multiply(F::splat(x.0[1]));
            let c = F::load(block.add(6)).multiply(F::splat(x.0[2]));
            a.add(b).add(c)
        }
    }

    /// Adds the products of a block's columns with a vector, lane by lane.
    ///
    /// # Safety
    /// As `product`.
    #[inline(always)]
    unsafe fn transposed<F: Four>(block: *const f64, x: &Lanes, columns: &mut [F; 3]) {
        // SAFETY: by contract; the vector's last lane is zero.
        unsafe {
            let x = F::load(x.0.as_ptr());
            columns[0] = columns[0].add(F::load(block).multiply(x));
            columns[1] = columns[1].add(F::load(block.add(3)).multiply(x));
            columns[2] = columns[2].add(F::load(block.add(6)).multiply(x));
        }
    }

    /// Sum of each column's lanes.
    ///
    /// # Safety
    /// The processor has `F`'s features.
    #[inline(always)]
    unsafe fn total<F: Four>(columns: [F; 3]) -> [f64; 3] {
        columns.map(|column| {
            // SAFETY: by contract.
            let lanes = unsafe { column.lanes() };
            lanes.0[0] + lanes.0[1] + lanes.0[2]
        })
    }
}
