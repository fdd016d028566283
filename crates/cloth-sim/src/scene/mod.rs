//! What to simulate. The types are the schema of scene files: see [`Scene::json_schema`].
//!
//! SI units: m, kg, s, N, rad. Keys that are not known are refused, never skipped.

mod bounds;
mod check;
mod check_garment;
mod cloth;
mod collider;
mod effects;
mod file;
mod friction;
mod garment;
mod generated;
mod motion;
mod output;
mod schema;
mod source;
mod world;

pub use cloth::{
    BoxRegion, Cloth, DiagonalPattern, FabricBending, FabricChoice, Generator, MaterialChoice, MeshSource,
    Pin, RestSource,
};
pub use collider::{Collider, SequenceSource, ShapeSource};
pub use effects::{Choice, Effects, Sleep};
pub use file::FileReference;
pub use friction::{Friction, PairFriction, StrainLimitSource, StrainLimitTable};
pub use garment::{Region, Seam};
pub use motion::{Keyframe, Rotation};
pub use output::Output;
pub use source::{SceneError, nearest};
pub use world::{Air, AutoStep, Contact, ContactMethod, Time, TimeStep, Up};

pub(crate) use bounds::{LENGTH, VELOCITY};
use cloth_core::SolverParams;
use serde::{Deserialize, Serialize};
use source::Source;
use std::sync::Arc;

/// What is done about a start state whose surfaces pass through each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// It is refused with the number of pairs, unless `contact.allow_intersections` is set.
    #[default]
    AsGiven,
    /// Small penetrations are repaired and listed in the report; what is left is refused.
    Untangle,
}

/// A scene: what there is, how it moves, how it is stepped and what is written.
#[derive(Debug, Clone, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Name for reports.
    #[serde(default = "default_name")]
    pub name: String,
    /// Which axis points up; the default gravity follows it.
    #[serde(default)]
    pub up: Up,
    /// Acceleration of gravity [m/s²]; by default 9.81 against `up`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<[f64; 3]>,
    /// Time to simulate [s], > 0.
    pub duration: f64,
    /// Time step and integrator.
    #[serde(default)]
    pub time: Time,
    /// What is done about a start state whose surfaces pass through each other: "as-given" or "untangle".
    #[serde(default)]
    pub start: Start,
    /// Linear solver of the implicit integrators.
    #[serde(default)]
    pub solver: SolverParams,
    /// Air: wind, drag, lift, damping.
    #[serde(default)]
    pub air: Air,
    /// Contact; without this table there is none, and nothing is built for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<Contact>,
    /// What may be left out where it cannot matter.
    #[serde(default, skip_serializing_if = "Effects::is_default")]
    pub effects: Effects,
    /// Pieces of cloth.
    #[serde(default)]
    pub cloth: Vec<Cloth>,
    /// Bodies that move as prescribed.
    #[serde(default)]
    pub collider: Vec<Collider>,
    /// What a run writes.
    #[serde(default)]
    pub output: Output,
    /// Where each key was read, for errors found later.
    #[serde(skip)]
    #[schemars(skip)]
    source: Option<Arc<Source>>,
}

impl PartialEq for Scene {
    /// Equal contents, wherever they were read.
    fn eq(&self, other: &Self) -> bool {
        let content = |s: &Self| serde_json::to_value(s).ok();
        content(self) == content(other)
    }
}

fn default_name() -> String {
    "scene".into()
}

impl Scene {
    /// Acceleration of gravity [m/s²]: as given, else 9.81 m/s² against `up`.
    pub fn gravity(&self) -> [f64; 3] {
        self.gravity.unwrap_or(match self.up {
            Up::Y => [0.0, -STANDARD_GRAVITY, 0.0],
            Up::Z => [0.0, 0.0, -STANDARD_GRAVITY],
        })
    }

    /// The error that `key` has a wrong value, with file and line where the scene was read from a file.
    pub fn error(&self, key: &str, expected: impl Into<String>, got: impl Into<String>) -> SceneError {
        SceneError::new(self.source.as_deref(), key, expected, got)
    }
}

/// Acceleration of gravity where the scene names none [m/s²].
const STANDARD_GRAVITY: f64 = 9.81;
