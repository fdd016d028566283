//! Sheets: grid, disc, ribbon. Front normal +y, UV in metres.

use super::{count, length};
use crate::{MeshError, TriMesh, Vec3};

/// How a grid's cells are cut into triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Diagonals {
    /// Two triangles per cell, the diagonal alternating like the fields of a chessboard (union jack): no direction
    /// is preferred and bending does not couple to twist.
    #[default]
    Alternating,
    /// Two triangles per cell, all diagonals parallel: stiffer along them, and a bent strip twists.
    OneWay,
    /// Four triangles per cell around a vertex in its middle (those vertices follow the nx·ny of the grid).
    Crossed,
}

/// A `width` × `height` rectangle in the xz-plane, centred at the origin, normal +y, with UV in metres.
///
/// `nx` × `ny` vertices, row by row from −z to +z and within a row from −x to +x; (nx−1)(ny−1) cells of two triangles;
/// diagonals alternate from cell to cell. u runs along +x, v along −z.
///
/// # Errors
/// [`MeshError::Parameter`] for a size that is not positive and finite or fewer than two vertices along a side.
pub fn grid(width: f64, height: f64, nx: usize, ny: usize) -> Result<TriMesh, MeshError> {
    grid_with(width, height, nx, ny, Diagonals::Alternating)
}

/// [`grid`] with a choice of the pattern.
///
/// # Errors
/// As [`grid`].
pub fn grid_with(
    width: f64,
    height: f64,
    nx: usize,
    ny: usize,
    diagonals: Diagonals,
) -> Result<TriMesh, MeshError> {
    length("width", width)?;
    length("height", height)?;
    count("nx", nx, 2, "2 to 65535 vertices along the width")?;
    count("ny", ny, 2, "2 to 65535 vertices along the height")?;

    let at = |i: f64, j: f64| {
        Vec3::new(width * (i / (nx - 1) as f64 - 0.5), 0.0, height * (j / (ny - 1) as f64 - 0.5))
    };
    let mut vertices = Vec::with_capacity(nx * ny);
    for j in 0..ny {
        for i in 0..nx {
            vertices.push(at(i as f64, j as f64));
        }
    }
    let mut triangles = Vec::with_capacity(2 * (nx - 1) * (ny - 1));
    for j in 0..ny - 1 {
        for i in 0..nx - 1 {
            let a = (j * nx + i) as u32;
            let [b, c, d] = [a + 1, a + 1 + nx as u32, a + nx as u32];
            match diagonals {
                Diagonals::Crossed => {
                    let m = vertices.len() as u32;
                    vertices.push(at(i as f64 + 0.5, j as f64 + 0.5));
                    triangles.extend([[m, b, a], [m, c, b], [m, d, c], [m, a, d]]);
                }
                Diagonals::Alternating if (i + j) % 2 == 1 => triangles.extend([[a, d, b], [b, d, c]]),
                _ => triangles.extend([[a, c, b], [a, d, c]]),
            }
        }
    }
    let uv = flat_uv(&vertices, &triangles, width, height);
    Ok(TriMesh { vertices, triangles, uv: Some(uv) })
}

/// A flat disc of `radius` in the xz-plane, normal +y, with UV in metres: a vertex in the middle and `rings` rings
/// of 6, 12, 18 … vertices, so that all triangles have about the same size.
///
/// # Errors
/// [`MeshError::Parameter`] for a radius that is not positive and finite or no ring.
pub fn disc(radius: f64, rings: usize) -> Result<TriMesh, MeshError> {
    /// Ring k has 6k vertices, 3k² in all: kept below the range of u32.
    const MAX_RINGS: usize = 30_000;
    length("radius", radius)?;
    if rings > MAX_RINGS {
        return Err(MeshError::Parameter {
            parameter: "rings",
            expected: "1 to 30000 rings",
            got: rings as f64,
        });
    }
    count("rings", rings, 1, "1 to 30000 rings")?;

    let mut vertices = vec![Vec3::zeros()];
    let first = |ring: usize| if ring == 0 { 0 } else { 1 + 3 * ring * (ring - 1) };
    for ring in 1..=rings {
        let r = radius * ring as f64 / rings as f64;
        for k in 0..6 * ring {
            // −z: counter-clockwise seen from +y.
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / (6 * ring) as f64).sin_cos();
            vertices.push(Vec3::new(r * cos, 0.0, -r * sin));
        }
    }
    let mut triangles = Vec::with_capacity(6 * rings * rings);
    for ring in 1..=rings {
        let outer = |k: usize| (first(ring) + k % (6 * ring)) as u32;
        let inner = |k: usize| if ring == 1 { 0 } else { (first(ring - 1) + k % (6 * (ring - 1))) as u32 };
        for sector in 0..6 {
            for k in 0..ring {
                let (o, i) = (sector * ring + k, sector * (ring - 1) + k);
                triangles.push([inner(i), outer(o), outer(o + 1)]);
                if k + 1 < ring {
                    triangles.push([inner(i), outer(o + 1), inner(i + 1)]);
                }
            }
        }
    }
    let uv = flat_uv(&vertices, &triangles, 2.0 * radius, 2.0 * radius);
    Ok(TriMesh { vertices, triangles, uv: Some(uv) })
}

/// A strip along x: `length` × `width`, `nx` × `ny` vertices as in [`grid`], turned about the x-axis by `twist`
/// [rad] from one end to the other. UV is the flat strip, so a twisted ribbon starts strained.
///
/// # Errors
/// As [`grid`], with `length` and `width`; [`MeshError::Parameter`] for a twist that is not finite.
pub fn ribbon(length: f64, width: f64, nx: usize, ny: usize, twist: f64) -> Result<TriMesh, MeshError> {
    super::length("length", length)?;
    super::length("width", width)?;
    if !twist.is_finite() {
        return Err(MeshError::Parameter {
            parameter: "twist",
            expected: "a finite angle [rad]",
            got: twist,
        });
    }
    let mut mesh = grid(length, width, nx, ny)?;
    for p in &mut mesh.vertices {
        let (sin, cos) = (twist * (p.x / length + 0.5)).sin_cos();
        *p = Vec3::new(p.x, -p.z * sin, p.z * cos);
    }
    Ok(mesh)
}

/// UV of a sheet in the xz-plane: u = x, v = −z, shifted so that both start at zero.
fn flat_uv(vertices: &[Vec3], triangles: &[[u32; 3]], width: f64, height: f64) -> Vec<[[f64; 2]; 3]> {
    triangles
        .iter()
        .map(|t| {
            t.map(|v| {
                let p = vertices[v as usize];
                [p.x + 0.5 * width, 0.5 * height - p.z]
            })
        })
        .collect()
}
