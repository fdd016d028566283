//! Linear springs between two vertices: along edges in the plane, between opposite vertices for bending.
//!
//! E = ½ k (r − l)²   [J],   r = |x_1 − x_0|
//!
//! u = (x_1 − x_0)/r, P = I − u uᵀ, w = v_1 − v_0; l the rest length [m], k the stiffness [N/m], k_d the damping
//! [N s/m]. Force on corner 0: k (r − l) u + k_d (w·u) u, on corner 1 its negative.
//! ∂f_0/∂x_1 = k [u uᵀ + (1 − l/r) P], ∂f_0/∂v_1 = k_d u uᵀ.
//! A spring shorter than 10⁻⁹ l has no direction: force and couplings are zero there.
//!
//! Source: thesis (3.1), (3.2), (3.26), (3.27) with the damping force central and the outer product in K_v.

use std::ops::Range;

use super::{
    Block, CouplingKind, Couplings, ForceModel, Linear, Psd, Survey,
    memory::{Past, PastMut},
};
use crate::{CoreError, EffectInfo, Energy, mesh::Vec3};

/// Length relative to the rest length under which a spring has no direction.
const COLLAPSED: f64 = 1e-9;

/// What a spring resists: which energy it counts to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    InPlane,
    Bending,
}

/// Springs of equal stiffness.
pub(crate) struct Springs {
    role: Role,
    stiffness: f64,
    damping: f64,
    vertices: Vec<[u32; 2]>,
    rest_length: Vec<f64>,
}

struct Spring {
    along: Vec3,
    length: f64,
    tension: f64,
    rate: f64,
}

impl Springs {
    /// Springs between global `vertices` [−] with rest lengths [m], stiffness [N/m] and damping [N s/m].
    ///
    /// # Errors
    /// [`CoreError::Degenerate`] for a rest length that is not positive.
    pub(crate) fn new(
        role: Role,
        stiffness: f64,
        damping: f64,
        vertices: Vec<[u32; 2]>,
        rest_length: Vec<f64>,
    ) -> Result<Self, CoreError> {
        if let Some(element) = rest_length.iter().position(|l| !(l.is_finite() && *l > 0.0)) {
            return Err(CoreError::Degenerate {
                model: role.name(),
                element,
                vertices: vertices[element].to_vec(),
                measure: "rest length in m",
                got: rest_length[element],
            });
        }
        Ok(Self { role, stiffness, damping, vertices, rest_length })
    }

    fn spring(&self, element: usize, x: &[Vec3], v: &[Vec3]) -> Spring {
        let [a, b] = self.vertices[element].map(|i| i as usize);
        let rest = self.rest_length[element];
        let d = x[b] - x[a];
        let length = d.norm();
        if length <= COLLAPSED * rest {
            return Spring { along: Vec3::zeros(), length: rest, tension: 0.0, rate: 0.0 };
        }
        let along = d / length;
        let rate = (v[b] - v[a]).dot(&along);
        let tension = self.stiffness * (length - rest) + self.damping * rate;
        Spring { along, length, tension, rate }
    }
}

impl Role {
    fn name(self) -> &'static str {
        match self {
            Self::InPlane => "spring",
            Self::Bending => "bending-spring",
        }
    }
}

impl ForceModel for Springs {
    fn info(&self) -> EffectInfo {
        EffectInfo {
            name: self.role.name(),
            elements: self.vertices.len(),
            bytes: size_of_val(self.vertices.as_slice()) + size_of_val(self.rest_length.as_slice()),
        }
    }

    fn corners(&self) -> usize {
        2
    }

    fn vertices(&self) -> &[u32] {
        self.vertices.as_flattened()
    }

    fn coupling(&self, _psd: Psd) -> CouplingKind {
        CouplingKind::Blocks
    }

    fn bends(&self) -> bool {
        self.role == Role::Bending
    }

    fn dissipates(&self) -> bool {
        self.damping > 0.0
    }

    fn add_energy(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        _memory: Past<'_>,
        _survey: Survey<&[f64]>,
        energy: &mut Energy,
    ) {
        let mut sum = 0.0;
        for element in range {
            let [a, b] = self.vertices[element].map(|i| i as usize);
            let stretch = (x[b] - x[a]).norm() - self.rest_length[element];
            sum += 0.5 * self.stiffness * stretch * stretch;
        }
        match self.role {
            Role::InPlane => energy.stretch += sum,
            Role::Bending => energy.bending += sum,
        }
    }

    fn forces(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        _memory: Past<'_>,
        _survey: Survey<&[f64]>,
        out: &mut [Vec3],
    ) {
        for (element, f) in range.zip(out.chunks_exact_mut(2)) {
            let spring = self.spring(element, x, v);
            f[0] = spring.tension * spring.along;
            f[1] = -f[0];
        }
    }

    fn linearise(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        linear: &Linear,
        _memory: PastMut<'_>,
        _survey: Survey<&mut [f64]>,
        forces: &mut [Vec3],
        couplings: Couplings<'_>,
    ) {
        let Couplings::Blocks(blocks) = couplings else { unreachable!("springs couple by blocks") };
        for ((element, f), block) in range.zip(forces.chunks_exact_mut(2)).zip(blocks) {
            let Spring { along: u, length, tension, rate } = self.spring(element, x, v);
            if u == Vec3::zeros() {
                f.fill(Vec3::zeros());
                *block = [0.0; 9];
                continue;
            }
            let [a, b] = self.vertices[element].map(|i| i as usize);
            let mut transverse = 1.0 - self.rest_length[element] / length;
            if linear.psd == Psd::Projected {
                transverse = transverse.max(0.0);
            }
            // K_x v = k [(1 − β)(w·u) u + β w] on corner 0, with β the transverse factor.
            let w = v[b] - v[a];
            let ahead = linear.ahead * self.stiffness;
            f[0] = (tension + ahead * (1.0 - transverse) * rate) * u + (ahead * transverse) * w;
            f[1] = -f[0];
            let axial = linear.stiffness * self.stiffness + linear.damping * self.damping;
            let identity = linear.stiffness * self.stiffness * transverse;
            *block = spring_block(&u, -(axial - identity), -identity);
        }
    }
}

/// `outer` u uᵀ + `identity` I.
fn spring_block(u: &Vec3, outer: f64, identity: f64) -> Block {
    let mut block = [0.0; 9];
    for column in 0..3 {
        for row in 0..3 {
            block[3 * column + row] = outer * u[row] * u[column];
        }
        block[4 * column] += identity;
    }
    block
}

#[cfg(test)]
mod tests {
    use super::super::testing::{
        Model, Random, check_derivatives, check_momentum, check_rigid_motion, check_velocity_terms, energy,
        forces,
    };
    use super::*;

    fn fan(damping: f64) -> Model {
        let vertices = vec![[0, 1], [2, 0], [1, 2], [3, 2]];
        Model::new(Springs::new(Role::InPlane, 40.0, damping, vertices, vec![1.0, 0.8, 1.2, 0.5]).unwrap())
    }

    #[test]
    fn derivatives_and_invariance() {
        let mut random = Random::new(1);
        for case in 0..6 {
            // Stretched and compressed springs.
            let x = random.vectors(4, if case < 3 { 1.5 } else { 0.4 });
            let v = random.vectors(4, 2.0);
            check_derivatives(&fan(0.0), &x, "springs");
            check_velocity_terms(&fan(0.7), &x, &v, "springs");
            check_momentum(&fan(0.7), &x, &v, "springs");
            check_rigid_motion(&fan(0.7), &x, "springs");
        }
    }

    #[test]
    fn rest_has_no_energy_and_no_force() {
        let model = Model::new(Springs::new(Role::Bending, 10.0, 0.1, vec![[0, 1]], vec![5.0]).unwrap());
        let x = [Vec3::new(1.0, 1.0, 0.0), Vec3::new(4.0, 5.0, 0.0)];
        assert_eq!(energy(&model, &x), 0.0);
        assert_eq!(forces(&model, &x, &[Vec3::zeros(); 2]), [Vec3::zeros(); 2]);
    }

    #[test]
    fn value_by_hand() {
        // Length 5, rest 4, k 10, k_d 2, u = (0.6, 0.8, 0), v_1 = (5, 0, 0): w·u = 3.
        // Tension 10·1 + 2·3 = 16, force on corner 0 = (9.6, 12.8, 0); energy ½·10·1² = 5.
        let model = Model::new(Springs::new(Role::InPlane, 10.0, 2.0, vec![[0, 1]], vec![4.0]).unwrap());
        let x = [Vec3::zeros(), Vec3::new(3.0, 4.0, 0.0)];
        let f = forces(&model, &x, &[Vec3::zeros(), Vec3::new(5.0, 0.0, 0.0)]);
        assert!((f[0] - Vec3::new(9.6, 12.8, 0.0)).norm() < 1e-13 && f[1] == -f[0]);
        assert_eq!(energy(&model, &x), 5.0);
    }

    #[test]
    fn collapsed_springs_stay_finite_and_bad_rest_lengths_are_named() {
        let f = forces(&fan(1.0), &[Vec3::zeros(); 4], &[Vec3::x(); 4]);
        assert!(f.iter().all(|f| *f == Vec3::zeros()));
        let error =
            Springs::new(Role::InPlane, 1.0, 0.0, vec![[0, 1], [4, 7]], vec![1.0, 0.0]).err().unwrap();
        assert!(
            matches!(error, CoreError::Degenerate { element: 1, ref vertices, .. } if vertices == &[4, 7])
        );
    }
}
