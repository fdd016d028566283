//! What the hinges of one triangle owe each other: the part of a plate's bending energy that hinges alone leave out.
//!
//! A triangle T of area A with the elastic angles θ_i over its inner edges (length l_i, in-plane normal n_i) has the
//! curvature S = Σ θ_i l_i/(2 A) n_i ⊗ n_i and, as a plate without Poisson effect, the energy A B/2 |S|². Its squares are the
//! energies of the hinges by themselves; its products are
//!
//! E = Σ_{i<j} C_ij θ_i θ_j   [J],   C_ij = B s_i s_j l_i l_j cos²φ_ij/(4 A)   [J],
//!
//! φ_ij the angle between edges i and j. A hinge between unequal triangles stores s_i² ≤ 1 of the plate's square; s_i
//! scales its products by as much, so the sum of squares and products is never negative.
//!
//! Torque on hinge i: Σ_j C_ij θ_j, over at most four neighbours.
//!
//! The matrix takes products by a bound on its diagonal, which couples no vertices that a hinge does not couple. In units of
//! the plate's squares a triangle has the matrix R = cos²φ_ij with eigenvalues λ_1 ≤ λ_2 ≤ λ_3 in [0, 3]. A single step takes
//! R by λ_3: bending then never has less stiffness than it has, and a step never overshoots. Iterations take it by
//! (λ_1 + λ_3)/2 and not less than 1: at least half of R, so that each descends, and what is left of an error shrinks fastest.
//!
//! Source: Grinspun et al. 2006 for the curvature of a triangle from the angles over its edges.

use nalgebra::{Matrix3, SymmetricEigen};

use super::hinge::Rest;
use crate::mesh::NONE;

/// The hinges of a triangle and its rest geometry.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plate {
    /// Hinge on each side; [`NONE`] on the boundary.
    pub(crate) hinges: [u32; 3],
    /// Rest length of each side [m].
    pub(crate) lengths: [f64; 3],
    /// Rest area [m²].
    pub(crate) area: f64,
}

impl Plate {
    /// cos²φ of the angles between sides: 1 on the diagonal.
    fn cosines(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|a, b| {
            if a == b {
                return 1.0;
            }
            let [la, lb, lc] = [a, b, 3 - a - b].map(|k| self.lengths[k]);
            let cosine = (la * la + lb * lb - lc * lc) / (2.0 * la * lb);
            (cosine * cosine).min(1.0)
        })
    }

    /// Least and greatest eigenvalue of cos²φ over its hinges; 1 without any.
    fn extremes(&self, cosines: &Matrix3<f64>) -> [f64; 2] {
        let has = |side: usize| self.hinges[side] != NONE;
        // A side that is no hinge stands alone with the eigenvalue 1, which lies between the others.
        let present =
            Matrix3::from_fn(|a, b| if a == b || (has(a) && has(b)) { cosines[(a, b)] } else { 0.0 });
        let values = SymmetricEigen::new(present).eigenvalues;
        [values.min(), values.max()]
    }

    /// What a plate of unit rigidity stores of the angle of a side: twice its energy over the angle's square.
    fn square(&self, side: usize) -> f64 {
        self.lengths[side] * self.lengths[side] / (4.0 * self.area)
    }

    /// Its sides that are hinges: (side, hinge).
    fn sides(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..3).filter(|&k| self.hinges[k] != NONE).map(|k| (k, self.hinges[k] as usize))
    }
}

/// The products of all hinges of a part.
pub(crate) struct Coupled {
    /// The other hinges of the two triangles of each hinge; itself where there are fewer than four.
    neighbours: Vec<[u32; 4]>,
    /// C_ij with each of them [J]; 0 with itself.
    factors: Vec<[f64; 4]>,
    /// What the matrix takes for them, per hinge [J]: of a single step, and of an iteration.
    bounds: [Vec<f64>; 2],
}

impl Coupled {
    /// From the elastic rigidity B [N m] and the triangles; none where no two hinges have a product.
    pub(crate) fn new(rigidity: f64, rest: &[Rest], plates: &[Plate]) -> Option<Self> {
        let mut squares = vec![0.0; rest.len()];
        for plate in plates {
            for (side, hinge) in plate.sides() {
                squares[hinge] += plate.square(side);
            }
        }
        // s_i²
        let shares: Vec<f64> =
            rest.iter().zip(&squares).map(|(r, square)| r.edge / r.height / square).collect();
        let mut coupled = Self {
            neighbours: (0..rest.len() as u32).map(|h| [h; 4]).collect(),
            factors: vec![[0.0; 4]; rest.len()],
            bounds: [vec![0.0; rest.len()], vec![0.0; rest.len()]],
        };
        let mut found = vec![0; rest.len()];
        for plate in plates {
            let cosines = plate.cosines();
            let [least, greatest] = plate.extremes(&cosines);
            let bounds = [greatest - 1.0, (0.5 * (least + greatest) - 1.0).max(0.0)];
            for (a, i) in plate.sides() {
                for (sum, bound) in coupled.bounds.iter_mut().zip(bounds) {
                    sum[i] += rigidity * bound * shares[i] * plate.square(a);
                }
                for (b, j) in plate.sides().filter(|&(b, _)| b != a) {
                    let scale = (shares[i] * plate.square(a) * shares[j] * plate.square(b)).sqrt();
                    coupled.neighbours[i][found[i]] = j as u32;
                    coupled.factors[i][found[i]] = rigidity * cosines[(a, b)] * scale;
                    found[i] += 1;
                }
            }
        }
        coupled.factors.iter().flatten().any(|c| *c > 0.0).then_some(coupled)
    }

    /// Torque of its neighbours on a hinge [N m], given the elastic angles of all hinges.
    #[inline]
    pub(crate) fn torque(&self, hinge: usize, elastic: &[f64]) -> f64 {
        let (factors, neighbours) = (&self.factors[hinge], &self.neighbours[hinge]);
        let [a, b, c, d] = neighbours.map(|j| elastic[j as usize]);
        (factors[0] * a + factors[1] * b) + (factors[2] * c + factors[3] * d)
    }

    /// What the matrix takes for the products of each hinge [J], in a single step or in an iteration.
    #[inline]
    pub(crate) fn bounds(&self, iterates: bool) -> &[f64] {
        &self.bounds[usize::from(iterates)]
    }

    /// Memory, with the two numbers per hinge that an evaluation works with [B].
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.neighbours.as_slice())
            + size_of_val(self.factors.as_slice())
            + 4 * size_of_val(self.bounds[0].as_slice())
    }
}
