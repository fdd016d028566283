//! Scenes and materials as JSON text; the Python side holds them as plain dictionaries.

use cloth_sim::Scene;
use cloth_sim::core::Material;
use cloth_sim::core::material::library;
use pyo3::prelude::*;

use crate::errors::{core_error, invalid_input, scene_error};

/// A checked scene; one read from a file remembers its lines for the errors found later.
#[pyclass(frozen, module = "clothsim._core", name = "Scene")]
pub(crate) struct PyScene {
    pub(crate) scene: Scene,
}

#[pymethods]
impl PyScene {
    /// Read the text of a scene file; `file_name` is named in errors only.
    #[staticmethod]
    fn from_toml(py: Python<'_>, text: &str, file_name: &str) -> PyResult<Self> {
        let scene = Scene::parse_toml(text, file_name).map_err(|error| scene_error(py, &error))?;
        Ok(Self { scene })
    }

    /// Read a scene from JSON of the same schema.
    #[staticmethod]
    fn from_json(py: Python<'_>, text: &str) -> PyResult<Self> {
        let scene = Scene::from_json(text).map_err(|error| scene_error(py, &error))?;
        Ok(Self { scene })
    }

    /// The scene as the text of a TOML file, defaults written out.
    fn to_toml(&self, py: Python<'_>) -> PyResult<String> {
        self.scene.to_toml().map_err(|error| scene_error(py, &error))
    }

    /// The scene as JSON, defaults written out.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.scene.to_json().map_err(|error| scene_error(py, &error))
    }

    /// The files that the scene names: path as written, whether it is an animated mesh, key in the scene, name of the asset.
    fn files(&self) -> Vec<(String, bool, String, String)> {
        self.scene.files().into_iter().map(|file| (file.path, file.sequence, file.key, file.asset)).collect()
    }

    /// Raise the error that `key` has a wrong value, with file and line where the scene was read from a file.
    fn fail(&self, py: Python<'_>, key: &str, expected: &str, got: &str) -> PyResult<()> {
        Err(scene_error(py, &self.scene.error(key, expected, got)))
    }
}

/// The JSON schema of scene files, as text.
#[pyfunction]
pub(crate) fn scene_schema() -> String {
    Scene::json_schema().to_string()
}

/// Names in the material library.
#[pyfunction]
pub(crate) fn material_names() -> Vec<&'static str> {
    library::names()
}

/// A fabric of the library under a bending law, as JSON.
#[pyfunction]
pub(crate) fn material_named(py: Python<'_>, name: &str, bending: &str) -> PyResult<String> {
    let material = library::named_with(name, bending).map_err(|error| core_error(py, &error))?;
    to_json(py, &material)
}

/// Names of the bending laws that the library knows.
#[pyfunction]
pub(crate) fn bending_laws() -> Vec<&'static str> {
    library::LAWS.to_vec()
}

/// Everything that the library has on a fabric, as JSON; `key` is empty where a value is an estimate, and `note` says
/// where in the reference it is or what it rests on.
#[pyfunction]
pub(crate) fn fabric(py: Python<'_>, name: &str) -> PyResult<String> {
    let fabric = library::fabric(name).map_err(|error| core_error(py, &error))?;
    let row = |property: library::Property| {
        let (key, note) = match property.quantity.source {
            library::Source::Published { key, at } => (key, at),
            library::Source::Estimate(basis) => ("", basis),
        };
        let value = serde_json::json!({
            "value": property.quantity.value, "unit": property.unit, "key": key, "note": note,
        });
        (property.name.to_owned(), value)
    };
    let values: serde_json::Map<_, _> = fabric.properties().into_iter().map(row).collect();
    Ok(serde_json::json!({ "name": fabric.name, "about": fabric.about, "values": values }).to_string())
}

/// References of the library's published values: key, and what it is.
#[pyfunction]
pub(crate) fn fabric_sources() -> Vec<(&'static str, &'static str)> {
    library::SOURCES.iter().map(|source| (source.key, source.about)).collect()
}

/// Refuse what is no material; the result has the defaults written out.
#[pyfunction]
pub(crate) fn check_material(py: Python<'_>, text: &str) -> PyResult<String> {
    let material: Material = serde_json::from_str(text)
        .map_err(|error| invalid_input(py, "material", "the keys of a material", &error.to_string()))?;
    material.check().map_err(|error| core_error(py, &error))?;
    to_json(py, &material)
}

fn to_json(py: Python<'_>, material: &Material) -> PyResult<String> {
    serde_json::to_string(material)
        .map_err(|error| invalid_input(py, "material", "finite numbers", &error.to_string()))
}
