//! Checks that every force model must pass, against central differences.

use nalgebra::{DMatrix, DVector, Rotation3, SymmetricEigen, Vector3};

use super::{ForceModel, Linear, Psd, Survey, memory::Memory};
use crate::{
    Energy,
    assembly::{Assembler, BlockMatrix, Corners, surveyed},
    mesh::Vec3,
    system::accept,
};

/// Step of central differences [m] or [m/s], for coordinates of order 1: truncation and rounding both near 10⁻¹⁰.
const STEP: f64 = 1e-5;
/// Relative error of a force against differences of the energy, or a block against differences of the force.
const TOLERANCE: f64 = 2e-6;
/// Relative size of a fault that the comparison must see.
const FAULT: f64 = 1e-4;
/// Relative rounding of sums.
const ROUNDING: f64 = 1e-12;

/// Repeatable numbers in [−1, 1].
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub(crate) fn value(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.value(), self.value(), self.value())
    }

    pub(crate) fn vectors(&mut self, n: usize, scale: f64) -> Vec<Vec3> {
        (0..n).map(|_| self.vector() * scale).collect()
    }
}

/// A model with its memory, as the system holds both.
pub(crate) struct Model {
    pub(crate) law: Box<dyn ForceModel>,
    pub(crate) memory: Memory,
}

impl Model {
    pub(crate) fn new(law: impl ForceModel + 'static) -> Self {
        Self::boxed(Box::new(law))
    }

    /// One whose elements remember beyond the elastic range alone.
    pub(crate) fn lean(mut law: impl ForceModel + 'static, neglected: f64) -> Self {
        law.remember_beyond(neglected);
        Self::boxed(Box::new(law))
    }

    fn boxed(law: Box<dyn ForceModel>) -> Self {
        let memory = law.unused();
        Self { law, memory }
    }

    pub(crate) fn accept(&mut self, x: &[Vec3]) {
        accept(&*self.law, &mut self.memory, x);
    }
}

fn survey(model: &Model, x: &[Vec3]) -> Survey<Vec<f64>> {
    let mut survey = Survey::new(&*model.law);
    survey.take(&*model.law, &model.memory, x);
    survey
}

/// Forces per vertex.
pub(crate) fn forces(model: &Model, x: &[Vec3], v: &[Vec3]) -> Vec<Vec3> {
    let mut corners = vec![Vec3::zeros(); model.law.vertices().len()];
    let all = 0..model.law.count();
    model.law.forces(
        all.clone(),
        x,
        v,
        model.memory.part(all.len(), all.clone()),
        surveyed(&survey(model, x), all),
        &mut corners,
    );
    scatter(model, &corners, x.len())
}

fn scatter(model: &Model, corners: &[Vec3], n: usize) -> Vec<Vec3> {
    let mut out = vec![Vec3::zeros(); n];
    for (&vertex, f) in model.law.vertices().iter().zip(corners) {
        out[vertex as usize] += f;
    }
    out
}

pub(crate) fn energy(model: &Model, x: &[Vec3]) -> f64 {
    let mut energy = Energy::default();
    let all = 0..model.law.count();
    model.law.add_energy(
        all.clone(),
        x,
        model.memory.part(all.len(), all.clone()),
        surveyed(&survey(model, x), all),
        &mut energy,
    );
    energy.elastic()
}

fn flat(v: &[Vec3]) -> DVector<f64> {
    DVector::from_iterator(3 * v.len(), v.iter().flat_map(|v| v.iter().copied()))
}

/// Forces and the dense matrix that assembly makes of a model's couplings.
pub(crate) fn linearised(
    model: &Model,
    x: &[Vec3],
    v: &[Vec3],
    linear: &Linear,
) -> (Vec<Vec3>, DMatrix<f64>) {
    let models = std::slice::from_ref(&model.law);
    let mut memory = vec![model.memory.clone()];
    let (mut assembler, pattern) = Assembler::new(x.len(), models, linear.psd);
    let mut corners = Corners::new(models);
    assembler.elements.linearise(models, &mut memory, &mut corners, x, v, linear);
    let mut matrix = BlockMatrix::new(std::sync::Arc::new(pattern));
    assembler.gather(&mut matrix, &|_| 0.0);
    (scatter(model, &corners.forces, x.len()), dense(&matrix))
}

/// All blocks of a matrix.
pub(crate) fn dense(matrix: &BlockMatrix) -> DMatrix<f64> {
    let pattern = &matrix.pattern;
    let mut out = DMatrix::zeros(3 * pattern.rows, 3 * pattern.rows);
    for row in 0..pattern.rows {
        let mut put = |r0: usize, c0: usize, block: &[f64]| {
            for c in 0..3 {
                for r in 0..3 {
                    out[(3 * r0 + r, 3 * c0 + c)] = block[3 * c + r];
                    out[(3 * c0 + c, 3 * r0 + r)] = block[3 * c + r];
                }
            }
        };
        put(row, row, &matrix.diagonal[row]);
        for k in pattern.upper_of(row) {
            put(row, pattern.columns[k] as usize, &matrix.upper[9 * k..9 * k + 9]);
        }
    }
    out
}

/// Largest entry of a − b relative to the largest of b.
fn error(a: &DVector<f64>, b: &DVector<f64>) -> f64 {
    (a - b).amax() / b.amax().max(1e-300)
}

fn matrix_error(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    (a - b).amax() / b.amax().max(1e-300)
}

const ELASTIC: Linear =
    Linear { damping: 0.0, stiffness: 1.0, ahead: 0.0, iterates: false, accept: false, psd: Psd::Raw };

/// −dE/dx by central differences.
pub(crate) fn force_by_differences(model: &Model, x: &[Vec3]) -> DVector<f64> {
    let mut x = x.to_vec();
    DVector::from_fn(3 * x.len(), |k, _| {
        let (i, axis) = (k / 3, k % 3);
        let at = x[i][axis];
        x[i][axis] = at + STEP;
        let plus = energy(model, &x);
        x[i][axis] = at - STEP;
        let minus = energy(model, &x);
        x[i][axis] = at;
        -(plus - minus) / (2.0 * STEP)
    })
}

/// −df/dx (`velocity` false) or −df/dv (true) by central differences.
fn blocks_by_differences(model: &Model, x: &[Vec3], v: &[Vec3], velocity: bool) -> DMatrix<f64> {
    let (mut x, mut v) = (x.to_vec(), v.to_vec());
    let n = 3 * x.len();
    let mut out = DMatrix::zeros(n, n);
    for k in 0..n {
        let (i, axis) = (k / 3, k % 3);
        let mut at = |offset: f64| {
            let target = if velocity { &mut v[i][axis] } else { &mut x[i][axis] };
            let before = *target;
            *target = before + offset;
            let f = flat(&forces(model, &x, &v));
            *(if velocity { &mut v[i][axis] } else { &mut x[i][axis] }) = before;
            f
        };
        let column = -(at(STEP) - at(-STEP)) / (2.0 * STEP);
        out.set_column(k, &column);
    }
    out
}

/// Force against energy, with a planted fault, and [`check_blocks`].
pub(crate) fn check_derivatives(model: &Model, x: &[Vec3], what: &str) {
    check_force(model, x, what);
    check_blocks(model, x, what);
}

/// Force against energy, with a planted fault.
pub(crate) fn check_force(model: &Model, x: &[Vec3], what: &str) {
    let rest = vec![Vec3::zeros(); x.len()];
    let f = flat(&forces(model, x, &rest));
    let expected = force_by_differences(model, x);
    assert!(error(&f, &expected) < TOLERANCE, "{what}: force {:e}", error(&f, &expected));
    let mut faulty = f.clone();
    faulty[f.iamax()] *= 1.0 + FAULT;
    assert!(error(&faulty, &expected) > TOLERANCE, "{what}: a fault in the force must be seen");
}

/// Blocks against force, with a planted fault; symmetry; no negative eigenvalue when projected.
pub(crate) fn check_blocks(model: &Model, x: &[Vec3], what: &str) {
    let rest = vec![Vec3::zeros(); x.len()];
    let (_, k) = linearised(model, x, &rest, &ELASTIC);
    let expected = blocks_by_differences(model, x, &rest, false);
    assert!(matrix_error(&k, &expected) < TOLERANCE, "{what}: blocks {:e}", matrix_error(&k, &expected));
    assert!(
        matrix_error(&(&k * (1.0 + FAULT)), &expected) > TOLERANCE,
        "{what}: a fault in a block must be seen"
    );
    assert!((&k - k.transpose()).amax() <= ROUNDING * k.amax(), "{what}: symmetric");

    let linear = Linear { psd: Psd::Projected, ..ELASTIC };
    let (_, projected) = linearised(model, x, &rest, &linear);
    let least = SymmetricEigen::new(projected.clone()).eigenvalues.min();
    assert!(least >= -ROUNDING * projected.amax(), "{what}: eigenvalue {least:e}");
}

/// K_v against differences in the velocity, and corner forces f + τ K_x v against the blocks.
pub(crate) fn check_velocity_terms(model: &Model, x: &[Vec3], v: &[Vec3], what: &str) {
    for psd in [Psd::Raw, Psd::Projected] {
        let (_, d) = linearised(
            model,
            x,
            v,
            &Linear { damping: 1.0, stiffness: 0.0, ahead: 0.0, iterates: false, accept: false, psd },
        );
        let expected = blocks_by_differences(model, x, v, true);
        let scale = expected.amax();
        assert!(scale > 0.0, "{what}: the model must be damped here");
        assert!(matrix_error(&d, &expected) < TOLERANCE, "{what}: K_v {:e}", matrix_error(&d, &expected));
        let ahead = 0.01;
        let (f, k) = linearised(model, x, v, &Linear { ahead, psd, ..ELASTIC });
        let expected = flat(&forces(model, x, v)) - k * flat(v) * ahead;
        assert!(error(&flat(&f), &expected) < 1e-9, "{what}: f + τ K_x v {:e}", error(&flat(&f), &expected));
    }
}

/// Forces and moments sum to zero, with velocities too.
pub(crate) fn check_momentum(model: &Model, x: &[Vec3], v: &[Vec3], what: &str) {
    let f = forces(model, x, v);
    let size: f64 = f.iter().map(Vec3::norm).sum();
    assert!(size > 0.0, "{what}: there must be forces");
    let sum: Vec3 = f.iter().sum();
    let moment: Vec3 = x.iter().zip(&f).map(|(x, f)| x.cross(f)).sum();
    let reach = x.iter().map(Vec3::norm).fold(0.0, f64::max);
    assert!(sum.norm() < ROUNDING * size, "{what}: force {sum:?}");
    assert!(moment.norm() < ROUNDING * size * reach, "{what}: moment {moment:?}");
    let mut faulty = f.clone();
    faulty[0] *= 1.0 + FAULT;
    let sum: Vec3 = faulty.iter().sum();
    assert!(sum.norm() > ROUNDING * size, "{what}: a fault must be seen");
}

/// Energy does not change and forces turn along under a rigid motion; a rigid velocity meets no damping.
pub(crate) fn check_rigid_motion(model: &Model, x: &[Vec3], what: &str) {
    let rotation = Rotation3::from_scaled_axis(Vector3::new(0.3, -1.1, 0.7));
    let shift = Vec3::new(0.4, -0.2, 0.9);
    let moved: Vec<Vec3> = x.iter().map(|x| rotation * x + shift).collect();
    let rest = vec![Vec3::zeros(); x.len()];
    let (e, e_moved) = (energy(model, x), energy(model, &moved));
    assert!((e - e_moved).abs() <= 1e-10 * e.max(1e-12), "{what}: energy {e:e} {e_moved:e}");
    let f = forces(model, x, &rest);
    let expected: Vec<Vec3> = f.iter().map(|f| rotation * f).collect();
    let got = forces(model, &moved, &rest);
    assert!(error(&flat(&got), &flat(&expected)) < 1e-9, "{what}: turned forces");
    let spin = Vec3::new(0.5, 1.5, -0.7);
    let v: Vec<Vec3> = x.iter().map(|x| spin.cross(x) + shift).collect();
    let spun = forces(model, x, &v);
    assert!(error(&flat(&spun), &flat(&f)) < 1e-9, "{what}: rigid velocity");
}
