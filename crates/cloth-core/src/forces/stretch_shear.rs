//! Stretch along warp and weft and shear between them, triangle by triangle.
//!
//! E = a/2 [k_u (|w_u| − 1)² + k_v (|w_v| − 1)² + k_s (w_u·w_v)²]   [J]
//!
//! w_u = Σ_a u_a x_a and w_v = Σ_a v_a x_a are the images of the material directions (dimensionless; u_a, v_a [1/m] from
//! the rest shape's inverse, Σ u_a = Σ v_a = 0); a the rest area [m²]; k_u warp, k_v weft, k_s shear [N/m]. One factor of the
//! area, so stiffness does not depend on the mesh. With p_u = ∂E/∂w_u and p_v = ∂E/∂w_v [N m], the force on corner a is
//! −(u_a p_u + v_a p_v).
//!
//! Damping (3.8) for each constraint C: f = −d k a (∂C/∂x) Ċ with the damping time d [s].
//!
//! Second derivatives, as 3×3 blocks of (w_u, w_v):
//! H_uu = a k_u [ŵ_u ŵ_uᵀ + β_u (I − ŵ_u ŵ_uᵀ)] + a k_s w_v w_vᵀ, β = 1 − 1/|w|; H_uv = a k_s (w_v w_uᵀ + C I).
//! Projected: β ≥ 0, and C I in H_uv becomes (C/2) I with (|C|/2) I added to H_uu and H_vv.
//! A direction shorter than 10⁻⁹ of its rest length has no image: its stretch force and blocks are zero there.
//!
//! Sources: thesis (3.4)–(3.8), (3.28), (3.29); Baraff and Witkin 1998.

use std::ops::Range;

use super::{
    Block, CouplingKind, Couplings, ForceModel, Linear, Psd, Survey,
    memory::{Past, PastMut},
};
use crate::{CoreError, EffectInfo, Energy, mesh::Vec3};

/// Length of w under which it has no direction.
const COLLAPSED: f64 = 1e-9;

/// Stiffness and damping of a [`StretchShear`] model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stiffness {
    /// Along the warp [N/m].
    pub(crate) warp: f64,
    /// Along the weft [N/m].
    pub(crate) weft: f64,
    /// Shear [N/m].
    pub(crate) shear: f64,
    /// Damping time [s].
    pub(crate) damping: f64,
}

/// Triangles with one stiffness.
pub(crate) struct StretchShear {
    stiffness: Stiffness,
    vertices: Vec<[u32; 3]>,
    rest: Vec<Rest>,
}

/// Rest data of a triangle: (u_1, u_2), (v_1, v_2) [1/m] and area [m²].
#[derive(Clone, Copy)]
struct Rest {
    u: [f64; 2],
    v: [f64; 2],
    area: f64,
}

/// A material direction's image: unit vector (zero if collapsed), length, 1/length (zero if collapsed).
struct Direction {
    unit: Vec3,
    length: f64,
    inverse: f64,
}

impl Direction {
    #[inline]
    fn new(w: Vec3) -> Self {
        let length = w.norm();
        if length > COLLAPSED {
            let inverse = 1.0 / length;
            Self { unit: w * inverse, length, inverse }
        } else {
            Self { unit: Vec3::zeros(), length: 1.0, inverse: 0.0 }
        }
    }

    /// Factor of I − ŵŵᵀ in the second derivative of the stretch energy, per stiffness and area.
    #[inline]
    fn transverse(&self, psd: Psd) -> f64 {
        if self.inverse == 0.0 {
            return 0.0;
        }
        let beta = 1.0 - self.inverse;
        if psd == Psd::Projected { beta.max(0.0) } else { beta }
    }
}

impl StretchShear {
    /// Triangles over global `vertices` with their rest `inverse` [1/m] and `area` [m²].
    ///
    /// # Errors
    /// [`CoreError::Degenerate`] for a triangle whose area is not positive or whose inverse is not finite.
    pub(crate) fn new(
        stiffness: Stiffness,
        vertices: Vec<[u32; 3]>,
        inverse: &[[[f64; 2]; 2]],
        area: &[f64],
    ) -> Result<Self, CoreError> {
        let mut rest = Vec::with_capacity(vertices.len());
        for (element, (inverse, &area)) in inverse.iter().zip(area).enumerate() {
            if !(area.is_finite() && area > 0.0 && inverse.as_flattened().iter().all(|c| c.is_finite())) {
                return Err(CoreError::Degenerate {
                    model: "baraff-witkin",
                    element,
                    vertices: vertices[element].to_vec(),
                    measure: "rest area in m²",
                    got: area,
                });
            }
            let [[u1, v1], [u2, v2]] = *inverse;
            rest.push(Rest { u: [u1, u2], v: [v1, v2], area });
        }
        Ok(Self { stiffness, vertices, rest })
    }

    /// w_u and w_v of one triangle from positions, or their rates from velocities.
    #[inline]
    fn images(&self, element: usize, x: &[Vec3]) -> (Vec3, Vec3) {
        let [a, b, c] = self.vertices[element].map(|i| i as usize);
        let rest = &self.rest[element];
        let (d1, d2) = (x[b] - x[a], x[c] - x[a]);
        (d1 * rest.u[0] + d2 * rest.u[1], d1 * rest.v[0] + d2 * rest.v[1])
    }
}

/// Corner forces −(u_a p_u + v_a p_v).
#[inline]
fn distribute(rest: &Rest, p_u: &Vec3, p_v: &Vec3, out: &mut [Vec3]) {
    let f1 = -(p_u * rest.u[0] + p_v * rest.v[0]);
    let f2 = -(p_u * rest.u[1] + p_v * rest.v[1]);
    out[0] = -(f1 + f2);
    out[1] = f1;
    out[2] = f2;
}

impl ForceModel for StretchShear {
    fn info(&self) -> EffectInfo {
        EffectInfo {
            name: "baraff-witkin",
            elements: self.vertices.len(),
            bytes: size_of_val(self.vertices.as_slice()) + size_of_val(self.rest.as_slice()),
        }
    }

    fn corners(&self) -> usize {
        3
    }

    fn vertices(&self) -> &[u32] {
        self.vertices.as_flattened()
    }

    fn coupling(&self, _psd: Psd) -> CouplingKind {
        CouplingKind::Blocks
    }

    fn dissipates(&self) -> bool {
        self.stiffness.damping > 0.0
    }

    fn add_energy(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        _memory: Past<'_>,
        _survey: Survey<&[f64]>,
        energy: &mut Energy,
    ) {
        let k = &self.stiffness;
        for element in range {
            let (wu, wv) = self.images(element, x);
            let (cu, cv, cs) = (wu.norm() - 1.0, wv.norm() - 1.0, wu.dot(&wv));
            let half_area = 0.5 * self.rest[element].area;
            energy.stretch += half_area * (k.warp * cu * cu + k.weft * cv * cv);
            energy.shear += half_area * k.shear * cs * cs;
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
        let k = self.stiffness;
        for (element, f) in range.zip(out.chunks_exact_mut(3)) {
            let rest = &self.rest[element];
            let (wu, wv) = self.images(element, x);
            let (u, w) = (Direction::new(wu), Direction::new(wv));
            let (mut cu, mut cv, mut cs) = (u.length - 1.0, w.length - 1.0, wu.dot(&wv));
            if k.damping > 0.0 {
                let (du, dv) = self.images(element, v);
                cu += k.damping * u.unit.dot(&du);
                cv += k.damping * w.unit.dot(&dv);
                cs += k.damping * (du.dot(&wv) + wu.dot(&dv));
            }
            let (su, sv, ss) = (rest.area * k.warp * cu, rest.area * k.weft * cv, rest.area * k.shear * cs);
            distribute(rest, &(u.unit * su + wv * ss), &(w.unit * sv + wu * ss), f);
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
        let Couplings::Blocks(blocks) = couplings else { unreachable!("triangles couple by blocks") };
        let k = self.stiffness;
        // Factors of the outer products of constraint gradients, elastic and damping together.
        let along = linear.stiffness + linear.damping * k.damping;
        for ((element, f), blocks) in range.zip(forces.chunks_exact_mut(3)).zip(blocks.chunks_exact_mut(3)) {
            let rest = &self.rest[element];
            let (wu, wv) = self.images(element, x);
            let (du, dv) = self.images(element, v);
            let (u, w) = (Direction::new(wu), Direction::new(wv));
            let cs = wu.dot(&wv);
            let (rate_u, rate_v) = (u.unit.dot(&du), w.unit.dot(&dv));
            let rate_s = du.dot(&wv) + wu.dot(&dv);
            let (beta_u, beta_v) = (u.transverse(linear.psd), w.transverse(linear.psd));
            // H_uv gets `cross` I, H_uu and H_vv get `spread` I from the second derivative of the shear constraint.
            let (cross, spread) = match linear.psd {
                Psd::Raw => (cs, 0.0),
                Psd::Projected => (0.5 * cs, 0.5 * cs.abs()),
            };
            let (ku, kv, ks) = (rest.area * k.warp, rest.area * k.weft, rest.area * k.shear);

            // p + ahead · H ẇ, the force's linearisation along the present velocity.
            let ahead = linear.ahead;
            let damped = k.damping + ahead;
            let su = ku * (u.length - 1.0 + (k.damping + ahead * (1.0 - beta_u)) * rate_u);
            let sv = kv * (w.length - 1.0 + (k.damping + ahead * (1.0 - beta_v)) * rate_v);
            let ss = ks * (cs + damped * rate_s);
            let (iu, iv, ic) = (
                ahead * (ku * beta_u + ks * spread),
                ahead * (kv * beta_v + ks * spread),
                ahead * ks * cross,
            );
            let p_u = u.unit * su + wv * ss + du * iu + dv * ic;
            let p_v = w.unit * sv + wu * ss + dv * iv + du * ic;
            distribute(rest, &p_u, &p_v, f);

            let stiff = linear.stiffness;
            let h_uu = Symmetric {
                identity: stiff * (ku * beta_u + ks * spread),
                unit: u.unit,
                unit_scale: ku * (along - stiff * beta_u),
                other: wv,
                other_scale: ks * along,
            };
            let h_vv = Symmetric {
                identity: stiff * (kv * beta_v + ks * spread),
                unit: w.unit,
                unit_scale: kv * (along - stiff * beta_v),
                other: wu,
                other_scale: ks * along,
            };
            let huu = h_uu.expand();
            let hvv = h_vv.expand();
            let huv = cross_block(&wv, &wu, ks * along, stiff * ks * cross);

            let k11 = corner_block(&huu, &hvv, &huv, rest, 0, 0);
            let k12 = corner_block(&huu, &hvv, &huv, rest, 0, 1);
            let k22 = corner_block(&huu, &hvv, &huv, rest, 1, 1);
            for i in 0..9 {
                let transposed = 3 * (i % 3) + i / 3;
                blocks[0][i] = -(k11[i] + k12[transposed]);
                blocks[1][i] = -(k12[i] + k22[i]);
            }
            blocks[2] = k12;
        }
    }
}

/// `identity` I + `unit_scale` unit unitᵀ + `other_scale` other otherᵀ.
struct Symmetric {
    identity: f64,
    unit: Vec3,
    unit_scale: f64,
    other: Vec3,
    other_scale: f64,
}

impl Symmetric {
    #[inline]
    fn expand(&self) -> Block {
        let mut block = [0.0; 9];
        for column in 0..3 {
            let (a, b) = (self.unit_scale * self.unit[column], self.other_scale * self.other[column]);
            for row in 0..3 {
                block[3 * column + row] = a * self.unit[row] + b * self.other[row];
            }
        }
        block[0] += self.identity;
        block[4] += self.identity;
        block[8] += self.identity;
        block
    }
}

/// `scale` left rightᵀ + `identity` I.
#[inline]
fn cross_block(left: &Vec3, right: &Vec3, scale: f64, identity: f64) -> Block {
    let mut block = [0.0; 9];
    for column in 0..3 {
        let r = scale * right[column];
        for row in 0..3 {
            block[3 * column + row] = r * left[row];
        }
    }
    block[0] += identity;
    block[4] += identity;
    block[8] += identity;
    block
}

/// Block of corners a + 1 and b + 1: u_a u_b H_uu + v_a v_b H_vv + u_a v_b H_uv + v_a u_b H_uvᵀ.
#[inline]
fn corner_block(huu: &Block, hvv: &Block, huv: &Block, rest: &Rest, a: usize, b: usize) -> Block {
    let (uu, vv) = (rest.u[a] * rest.u[b], rest.v[a] * rest.v[b]);
    let (uv, vu) = (rest.u[a] * rest.v[b], rest.v[a] * rest.u[b]);
    let mut block = [0.0; 9];
    for i in 0..9 {
        let transposed = 3 * (i % 3) + i / 3;
        block[i] = uu * huu[i] + vv * hvv[i] + uv * huv[i] + vu * huv[transposed];
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

    const STIFFNESS: Stiffness = Stiffness { warp: 50.0, weft: 30.0, shear: 12.0, damping: 0.0 };

    /// Two triangles of a unit square with material axes along its sides.
    fn square(stiffness: Stiffness) -> Model {
        let vertices = vec![[0, 1, 2], [3, 2, 1]];
        let inverse = [[[1.0, 0.0], [0.0, 1.0]], [[-1.0, 0.0], [0.0, -1.0]]];
        Model::new(StretchShear::new(stiffness, vertices, &inverse, &[0.5, 0.5]).unwrap())
    }

    fn at_rest() -> [Vec3; 4] {
        [Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::new(1.0, 1.0, 0.0)]
    }

    #[test]
    fn derivatives_and_invariance() {
        let mut random = Random::new(2);
        for case in 0..8 {
            // Around rest, stretched, compressed, far from rest.
            let scale = [1.02, 1.6, 0.5, 1.0][case % 4];
            let noise = [0.05, 0.3, 0.1, 0.9][case % 4];
            let x: Vec<Vec3> = at_rest().iter().map(|x| x * scale + random.vector() * noise).collect();
            let v = random.vectors(4, 2.0);
            let damped = Stiffness { damping: 0.03, ..STIFFNESS };
            check_derivatives(&square(STIFFNESS), &x, "stretch and shear");
            check_velocity_terms(&square(damped), &x, &v, "stretch and shear");
            check_momentum(&square(damped), &x, &v, "stretch and shear");
            check_rigid_motion(&square(damped), &x, "stretch and shear");
        }
    }

    #[test]
    fn rest_has_no_energy_and_no_force() {
        let model = square(STIFFNESS);
        assert_eq!(energy(&model, &at_rest()), 0.0);
        assert!(forces(&model, &at_rest(), &[Vec3::zeros(); 4]).iter().all(|f| *f == Vec3::zeros()));
    }

    #[test]
    fn value_by_hand() {
        // Unit square stretched by 1.2 along u and sheared by 0.5: w_u = (1.2, 0), w_v = (0.5, 1).
        // C_u = 0.2, C_v = √1.25 − 1 = 0.1180339887, C_s = 0.6.
        // E = ½ [50·0.04 + 30·0.01393202250 + 12·0.36] = 1 + 0.2089803375 + 2.16.
        let x = at_rest().map(|x| Vec3::new(1.2 * x.x + 0.5 * x.y, x.y, 0.0));
        let e = energy(&square(STIFFNESS), &x);
        assert!((e - 3.368_980_337_5).abs() < 1e-9, "{e}");
        // Warp and weft stiffness are apart: the same along v with only the weft counts 30, along u 50.
        let along_u = energy(&square(STIFFNESS), &at_rest().map(|x| Vec3::new(1.1 * x.x, x.y, 0.0)));
        let along_v = energy(&square(STIFFNESS), &at_rest().map(|x| Vec3::new(x.x, 1.1 * x.y, 0.0)));
        assert!((along_u - 0.25).abs() < 1e-12 && (along_v - 0.15).abs() < 1e-12, "{along_u} {along_v}");
    }

    #[test]
    fn stiffness_does_not_depend_on_the_triangle_size() {
        // The same square at a tenth of the size stores a hundredth of the energy at equal strain.
        let inverse = [[[10.0, 0.0], [0.0, 10.0]], [[-10.0, 0.0], [0.0, -10.0]]];
        let small = Model::new(
            StretchShear::new(STIFFNESS, vec![[0, 1, 2], [3, 2, 1]], &inverse, &[0.005, 0.005]).unwrap(),
        );
        let x = at_rest().map(|x| Vec3::new(1.3 * x.x, 0.9 * x.y + 0.2 * x.x, 0.0));
        let (large, small) = (energy(&square(STIFFNESS), &x), energy(&small, &x.map(|x| x * 0.1)));
        assert!((large / small - 100.0).abs() < 1e-9);
    }

    #[test]
    fn collapsed_triangles_stay_finite_and_bad_ones_are_named() {
        let f = forces(&square(STIFFNESS), &[Vec3::zeros(); 4], &[Vec3::x(); 4]);
        assert!(f.iter().all(|f| f.iter().all(|c| c.is_finite())));
        let error = StretchShear::new(STIFFNESS, vec![[5, 6, 9]], &[[[1.0, 0.0], [0.0, 1.0]]], &[0.0]);
        assert!(
            matches!(error.err(), Some(CoreError::Degenerate { element: 0, ref vertices, .. }) if vertices == &[5, 6, 9])
        );
    }
}
