//! Rigid shapes as closed triangle meshes.

use crate::{DetectError, Vec3};
use cloth_mesh::{MeshError, TriMesh, generators};
use parry3d_f64::shape::{Capsule, Cone, Cuboid};

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

/// Fewest segments around an axis, however large the tolerance.
const MIN_SEGMENTS: u32 = 8;
/// Most segments around an axis: a finer tolerance is refused.
const MAX_SEGMENTS: u32 = 8192;
/// Most bands of a quarter circle of a capsule, which has 8 n² vertices: four million.
const MAX_RINGS: u32 = 724;

/// The shape's surface as triangles with outward normals, closed and manifold (the plane: an open square). No point of
/// it is farther than `tolerance` \[m\] from the true surface, nor the other way round; corners lie on it.
///
/// With τ = tolerance / radius: the sphere is a subdivided icosahedron; the capsule's caps are cut into cells of
/// δ × δ rad, whose triangles stay within radius (1 − √cos δ), so cos δ ≥ (1 − τ)²; the cone's segments of angle α
/// stay within radius (1 − cos(α/2)). Box and plane are exact.
///
/// # Errors
/// [`DetectError::Parameter`] for a size or a tolerance that is not positive and finite, or a tolerance too fine for the
/// size (below about 4·10⁻⁷ of the radius; of a capsule's 1.2·10⁻⁶).
pub fn tessellate(shape: &Shape, tolerance: f64) -> Result<TriMesh, DetectError> {
    let tolerance = length("tolerance", tolerance)?;
    match *shape {
        Shape::Sphere { radius } => {
            let radius = length("radius", radius)?;
            generators::sphere_within(radius, tolerance).map_err(|error| match error {
                MeshError::Parameter { parameter, expected, got } => {
                    DetectError::Parameter { parameter, expected, got }
                }
                _ => too_fine(tolerance),
            })
        }
        Shape::Capsule { radius, half_height } => {
            let (radius, half_height) = (length("radius", radius)?, length("half_height", half_height)?);
            let keep = (1.0 - tolerance / radius).max(0.0);
            let rings =
                segments(std::f64::consts::FRAC_PI_2, (keep * keep).acos(), tolerance)?.max(MIN_SEGMENTS / 4);
            if rings > MAX_RINGS {
                return Err(too_fine(tolerance));
            }
            Ok(outward(Capsule::new_y(half_height, radius).to_trimesh(4 * rings, 2 * rings)))
        }
        Shape::Box { half_extents } => {
            let [x, y, z] = half_extents;
            for (name, h) in [("half_extents.x", x), ("half_extents.y", y), ("half_extents.z", z)] {
                length(name, h)?;
            }
            Ok(outward(Cuboid::new(parry3d_f64::math::Vector::new(x, y, z)).to_trimesh()))
        }
        Shape::Plane { half_size } => {
            let h = length("half_size", half_size)?;
            let corner = |x: f64, z: f64| Vec3::new(x * h, 0.0, z * h);
            Ok(TriMesh {
                vertices: vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                uv: None,
            })
        }
        Shape::Cone { radius, height } => {
            let (radius, height) = (length("radius", radius)?, length("height", height)?);
            let half_angle = (1.0 - tolerance / radius).max(0.0).acos();
            let count = segments(std::f64::consts::PI, half_angle, tolerance)?.max(MIN_SEGMENTS);
            let (vertices, triangles) = Cone::new(0.5 * height, radius).to_trimesh(count);
            let mut mesh = outward((vertices, triangles));
            // The base as a fan about its middle: no needles from one corner across the disc.
            let apex = count;
            mesh.triangles.retain(|t| t.contains(&apex));
            let middle = mesh.vertices.len() as u32;
            mesh.vertices.push(Vec3::new(0.0, -0.5 * height, 0.0));
            let base: Vec<[u32; 3]> = mesh
                .triangles
                .iter()
                .map(|t| {
                    let k = (0..3).find(|&k| t[k] == apex).unwrap_or(0);
                    [t[(k + 2) % 3], t[(k + 1) % 3], middle]
                })
                .collect();
            mesh.triangles.extend(base);
            Ok(mesh)
        }
    }
}

fn length(parameter: &'static str, got: f64) -> Result<f64, DetectError> {
    if got > 0.0 && got.is_finite() {
        return Ok(got);
    }
    Err(DetectError::Parameter { parameter, expected: "a positive finite length in m", got })
}

fn too_fine(tolerance: f64) -> DetectError {
    DetectError::Parameter {
        parameter: "tolerance",
        expected: "at least about 4e-7 of the shape's radius in m (1.2e-6 of a capsule's)",
        got: tolerance,
    }
}

/// Pieces of at most `step` rad that make up `total` rad.
fn segments(total: f64, step: f64, tolerance: f64) -> Result<u32, DetectError> {
    let count = (total / step).ceil();
    if count <= f64::from(MAX_SEGMENTS) { Ok(count as u32) } else { Err(too_fine(tolerance)) }
}

/// The mesh with its triangles turned so that it encloses a positive volume.
fn outward((points, mut triangles): (Vec<parry3d_f64::math::Vector>, Vec<[u32; 3]>)) -> TriMesh {
    let vertices: Vec<Vec3> = points.iter().map(|p| Vec3::new(p.x, p.y, p.z)).collect();
    let six_volumes: f64 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| vertices[v as usize]);
            a.dot(&b.cross(&c))
        })
        .sum();
    if six_volumes < 0.0 {
        for triangle in &mut triangles {
            triangle.swap(1, 2);
        }
    }
    TriMesh { vertices, triangles, uv: None }
}
