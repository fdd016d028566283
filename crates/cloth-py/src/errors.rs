//! The one table from engine errors to Python exceptions.
//!
//! The classes live in `clothsim.errors` (they inherit from two bases and carry typed attributes); here each engine
//! error becomes its class, with its attributes as keywords. What is wrong with an argument or a scene is also a
//! `ValueError`.

use cloth_sim::collision::DetectError;
use cloth_sim::core::CoreError;
use cloth_sim::core::mesh::MeshError;
use cloth_sim::device::{DeviceError, only};
use cloth_sim::{SceneError, SimError};
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
        MeshError::DuplicateTriangle { triangles, vertices } => {
            ("duplicate-triangle", vertices.map(u64::from).to_vec(), triangles.map(u64::from).to_vec())
        }
        MeshError::Parameter { .. } => ("parameter", vec![], vec![]),
        MeshError::Empty => ("empty", vec![], vec![]),
    };
    exception(py, "MeshError", &error.to_string(), |attributes| {
        attributes.set_item("kind", kind)?;
        attributes.set_item("vertices", vertices)?;
        attributes.set_item("triangles", triangles)
    })
}

/// A query that detection refuses: about arguments, except for a device that fails.
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
        DetectError::Device { .. } => exception(py, "DeviceError", &error.to_string(), |_| Ok(())),
        DetectError::NotFinite { .. }
        | DetectError::IndexOutOfRange { .. }
        | DetectError::RepeatedVertex { .. }
        | DetectError::TooLarge { .. }
        | DetectError::OtherMesh { .. }
        | DetectError::ChangedTopology { .. }
        | DetectError::ChangedBodies => {
            let message = error.to_string();
            exception(py, "InvalidInput", &message, |attributes| {
                attributes.set_item("name", message.split(':').next())
            })
        }
    }
}

/// `GpuUnavailable` and `DeviceError` for the device; the rest is about arguments.
pub(crate) fn device_error(py: Python<'_>, error: &DeviceError) -> PyErr {
    match error {
        DeviceError::Unknown { parameter, expected, got, nearest } => {
            let hint =
                nearest.as_ref().map(|name| format!(" (did you mean \"{name}\"?)")).unwrap_or_default();
            invalid_input(py, parameter, expected, &format!("\"{got}\"{hint}"))
        }
        DeviceError::WrongDevice { method, expected } => {
            invalid_input(py, "method", expected, &format!("\"{method}\""))
        }
        DeviceError::OtherMethod { parameter, owners, method } => invalid_input(
            py,
            parameter,
            &format!("nothing, as {}", only(owners)),
            &format!("a value for \"{method}\""),
        ),
        DeviceError::Unavailable { .. } => exception(py, "GpuUnavailable", &error.to_string(), |_| Ok(())),
        DeviceError::Failed { device, .. } => {
            exception(py, "DeviceError", &error.to_string(), |attributes| {
                attributes.set_item("device", device)
            })
        }
        DeviceError::Query(inner) => detect_error(py, inner),
    }
}

/// A material or an array that the forces refuse.
pub(crate) fn core_error(py: Python<'_>, error: &CoreError) -> PyErr {
    match error {
        CoreError::Parameter { name, expected, got } => invalid_input(py, name, expected, &got.to_string()),
        CoreError::Missing { name, expected } => invalid_input(py, name, expected, "nothing"),
        CoreError::NotFinite { name, index, got } => {
            invalid_input(py, name, "finite numbers", &format!("{got} at index {index}"))
        }
        CoreError::UnknownMaterial { got, known } => {
            invalid_input(py, "material", &format!("one of {known:?}"), &format!("\"{got}\""))
        }
        CoreError::UnknownLaw { got, known } => {
            invalid_input(py, "bending", &format!("one of {known:?}"), &format!("\"{got}\""))
        }
        CoreError::Length { name, expected, got } => {
            invalid_input(py, name, &format!("length {expected}"), &got.to_string())
        }
        CoreError::Degenerate { vertices, element, .. } => {
            exception(py, "MeshError", &error.to_string(), |attributes| {
                attributes.set_item("kind", "degenerate")?;
                attributes.set_item("vertices", vertices)?;
                attributes.set_item("triangles", [*element])
            })
        }
        CoreError::Mesh(inner) => mesh_error(py, inner),
        CoreError::Massless { vertex } => exception(py, "MeshError", &error.to_string(), |attributes| {
            attributes.set_item("kind", "unreferenced")?;
            attributes.set_item("vertices", [*vertex])
        }),
    }
}

/// `InvalidScene` with file, line and key.
pub(crate) fn scene_error(py: Python<'_>, error: &SceneError) -> PyErr {
    exception(py, "InvalidScene", &error.to_string(), |attributes| {
        attributes.set_item("file", &error.file)?;
        attributes.set_item("line", error.line)?;
        attributes.set_item("key", &error.key)?;
        attributes.set_item("expected", &error.expected)?;
        attributes.set_item("got", &error.got)?;
        attributes.set_item("nearest", &error.nearest)
    })
}

/// What a simulation raises; after `SimulationDiverged` and `SimulationStuck` it holds the last good state.
pub(crate) fn sim_error(py: Python<'_>, error: &SimError) -> PyErr {
    let message = error.to_string();
    match error {
        SimError::InvalidScene(inner) => scene_error(py, inner),
        SimError::StartIntersections { count, pairs, .. } => {
            exception(py, "IntersectingStart", &message, |attributes| {
                attributes.set_item("count", *count)?;
                attributes.set_item("pairs", pairs.iter().map(|&[a, b]| (a, b)).collect::<Vec<_>>())
            })
        }
        SimError::Diverged { time, vertices, .. } => {
            exception(py, "SimulationDiverged", &message, |attributes| {
                attributes.set_item("time", *time)?;
                attributes.set_item("vertices", vertices)
            })
        }
        SimError::Stuck { time, pairs, vertices } => {
            exception(py, "SimulationStuck", &message, |attributes| {
                attributes.set_item("time", *time)?;
                attributes.set_item("vertices", vertices)?;
                attributes.set_item("count", pairs.len())?;
                let pairs: Vec<_> = pairs.iter().map(|&[a, b, c, d]| (a, b, c, d)).collect();
                attributes.set_item("pairs", pairs)
            })
        }
        SimError::InvalidCheckpoint { .. } => exception(py, "CheckpointError", &message, |_| Ok(())),
        SimError::InvalidArgument { name, expected, got } => invalid_input(py, name, expected, got),
        SimError::Device(inner) => device_error(py, inner),
        SimError::Stage { stage, .. } => {
            exception(py, "SolverFailed", &message, |attributes| attributes.set_item("stage", *stage))
        }
    }
}
