//! Force models: what pushes on the vertices of springs, triangles or hinges.
//!
//! Each model owns a list of elements with 2, 3 or 4 corners and writes, per element, the forces on its corners and the
//! couplings between them. Assembly gathers both per vertex and per vertex pair in a fixed order.
//!
//! Signs: `energy` E [J]; force f = −dE/dx − dissipation [N]; coupling blocks are those of
//! `damping`·(−K_v) + `stiffness`·(−K_x), K_x = ∂f/∂x [N/m], K_v = ∂f/∂v [N s/m] (3.24), positive (semi-)definite for
//! a stable element. All models but [`Diagonal`](Couplings::Diagonal) ones depend on differences of positions and
//! velocities only, so an element's diagonal blocks are minus the sums of its off-diagonal ones and are not written.
//!
//! The part of K_x that comes from damping forces (the geometry changes under them) is left out: it is not symmetric
//! and vanishes with the velocity, so a linearised step stays consistent of order one.

pub(crate) mod air;
pub(crate) mod coupled;
pub(crate) mod dihedral;
pub(crate) mod hinge;
pub(crate) mod memory;
pub(crate) mod spring;
pub(crate) mod stitch;
pub(crate) mod stretch_shear;

#[cfg(test)]
pub(crate) mod testing;

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use crate::{EffectInfo, Energy, bending::HingeState, mesh::Vec3};
use memory::{Memory, Past, PastMut};

/// What is done about the indefinite part of Hessian blocks.
///
/// `Raw` keeps exact second derivatives: Newton's method converges fastest near a solution, but a compressed spring or
/// triangle may make the matrix indefinite, which the solvers report as an error. `Projected` is positive semi-definite
/// element by element, in closed form:
///
/// * spring: the transverse term k (1 − l/r) P is dropped where it is negative (compression);
/// * stretch: the same term k a (1 − 1/|w|) P is dropped where |w| < 1;
/// * shear: the term k a C (I ⊗ [[0, 1], [1, 0]]) is replaced by its positive part;
/// * hinge: M dθ²/dx² is dropped, which leaves M' (dθ/dx)(dθ/dx)ᵀ.
///
/// The equilibrium reached is the same: only the linearisation differs, not the forces.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Psd {
    /// Exact second derivatives, possibly indefinite.
    Raw,
    /// Each element's block made positive semi-definite in closed form.
    #[default]
    Projected,
}

/// A 3×3 block, column by column.
pub(crate) type Block = [f64; 9];

/// Couplings of a four-corner element of rank one: block (a, b) is `scale` · g_a g_bᵀ.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Outer {
    pub(crate) gradient: [[f64; 3]; 4],
    pub(crate) scale: f64,
}

/// Factors of a linearisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Linear {
    /// Factor of −K_v in the couplings.
    pub(crate) damping: f64,
    /// Factor of −K_x in the couplings.
    pub(crate) stiffness: f64,
    /// Corner forces are f + `ahead` · K_x v, with the K_x of the couplings [s].
    pub(crate) ahead: f64,
    /// Whether iterations follow, which make up for what the couplings are not exact in.
    pub(crate) iterates: bool,
    /// Whether `x` has been accepted as the end of a motion: laws with memory then move on to it first.
    pub(crate) accept: bool,
    pub(crate) psd: Psd,
}

/// How a model couples its corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CouplingKind {
    /// Off-diagonal blocks for the corner pairs of [`corner_pairs`]: n(n−1)/2 per element.
    Blocks,
    /// One [`Outer`] per element.
    Outer,
    /// One scalar per element, added to the diagonal of each of its corners.
    Diagonal,
}

/// Room for the couplings of a range of elements.
pub(crate) enum Couplings<'a> {
    Blocks(&'a mut [Block]),
    Outer(&'a mut [Outer]),
    Diagonal(&'a mut [f64]),
}

/// What the elements of a coupled model see of each other, two numbers per element; empty for models whose elements
/// stand alone. `elastic` is that of all elements where a pass reads it, of its range where it writes it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Survey<T> {
    /// Elastic angle [rad].
    pub(crate) elastic: T,
    /// Of a range: the curvature [1/m] after a survey, what [`ForceModel::couple`] needs after a linearisation.
    pub(crate) work: T,
}

/// A list of elements with one law.
///
/// Of a coupled model, energy and forces are asked for after a survey of all elements at the same state, and a
/// linearisation is complete after [`ForceModel::couple`] of all.
pub(crate) trait ForceModel: Send + Sync {
    /// Name, number of elements, memory.
    fn info(&self) -> EffectInfo;
    /// Corners per element: 2, 3 or 4.
    fn corners(&self) -> usize;
    /// Global vertices of all corners, element by element.
    fn vertices(&self) -> &[u32];
    /// Form of the couplings that `linearise` writes.
    fn coupling(&self, psd: Psd) -> CouplingKind;
    /// Adds the energy of a range of elements [J]. `memory`: that of the range, here and below.
    fn add_energy(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        memory: Past<'_>,
        survey: Survey<&[f64]>,
        energy: &mut Energy,
    );
    /// Corner forces of a range of elements [N]: `corners` entries per element.
    fn forces(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        memory: Past<'_>,
        survey: Survey<&[f64]>,
        out: &mut [Vec3],
    );
    /// Corner forces and couplings of a range of elements. Memory moves on where [`Linear::accept`] says so.
    fn linearise(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        linear: &Linear,
        memory: PastMut<'_>,
        survey: Survey<&mut [f64]>,
        forces: &mut [Vec3],
        couplings: Couplings<'_>,
    );
    /// Whether it dissipates: its force is then not the gradient of an energy.
    fn dissipates(&self) -> bool;

    /// What the coupling of its elements takes; none where they stand alone.
    fn coupled(&self) -> Option<EffectInfo> {
        None
    }

    /// Looks at a range of elements of a coupled model.
    fn survey(&self, _range: Range<usize>, _x: &[Vec3], _memory: Past<'_>, _survey: Survey<&mut [f64]>) {}

    /// Second pass of [`ForceModel::linearise`] over a coupled model.
    fn couple(
        &self,
        _range: Range<usize>,
        _x: &[Vec3],
        _v: &[Vec3],
        _linear: &Linear,
        _memory: Past<'_>,
        _survey: Survey<&[f64]>,
        _forces: &mut [Vec3],
        _couplings: Couplings<'_>,
    ) {
    }

    /// Adds to `out` what the exact −K_x of a coupled model makes of the corner motions `d` beyond its `couplings` of a
    /// single step.
    fn add_beyond(&self, _couplings: &[Outer], _d: &[Vec3], _out: &mut [Vec3]) {}

    /// Says at which time [s] forces and energy are asked for, for laws that change with it.
    fn set_time(&mut self, _time: f64) {}

    /// Whether it is the force of the air.
    fn is_air(&self) -> bool {
        false
    }

    /// Whether it resists bending.
    fn bends(&self) -> bool {
        false
    }

    /// How much stiffer than at rest it may become on a path.
    fn stiffening(&self) -> f64 {
        1.0
    }

    /// Asks that an element remembers only once it has left the elastic range of its law, `neglected` being what may be
    /// neglected there (see `BendingLaw::leaves`); before any motion. Nothing for laws without memory.
    fn remember_beyond(&mut self, _neglected: f64) {}

    /// Memory of all elements before any motion; empty for laws without.
    fn unused(&self) -> Memory {
        Memory::default()
    }

    /// Takes a motion to `x` as done: the memory of a range of elements moves on.
    fn accept(&self, _range: Range<usize>, _x: &[Vec3], _memory: PastMut<'_>) {}

    /// Each hinge of a law with memory as it stands at `x`, to which its memory has moved on; empty for other models.
    fn hinge_states(&self, _x: &[Vec3], _memory: &Memory) -> Vec<HingeState> {
        Vec::new()
    }

    /// Number of elements.
    fn count(&self) -> usize {
        self.vertices().len() / self.corners()
    }
}

/// Corner pairs in the order of [`CouplingKind::Blocks`].
pub(crate) fn corner_pairs(corners: usize) -> &'static [(usize, usize)] {
    const PAIRS: [(usize, usize); 6] = [(0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3)];
    &PAIRS[..corners * (corners - 1) / 2]
}
