//! Friction: the laws, which pair has which, and the cone.
//!
//! At a contact with the normal impulse λ the tangential impulse is what stops the tangential motion, but at most
//! μλ (3.37, 3.38 with the effective mass: λ = m Δv_n, so that |Δv_t| ≤ μ Δv_n, Δv_n being the change of normal
//! velocity that the contact itself made). The velocity is that after external and internal forces, so λ holds the
//! weight that presses the pair and a contact below the friction angle sticks exactly.

pub(crate) mod general;
pub(crate) mod kernel;
pub(crate) mod law;
pub(crate) mod rule;
pub(crate) mod slow;

use crate::Vec3;

/// The nearest vector of length ≤ `radius`.
pub(crate) fn into_cone(p: Vec3, radius: f64) -> Vec3 {
    let length = p.norm();
    if length <= radius { p } else { p * (radius / length) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Keep what is inside the disc, scale what is outside.
    #[test]
    fn cone_is_a_projection() {
        let p = Vec3::new(3.0, 0.0, 4.0);
        assert_eq!(into_cone(p, 5.0), p);
        assert_eq!(into_cone(p, 2.5), p * 0.5);
        assert_eq!(into_cone(p, 0.0), Vec3::zeros());
        assert_eq!(into_cone(Vec3::zeros(), 0.0), Vec3::zeros());
    }
}
