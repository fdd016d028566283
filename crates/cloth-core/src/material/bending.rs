//! Out-of-plane laws of a material.

use super::not_negative;
use crate::{
    CoreError,
    bending::{Curve, Hysteresis, Law, Linear, Plastic},
};

/// How the hinges of a triangle answer to each other.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum HingeCoupling {
    /// As a plate: the mesh bends with the rigidity of the material whatever way it is cut into triangles.
    #[default]
    Coupled,
    /// Not at all: each hinge bends by itself, as in the thesis. The mesh then has a rigidity of its own, 0.8 to 1 of the
    /// material's.
    Independent,
}

/// Out-of-plane law.
#[derive(
    Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(tag = "model", rename_all = "kebab-case", deny_unknown_fields)]
#[schemars(transform = with_aliases)]
pub enum Bending {
    /// No resistance to bending.
    #[default]
    None,
    /// Linear springs between the vertices opposite each shared edge, damped along their axis.
    #[serde(rename = "bending-spring", alias = "spring")]
    Spring {
        /// Stiffness of each spring [N/m].
        stiffness: f64,
        /// Damping of each spring [N s/m].
        #[serde(default)]
        damping: f64,
    },
    /// Moment per width proportional to the change of curvature across each shared edge.
    #[serde(alias = "linear")]
    Hinge {
        /// Bending rigidity per width [N m].
        rigidity: f64,
        /// Damping time [s]: the damping moment is this times the rigidity times the rate of curvature.
        #[serde(default)]
        damping: f64,
        /// Whether the elastic part acts across the hinges of a triangle.
        #[serde(default)]
        hinges: HingeCoupling,
    },
    /// Moment that softens with curvature, the same way there and back (4.1–4.3).
    Nonlinear(NonlinearBending),
    /// Elastic limit and plastic flow.
    Plastic(PlasticBending),
    /// Hysteresis loop with residual curvature and fatigue (4.4–4.12).
    Hysteresis(HysteresisBending),
}

/// Lists variants under their second name too.
fn with_aliases(schema: &mut schemars::Schema) {
    const ALIASES: [(&str, &str); 2] = [("bending-spring", "spring"), ("hinge", "linear")];
    let Some(serde_json::Value::Array(variants)) = schema.get_mut("oneOf") else { return };
    for (name, alias) in ALIASES {
        let named = |v: &&serde_json::Value| v.pointer("/properties/model/const").is_some_and(|c| c == name);
        if let Some(mut variant) = variants.iter().find(named).cloned() {
            variant["properties"]["model"]["const"] = alias.into();
            variants.push(variant);
        }
    }
}

/// The curve of first loading: either from measured values, `rigidity`, `coercive_couple` and `transition_curvature`, or
/// from the coefficients `b1`, `b2`, `c1` of (4.2).
#[derive(
    Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(default, deny_unknown_fields)]
pub struct NonlinearBending {
    /// Bending rigidity per width past the friction, B = b2 [N m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rigidity: Option<f64>,
    /// Coercive couple 2HB per width: the gap between the straight sides of the loop [N m/m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coercive_couple: Option<f64>,
    /// Curvature at which the first loading becomes straight [1/m]; 50 by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transition_curvature: Option<f64>,
    /// Initial rigidity per width [N m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub b1: Option<f64>,
    /// Rigidity per width past the friction [N m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub b2: Option<f64>,
    /// Quadratic coefficient of positive curvatures, < 0 [N m²].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub c1: Option<f64>,
    /// Damping time [s]: the damping moment is this times b2 times the rate of curvature.
    pub damping: f64,
    /// Whether the elastic part b2 K acts across the hinges of a triangle.
    pub hinges: HingeCoupling,
}

/// Elastic limit and plastic flow.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlasticBending {
    /// Bending rigidity per width below the limit [N m].
    pub rigidity: f64,
    /// Change of curvature from which the fabric flows [1/m].
    pub elastic_limit: f64,
    /// Hardening H [N m]: while it flows the slope is B H/(B + H).
    #[serde(default)]
    pub hardening: f64,
    /// Damping time [s]: the damping moment is this times the rigidity times the rate of curvature.
    #[serde(default)]
    pub damping: f64,
    /// Whether the elastic part acts across the hinges of a triangle.
    #[serde(default)]
    pub hinges: HingeCoupling,
}

/// Hysteresis: the curve of first loading as in [`NonlinearBending`], and how much of a bend stays.
#[derive(
    Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(default, deny_unknown_fields)]
pub struct HysteresisBending {
    /// Bending rigidity per width past the friction, B = b2 [N m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rigidity: Option<f64>,
    /// Coercive couple 2HB per width: the gap between the straight sides of the loop [N m/m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coercive_couple: Option<f64>,
    /// Curvature at which the first loading becomes straight [1/m]; 50 by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transition_curvature: Option<f64>,
    /// Initial rigidity per width [N m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub b1: Option<f64>,
    /// Rigidity per width past the friction [N m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub b2: Option<f64>,
    /// Quadratic coefficient of positive curvatures, < 0 [N m²].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub c1: Option<f64>,
    /// λ in [0, 1]: share of a residual curvature that stays.
    pub plasticity: f64,
    /// μ in [0, 1]: share of the friction that a full cycle takes away.
    pub fatigue: f64,
    /// Damping time [s]: the damping moment is this times b2 times the rate of curvature.
    pub damping: f64,
    /// Whether the elastic part b2 K acts across the hinges of a triangle.
    pub hinges: HingeCoupling,
}

/// Transition curvature where none is given [1/m]: the bending tester of Kawabata's system reads B between 0.5 and
/// 1.5 per cm, where it takes the curve as straight.
const TRANSITION_CURVATURE: f64 = 50.0;

impl NonlinearBending {
    /// The curve of first loading.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] or [`CoreError::Missing`] naming the value that leaves none.
    pub fn curve(&self) -> Result<Curve, CoreError> {
        let measured = [
            ("bending.rigidity", self.rigidity),
            ("bending.coercive_couple", self.coercive_couple),
            ("bending.transition_curvature", self.transition_curvature),
        ];
        let missing = |name, expected| Err(CoreError::Missing { name, expected });
        if self.b1.or(self.b2).or(self.c1).is_none() {
            let Some(rigidity) = self.rigidity else {
                return missing("bending.rigidity", "a value > 0 in N m, or b1, b2 and c1");
            };
            let Some(couple) = self.coercive_couple else {
                return missing("bending.coercive_couple", "a value ≥ 0 in N m/m beside rigidity");
            };
            return Curve::measured(
                rigidity,
                couple,
                self.transition_curvature.unwrap_or(TRANSITION_CURVATURE),
            );
        }
        if let Some((name, Some(got))) = measured.into_iter().find(|(_, value)| value.is_some()) {
            return Err(CoreError::Parameter { name, expected: "no value beside b1, b2 and c1", got });
        }
        match (self.b1, self.b2, self.c1) {
            (None, ..) => missing("bending.b1", "a value ≥ b2 in N m beside b2 and c1"),
            (_, None, _) => missing("bending.b2", "a value > 0 in N m beside b1 and c1"),
            (Some(b1), Some(b2), None) if b1 != b2 => {
                missing("bending.c1", "a value < 0 in N m² beside b1 and b2")
            }
            (Some(b1), Some(b2), c1) => Curve::new(b1, b2, c1.unwrap_or(0.0)),
        }
    }
}

impl HysteresisBending {
    /// The law.
    ///
    /// # Errors
    /// As [`NonlinearBending::curve`] and [`Hysteresis::new`].
    pub fn law(&self) -> Result<Hysteresis, CoreError> {
        let Self { rigidity, coercive_couple, transition_curvature, b1, b2, c1, .. } = *self;
        let curve = NonlinearBending {
            rigidity,
            coercive_couple,
            transition_curvature,
            b1,
            b2,
            c1,
            ..NonlinearBending::default()
        };
        Hysteresis::new(curve.curve()?, self.plasticity, self.fatigue)
    }
}

impl PlasticBending {
    /// The law.
    ///
    /// # Errors
    /// As [`Plastic::new`].
    pub fn law(&self) -> Result<Plastic, CoreError> {
        Plastic::new(self.rigidity, self.elastic_limit, self.hardening)
    }
}

impl Bending {
    /// Moment over curvature; none without a law of that kind (no bending, springs).
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn law(&self) -> Result<Option<Law>, CoreError> {
        Ok(match self {
            Self::None | Self::Spring { .. } => None,
            Self::Hinge { rigidity, .. } => Some(Law::Linear(Linear::new(*rigidity)?)),
            Self::Nonlinear(law) => Some(Law::Nonlinear(law.curve()?)),
            Self::Plastic(law) => Some(Law::Plastic(law.law()?)),
            Self::Hysteresis(law) => Some(Law::Hysteresis(law.law()?)),
        })
    }

    /// How its hinges answer to each other; none without hinges.
    pub fn hinges(&self) -> Option<HingeCoupling> {
        match self {
            Self::None | Self::Spring { .. } => None,
            Self::Hinge { hinges, .. } => Some(*hinges),
            Self::Nonlinear(law) => Some(law.hinges),
            Self::Plastic(law) => Some(law.hinges),
            Self::Hysteresis(law) => Some(law.hinges),
        }
    }

    /// The same law with hinges that answer to each other as asked for; as it is without hinges.
    #[must_use]
    pub fn with_hinges(mut self, coupling: HingeCoupling) -> Self {
        match &mut self {
            Self::None | Self::Spring { .. } => {}
            Self::Hinge { hinges, .. } => *hinges = coupling,
            Self::Nonlinear(law) => law.hinges = coupling,
            Self::Plastic(law) => law.hinges = coupling,
            Self::Hysteresis(law) => law.hinges = coupling,
        }
        self
    }

    /// Refuses values that give no law.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] or [`CoreError::Missing`] naming the first such value.
    pub fn check(&self) -> Result<(), CoreError> {
        let time = |got| not_negative(&[("bending.damping", "a value ≥ 0 in s", got)]);
        match self {
            Self::None => Ok(()),
            Self::Spring { stiffness, damping } => not_negative(&[
                ("bending.stiffness", "a value ≥ 0 in N/m", *stiffness),
                ("bending.damping", "a value ≥ 0 in N s/m", *damping),
            ]),
            Self::Hinge { rigidity, damping, .. } => Linear::new(*rigidity).and(time(*damping)),
            Self::Nonlinear(law) => law.curve().and(time(law.damping)),
            Self::Plastic(law) => law.law().and(time(law.damping)),
            Self::Hysteresis(law) => law.law().and(time(law.damping)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEASURED: HysteresisBending = HysteresisBending {
        rigidity: Some(5e-6),
        coercive_couple: Some(4e-4),
        transition_curvature: None,
        b1: None,
        b2: None,
        c1: None,
        plasticity: 0.1,
        fatigue: 0.02,
        damping: 0.0,
        hinges: HingeCoupling::Coupled,
    };

    fn name(bending: Bending) -> &'static str {
        match bending.check() {
            Err(CoreError::Parameter { name, .. } | CoreError::Missing { name, .. }) => name,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn measured_values_and_coefficients_give_the_same_law() {
        let law = MEASURED.law().unwrap();
        let curve = Curve::measured(5e-6, 4e-4, 50.0).unwrap();
        let given = HysteresisBending {
            b1: Some(curve.b1()),
            b2: Some(curve.b2()),
            c1: Some(curve.c1()),
            rigidity: None,
            coercive_couple: None,
            ..MEASURED
        };
        assert_eq!(given.law().unwrap(), law);
    }

    #[test]
    fn what_is_missing_or_too_much_is_named() {
        let hysteresis = Bending::Hysteresis;
        assert_eq!(name(hysteresis(HysteresisBending::default())), "bending.rigidity");
        assert_eq!(
            name(hysteresis(HysteresisBending { coercive_couple: None, ..MEASURED })),
            "bending.coercive_couple"
        );
        assert_eq!(name(hysteresis(HysteresisBending { b1: Some(1.0), ..MEASURED })), "bending.rigidity");
        let half = NonlinearBending { b1: Some(2.0), b2: Some(1.0), ..NonlinearBending::default() };
        assert_eq!(name(Bending::Nonlinear(half)), "bending.c1");
        assert_eq!(name(Bending::Nonlinear(NonlinearBending { b2: None, ..half })), "bending.b2");
        assert_eq!(name(hysteresis(HysteresisBending { plasticity: 1.5, ..MEASURED })), "bending.plasticity");
        assert_eq!(name(hysteresis(HysteresisBending { fatigue: -0.1, ..MEASURED })), "bending.fatigue");
        assert_eq!(name(hysteresis(HysteresisBending { damping: f64::NAN, ..MEASURED })), "bending.damping");
        let plastic = PlasticBending {
            rigidity: 1.0,
            elastic_limit: 0.0,
            hardening: 0.0,
            damping: 0.0,
            hinges: HingeCoupling::Coupled,
        };
        assert_eq!(name(Bending::Plastic(plastic)), "bending.elastic_limit");
    }

    #[test]
    fn reads_what_it_writes_and_refuses_unknown_keys() {
        let text = serde_json::to_string(&Bending::Hysteresis(MEASURED)).unwrap();
        assert_eq!(serde_json::from_str::<Bending>(&text).unwrap(), Bending::Hysteresis(MEASURED));
        let linear: Bending = serde_json::from_str(r#"{"model": "linear", "rigidity": 1.0}"#).unwrap();
        assert_eq!(linear, Bending::Hinge { rigidity: 1.0, damping: 0.0, hinges: HingeCoupling::Coupled });
        let error = serde_json::from_str::<Bending>(r#"{"model": "hysteresis", "b4": 1.0}"#).unwrap_err();
        assert!(error.to_string().contains("b4"), "{error}");
        assert!(serde_json::from_str::<Bending>(r#"{"model": "rubber"}"#).is_err());
    }
}
