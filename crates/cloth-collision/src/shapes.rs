//! Rigid shapes as closed triangle meshes.

use crate::DetectError;
use cloth_mesh::TriMesh;

/// A rigid shape, centred at the origin, its axis along +y. Lengths in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// All points within `radius` of the centre.
    Sphere {
        /// Radius [m].
        radius: f64,
    },
    /// All points within `radius` of the segment from (0, −half_height, 0) to (0, half_height, 0).
    Capsule {
        /// Radius [m].
        radius: f64,
        /// Half the length of the segment [m].
        half_height: f64,
    },
    /// |x| ≤ hx, |y| ≤ hy, |z| ≤ hz.
    Box {
        /// (hx, hy, hz) [m].
        half_extents: [f64; 3],
    },
    /// The square |x|, |z| ≤ half_size in the plane y = 0, normal +y. Not closed.
    Plane {
        /// Half the side [m].
        half_size: f64,
    },
    /// Base disc of `radius` at y = −height/2, apex at y = height/2.
    Cone {
        /// Radius of the base [m].
        radius: f64,
        /// Height [m].
        height: f64,
    },
}

/// The shape's surface as triangles with outward normals, closed and manifold (the plane: a square). Every point of
/// it is within `tolerance` \[m\] of the true surface and the other way round.
///
/// # Errors
/// [`DetectError::Parameter`] for a size or a tolerance that is not positive and finite.
pub fn tessellate(_shape: &Shape, _tolerance: f64) -> Result<TriMesh, DetectError> {
    todo!()
}
