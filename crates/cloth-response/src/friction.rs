//! Coulomb friction: the cone, and the coefficient of a pair.
//!
//! At a contact with the normal impulse λ the tangential impulse is what stops the tangential motion, but at most
//! μλ (3.37, 3.38 with the effective mass: λ = m Δv_n, so that |Δv_t| ≤ μ Δv_n, Δv_n being the change of normal
//! velocity that the contact itself made). The velocity is that after external and internal forces, so λ holds the
//! weight that presses the pair and a contact below the friction angle sticks exactly.

use crate::{FrictionRule, Vec3};
use cloth_collision::CollisionMesh;

/// The nearest vector of length ≤ `radius`.
pub(crate) fn into_cone(p: Vec3, radius: f64) -> Vec3 {
    let length = p.norm();
    if length <= radius { p } else { p * (radius / length) }
}

impl FrictionRule {
    /// Coefficient of a pair, given one vertex of either side.
    pub(crate) fn coefficient(&self, mesh: &CollisionMesh, first: u32, second: u32) -> f64 {
        let bodies = [first, second].map(|v| mesh.vertex_body[v as usize] as usize);
        match bodies.into_iter().find(|&b| !mesh.bodies[b].dynamic) {
            Some(collider) => self.bodies.get(collider).copied().unwrap_or(self.default),
            None => self.self_friction,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cloth_collision::Body;

    /// Keep what is inside the disc, scale what is outside.
    #[test]
    fn cone_is_a_projection() {
        let p = Vec3::new(3.0, 0.0, 4.0);
        assert_eq!(into_cone(p, 5.0), p);
        assert_eq!(into_cone(p, 2.5), p * 0.5);
        assert_eq!(into_cone(p, 0.0), Vec3::zeros());
        assert_eq!(into_cone(Vec3::zeros(), 0.0), Vec3::zeros());
    }

    /// The collider's coefficient overrides; cloth against cloth has its own.
    #[test]
    fn pair_rule() {
        let triangle: &[[u32; 3]] = &[[0, 1, 2]];
        let cloth = Body { dynamic: true, self_collision: true };
        let collider = Body { dynamic: false, self_collision: false };
        let mesh = CollisionMesh::new(&[(cloth, 3, triangle), (cloth, 3, triangle), (collider, 3, triangle)])
            .expect("valid");
        let mut rule = FrictionRule { self_friction: 0.1, bodies: vec![], default: 0.2 };
        assert_eq!(rule.coefficient(&mesh, 0, 1), 0.1);
        assert_eq!(rule.coefficient(&mesh, 0, 4), 0.1);
        assert_eq!(rule.coefficient(&mesh, 0, 7), 0.2);
        rule.bodies = vec![9.0, 9.0, 0.7];
        assert_eq!(rule.coefficient(&mesh, 7, 4), 0.7);
        assert_eq!(rule.coefficient(&mesh, 0, 4), 0.1);
    }
}
