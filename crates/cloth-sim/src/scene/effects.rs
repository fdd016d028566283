//! Effects that may be left out where they cannot matter, and cloth that may sleep.

use serde::{Deserialize, Serialize};

/// What the engine may decide by itself. By default everything that the scene holds runs in every step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Effects {
    /// The search of cloth near itself: "auto" passes over surfaces whose normals and contour prove that they do not come near
    /// themselves. Results do not depend on it.
    pub self_collision: Choice,
    /// The continuous detection of a step: "auto" leaves out vertices that do not move far enough to carry a pair across its gap, and
    /// the detection where there are no others. Results do not depend on it.
    pub ccd: Choice,
    /// Terms of friction that depend on speed: "auto" takes steps in which no contact is fast enough for them with Coulomb's law and
    /// the coefficients at rest.
    pub friction: Choice,
    /// Largest relative error that `friction = "auto"` may make in a coefficient [-], in (0, 1).
    pub friction_tolerance: f64,
    /// What hinges of laws with memory (`plastic`, `hysteresis`) remember: "auto" begins with it where a hinge leaves the elastic range.
    /// Results of the plastic law do not depend on it.
    pub history: Choice,
    /// Largest error that `history = "auto"` may make in a hinge's moment, as a share of the frictional moment of its law
    /// (`hysteresis`) [-], in (0, 1).
    pub history_tolerance: f64,
    /// The account of energy in every step, as it is kept anyway where contact touches: mechanical energy, work of pins and of air.
    pub energy_account: bool,
    /// Cloth that has come to rest is no longer stepped until something that moves comes near; without this table none sleeps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sleep: Option<Sleep>,
}

impl Default for Effects {
    fn default() -> Self {
        let on = Choice::On;
        Self {
            self_collision: on,
            ccd: on,
            friction: on,
            friction_tolerance: 0.01,
            history: on,
            history_tolerance: 0.01,
            energy_account: false,
            sleep: None,
        }
    }
}

impl Effects {
    /// Whether the engine decides nothing.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// Whether an effect runs in every step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Choice {
    /// Everywhere, in every step.
    #[default]
    On,
    /// Where it is not proved to be without effect.
    Auto,
}

/// When cloth sleeps: all vertices of it and of all cloth that it touches have been slower than `speed` for `time`. What it would
/// have crept is missed: at most `speed` times the time that it sleeps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sleep {
    /// Largest speed of a vertex that counts as rest [m/s], > 0.
    pub speed: f64,
    /// How long it must have lasted [s], > 0.
    pub time: f64,
}

impl Default for Sleep {
    fn default() -> Self {
        Self { speed: 2e-3, time: 0.25 }
    }
}
