//! What the response may do: thickness, stiffness, friction, caps. Checked once, when the responder is built.

use crate::{FrictionRule, ResponseError};

/// Parameters of the response; [`ResponseParams::default`] suits garments and tablecloths at dt = 1–8 ms.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseParams {
    /// Cloth thickness h [m], > 0: surfaces rest at this distance (3.34, 3.35).
    pub thickness: f64,
    /// Elastic stiffness k_r of one contact [N/m], ≥ 0 (3.36). A resting contact that carries the force F stays at
    /// an overlap of at most F/k_r; the speed of separation is capped, so a large value does not bounce.
    pub repulsion_stiffness: f64,
    /// The friction law of each pair of bodies.
    pub friction: FrictionRule,
    /// Cap on continuous-detection passes that answer with impulses.
    pub max_passes: usize,
    /// Cap on continuous-detection passes that answer with rigid impact zones.
    pub max_zone_passes: usize,
    /// Cap on the work of one pass: contacts are relaxed at most this many times their number. Reaching it is no
    /// error (the passes go on); the residual is reported.
    pub max_sweeps: usize,
    /// A contact whose relative velocity is off by less than this is left alone [m/s], > 0.
    pub velocity_tolerance: f64,
    /// Cloth vertices carry on colliders, held by something else: edges and vertices of colliders rest on cloth only at half of
    /// the thickness, so that they stay idle where surfaces are nearly flat.
    pub vertices_carry: bool,
    /// The first continuous detection leaves out vertices that cannot carry a pair across its gap in the step, and is left out if
    /// there are no others. Accepted steps do not depend on it.
    pub skip_proved: bool,
    /// Relative error ε of a friction coefficient, in (0, 1), for which steps in which all is slow enough leave out the terms that
    /// depend on speed; `None`: never left out.
    pub friction_tolerance: Option<f64>,
    /// Pairs in contact already at `x_t0` are exempt from acceptance and counted. Without this they make the step
    /// [`ResponseError::Unresolved`].
    pub allow_initial_contacts: bool,
}

impl Default for ResponseParams {
    fn default() -> Self {
        Self {
            thickness: 0.004,
            repulsion_stiffness: 20.0,
            friction: FrictionRule::default(),
            max_passes: 6,
            max_zone_passes: 8,
            max_sweeps: 15,
            velocity_tolerance: 1e-6,
            vertices_carry: false,
            skip_proved: false,
            friction_tolerance: None,
            allow_initial_contacts: false,
        }
    }
}

impl ResponseParams {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ResponseError::Parameter`] naming the first value out of range, [`ResponseError::Length`] if the friction rule is a
    /// table for another number of bodies than `body_count`.
    pub fn check(&self, body_count: usize) -> Result<(), ResponseError> {
        let positive = "a finite number > 0";
        let not_negative = "a finite number ≥ 0";
        let checks = [
            ("thickness", self.thickness, positive),
            ("velocity_tolerance", self.velocity_tolerance, positive),
            ("repulsion_stiffness", self.repulsion_stiffness, not_negative),
        ];
        for (name, got, expected) in checks {
            let inside = got.is_finite() && if expected == positive { got > 0.0 } else { got >= 0.0 };
            if !inside {
                return Err(ResponseError::Parameter { name, expected, got });
            }
        }
        if let Some(got) = self.friction_tolerance.filter(|t| !(*t > 0.0 && *t < 1.0)) {
            return Err(ResponseError::Parameter {
                name: "friction_tolerance",
                expected: "a number > 0 and < 1",
                got,
            });
        }
        for (name, got) in [("max_passes", self.max_passes), ("max_sweeps", self.max_sweeps)] {
            if got == 0 {
                return Err(ResponseError::Parameter { name, expected: "at least 1", got: 0.0 });
            }
        }
        self.friction.check(body_count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrictionLaw;

    /// Name the first value out of range and accept the defaults.
    #[test]
    fn ranges_are_checked() {
        assert_eq!(ResponseParams::default().check(3), Ok(()));
        let bad = |change: &dyn Fn(&mut ResponseParams)| {
            let mut params = ResponseParams::default();
            change(&mut params);
            params.check(2).expect_err("out of range").to_string()
        };
        assert!(bad(&|p| p.thickness = -0.1).contains("thickness"));
        assert!(bad(&|p| p.thickness = f64::NAN).contains("thickness"));
        assert!(bad(&|p| p.repulsion_stiffness = -1.0).contains("repulsion_stiffness"));
        let law = FrictionLaw::Coulomb { mu_c: 0.1 };
        assert!(
            bad(&|p| p.friction = FrictionRule::uniform(FrictionLaw::Coulomb { mu_c: -1.0 }))
                .contains("mu_c")
        );
        assert!(bad(&|p| p.friction = FrictionRule::from_pairs(3, |_, _| law)).contains("friction"));
        for tolerance in [0.0, 1.0, f64::NAN] {
            assert!(bad(&|p| p.friction_tolerance = Some(tolerance)).contains("friction_tolerance"));
        }
        assert!(bad(&|p| p.max_passes = 0).contains("max_passes"));
    }
}
