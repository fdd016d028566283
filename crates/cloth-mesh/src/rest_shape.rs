//! The undeformed geometry of each triangle, in material coordinates.

use crate::{MeshError, TriMesh, Vec3};

/// Rest geometry per triangle: material coordinates relative to the first corner, their inverse, and the area.
#[derive(Debug, Clone, PartialEq)]
pub struct RestShape {
    /// `[[du1, du2], [dv1, dv2]]⁻¹` row by row \[1/m\], so that `[w_u w_v] = [dx1 dx2] · inverse`.
    pub inverse: Vec<[[f64; 2]; 2]>,
    /// Area [m²].
    pub area: Vec<f64>,
    /// Rest length of each triangle's sides (01, 12, 20) [m].
    pub side_lengths: Vec<[f64; 3]>,
}

impl RestShape {
    /// Rest shape from the mesh's UV panels where it has them, else from its 3D positions; there u is the
    /// direction of `warp` projected into each triangle's plane (any direction where that vanishes).
    ///
    /// # Errors
    /// [`MeshError::ZeroArea`] naming the triangle whose panel has no area.
    pub fn new(_mesh: &TriMesh, _warp: Vec3) -> Result<Self, MeshError> {
        todo!()
    }
}
