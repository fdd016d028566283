//! What touches what, on the CPU: bounds, broad phase, continuous and discrete narrow phase, proximity, intersections.
//!
//! Nouns: a [`CollisionMesh`] is the scene's fixed topology (built once); a [`Detector`] finds, for a [`Query`]
//! (positions at both ends of a step, a thickness), the [`Contacts`]: every vertex-triangle and edge-edge pair that
//! shares no vertex and comes within the thickness. No miss, ever: bounds are closed, filters carry derived error
//! bounds, and what cannot be decided is a contact. [`BruteForce`] is the oracle of [`Bvh`].
//!
//! Lengths are in metres, times are fractions of the step in \[0, 1\].

#![allow(
    clippy::inline_always,
    reason = "arithmetic in lanes must land in the function that enables the instructions"
)]
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "what is not a number must fall on the safe side: the negation of the comparison that would reject"
)]

pub use cloth_mesh as mesh;

pub mod ccd;
pub mod distance;
pub mod shapes;

mod bounds;
mod brute;
mod bvh;
mod collision_mesh;
mod contact;
mod detector;
mod edges;
mod error;
mod intersect;
mod narrow;
mod nearest;
mod session;
mod stencil;

pub use brute::BruteForce;
pub use bvh::Bvh;
pub use ccd::{edge_edge_ccd, vertex_triangle_ccd};
pub use collision_mesh::{Body, CollisionMesh};
pub use contact::{Contacts, DetectStats, Mode, Query};
pub use detector::{Detector, detector, detector_in};
pub use error::DetectError;
pub use intersect::{intersections, self_intersections};
pub use narrow::NarrowPhase;
pub use nearest::Nearest;
pub use session::{
    Adapt, FrameKind, Frames, MOST_FRAMES, SessionOptions, SessionStats, SkippingSession, Variant,
};
pub use stencil::{Stencil, StencilKind, stencil_at_contact_edge_edge, stencil_at_contact_vertex_triangle};

/// A point [m] in space.
pub type Vec3 = cloth_mesh::Vec3;
