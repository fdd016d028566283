//! Vertices and triangles as they come in.

use crate::{MeshError, Vec3};

/// A triangle mesh: positions [m], triangles, and optionally material coordinates per triangle corner [m].
///
/// Nothing is checked on construction; see [`TriMesh::check`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TriMesh {
    /// Vertex positions [m].
    pub vertices: Vec<Vec3>,
    /// Vertex indices of each triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Material coordinates (u along the warp, v along the weft) of each triangle's corners [m]. Per corner,
    /// because a vertex on a seam lies in two panels.
    pub uv: Option<Vec<[[f64; 2]; 3]>>,
}

impl TriMesh {
    /// Refuses what no scene can use: no triangle, non-finite vertices, indices out of range, triangles without area,
    /// unreferenced vertices, a UV array of the wrong length.
    ///
    /// Non-manifold edges are legal here (colliders may have them): see [`crate::Topology::require_manifold`].
    ///
    /// # Errors
    /// The first defect, in the order above.
    pub fn check(&self) -> Result<(), MeshError> {
        todo!()
    }
}
