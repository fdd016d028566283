//! Rest shape and topology of cloth: what is shared by everything above, with no solver and no device.
//!
//! Three nouns: a [`TriMesh`] is vertices and triangles as they come in; a [`Topology`] is what follows from
//! the triangles alone (edges, hinges, adjacency, boundary); a [`RestShape`] is the undeformed geometry in
//! material coordinates, from 3D or from UV panels in metres.

pub mod generators;

mod error;
mod rest_shape;
mod topology;
mod trimesh;
mod vertex_triangles;

pub use error::MeshError;
pub use rest_shape::RestShape;
pub use topology::{Hinge, Topology};
pub use trimesh::TriMesh;
pub use vertex_triangles::VertexTriangles;

/// A point [m], velocity [m/s] or force [N] in space.
pub type Vec3 = nalgebra::Vector3<f64>;

/// "No such element" in index arrays.
pub const NONE: u32 = u32::MAX;
