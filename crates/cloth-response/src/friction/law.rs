//! What friction does between two surfaces: the four laws of chapter 7.
//!
//! With the normal force N, the sliding speed s, the contact area A and the thresholds F_C = μ_c N, F_S = μ_s N:
//!
//! | law | sticks while the applied force is below | kinetic force F_k(s) |
//! |---|---|---|
//! | Coulomb (C) | F_C | F_C |
//! | Coulomb with stiction (CS) | F_S | F_C |
//! | Stribeck (CSS) | F_S | F_C + (F_S − F_C) e^(−(s/v_S)^δ_S) |
//! | viscous (CSSV) | F_S | the same + A f_v s^δ_v |
//!
//! The printed F_v has no mass or area, so that with one contact per vertex viscosity would grow with the mesh; here it
//! is per area of contact. Source: thesis, Equations 7.1–7.7.

use crate::{ResponseError, Vec3};

/// One of the four laws, with its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FrictionLaw {
    /// One coefficient, at rest and sliding (7.1).
    Coulomb {
        /// Coefficient μ_c [-], ≥ 0.
        mu_c: f64,
    },
    /// A larger coefficient at rest (7.2, 7.3).
    CoulombStiction {
        /// Coefficient while sliding, μ_c [-], ≥ 0.
        mu_c: f64,
        /// Coefficient at rest, μ_s [-], ≥ μ_c.
        mu_s: f64,
    },
    /// From μ_s at rest down to μ_c as the speed grows (7.4).
    Stribeck {
        /// Coefficient at high speed, μ_c [-], ≥ 0.
        mu_c: f64,
        /// Coefficient at rest, μ_s [-], ≥ μ_c.
        mu_s: f64,
        /// Stribeck speed v_S [m/s], > 0: there 1/e of the excess is left.
        v_s: f64,
        /// Shape δ_S [-], in (0, 2]. The thesis takes 0.2 and allows [0, 1]; 0 is no decrease at all, and 2 is the Gaussian
        /// of the engineering literature.
        delta_s: f64,
    },
    /// [`FrictionLaw::Stribeck`] and viscous friction (7.5, 7.7).
    Viscous {
        /// Coefficient of the dry part at high speed, μ_c [-], ≥ 0.
        mu_c: f64,
        /// Coefficient at rest, μ_s [-], ≥ μ_c.
        mu_s: f64,
        /// Stribeck speed v_S [m/s], > 0.
        v_s: f64,
        /// Shape δ_S [-], in (0, 2].
        delta_s: f64,
        /// Viscous coefficient f_v [N/m² (s/m)^δ_v], ≥ 0, per area of contact.
        f_v: f64,
        /// Exponent δ_v [-], in (0, 2]; 1: in proportion to the speed.
        delta_v: f64,
    },
}

impl FrictionLaw {
    /// The law's name in scene files: `coulomb`, `coulomb-stiction`, `stribeck` or `viscous`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Coulomb { .. } => "coulomb",
            Self::CoulombStiction { .. } => "coulomb-stiction",
            Self::Stribeck { .. } => "stribeck",
            Self::Viscous { .. } => "viscous",
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`ResponseError::Parameter`] naming the first value out of range.
    pub fn check(&self) -> Result<(), ResponseError> {
        let refuse = |name, expected, got| Err(ResponseError::Parameter { name, expected, got });
        let mu_c = self.kinetic_coefficient();
        if !(mu_c.is_finite() && mu_c >= 0.0) {
            return refuse("mu_c", "a finite number ≥ 0", mu_c);
        }
        let mu_s = self.static_coefficient();
        if !(mu_s.is_finite() && mu_s >= mu_c) {
            return refuse("mu_s", "a finite number ≥ mu_c", mu_s);
        }
        if let Self::Stribeck { v_s, delta_s, .. } | Self::Viscous { v_s, delta_s, .. } = *self {
            if !(v_s.is_finite() && v_s > 0.0) {
                return refuse("v_s", "a finite speed > 0 m/s", v_s);
            }
            if !(delta_s > 0.0 && delta_s <= 2.0) {
                return refuse("delta_s", "a number in (0, 2]", delta_s);
            }
        }
        if let Self::Viscous { f_v, delta_v, .. } = *self {
            if !(f_v.is_finite() && f_v >= 0.0) {
                return refuse("f_v", "a finite number ≥ 0", f_v);
            }
            if !(delta_v > 0.0 && delta_v <= 2.0) {
                return refuse("delta_v", "a number in (0, 2]", delta_v);
            }
        }
        Ok(())
    }

    /// Coefficient of the dry part at high speed, μ_c [-].
    pub fn kinetic_coefficient(&self) -> f64 {
        match *self {
            Self::Coulomb { mu_c }
            | Self::CoulombStiction { mu_c, .. }
            | Self::Stribeck { mu_c, .. }
            | Self::Viscous { mu_c, .. } => mu_c,
        }
    }

    /// Coefficient at rest, μ_s [-]; μ_c for Coulomb.
    pub fn static_coefficient(&self) -> f64 {
        match *self {
            Self::Coulomb { mu_c } => mu_c,
            Self::CoulombStiction { mu_s, .. } | Self::Stribeck { mu_s, .. } | Self::Viscous { mu_s, .. } => {
                mu_s
            }
        }
    }

    /// Whether the force depends on the area of contact.
    pub fn is_viscous(&self) -> bool {
        matches!(*self, Self::Viscous { f_v, .. } if f_v > 0.0)
    }

    /// F_k(s) [N], the kinetic force that opposes sliding at `speed` [m/s] ≥ 0 under `normal_force` [N] ≥ 0 over
    /// `area` [m²] ≥ 0 (7.7).
    pub fn kinetic_force(&self, normal_force: f64, speed: f64, area: f64) -> f64 {
        let stribeck = |mu_c: f64, mu_s: f64, v_s: f64, delta_s: f64| {
            normal_force * (mu_c + (mu_s - mu_c) * (-(speed / v_s).powf(delta_s)).exp())
        };
        match *self {
            Self::Coulomb { mu_c } | Self::CoulombStiction { mu_c, .. } => mu_c * normal_force,
            Self::Stribeck { mu_c, mu_s, v_s, delta_s } => stribeck(mu_c, mu_s, v_s, delta_s),
            Self::Viscous { mu_c, mu_s, v_s, delta_s, f_v, delta_v } => {
                stribeck(mu_c, mu_s, v_s, delta_s) + area * f_v * speed.powf(delta_v)
            }
        }
    }

    /// The force of friction [N] (7.6): −F_k(|v_t|) v_t/|v_t| where the surfaces slide; where they do not, −F_e up to
    /// the length μ_s N.
    ///
    /// `tangential_velocity` v_t [m/s] of the body that the force acts on, relative to the other; `applied_force` F_e
    /// [N]: all tangential force on it but friction. `normal_force` [N] and `area` [m²] as in
    /// [`FrictionLaw::kinetic_force`].
    pub fn force(
        &self,
        normal_force: f64,
        tangential_velocity: Vec3,
        applied_force: Vec3,
        area: f64,
    ) -> Vec3 {
        let speed = tangential_velocity.norm();
        if speed > 0.0 {
            return tangential_velocity * (-self.kinetic_force(normal_force, speed, area) / speed);
        }
        let (applied, threshold) = (applied_force.norm(), self.static_coefficient() * normal_force);
        if applied <= threshold { -applied_force } else { applied_force * (-threshold / applied) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a handful of operations on numbers of size 1.
    const ROUNDING: f64 = 1e-15;
    const STRIBECK: FrictionLaw = FrictionLaw::Stribeck { mu_c: 0.1, mu_s: 0.2, v_s: 0.4, delta_s: 0.2 };
    const VISCOUS: FrictionLaw =
        FrictionLaw::Viscous { mu_c: 0.1, mu_s: 0.2, v_s: 0.4, delta_s: 0.2, f_v: 3.0, delta_v: 1.0 };

    /// Each value out of range is named, with what it was; the edges of the ranges are inside.
    #[test]
    fn ranges_are_checked() {
        let refused = |law: FrictionLaw| match law.check() {
            Err(ResponseError::Parameter { name, got, .. }) => (name, got),
            other => panic!("{law:?}: {other:?}"),
        };
        assert_eq!(refused(FrictionLaw::Coulomb { mu_c: -0.1 }), ("mu_c", -0.1));
        assert_eq!(refused(FrictionLaw::CoulombStiction { mu_c: 0.2, mu_s: 0.1 }), ("mu_s", 0.1));
        assert_eq!(refused(FrictionLaw::CoulombStiction { mu_c: 0.2, mu_s: f64::INFINITY }).0, "mu_s");
        let stribeck = |v_s, delta_s| FrictionLaw::Stribeck { mu_c: 0.1, mu_s: 0.2, v_s, delta_s };
        assert_eq!(refused(stribeck(0.0, 0.2)), ("v_s", 0.0));
        assert_eq!(refused(stribeck(0.4, 0.0)), ("delta_s", 0.0));
        assert_eq!(refused(stribeck(0.4, 2.1)), ("delta_s", 2.1));
        assert_eq!(refused(stribeck(f64::NAN, 0.2)).0, "v_s");
        let viscous = |f_v, delta_v| FrictionLaw::Viscous {
            mu_c: 0.1,
            mu_s: 0.2,
            v_s: 0.4,
            delta_s: 0.2,
            f_v,
            delta_v,
        };
        assert_eq!(refused(viscous(-1.0, 1.0)), ("f_v", -1.0));
        assert_eq!(refused(viscous(1.0, 0.0)), ("delta_v", 0.0));
        for law in [
            FrictionLaw::Coulomb { mu_c: 0.0 },
            FrictionLaw::CoulombStiction { mu_c: 0.2, mu_s: 0.2 },
            stribeck(0.4, 2.0),
            viscous(0.0, 2.0),
        ] {
            assert_eq!(law.check(), Ok(()), "{law:?}");
        }
    }

    /// Hand-computed values of 7.7, and of its limits.
    #[test]
    fn kinetic_force_has_its_values() {
        let e = std::f64::consts::E;
        assert_eq!(FrictionLaw::Coulomb { mu_c: 0.3 }.kinetic_force(2.0, 5.0, 1.0), 0.6);
        assert_eq!(FrictionLaw::CoulombStiction { mu_c: 0.3, mu_s: 0.5 }.kinetic_force(2.0, 0.0, 1.0), 0.6);
        assert!((STRIBECK.kinetic_force(2.0, 0.4, 1.0) - 2.0 * (0.1 + 0.1 / e)).abs() < ROUNDING);
        assert_eq!(STRIBECK.kinetic_force(2.0, 0.0, 1.0), 0.4);
        // (12.8/0.4)^0.2 = 2.
        assert!((STRIBECK.kinetic_force(1.0, 12.8, 1.0) - (0.1 + 0.1 * (-2.0_f64).exp())).abs() < ROUNDING);
        let extra = VISCOUS.kinetic_force(2.0, 0.4, 0.5) - STRIBECK.kinetic_force(2.0, 0.4, 0.5);
        assert!((extra - 0.5 * 3.0 * 0.4).abs() < ROUNDING);
        assert_eq!(VISCOUS.kinetic_force(2.0, 0.4, 0.0), STRIBECK.kinetic_force(2.0, 0.4, 0.0));
    }

    /// 7.6: at rest the applied force is met up to the threshold; sliding, friction opposes the velocity alone.
    #[test]
    fn force_sticks_and_slides() {
        let (still, pull) = (Vec3::zeros(), Vec3::new(0.0, 0.0, 1.0));
        assert_eq!(STRIBECK.force(10.0, still, pull * 1.9, 1.0), pull * -1.9);
        assert!((STRIBECK.force(10.0, still, pull * 2.5, 1.0) + pull * 2.0).norm() < ROUNDING);
        let coulomb = FrictionLaw::Coulomb { mu_c: 0.1 };
        assert!((coulomb.force(10.0, still, pull * 1.9, 1.0) + pull).norm() < ROUNDING);
        assert_eq!(STRIBECK.force(10.0, still, still, 1.0), still);
        let v = Vec3::new(0.4, 0.0, 0.0);
        let friction = VISCOUS.force(10.0, v, pull, 0.5);
        assert!((friction + Vec3::x() * VISCOUS.kinetic_force(10.0, 0.4, 0.5)).norm() < ROUNDING);
    }
}
