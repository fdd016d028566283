//! Scene, effect plan, step loop, reports, checkpoints: the engine as one object.
//!
//! A [`Scene`] says what there is; a [`Simulation`] is built from it and from the [`Assets`] that it names, holds the
//! state and steps it. The [`Plan`] says beforehand which effects run and why, the [`Report`] afterwards what each
//! cost.
//!
//! One global vertex array: the vertices of all cloth in scene order, then those of all colliders. Prescribed vertices
//! (colliders, pins) have a known end of each step and infinite mass.

#![allow(clippy::result_large_err, reason = "an error ends the load or the run: its size costs nothing")]

pub use cloth_collision as collision;
pub use cloth_core as core;
#[cfg(feature = "gpu")]
pub use cloth_gpu as gpu;
pub use cloth_response as response;

pub mod device;
pub mod friction;
pub mod scene;

mod assets;
mod auto_step;
mod bodies;
mod checkpoint;
mod constraints;
mod contact;
mod cost;
mod error;
mod guard;
mod ledger;
mod motion;
mod pace;
mod pins;
mod plan;
mod precision;
mod regions;
mod report;
mod restart;
mod seams;
mod simulation;
mod sleep;
mod steer;
mod step;
mod untangle;

pub use assets::{Assets, Sequence};
pub use bodies::{BodyInfo, BodyKind};
pub use checkpoint::Continued;
pub use error::SimError;
pub use pace::Advance;
pub use plan::{Effect, Plan};
pub use report::{
    Chosen, ContactReport, Detection, EffectCost, EnergyReport, Fallback, Refused, Report, StepReport, Totals,
};
pub use scene::{Scene, SceneError};
pub use simulation::{Simulation, SimulationOptions};
pub use untangle::Untangled;

use cloth_core::mesh::Vec3;
