//! The undeformed geometry of each triangle, in material coordinates.

use crate::trimesh::zero_area_bound;
use crate::{MeshError, TriMesh, Vec3};

/// A warp direction closer than this to a triangle's normal (sine of the angle between them) gives no direction in
/// the triangle's plane: what projection leaves is then rounding, and the triangle's first side is used instead.
const WARP_MIN_SINE: f64 = 1e-6;

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
    /// [`MeshError::ZeroArea`] or [`MeshError::ZeroAreaUv`] naming the triangle whose panel has no area.
    pub fn new(mesh: &TriMesh, warp: Vec3) -> Result<Self, MeshError> {
        match &mesh.uv {
            Some(uv) => Self::from_uv(uv),
            None => Self::from_positions(mesh, warp),
        }
    }

    /// Rest shape from panels in metres, one `[u, v]` per triangle corner. A mirrored panel is as good as any.
    ///
    /// # Errors
    /// [`MeshError::ZeroAreaUv`] naming the triangle whose panel has no area.
    pub fn from_uv(uv: &[[[f64; 2]; 3]]) -> Result<Self, MeshError> {
        let mut shape = Self::with_capacity(uv.len());
        for (triangle, corners) in uv.iter().enumerate() {
            let p = corners.map(|[u, v]| Vec3::new(u, v, 0.0));
            let area = crate::trimesh::triangle_area(&p);
            if area.is_nan() || area <= zero_area_bound(&p) {
                return Err(MeshError::ZeroAreaUv { triangle, area });
            }
            shape.push(corners, area);
        }
        Ok(shape)
    }

    /// Rest shape from the 3D positions, ignoring UV: u along `warp` projected into each triangle's plane, v = n × u.
    ///
    /// # Errors
    /// [`MeshError::ZeroArea`] naming the triangle without area.
    pub fn from_positions(mesh: &TriMesh, warp: Vec3) -> Result<Self, MeshError> {
        let mut shape = Self::with_capacity(mesh.triangles.len());
        let warp_length = warp.norm();
        for (triangle, &vertices) in mesh.triangles.iter().enumerate() {
            let p = mesh.corners(triangle);
            let (side1, side2) = (p[1] - p[0], p[2] - p[0]);
            let cross = side1.cross(&side2);
            let area = 0.5 * cross.norm();
            if area.is_nan() || area <= zero_area_bound(&p) {
                return Err(MeshError::ZeroArea { triangle, vertices, area });
            }
            let normal = cross / (2.0 * area);
            let projected = warp - normal * normal.dot(&warp);
            let along =
                if projected.norm() > WARP_MIN_SINE * warp_length { projected } else { side1 }.normalize();
            let across = normal.cross(&along);
            let local = |d: &Vec3| [d.dot(&along), d.dot(&across)];
            shape.push(&[[0.0; 2], local(&side1), local(&side2)], area);
        }
        Ok(shape)
    }

    fn with_capacity(count: usize) -> Self {
        Self {
            inverse: Vec::with_capacity(count),
            area: Vec::with_capacity(count),
            side_lengths: Vec::with_capacity(count),
        }
    }

    fn push(&mut self, uv: &[[f64; 2]; 3], area: f64) {
        let ([du1, dv1], [du2, dv2]) = (difference(uv[1], uv[0]), difference(uv[2], uv[0]));
        let determinant = du1 * dv2 - du2 * dv1;
        self.inverse.push([[dv2 / determinant, -du2 / determinant], [-dv1 / determinant, du1 / determinant]]);
        self.area.push(area);
        self.side_lengths.push([0, 1, 2].map(|k| {
            let [du, dv] = difference(uv[(k + 1) % 3], uv[k]);
            du.hypot(dv)
        }));
    }
}

fn difference(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generators;

    /// Rounding of a few products of numbers near one.
    const ROUNDING: f64 = 1e-12;

    /// `[w_u w_v]` of a triangle at the given positions.
    fn gradient(shape: &RestShape, triangle: usize, p: &[Vec3; 3]) -> (Vec3, Vec3) {
        let (dx1, dx2, m) = (p[1] - p[0], p[2] - p[0], shape.inverse[triangle]);
        (dx1 * m[0][0] + dx2 * m[1][0], dx1 * m[0][1] + dx2 * m[1][1])
    }

    #[test]
    fn at_rest_the_gradient_is_the_material_frame() {
        // A slanted plane: u along the projected x-axis, both columns of unit length and at right angles.
        let mut mesh = generators::grid(1.0, 2.0, 4, 3).unwrap();
        mesh.uv = None;
        mesh.rotate(&nalgebra::UnitQuaternion::from_axis_angle(&Vec3::z_axis(), 0.4));
        let shape = RestShape::new(&mesh, Vec3::x()).unwrap();
        for t in 0..mesh.triangles.len() {
            let (wu, wv) = gradient(&shape, t, &mesh.corners(t));
            assert!((wu - Vec3::new(0.4_f64.cos(), 0.4_f64.sin(), 0.0)).norm() < ROUNDING);
            assert!((wv + Vec3::z()).norm() < ROUNDING);
        }
        assert!((shape.area.iter().sum::<f64>() - 2.0).abs() < ROUNDING);
    }

    #[test]
    fn uv_and_positions_agree_on_a_flat_sheet() {
        let mut mesh = generators::grid(1.0, 2.0, 4, 3).unwrap();
        let from_uv = RestShape::new(&mesh, Vec3::z()).unwrap();
        mesh.uv = None;
        let from_positions = RestShape::new(&mesh, Vec3::x()).unwrap();
        for t in 0..mesh.triangles.len() {
            assert!((from_uv.area[t] - from_positions.area[t]).abs() < ROUNDING);
            for k in 0..3 {
                assert!((from_uv.side_lengths[t][k] - from_positions.side_lengths[t][k]).abs() < ROUNDING);
            }
            for (a, b) in from_uv.inverse[t].iter().flatten().zip(from_positions.inverse[t].iter().flatten())
            {
                assert!((a - b).abs() < 1e-9, "triangle {t}");
            }
        }
    }

    #[test]
    fn a_sheet_smaller_than_its_panel_is_compressed() {
        let mut mesh = generators::grid(1.0, 1.0, 3, 3).unwrap();
        for p in &mut mesh.vertices {
            p.x *= 0.5;
        }
        let shape = RestShape::new(&mesh, Vec3::x()).unwrap();
        let (wu, wv) = gradient(&shape, 0, &mesh.corners(0));
        assert!((wu.norm() - 0.5).abs() < ROUNDING && (wv.norm() - 1.0).abs() < ROUNDING);
    }

    #[test]
    fn warp_along_the_normal_still_gives_a_frame() {
        let mut mesh = generators::grid(1.0, 1.0, 3, 3).unwrap();
        mesh.uv = None;
        for warp in [Vec3::y(), Vec3::zeros()] {
            let shape = RestShape::new(&mesh, warp).unwrap();
            let (wu, wv) = gradient(&shape, 1, &mesh.corners(1));
            assert!((wu.norm() - 1.0).abs() < ROUNDING && wu.dot(&wv).abs() < ROUNDING);
        }
    }

    #[test]
    fn panels_and_triangles_without_area_are_named() {
        let mut mesh = generators::grid(1.0, 1.0, 3, 3).unwrap();
        mesh.uv.as_mut().unwrap()[5] = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]];
        assert!(matches!(RestShape::new(&mesh, Vec3::x()), Err(MeshError::ZeroAreaUv { triangle: 5, .. })));
        mesh.uv.as_mut().unwrap()[4][0][0] = f64::NAN;
        assert!(matches!(RestShape::new(&mesh, Vec3::x()), Err(MeshError::ZeroAreaUv { triangle: 4, .. })));
        mesh.uv = None;
        mesh.triangles[2] = [0, 0, 1];
        assert!(matches!(RestShape::new(&mesh, Vec3::x()), Err(MeshError::ZeroArea { triangle: 2, .. })));
    }
}
