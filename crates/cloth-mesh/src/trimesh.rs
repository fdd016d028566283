//! Vertices and triangles as they come in.

use crate::{MeshError, Vec3};

/// A triangle counts as having no area if its computed area is at most this many units in the last place of
/// (longest side × largest coordinate). The cross product of two sides, each the difference of coordinates of
/// that size, is only known to about that: below it the area and the normal are rounding noise.
const ZERO_AREA_ULPS: f64 = 8.0;

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
    /// unreferenced vertices, a UV array of the wrong length or with non-finite entries.
    ///
    /// Non-manifold edges are legal here (colliders may have them): see [`crate::Topology::require_manifold`].
    ///
    /// # Errors
    /// The first defect, in the order above.
    pub fn check(&self) -> Result<(), MeshError> {
        if self.triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        self.check_finite()?;
        let vertex_count = self.vertices.len();
        for (triangle, corners) in self.triangles.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&v| v as usize >= vertex_count) {
                return Err(MeshError::IndexOutOfRange { triangle, index: i64::from(index), vertex_count });
            }
        }
        for (triangle, &vertices) in self.triangles.iter().enumerate() {
            let p = vertices.map(|v| self.vertices[v as usize]);
            let area = triangle_area(&p);
            let repeated =
                vertices[0] == vertices[1] || vertices[1] == vertices[2] || vertices[2] == vertices[0];
            if repeated || area <= zero_area_bound(&p) {
                return Err(MeshError::ZeroArea { triangle, vertices, area });
            }
        }
        self.check_referenced()?;
        self.check_uv()
    }

    /// Refuses non-finite coordinates only, e.g. for a frame of an animated mesh whose triangles are known to be good.
    ///
    /// # Errors
    /// [`MeshError::NotFinite`] with the first such vertex.
    pub fn check_finite(&self) -> Result<(), MeshError> {
        match self.vertices.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            Some(vertex) => Err(MeshError::NotFinite { vertex, position: self.vertices[vertex].into() }),
            None => Ok(()),
        }
    }

    fn check_referenced(&self) -> Result<(), MeshError> {
        let mut used = vec![false; self.vertices.len()];
        for &v in self.triangles.iter().flatten() {
            used[v as usize] = true;
        }
        match used.iter().position(|u| !u) {
            Some(vertex) => {
                Err(MeshError::Unreferenced { vertex, count: used.iter().filter(|u| !**u).count() })
            }
            None => Ok(()),
        }
    }

    fn check_uv(&self) -> Result<(), MeshError> {
        let Some(uv) = &self.uv else { return Ok(()) };
        if uv.len() != self.triangles.len() {
            return Err(MeshError::UvLength { expected: self.triangles.len(), got: uv.len() });
        }
        match uv.iter().position(|corners| !corners.iter().flatten().all(|c| c.is_finite())) {
            Some(triangle) => Err(MeshError::UvNotFinite { triangle, uv: uv[triangle] }),
            None => Ok(()),
        }
    }

    /// The corners of `triangle` [m].
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|v| self.vertices[v as usize])
    }

    /// Total area Σ ½|(b−a)×(c−a)| [m²].
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|t| triangle_area(&self.corners(t))).sum()
    }

    /// Signed volume Σ a·(b×c)/6 [m³]: positive for a closed surface with outward normals; meaningless for an open one.
    pub fn signed_volume(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    /// Lowest and highest coordinates [m]; `None` without vertices.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(lo, hi), p| (lo.inf(p), hi.sup(p))))
    }

    /// Moves all vertices by `offset` [m].
    pub fn translate(&mut self, offset: Vec3) {
        for p in &mut self.vertices {
            *p += offset;
        }
    }

    /// Turns all vertices about the origin by a unit quaternion.
    pub fn rotate(&mut self, rotation: &nalgebra::UnitQuaternion<f64>) {
        for p in &mut self.vertices {
            *p = rotation * *p;
        }
    }

    /// Multiplies positions and UV by `factor` [-] (> 0 keeps the orientation).
    pub fn scale(&mut self, factor: f64) {
        for p in &mut self.vertices {
            *p *= factor;
        }
        for c in self.uv.iter_mut().flatten().flatten().flatten() {
            *c *= factor;
        }
    }

    /// Appends another mesh's vertices and triangles. UV is kept only if both have it.
    pub fn append(&mut self, other: &TriMesh) {
        let first = self.vertices.len() as u32;
        self.uv = match (self.uv.take(), &other.uv) {
            (Some(mut own), Some(more)) => {
                own.extend_from_slice(more);
                Some(own)
            }
            _ => None,
        };
        self.vertices.extend_from_slice(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    }
}

/// Area ½|(b−a)×(c−a)| of a triangle [m²].
pub(crate) fn triangle_area(p: &[Vec3; 3]) -> f64 {
    0.5 * (p[1] - p[0]).cross(&(p[2] - p[0])).norm()
}

/// Area [m²] below which a triangle's area cannot be told from zero.
pub(crate) fn zero_area_bound(p: &[Vec3; 3]) -> f64 {
    let longest = (p[1] - p[0]).norm().max((p[2] - p[1]).norm()).max((p[0] - p[2]).norm());
    let largest = p.iter().fold(0.0_f64, |m, q| m.max(q.amax()));
    ZERO_AREA_ULPS * f64::EPSILON * longest * largest.max(longest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> TriMesh {
        TriMesh {
            vertices: vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            uv: None,
        }
    }

    #[test]
    fn a_sound_mesh_passes() {
        assert_eq!(tetrahedron().check(), Ok(()));
    }

    #[test]
    fn each_defect_is_named() {
        assert_eq!(TriMesh::default().check(), Err(MeshError::Empty));

        let mut mesh = tetrahedron();
        mesh.vertices[2].y = f64::NAN;
        assert!(matches!(mesh.check(), Err(MeshError::NotFinite { vertex: 2, .. })));
        mesh.vertices[2].y = f64::INFINITY;
        assert!(matches!(mesh.check(), Err(MeshError::NotFinite { vertex: 2, .. })));

        let mut mesh = tetrahedron();
        mesh.triangles[1][2] = 4;
        assert_eq!(mesh.check(), Err(MeshError::IndexOutOfRange { triangle: 1, index: 4, vertex_count: 4 }));

        let mut mesh = tetrahedron();
        mesh.triangles[3] = [1, 1, 3];
        assert!(matches!(mesh.check(), Err(MeshError::ZeroArea { triangle: 3, .. })));

        let mut mesh = tetrahedron();
        mesh.vertices.push(Vec3::new(5.0, 5.0, 5.0));
        mesh.vertices.push(Vec3::new(6.0, 5.0, 5.0));
        assert_eq!(mesh.check(), Err(MeshError::Unreferenced { vertex: 4, count: 2 }));

        let mut mesh = tetrahedron();
        mesh.uv = Some(vec![[[0.0; 2]; 3]; 3]);
        assert_eq!(mesh.check(), Err(MeshError::UvLength { expected: 4, got: 3 }));

        let mut mesh = tetrahedron();
        mesh.uv = Some(vec![[[0.0; 2]; 3]; 4]);
        mesh.uv.as_mut().unwrap()[2][1][0] = f64::NAN;
        assert!(matches!(mesh.check(), Err(MeshError::UvNotFinite { triangle: 2, .. })));
    }

    #[test]
    fn collinear_points_have_no_area_whatever_their_rounding() {
        for scale in [1e-6, 0.1, 1.0, 1e5] {
            for shift in [0.0, 1.0, 1e4] {
                let at =
                    |s: f64| Vec3::new(shift + 0.1 * s * scale, shift - 0.7 * s * scale, 0.3 * s * scale);
                let mesh = TriMesh {
                    vertices: vec![at(0.0), at(0.3), at(1.1)],
                    triangles: vec![[0, 1, 2]],
                    uv: None,
                };
                assert!(
                    matches!(mesh.check(), Err(MeshError::ZeroArea { triangle: 0, .. })),
                    "scale {scale} shift {shift}"
                );
            }
        }
    }

    #[test]
    fn a_thin_but_real_triangle_passes() {
        // Height 1e-9 of the longest side: far above the rounding of coordinates of that size.
        let mesh = TriMesh {
            vertices: vec![Vec3::zeros(), Vec3::x(), Vec3::new(0.5, 1e-9, 0.0)],
            triangles: vec![[0, 1, 2]],
            uv: None,
        };
        assert_eq!(mesh.check(), Ok(()));
        // A tiny one, a micrometre across, too.
        let mut mesh = tetrahedron();
        mesh.scale(1e-6);
        assert_eq!(mesh.check(), Ok(()));
    }

    #[test]
    fn volume_area_and_transforms() {
        let mut mesh = tetrahedron();
        assert!((mesh.signed_volume() - 1.0 / 6.0).abs() < 1e-15);
        assert!((mesh.area() - (1.5 + 0.75_f64.sqrt())).abs() < 1e-15);
        mesh.rotate(&nalgebra::UnitQuaternion::from_axis_angle(&Vec3::z_axis(), std::f64::consts::FRAC_PI_2));
        assert!((mesh.vertices[1] - Vec3::y()).norm() < 1e-15);
        mesh.translate(Vec3::new(1.0, 2.0, 3.0));
        assert!((mesh.signed_volume() - 1.0 / 6.0).abs() < 1e-14);
        mesh.scale(2.0);
        assert!((mesh.signed_volume() - 8.0 / 6.0).abs() < 1e-13);
        let (lo, hi) = mesh.bounds().unwrap();
        assert!(
            (lo - Vec3::new(0.0, 4.0, 6.0)).norm() < 1e-14 && (hi - Vec3::new(2.0, 6.0, 8.0)).norm() < 1e-14
        );
        let other = mesh.clone();
        mesh.append(&other);
        assert_eq!(mesh.triangles[4], [4, 6, 5]);
        assert_eq!(mesh.check(), Ok(()));
    }
}
