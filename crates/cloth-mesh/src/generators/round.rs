//! Bodies of revolution about +y, and the sphere. Vertices lie on the true surface, so meshes are inscribed.

use super::{count, length};
use crate::{MeshError, Topology, TriMesh, Vec3};
use std::f64::consts::TAU;

/// Most times an icosahedron is subdivided: 20·4⁹ = 5.2 million triangles.
const MAX_SUBDIVISIONS: u32 = 9;

/// Vertices of one horizontal circle, counter-clockwise seen from +y.
fn circle(vertices: &mut Vec<Vec3>, radius: f64, y: f64, segments: usize) {
    for k in 0..segments {
        let (sin, cos) = (TAU * k as f64 / segments as f64).sin_cos();
        vertices.push(Vec3::new(radius * cos, y, -radius * sin));
    }
}

/// Triangles between two circles of `segments` vertices, the lower starting at `low`, the upper at `high`.
fn band(triangles: &mut Vec<[u32; 3]>, low: usize, high: usize, segments: usize) {
    for k in 0..segments {
        let (a, b) = ((low + k) as u32, (low + (k + 1) % segments) as u32);
        let (d, c) = ((high + k) as u32, (high + (k + 1) % segments) as u32);
        if k % 2 == 0 {
            triangles.extend([[a, b, c], [a, c, d]]);
        } else {
            triangles.extend([[a, b, d], [b, c, d]]);
        }
    }
}

/// Triangles from a circle to one vertex above (`up`) or below it.
fn fan(triangles: &mut Vec<[u32; 3]>, ring: usize, apex: u32, segments: usize, up: bool) {
    for k in 0..segments {
        let (a, b) = ((ring + k) as u32, (ring + (k + 1) % segments) as u32);
        triangles.push(if up { [a, b, apex] } else { [b, a, apex] });
    }
}

/// A cylinder about the y-axis, centred: `segments` corners, `rows` bands along `height`; with `caps` closed by a fan
/// at both ends, else an open tube with UV (unrolled, without strain; the seam is at +x).
///
/// # Errors
/// [`MeshError::Parameter`] for a size that is not positive and finite, fewer than 3 segments or no row.
pub fn cylinder(
    radius: f64,
    height: f64,
    segments: usize,
    rows: usize,
    caps: bool,
) -> Result<TriMesh, MeshError> {
    length("radius", radius)?;
    length("height", height)?;
    count("segments", segments, 3, "3 to 65535 segments around the axis")?;
    count("rows", rows, 1, "1 to 65535 rows along the axis")?;

    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for row in 0..=rows {
        circle(&mut vertices, radius, height * (row as f64 / rows as f64 - 0.5), segments);
    }
    for row in 0..rows {
        band(&mut triangles, row * segments, (row + 1) * segments, segments);
    }
    if caps {
        let bottom = vertices.len() as u32;
        vertices.push(Vec3::new(0.0, -0.5 * height, 0.0));
        vertices.push(Vec3::new(0.0, 0.5 * height, 0.0));
        fan(&mut triangles, 0, bottom, segments, false);
        fan(&mut triangles, rows * segments, bottom + 1, segments, true);
        return Ok(TriMesh { vertices, triangles, uv: None });
    }
    let chord = 2.0 * radius * (0.5 * TAU / segments as f64).sin();
    let uv = triangles
        .iter()
        .enumerate()
        .map(|(t, corners)| {
            // A corner at the seam belongs to segment 0 or, in the last panel, to `segments`.
            let last_panel = (t / 2) % segments == segments - 1;
            corners.map(|v| {
                let (k, row) = (v as usize % segments, v as usize / segments);
                let k = if last_panel && k == 0 { segments } else { k };
                [chord * k as f64, height * row as f64 / rows as f64]
            })
        })
        .collect();
    Ok(TriMesh { vertices, triangles, uv: Some(uv) })
}

/// A closed cone about the y-axis: base of `radius` at −height/2, apex at +height/2.
///
/// # Errors
/// [`MeshError::Parameter`] for a size that is not positive and finite or fewer than 3 segments.
pub fn cone(radius: f64, height: f64, segments: usize) -> Result<TriMesh, MeshError> {
    length("radius", radius)?;
    length("height", height)?;
    count("segments", segments, 3, "3 to 65535 segments around the axis")?;

    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    circle(&mut vertices, radius, -0.5 * height, segments);
    vertices.push(Vec3::new(0.0, -0.5 * height, 0.0));
    vertices.push(Vec3::new(0.0, 0.5 * height, 0.0));
    fan(&mut triangles, 0, segments as u32, segments, false);
    fan(&mut triangles, 0, segments as u32 + 1, segments, true);
    Ok(TriMesh { vertices, triangles, uv: None })
}

/// A closed capsule about the y-axis: a tube from −`half_height` to +`half_height` of `radius`, a half sphere of
/// `rings` bands at both ends.
///
/// # Errors
/// [`MeshError::Parameter`] for a size that is not positive and finite, fewer than 3 segments or no ring.
pub fn capsule(radius: f64, half_height: f64, segments: usize, rings: usize) -> Result<TriMesh, MeshError> {
    length("radius", radius)?;
    length("half_height", half_height)?;
    count("segments", segments, 3, "3 to 65535 segments around the axis")?;
    count("rings", rings, 1, "1 to 65535 rings in each half sphere")?;

    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for ring in 1..=rings {
        let (sin, cos) = (0.25 * TAU * ring as f64 / rings as f64).sin_cos();
        circle(&mut vertices, radius * sin, -half_height - radius * cos, segments);
    }
    for ring in (1..=rings).rev() {
        let (sin, cos) = (0.25 * TAU * ring as f64 / rings as f64).sin_cos();
        circle(&mut vertices, radius * sin, half_height + radius * cos, segments);
    }
    for ring in 0..2 * rings - 1 {
        band(&mut triangles, ring * segments, (ring + 1) * segments, segments);
    }
    let bottom = vertices.len() as u32;
    vertices.push(Vec3::new(0.0, -half_height - radius, 0.0));
    vertices.push(Vec3::new(0.0, half_height + radius, 0.0));
    fan(&mut triangles, 0, bottom, segments, false);
    fan(&mut triangles, (2 * rings - 1) * segments, bottom + 1, segments, true);
    Ok(TriMesh { vertices, triangles, uv: None })
}

/// A sphere of `radius`: an icosahedron whose triangles are cut into four `subdivisions` times, vertices pushed out to
/// the sphere. 20·4ⁿ triangles, nearly equal.
///
/// # Errors
/// [`MeshError::Parameter`] for a radius that is not positive and finite or more than nine subdivisions.
pub fn sphere(radius: f64, subdivisions: u32) -> Result<TriMesh, MeshError> {
    length("radius", radius)?;
    if subdivisions > MAX_SUBDIVISIONS {
        return Err(MeshError::Parameter {
            parameter: "subdivisions",
            expected: "0 to 9",
            got: f64::from(subdivisions),
        });
    }
    let mut mesh = icosahedron();
    for _ in 0..subdivisions {
        mesh = subdivide_on_unit_sphere(&mesh);
    }
    mesh.scale(radius);
    Ok(mesh)
}

/// The coarsest [`sphere`] whose triangles are nowhere more than `tolerance` [m] inside the true sphere.
///
/// # Errors
/// [`MeshError::Parameter`] for a radius or tolerance that is not positive and finite, or a tolerance that needs more
/// than nine subdivisions (about 4·10⁻⁷ of the radius).
pub fn sphere_within(radius: f64, tolerance: f64) -> Result<TriMesh, MeshError> {
    length("radius", radius)?;
    length("tolerance", tolerance)?;
    for subdivisions in 0..=MAX_SUBDIVISIONS {
        let mesh = sphere(radius, subdivisions)?;
        let deepest = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                radius - (b - a).cross(&(c - a)).normalize().dot(&a)
            })
            .fold(0.0, f64::max);
        if deepest <= tolerance {
            return Ok(mesh);
        }
    }
    Err(MeshError::Parameter {
        parameter: "tolerance",
        expected: "at least 4e-7 of the radius [m]",
        got: tolerance,
    })
}

fn icosahedron() -> TriMesh {
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    let raw = [
        [-1.0, golden, 0.0],
        [1.0, golden, 0.0],
        [-1.0, -golden, 0.0],
        [1.0, -golden, 0.0],
        [0.0, -1.0, golden],
        [0.0, 1.0, golden],
        [0.0, -1.0, -golden],
        [0.0, 1.0, -golden],
        [golden, 0.0, -1.0],
        [golden, 0.0, 1.0],
        [-golden, 0.0, -1.0],
        [-golden, 0.0, 1.0],
    ];
    let triangles = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    TriMesh { vertices: raw.iter().map(|p| Vec3::from(*p).normalize()).collect(), triangles, uv: None }
}

fn subdivide_on_unit_sphere(mesh: &TriMesh) -> TriMesh {
    let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
    let mut vertices = mesh.vertices.clone();
    let first = vertices.len() as u32;
    for &[a, b] in &topology.edges {
        vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
    }
    let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
    for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        let [ab, bc, ca] = topology.triangle_edges[t].map(|e| first + e);
        triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    TriMesh { vertices, triangles, uv: None }
}
