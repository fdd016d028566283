//! Mesh checks and generators: arrays in, arrays out.

use cloth_sim::core::mesh::{MeshError, TriMesh, Vec3, generators};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::convert::{corner_uv_from, indices_to_numpy, points_to_numpy, triangles_from, vertices_from};
use crate::errors::mesh_error;

/// `(vertices (n, 3), triangles (m, 3), uv (m, 3, 2) or None)`.
pub(crate) type Arrays<'py> =
    (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<i64>>, Option<Bound<'py, PyArray3<f64>>>);

/// The engine's mesh from arrays; UV per triangle corner.
///
/// # Errors
/// `InvalidInput` for what the arrays cannot be.
pub(crate) fn mesh_from(
    vertices: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    uv: Option<&Bound<'_, PyAny>>,
) -> PyResult<TriMesh> {
    let vertices = vertices_from(vertices, "vertices")?;
    let triangles = triangles_from(triangles, "triangles", vertices.len())?;
    let uv = uv.map(|uv| corner_uv_from(uv, "uv", triangles.len())).transpose()?;
    Ok(TriMesh { vertices, triangles, uv })
}

/// The arrays of a mesh.
pub(crate) fn mesh_to_numpy<'py>(
    py: Python<'py>,
    vertices: &[Vec3],
    triangles: Vec<[u32; 3]>,
    uv: Option<Vec<[[f64; 2]; 3]>>,
) -> PyResult<Arrays<'py>> {
    let count = triangles.len();
    let uv = uv.map(|uv| {
        let flat: Vec<f64> = uv.into_iter().flatten().flatten().collect();
        flat.into_pyarray(py).reshape([count, 3, 2])
    });
    Ok((points_to_numpy(py, vertices), indices_to_numpy(py, triangles.into_iter()), uv.transpose()?))
}

/// Refuses what no scene can use, naming the element.
#[pyfunction]
#[pyo3(signature = (vertices, triangles, uv))]
pub(crate) fn check_mesh(
    py: Python<'_>,
    vertices: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    uv: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    mesh_from(vertices, triangles, uv)?.check().map_err(|error| mesh_error(py, &error))
}

fn made(py: Python<'_>, mesh: Result<TriMesh, MeshError>) -> PyResult<Arrays<'_>> {
    let TriMesh { vertices, triangles, uv } = mesh.map_err(|error| mesh_error(py, &error))?;
    mesh_to_numpy(py, &vertices, triangles, uv)
}

/// A rectangle in the xz-plane.
#[pyfunction]
pub(crate) fn grid(py: Python<'_>, width: f64, height: f64, nx: usize, ny: usize) -> PyResult<Arrays<'_>> {
    made(py, generators::grid(width, height, nx, ny))
}

/// A disc in the xz-plane.
#[pyfunction]
pub(crate) fn disc(py: Python<'_>, radius: f64, rings: usize) -> PyResult<Arrays<'_>> {
    made(py, generators::disc(radius, rings))
}

/// A strip along x, twisted about x.
#[pyfunction]
pub(crate) fn ribbon(
    py: Python<'_>,
    length: f64,
    width: f64,
    nx: usize,
    ny: usize,
    twist: f64,
) -> PyResult<Arrays<'_>> {
    made(py, generators::ribbon(length, width, nx, ny, twist))
}

/// A cylinder about y.
#[pyfunction]
pub(crate) fn cylinder(
    py: Python<'_>,
    radius: f64,
    height: f64,
    segments: usize,
    rows: usize,
    caps: bool,
) -> PyResult<Arrays<'_>> {
    made(py, generators::cylinder(radius, height, segments, rows, caps))
}

/// A cone about y.
#[pyfunction]
pub(crate) fn cone(py: Python<'_>, radius: f64, height: f64, segments: usize) -> PyResult<Arrays<'_>> {
    made(py, generators::cone(radius, height, segments))
}

/// A capsule about y.
#[pyfunction]
pub(crate) fn capsule(
    py: Python<'_>,
    radius: f64,
    half_height: f64,
    segments: usize,
    rings: usize,
) -> PyResult<Arrays<'_>> {
    made(py, generators::capsule(radius, half_height, segments, rings))
}

/// A sphere: an icosahedron subdivided.
#[pyfunction]
pub(crate) fn sphere(py: Python<'_>, radius: f64, subdivisions: u32) -> PyResult<Arrays<'_>> {
    made(py, generators::sphere(radius, subdivisions))
}

/// A box.
#[pyfunction]
pub(crate) fn cuboid(py: Python<'_>, size: [f64; 3], cells: [usize; 3]) -> PyResult<Arrays<'_>> {
    made(py, generators::cuboid(size, cells))
}
