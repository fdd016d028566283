//! Drag and lift of moving air on triangles.
//!
//! u = wind − (v_0 + v_1 + v_2)/3 the air's velocity relative to the triangle [m/s], n its unit normal, A its present area [m²]:
//! drag F = ½ ρ C_D A |n·u| u, lift F = ½ ρ C_L A (n·u) (|u| n − (n·u) u/|u|)   [N], a third on each corner.
//!
//! Both vanish for flow along the surface and do not depend on which side is the front. Lift is perpendicular to the
//! flow with |F| ∝ sin α cos α |u|² (α between flow and normal). They have no energy.
//!
//! Couplings: the drag's −∂F/∂v at frozen |n·u|, lumped to the corners' diagonals: ½ ρ C_D A |n·u|/3 I ≥ 0.
//! A collapsed triangle has no area and no force.

use std::ops::Range;

use super::{
    CouplingKind, Couplings, ForceModel, Linear, Psd, Survey,
    memory::{Past, PastMut},
};
use crate::{EffectInfo, Energy, mesh::Vec3};

/// Drag and lift on the triangles of all cloth.
pub(crate) struct Air {
    pub(crate) wind: Vec3,
    /// ½ ρ C_D [kg/m³].
    pub(crate) drag: f64,
    /// ½ ρ C_L [kg/m³].
    pub(crate) lift: f64,
    pub(crate) vertices: Vec<[u32; 3]>,
}

impl Air {
    /// Force on each corner [N] and drag per relative velocity of each corner [N s/m].
    #[inline]
    fn corner(&self, element: usize, x: &[Vec3], v: &[Vec3]) -> (Vec3, f64) {
        let [a, b, c] = self.vertices[element].map(|i| i as usize);
        // |area_normal| is the area.
        let area_normal = (x[b] - x[a]).cross(&(x[c] - x[a])) * 0.5;
        let u = self.wind - (v[a] + v[b] + v[c]) / 3.0;
        let flux = area_normal.dot(&u);
        let drag = self.drag * flux.abs() / 3.0;
        let mut force = u * drag;
        let (area, speed) = (area_normal.norm(), u.norm());
        if self.lift > 0.0 && area > 0.0 && speed > 0.0 {
            let normal = area_normal / area;
            force += (normal * speed - u * (normal.dot(&u) / speed)) * (self.lift * flux / 3.0);
        }
        (force, drag)
    }
}

impl ForceModel for Air {
    fn info(&self) -> EffectInfo {
        EffectInfo {
            name: "wind",
            elements: self.vertices.len(),
            bytes: size_of_val(self.vertices.as_slice()),
        }
    }

    fn corners(&self) -> usize {
        3
    }

    fn vertices(&self) -> &[u32] {
        self.vertices.as_flattened()
    }

    fn coupling(&self, _psd: Psd) -> CouplingKind {
        CouplingKind::Diagonal
    }

    fn is_air(&self) -> bool {
        true
    }

    fn dissipates(&self) -> bool {
        true
    }

    fn add_energy(
        &self,
        _range: Range<usize>,
        _x: &[Vec3],
        _memory: Past<'_>,
        _survey: Survey<&[f64]>,
        _energy: &mut Energy,
    ) {
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
        for (element, f) in range.zip(out.chunks_exact_mut(3)) {
            f.fill(self.corner(element, x, v).0);
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
        let Couplings::Diagonal(diagonal) = couplings else { unreachable!("air acts on diagonals") };
        for ((element, f), diagonal) in range.zip(forces.chunks_exact_mut(3)).zip(diagonal) {
            let (force, drag) = self.corner(element, x, v);
            f.fill(force);
            *diagonal = linear.damping * drag;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Model, Random, forces};
    use super::*;

    fn triangle(drag: f64, lift: f64, wind: Vec3) -> Model {
        Model::new(Air { wind, drag, lift, vertices: vec![[0, 1, 2]] })
    }

    const TRIANGLE: [Vec3; 3] =
        [Vec3::new(0.0, 0.0, 0.0), Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];

    #[test]
    fn drag_and_lift_by_hand() {
        // Area 1, normal z. Head-on wind of 3 m/s with ½ρC = 0.5: drag 0.5·1·3·3 = 4.5 along z, a third per corner;
        // no lift head-on.
        let still = [Vec3::zeros(); 3];
        let f = forces(&triangle(0.5, 0.5, Vec3::z() * 3.0), &TRIANGLE, &still);
        assert!((f[0] - Vec3::z() * 1.5).norm() < 1e-14, "{:?}", f[0]);
        // Moving with the wind, or wind along the surface: nothing.
        assert_eq!(forces(&triangle(0.5, 0.5, Vec3::z()), &TRIANGLE, &[Vec3::z(); 3])[1], Vec3::zeros());
        assert_eq!(forces(&triangle(0.5, 0.5, Vec3::x()), &TRIANGLE, &still)[1], Vec3::zeros());
        // Wind (1, 0, 1)·√2, |u| = 2, u·n = √2: lift 0.5·√2 (2 z − √2/2 u) = 0.5·√2·(−1, 0, 1), perpendicular to u.
        let u = Vec3::new(1.0, 0.0, 1.0) * 2f64.sqrt();
        let f = forces(&triangle(0.0, 0.5, u), &TRIANGLE, &still);
        let expected = Vec3::new(-1.0, 0.0, 1.0) * (0.5 * 2f64.sqrt() / 3.0);
        assert!((f[2] - expected).norm() < 1e-14, "{:?}", f[2]);
        assert!(f[2].dot(&u).abs() < 1e-14);
    }

    #[test]
    fn does_not_depend_on_the_front_and_drag_takes_energy() {
        let mut random = Random::new(4);
        for _ in 0..20 {
            let x = random.vectors(3, 1.0);
            let v = [random.vector(); 3];
            let wind = random.vector();
            let f = forces(&triangle(0.4, 0.3, wind), &x, &v)[0];
            let turned = [x[0], x[2], x[1]];
            assert!((forces(&triangle(0.4, 0.3, wind), &turned, &v)[0] - f).norm() < 1e-14);
            assert!(forces(&triangle(0.4, 0.0, Vec3::zeros()), &x, &v)[0].dot(&v[0]) <= 0.0);
        }
    }

    #[test]
    fn collapsed_triangles_have_no_force() {
        let f = forces(&triangle(1.0, 1.0, Vec3::x()), &[Vec3::y(); 3], &[Vec3::zeros(); 3]);
        assert_eq!(f[0], Vec3::zeros());
    }
}
