//! Largest stable step of the explicit schemes.
//!
//! The system linearised at a state, M ẍ + D ẋ + K x = 0, is reduced to its fastest modes: a Lanczos iteration on
//! M^(−1/2) K M^(−1/2) gives Ritz vectors q with frequency ω² = qᵀ K q and damping rate β = qᵀ D q, and one on
//! M^(−1/2) D M^(−1/2) those of the strongest damping. A mode's eigenvalues λ = −β/2 ± √(β²/4 − ω²) must satisfy
//! |R(λ dt)| ≤ e^(σ dt), with R the scheme's polynomial Σ z^k/k! up to its order and σ the growth rate that is let pass.
//!
//! For the bending sub-steps of the semi-implicit scheme, symplectic Euler: ω² dt² + 2 β dt ≤ 4.
//!
//! K is taken with the projected blocks: compressed parts are unstable in nature, not through the step. What hinges owe
//! their neighbours is taken exactly, not by its bound.

use nalgebra::{Complex, DMatrix, DVector, SymmetricEigen};

use super::Method;
use crate::{
    ClothSystem, Psd,
    assembly::{Assembler, BlockMatrix, Corners, Lanes},
    forces::Linear,
    mesh::Vec3,
};

/// Lanczos vectors: the largest eigenvalue of a cloth mesh, where many are close to it, is then known to about 1 %.
const VECTORS: usize = 40;
/// Growth rate that is let pass [1/s].
const GROWTH: f64 = 1.0;
/// Relative width to which the step is bisected.
const PRECISION: f64 = 1e-6;

/// Estimate at (x, v) [s]. Call on the pool.
pub(super) fn stable_step(system: &ClothSystem, method: Method, x: &[Vec3], v: &[Vec3]) -> f64 {
    let (mut assembler, pattern) = Assembler::new(system.vertex_count(), system.models(), Psd::Projected);
    let pattern = std::sync::Arc::new(pattern);
    let mut corners = Corners::new(system.models());
    let mut memory = system.settled_memory().to_vec();
    let mut build = |damping: f64, stiffness: f64| {
        let linear =
            Linear { damping, stiffness, ahead: 0.0, iterates: false, accept: false, psd: Psd::Projected };
        assembler.elements.linearise(system.models(), &mut memory, &mut corners, x, v, &linear);
        let mut matrix = BlockMatrix::new(pattern.clone());
        let rate = damping * system.air_damping();
        assembler.gather(&mut matrix, &|row| rate * system.masses()[row]);
        matrix
    };
    let stiffness = build(0.0, 1.0);
    let damping = build(1.0, 0.0);
    let scale: Vec<f64> = system.masses().iter().map(|m| 1.0 / m.sqrt()).collect();
    // Gradients of couplings do not depend on the factors that they were last built with.
    let beyond = |q: &DVector<f64>, out: &mut DVector<f64>| {
        let d: Vec<Vec3> = scale.iter().enumerate().map(|(i, s)| q.fixed_rows::<3>(3 * i) * *s).collect();
        let mut forces = vec![Vec3::zeros(); d.len()];
        assembler.elements.add_beyond(system.models(), &d, &mut forces);
        for (i, (force, s)) in forces.iter().zip(&scale).enumerate() {
            let mut rows = out.fixed_rows_mut::<3>(3 * i);
            rows += force * *s;
        }
    };
    let stiff = |q: &DVector<f64>| {
        let mut out = product(&stiffness, &scale, q);
        beyond(q, &mut out);
        out
    };
    let damped = |q: &DVector<f64>| product(&damping, &scale, q);

    let mut step = f64::INFINITY;
    let n = 3 * scale.len();
    for q in ritz_vectors(&stiff, n).into_iter().chain(ritz_vectors(&damped, n)) {
        let mode = Mode { squared: q.dot(&stiff(&q)).max(0.0), rate: q.dot(&damped(&q)).max(0.0) };
        step = step.min(mode.largest_step(method));
    }
    // ω grows with the root of the stiffness.
    step / system.stiffening().sqrt()
}

/// S A S q with the diagonal scale S.
fn product(matrix: &BlockMatrix, scale: &[f64], q: &DVector<f64>) -> DVector<f64> {
    let lanes: Vec<Lanes> = scale
        .iter()
        .enumerate()
        .map(|(i, s)| Lanes([q[3 * i] * s, q[3 * i + 1] * s, q[3 * i + 2] * s, 0.0]))
        .collect();
    let mut out = vec![Lanes::ZERO; lanes.len()];
    matrix.multiply_rows(0, &lanes, &mut out);
    DVector::from_fn(q.len(), |k, _| out[k / 3].0[k % 3] * scale[k / 3])
}

/// Unit Ritz vectors of an n × n matrix that is known by its products, with full reorthogonalisation.
fn ritz_vectors(multiply: &impl Fn(&DVector<f64>) -> DVector<f64>, n: usize) -> Vec<DVector<f64>> {
    // A fixed start with all wavelengths and directions in it.
    let mut q = DVector::from_fn(n, |k, _| {
        let hash = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 33;
        hash as f64 / f64::from(1u32 << 31) - 0.5
    });
    q /= q.norm();
    let mut basis: Vec<DVector<f64>> = Vec::new();
    let (mut alphas, mut betas) = (Vec::new(), Vec::new());
    while basis.len() < VECTORS.min(n) {
        let mut w = multiply(&q);
        let size = w.norm();
        alphas.push(q.dot(&w));
        basis.push(q);
        for _ in 0..2 {
            for b in &basis {
                w.axpy(-b.dot(&w), b, 1.0);
            }
        }
        let beta = w.norm();
        if !(beta.is_finite() && beta > size * 1e-10) {
            break;
        }
        betas.push(beta);
        q = w / beta;
    }
    let m = basis.len();
    let tridiagonal = DMatrix::from_fn(m, m, |i, j| match i.abs_diff(j) {
        0 => alphas[i],
        1 => betas[i.min(j)],
        _ => 0.0,
    });
    if tridiagonal.iter().any(|t| !t.is_finite()) {
        return Vec::new();
    }
    let vectors = SymmetricEigen::new(tridiagonal).eigenvectors;
    vectors
        .column_iter()
        .map(|weights| {
            let mut q = DVector::zeros(n);
            for (b, w) in basis.iter().zip(weights.iter()) {
                q.axpy(*w, b, 1.0);
            }
            let norm = q.norm();
            q / norm
        })
        .collect()
}

/// One vibration mode.
#[derive(Debug, Clone, Copy)]
struct Mode {
    /// ω² [1/s²].
    squared: f64,
    /// β [1/s].
    rate: f64,
}

impl Mode {
    /// Whether no solution grows faster than allowed.
    fn stable(&self, method: Method, dt: f64) -> bool {
        if method == Method::SemiImplicit {
            return dt * (self.squared * dt + 2.0 * self.rate) <= 4.0;
        }
        let root = Complex::new(self.rate * self.rate / 4.0 - self.squared, 0.0).sqrt();
        [root, -root].into_iter().all(|root| {
            let z = (root - self.rate / 2.0) * dt;
            let factor = match method {
                Method::ExplicitEuler => z + 1.0,
                Method::Midpoint => z * (z / 2.0 + 1.0) + 1.0,
                _ => z * (z * (z * (z / 4.0 + 1.0) / 3.0 + 1.0) / 2.0 + 1.0) + 1.0,
            };
            factor.norm() <= (GROWTH * dt).exp()
        })
    }

    /// Largest step up to which the mode is stable [s]; infinite for a mode that does not move.
    fn largest_step(&self, method: Method) -> f64 {
        let fastest = self.squared.sqrt().max(self.rate);
        if fastest == 0.0 {
            return f64::INFINITY;
        }
        // |R| leaves the unit disc before |λ| dt = 3 for all schemes.
        let (mut low, mut high) = (0.0, 3.0 / fastest);
        while high - low > PRECISION * high {
            let middle = 0.5 * (low + high);
            if self.stable(method, middle) { low = middle } else { high = middle }
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative width of the bisection plus the growth that is let pass at these frequencies.
    const TOLERANCE: f64 = 1e-3;

    #[test]
    fn limits_of_single_modes() {
        let omega = 1000.0;
        // Undamped RK4: |λ dt| = 2√2.
        let step = Mode { squared: omega * omega, rate: 0.0 }.largest_step(Method::Rk4);
        assert!((step * omega - 8f64.sqrt()).abs() < TOLERANCE * 3.0, "{step}");
        // Explicit Euler with stiffness-proportional damping β = d ω²: dt = d while underdamped.
        let d = 2e-4;
        let step =
            Mode { squared: omega * omega, rate: d * omega * omega }.largest_step(Method::ExplicitEuler);
        assert!((step / d - 1.0).abs() < 0.02, "{step}");
        // Pure decay: 2/β for Euler and midpoint, 2.785/β for RK4.
        for (method, limit) in [(Method::ExplicitEuler, 2.0), (Method::Midpoint, 2.0), (Method::Rk4, 2.7853)]
        {
            let step = Mode { squared: 0.0, rate: 500.0 }.largest_step(method);
            assert!((step * 500.0 / limit - 1.0).abs() < 5.0 * TOLERANCE, "{method:?} {step}");
        }
        // Undamped explicit Euler: growth rate ω² dt/2 = 1/s.
        let step = Mode { squared: omega * omega, rate: 0.0 }.largest_step(Method::ExplicitEuler);
        assert!((step / (2.0 / (omega * omega)) - 1.0).abs() < TOLERANCE, "{step}");
    }
}
