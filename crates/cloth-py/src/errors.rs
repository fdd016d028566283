//! The one table from engine errors to Python exceptions.
//!
//! The classes live in `clothsim.errors` (they inherit from two bases and carry typed attributes); here each engine
//! error becomes its class, with its attributes as keywords. What is wrong with an argument or a scene is also a
//! `ValueError`.

use cloth_sim::collision::DetectError;
use cloth_sim::core::mesh::MeshError;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

/// An instance of `clothsim.errors.<class>` with `message` and the attributes that `fill` sets.
fn exception(
    py: Python<'_>,
    class: &str,
    message: &str,
    fill: impl FnOnce(&Bound<'_, PyDict>) -> PyResult<()>,
) -> PyErr {
    let build = || -> PyResult<Bound<'_, PyAny>> {
        let attributes = PyDict::new(py);
        fill(&attributes)?;
        py.import(intern!(py, "clothsim.errors"))?
            .getattr(PyString::new(py, class))?
            .call((message,), Some(&attributes))
    };
    build().map_or_else(|error| error, PyErr::from_value)
}

/// `InvalidInput`: an argument is not what it should be.
pub(crate) fn invalid_input(py: Python<'_>, name: &str, expected: &str, got: &str) -> PyErr {
    exception(py, "InvalidInput", &format!("{name}: expected {expected}, got {got}"), |attributes| {
        attributes.set_item("name", name)?;
        attributes.set_item("expected", expected)?;
        attributes.set_item("got", got)
    })
}

/// `MeshError` with the element's kind, vertices and triangles.
pub(crate) fn mesh_error(py: Python<'_>, error: &MeshError) -> PyErr {
    let (kind, vertices, triangles): (&str, Vec<u64>, Vec<u64>) = match error {
        MeshError::NotFinite { vertex, .. } => ("not-finite", vec![*vertex as u64], vec![]),
        MeshError::IndexOutOfRange { triangle, .. } => ("index-out-of-range", vec![], vec![*triangle as u64]),
        MeshError::ZeroArea { triangle, vertices, .. } => {
            ("zero-area", vertices.map(u64::from).to_vec(), vec![*triangle as u64])
        }
        MeshError::NonManifoldEdge { edge, triangles, .. } => (
            "non-manifold-edge",
            edge.map(u64::from).to_vec(),
            triangles.iter().copied().map(u64::from).collect(),
        ),
        MeshError::Unreferenced { vertex, .. } => ("unreferenced", vec![*vertex as u64], vec![]),
        MeshError::UvLength { .. } => ("uv-length", vec![], vec![]),
        MeshError::UvNotFinite { triangle, .. } => ("uv-not-finite", vec![], vec![*triangle as u64]),
        MeshError::ZeroAreaUv { triangle, .. } => ("zero-area-uv", vec![], vec![*triangle as u64]),
        MeshError::DuplicateTriangle { triangles, vertices } => (
            "duplicate-triangle",
            vertices.map(u64::from).to_vec(),
            triangles.map(u64::from).to_vec(),
        ),
        MeshError::Parameter { .. } => ("parameter", vec![], vec![]),
        MeshError::Empty => ("empty", vec![], vec![]),
    };
    exception(py, "MeshError", &error.to_string(), |attributes| {
        attributes.set_item("kind", kind)?;
        attributes.set_item("vertices", vertices)?;
        attributes.set_item("triangles", triangles)
    })
}

/// A query that detection refuses: all of them are about arguments.
pub(crate) fn detect_error(py: Python<'_>, error: &DetectError) -> PyErr {
    match error {
        DetectError::UnknownDetector { known, got } => {
            invalid_input(py, "method", &format!("one of {known}"), &format!("\"{got}\""))
        }
        DetectError::Length { array, expected, got } => {
            invalid_input(py, array, &format!("{expected} entries"), &got.to_string())
        }
        DetectError::Parameter { parameter, expected, got } => {
            invalid_input(py, parameter, expected, &got.to_string())
        }
        DetectError::NotFinite { .. }
        | DetectError::IndexOutOfRange { .. }
        | DetectError::RepeatedVertex { .. }
        | DetectError::TooLarge { .. }
        | DetectError::OtherMesh { .. } => {
            let message = error.to_string();
            exception(py, "InvalidInput", &message, |attributes| {
                attributes.set_item("name", message.split(':').next())
            })
        }
    }
}
