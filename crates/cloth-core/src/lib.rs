//! What moves cloth: material, forces, integrators, the linear solver (chapter 3 of the thesis).
//!
//! Four nouns: a [`Material`] says what the cloth is made of and an [`Environment`] what surrounds it; a
//! [`ClothSystem`] holds the force models of all cloth of a scene, built once; an [`Integrator`] advances positions and
//! velocities over one step. An effect that is off is not built.
//!
//! SI units throughout. Every sum runs in an order that does not depend on the number of threads, so equal input gives
//! equal bits.

#![allow(rustdoc::broken_intra_doc_links, reason = "units and reference keys stand in square brackets")]

pub use cloth_mesh as mesh;

pub mod bending;
mod forces;
pub mod material;
mod solver;

mod assembly;
mod effect;
mod energy;
mod environment;
mod error;
mod integrator;
mod part;
mod system;

pub use effect::EffectInfo;
pub use energy::Energy;
pub use environment::Environment;
pub use error::{CoreError, StepError};
pub use forces::{Psd, stitch::Stitch};
pub use integrator::{
    ActiveSet, Constraint, Integrator, IntegratorParams, Method, Motion, Pins, StepInfo, Work,
};
pub use material::{Bending, HingeCoupling, InPlane, Material};
pub use part::ClothPart;
pub use solver::{SolveError, SolveInfo, SolverMethod, SolverParams};
pub use system::{ClothSystem, History};
