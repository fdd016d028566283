//! What holds for the whole scene: axes, time, air, contact.

use super::{Friction, PairFriction};
use cloth_core::{IntegratorParams, Method, Psd};
use serde::{Deserialize, Serialize};

/// Which axis points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Up {
    /// +y.
    #[default]
    Y,
    /// +z.
    Z,
}

/// Size of the time step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum TimeStep {
    /// So long [s], > 0: a run divides each frame into equal steps of at most this.
    Seconds(f64),
    /// As long as its estimated error allows, see `dt_tolerance`.
    Auto(AutoStep),
}

/// The step is chosen by its error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AutoStep {
    /// The only choice.
    Auto,
}

/// Time step and integrator.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Time {
    /// Largest time step [s], > 0: a run divides each frame into equal steps of at most this. Or "auto": as large as
    /// `dt_tolerance` allows.
    pub dt: TimeStep,
    /// Error of the positions that `dt = "auto"` aims at [m], > 0: no step may add more than a tenth of it at any cloth vertex.
    pub dt_tolerance: f64,
    /// Largest step of `dt = "auto"` [s], > 0.
    pub dt_max: f64,
    /// Integration scheme.
    pub integrator: Method,
    /// What the implicit schemes do about indefinite element matrices.
    pub indefinite: Psd,
    /// Newton's method stops at this residual relative to its first (`implicit-newton`), > 0.
    pub newton_tolerance: f64,
    /// Newton's method stops after this many iterations (`implicit-newton`), ≥ 1.
    pub newton_max_iterations: usize,
    /// α: explicit sub-steps for bending in one step (`semi-implicit`), ≥ 1.
    pub bending_substeps: usize,
    /// How often a step that fails is halved before the run stops, 0 to 16; it grows back after some that succeed.
    pub max_halvings: u32,
    /// Floor of the size of a step that fails, or of one of `dt = "auto"` [s], > 0: none is made smaller.
    pub dt_min: f64,
}

impl Time {
    /// The size of steps [s]; none where their error decides.
    pub fn fixed(&self) -> Option<f64> {
        match self.dt {
            TimeStep::Seconds(dt) => Some(dt),
            TimeStep::Auto(_) => None,
        }
    }

    /// Largest step [s].
    pub fn largest(&self) -> f64 {
        self.fixed().unwrap_or(self.dt_max)
    }
}

impl Default for Time {
    fn default() -> Self {
        let core = IntegratorParams::default();
        Self {
            dt: TimeStep::Seconds(0.005),
            dt_tolerance: 1e-3,
            dt_max: 0.04,
            integrator: core.method,
            indefinite: core.psd,
            newton_tolerance: core.newton_tolerance,
            newton_max_iterations: core.newton_max_iterations,
            bending_substeps: core.bending_substeps,
            max_halvings: 6,
            dt_min: 1e-9,
        }
    }
}

/// Air.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Air {
    /// Velocity of the wind [m/s].
    pub wind: [f64; 3],
    /// Density of the air [kg/m³], ≥ 0.
    pub density: f64,
    /// Drag coefficient of the cloth [-], ≥ 0.
    pub drag: f64,
    /// Lift coefficient of the cloth [-], ≥ 0.
    pub lift: f64,
    /// Damping proportional to mass, relative to the wind [1/s], ≥ 0.
    pub damping: f64,
}

impl Default for Air {
    fn default() -> Self {
        Self { wind: [0.0; 3], density: 1.2, drag: 0.0, lift: 0.0, damping: 0.0 }
    }
}

/// How contact with colliders is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ContactMethod {
    /// Impulses after the dynamics (Bridson et al. 2002).
    #[default]
    VelocityFilter,
    /// Constraints in the implicit solve for cloth vertices on colliders (Baraff and Witkin 1998); impulses for the rest.
    Constraints,
}

/// Contact of cloth with itself, other cloth and colliders.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Contact {
    /// How contact with colliders is kept: "velocity-filter", or "constraints" (implicit integrators only).
    pub method: ContactMethod,
    /// Distance at which surfaces rest on each other [m], > 0.
    pub thickness: f64,
    /// Continuous detection: "auto" (the cheapest of those that the device has, measured during the run; named in plan and
    /// report), "bvh", "session" (skips tree updates in coherent motion) or "brute" (every pair, the oracle) on the CPU, "grid",
    /// "virtual-subdivision", "octree-single" or "octree" on a GPU. Results do not depend on it.
    pub detector: String,
    /// Whether cloth meets itself; a piece of cloth may opt out with its own `self_collision`.
    #[serde(rename = "self")]
    pub self_collision: bool,
    /// Friction of cloth on colliders: Coulomb's coefficient [-], ≥ 0, or a table with a law; a collider, a piece of cloth or
    /// a pair may have its own.
    pub friction: Friction,
    /// Friction of cloth on cloth, as `friction`; a piece of cloth or a pair may have its own.
    pub self_friction: Friction,
    /// Friction of single pairs of bodies, before all other entries.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pairs: Vec<PairFriction>,
    /// Stiffness of the repulsion of one contact within the thickness [N/m], ≥ 0.
    pub repulsion_stiffness: f64,
    /// Detection passes answered with impulses, ≥ 1.
    pub max_passes: usize,
    /// Detection passes answered with rigid impact zones.
    pub max_zone_passes: usize,
    /// Runs from a start with intersections, makes none worse and reports their number.
    pub allow_intersections: bool,
}

impl Default for Contact {
    fn default() -> Self {
        let response = cloth_response::ResponseParams::default();
        Self {
            method: ContactMethod::default(),
            thickness: response.thickness,
            detector: "auto".into(),
            self_collision: true,
            friction: Friction::Coefficient(0.3),
            self_friction: Friction::Coefficient(0.2),
            pairs: Vec::new(),
            repulsion_stiffness: response.repulsion_stiffness,
            max_passes: response.max_passes,
            max_zone_passes: response.max_zone_passes,
            allow_intersections: response.allow_initial_contacts,
        }
    }
}
