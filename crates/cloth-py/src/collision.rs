//! Detection alone: `clothsim.collision`.

use cloth_sim::collision::mesh::Vec3;
use cloth_sim::collision::{self, CollisionMesh, Contacts, Mode, Query};
use cloth_sim::device::{self, Detected, Device, DeviceError, Reason, Tuning};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{indices_to_numpy, queries_from, triangles_from, vertices_from};
use crate::detach::{detached, pool};
use crate::errors::{detect_error, device_error, invalid_input};

/// `(vertex_triangle, time_vertex_triangle, edge_edge, time_edge_edge)`.
pub(crate) type Pairs<'py> = (
    Bound<'py, PyArray2<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<i64>>,
    Bound<'py, PyArray1<f64>>,
);

/// `(hit, time)`, both of length n.
type Answers<'py> = (Bound<'py, PyArray1<bool>>, Bound<'py, PyArray1<f64>>);

/// Whether a GPU failed, and why the CPU was taken.
type Fallback = Option<(bool, String)>;

/// `(vertex_triangle, time_vertex_triangle, edge_edge, time_edge_edge, stats, fallback)`.
type Answer<'py> = (
    Bound<'py, PyArray2<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyDict>,
    Fallback,
);

/// All pairs in contact between two frames of one mesh; edges come back as their two vertices.
#[pyfunction]
#[pyo3(signature = (x_t0, x_t1, triangles, method, mode, thickness, device, threads, cell_factor, distribution, duplicates))]
pub(crate) fn detect<'py>(
    py: Python<'py>,
    x_t0: &Bound<'py, PyAny>,
    x_t1: &Bound<'py, PyAny>,
    triangles: &Bound<'py, PyAny>,
    method: &str,
    mode: &str,
    thickness: f64,
    device: &str,
    threads: Option<usize>,
    cell_factor: Option<f64>,
    distribution: Option<&str>,
    duplicates: Option<&str>,
) -> PyResult<Answer<'py>> {
    let device: Device = device.parse().map_err(|error| device_error(py, &error))?;
    let tuning =
        Tuning::new(cell_factor, distribution, duplicates).map_err(|error| device_error(py, &error))?;
    let mode = mode_from(py, mode)?;
    let x_t0 = vertices_from(x_t0, "x_t0")?;
    let x_t1 = vertices_from(x_t1, "x_t1")?;
    let triangles = triangles_from(triangles, "triangles", x_t0.len())?;
    let pool = pool(py, threads)?;
    let work = || {
        let mesh = CollisionMesh::single_in(x_t0.len(), &triangles, &pool)?;
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode, active: None };
        let detected = device::detect(&mesh, &query, method, &tuning, device, &pool)?;
        Ok::<_, DeviceError>((mesh, detected))
    };
    let (mesh, detected) = detached(py, work, device_error)?;
    let stats = stats_to_dict(py, &detected)?;
    let Detected { contacts, reason, .. } = detected;
    let Contacts { vertex_triangle, time_vertex_triangle, edge_edge, time_edge_edge, .. } = contacts;
    let fallback = reason.map(|reason| match reason {
        Reason::NoGpu(why) => (false, why),
        Reason::Failed(why) => (true, why),
    });
    let edge_vertices = edge_edge.iter().map(|&[a, b]| {
        let (a, b) = (mesh.edges[a as usize], mesh.edges[b as usize]);
        [a[0], a[1], b[0], b[1]]
    });
    Ok((
        indices_to_numpy(py, vertex_triangle.iter().copied()),
        time_vertex_triangle.into_pyarray(py),
        indices_to_numpy(py, edge_vertices),
        time_edge_edge.into_pyarray(py),
        stats,
        fallback,
    ))
}

/// The mode of that name.
pub(crate) fn mode_from(py: Python<'_>, name: &str) -> PyResult<Mode> {
    match name {
        "continuous" => Ok(Mode::Continuous),
        "discrete" => Ok(Mode::Discrete),
        other => {
            let got = format!("\"{other}\"");
            Err(invalid_input(py, "mode", "one of \"continuous\", \"discrete\"", &got))
        }
    }
}

fn stats_to_dict<'py>(py: Python<'py>, detected: &Detected) -> PyResult<Bound<'py, PyDict>> {
    let stats = &detected.contacts.stats;
    let dict = PyDict::new(py);
    dict.set_item("device", &detected.device)?;
    dict.set_item("method", detected.method)?;
    dict.set_item("broad_phase_tests", stats.broad_phase_tests)?;
    dict.set_item("leaf_pairs", stats.leaf_pairs)?;
    dict.set_item("candidates_vertex_triangle", stats.candidates_vertex_triangle)?;
    dict.set_item("candidates_edge_edge", stats.candidates_edge_edge)?;
    dict.set_item("root_searches", stats.root_searches)?;
    for (name, count) in &stats.counts {
        dict.set_item(*name, *count)?;
    }
    let seconds = PyDict::new(py);
    for (stage, time) in &stats.seconds {
        seconds.set_item(*stage, *time)?;
    }
    dict.set_item("seconds", seconds)?;
    Ok(dict)
}

/// Vertex-triangle queries, each on its own: whether they are in contact during the step, and when first.
#[pyfunction]
#[pyo3(signature = (queries, thickness))]
pub(crate) fn vertex_triangle_ccd<'py>(
    py: Python<'py>,
    queries: &Bound<'py, PyAny>,
    thickness: f64,
) -> PyResult<Answers<'py>> {
    answer(py, queries, thickness, collision::vertex_triangle_ccd)
}

/// Edge-edge queries, each on its own: whether they are in contact during the step, and when first.
#[pyfunction]
#[pyo3(signature = (queries, thickness))]
pub(crate) fn edge_edge_ccd<'py>(
    py: Python<'py>,
    queries: &Bound<'py, PyAny>,
    thickness: f64,
) -> PyResult<Answers<'py>> {
    answer(py, queries, thickness, collision::edge_edge_ccd)
}

fn answer<'py>(
    py: Python<'py>,
    queries: &Bound<'py, PyAny>,
    thickness: f64,
    ccd: impl Fn(&[Vec3; 8], f64) -> Option<f64> + Sync,
) -> PyResult<Answers<'py>> {
    if !(thickness >= 0.0 && thickness.is_finite()) {
        return Err(invalid_input(py, "thickness", "a finite length ≥ 0 m", &thickness.to_string()));
    }
    let queries = queries_from(queries, "queries")?;
    let times: Vec<Option<f64>> = py.detach(|| queries.iter().map(|query| ccd(query, thickness)).collect());
    let hit: Vec<bool> = times.iter().map(Option::is_some).collect();
    let time: Vec<f64> = times.iter().map(|time| time.unwrap_or(f64::INFINITY)).collect();
    Ok((hit.into_pyarray(py), time.into_pyarray(py)))
}

/// Pairs of triangles of one mesh that pass through each other.
#[pyfunction]
#[pyo3(signature = (x, triangles, threads))]
pub(crate) fn self_intersections<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    triangles: &Bound<'py, PyAny>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let x = vertices_from(x, "x")?;
    let triangles = triangles_from(triangles, "triangles", x.len())?;
    let pool = pool(py, threads)?;
    let pairs = detached(py, || collision::self_intersections(&triangles, &x, &pool), detect_error)?;
    Ok(indices_to_numpy(py, pairs.into_iter()))
}
