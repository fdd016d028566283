//! Meshes made by formula: grid, disc, ribbon, cylinder, sphere, capsule, cone, box. Sizes in metres.

use crate::{MeshError, TriMesh};

/// A `width` × `height` rectangle in the xz-plane, centred at the origin, normal +y, with UV in metres.
///
/// `nx` × `ny` vertices, (nx−1)(ny−1) cells of two triangles; diagonals alternate from cell to cell.
///
/// # Errors
/// [`MeshError::Parameter`] for a size that is not positive and finite or fewer than two vertices along a side.
pub fn grid(_width: f64, _height: f64, _nx: usize, _ny: usize) -> Result<TriMesh, MeshError> {
    todo!()
}
