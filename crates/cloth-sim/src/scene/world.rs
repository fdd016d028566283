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

/// Time step and integrator.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Time {
    /// Largest time step [s], > 0. A run divides each frame into equal steps of at most this.
    pub dt: f64,
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
    /// How often a step that fails is halved before the run stops.
    pub max_halvings: u32,
}

impl Default for Time {
    fn default() -> Self {
        let core = IntegratorParams::default();
        Self {
            dt: 0.005,
            integrator: core.method,
            indefinite: core.psd,
            newton_tolerance: core.newton_tolerance,
            newton_max_iterations: core.newton_max_iterations,
            bending_substeps: core.bending_substeps,
            max_halvings: 6,
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
