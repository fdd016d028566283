//! The kernel of steps in which no contact is fast enough for the terms of its law that depend on speed.
//!
//! Coulomb's law with μ_s, tried first where [`crate::ResponseParams::friction_tolerance`] allows an error ε of the coefficient. It
//! stands for a law
//!
//! - at a contact that sticks below its threshold, |p_t| < μ_s λ: all four laws are the same there;
//! - at a contact that slides no faster than s*, where F_k has fallen from F_S by the fraction ε of it:
//!   (μ_s − μ_c)(1 − e^(−(s*/v_S)^δ_S)) = ε μ_s, so s* = v_S (−ln(1 − ε μ_s/(μ_s − μ_c)))^(1/δ_S).
//!
//! A contact on the way from sticking to fast sliding is what has to be kept out: friction that weakens has solutions of another
//! speed. With the speed s under μ_s λ the fastest solution under the law is at most s + λ (μ_s − μ_c)/m, as F_k ≥ F_C; that bound is
//! what may not be above s*. Viscous terms have no bound relative to λ and stiction jumps: s* = 0, so that these only stick.
//! After each settling of the sweeps every contact is looked at; where one does not hold, the step is taken with the whole law.

use super::{into_cone, kernel::Kernel, law::FrictionLaw};
use crate::impulse::Contact;
use crate::motion::{Motion, bytes_of};
use crate::{FrictionRule, Vec3};
use cloth_collision::CollisionMesh;

/// A contact sticks below its threshold where it is this fraction from it: rounding.
const THRESHOLD_ROUNDING: f64 = 1e-9;

/// A law as this kernel wants it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Entry {
    mu_s: f64,
    /// μ_s − μ_c.
    drop: f64,
    /// s* [m/s].
    speed: f64,
    acts: bool,
}

impl Entry {
    fn of(law: &FrictionLaw, tolerance: f64) -> Self {
        let (mu_s, drop) = (law.static_coefficient(), law.static_coefficient() - law.kinetic_coefficient());
        let allowed = tolerance * mu_s;
        let speed = match *law {
            _ if law.is_viscous() => 0.0,
            _ if drop <= allowed => f64::INFINITY,
            FrictionLaw::Stribeck { v_s, delta_s, .. } | FrictionLaw::Viscous { v_s, delta_s, .. } => {
                v_s * (-(-allowed / drop).ln_1p()).powf(delta_s.recip())
            }
            FrictionLaw::Coulomb { .. } | FrictionLaw::CoulombStiction { .. } => 0.0,
        };
        Self { mu_s, drop, speed, acts: mu_s > 0.0 || law.is_viscous() }
    }
}

/// Coulomb with the coefficients at rest.
#[derive(Debug)]
pub(crate) struct Slow {
    /// One per law of the rule, and the last for contacts without friction.
    laws: Vec<Entry>,
}

impl Slow {
    /// None where all laws are Coulomb's: there is nothing to leave out.
    pub(crate) fn new(rule: &FrictionRule, tolerance: Option<f64>) -> Option<Self> {
        let tolerance = tolerance.filter(|_| !rule.is_coulomb())?;
        let none = FrictionLaw::Coulomb { mu_c: 0.0 };
        Some(Self { laws: rule.laws().iter().chain([&none]).map(|l| Entry::of(l, tolerance)).collect() })
    }

    /// Least s* of the laws [m/s].
    pub(crate) fn speed(&self) -> f64 {
        self.laws.iter().map(|law| law.speed).fold(f64::INFINITY, f64::min)
    }
}

impl Kernel for Slow {
    type State = u32;

    #[inline]
    fn state(&self, rule: &FrictionRule, mesh: &CollisionMesh, first: u32, second: u32) -> u32 {
        rule.index_of(mesh, first, second) as u32
    }

    fn frictionless(&self) -> u32 {
        (self.laws.len() - 1) as u32
    }

    #[inline]
    fn acts(&self, state: &u32) -> bool {
        self.laws[*state as usize].acts
    }

    #[inline]
    fn at_rest(&self, state: &u32) -> f64 {
        self.laws[*state as usize].mu_s
    }

    #[inline]
    fn bound(&self, state: &mut u32, stop: Vec3, lambda: f64, _mass: f64) -> Vec3 {
        into_cone(stop, self.laws[*state as usize].mu_s * lambda)
    }

    #[inline]
    fn begin(&mut self, _contacts: &mut [Contact<u32>], _vertex_count: usize) {}

    #[inline]
    fn before_sweep(&mut self, _sweep: usize) {}

    const REVIEWS: bool = false;

    #[inline]
    fn alone(&self, _state: &u32) -> bool {
        false
    }

    #[inline]
    fn review(
        &mut self,
        _contacts: &mut [Contact<u32>],
        _motion: &Motion<'_>,
        _tolerance: f64,
        _again: impl FnMut(usize),
    ) {
    }

    const TENTATIVE: bool = true;

    fn holds(&self, contact: &Contact<u32>, velocity: &[Vec3], tolerance: f64) -> bool {
        let law = &self.laws[contact.friction as usize];
        let lambda = contact.normal.dot(&contact.impulse);
        if !law.acts || lambda <= 0.0 || law.speed == f64::INFINITY {
            return true;
        }
        let u = contact.relative(velocity);
        let sliding = (u - contact.normal * contact.normal.dot(&u)).norm();
        let tangential = (contact.impulse - contact.normal * lambda).norm();
        let sticks = sliding <= tolerance && tangential < law.mu_s * lambda * (1.0 - THRESHOLD_ROUNDING);
        sticks || sliding + lambda * law.drop / contact.mass <= law.speed
    }

    fn bytes(&self) -> usize {
        bytes_of(&self.laws)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The speed at which a law has left its coefficient at rest by the tolerance, for each shape of the curve.
    #[test]
    fn the_error_at_its_speed_is_the_tolerance() {
        for (mu_c, mu_s, v_s, delta_s) in [(0.3, 0.4, 0.1, 1.0), (0.1, 0.9, 0.02, 0.2), (0.2, 0.3, 1.0, 2.0)]
        {
            for tolerance in [1e-3, 0.01, 0.1] {
                let law = FrictionLaw::Stribeck { mu_c, mu_s, v_s, delta_s };
                let entry = Entry::of(&law, tolerance);
                let error = |s: f64| 1.0 - law.kinetic_force(1.0, s, 0.0) / entry.mu_s;
                // Rounding of ε against 1, magnified by at most 1/ε.
                assert!((error(entry.speed) - tolerance).abs() < 1e-12, "{law:?}");
                assert!(error(0.9 * entry.speed) < tolerance && error(1.1 * entry.speed) > tolerance);
            }
        }
    }

    /// What jumps or has no bound is at no speed within it; what differs by less than the tolerance is at all.
    #[test]
    fn laws_without_a_speed() {
        let viscous =
            FrictionLaw::Viscous { mu_c: 0.3, mu_s: 0.3, v_s: 0.1, delta_s: 1.0, f_v: 1.0, delta_v: 1.0 };
        let stiction = |mu_s| FrictionLaw::CoulombStiction { mu_c: 0.3, mu_s };
        assert_eq!(Entry::of(&viscous, 0.5).speed, 0.0);
        assert_eq!(Entry::of(&stiction(0.4), 0.01).speed, 0.0);
        assert_eq!(Entry::of(&stiction(0.301), 0.01).speed, f64::INFINITY);
        assert_eq!(Entry::of(&FrictionLaw::Coulomb { mu_c: 0.3 }, 0.01).speed, f64::INFINITY);
        let rule = FrictionRule::uniform(stiction(0.4));
        assert_eq!(Slow::new(&rule, Some(0.01)).map(|slow| slow.speed()), Some(0.0));
        assert!(
            Slow::new(&rule, None).is_none() && Slow::new(&FrictionRule::default(), Some(0.01)).is_none()
        );
    }
}
