//! Scenes as text: TOML files, JSON from scripts, and the schema of both.

use super::schema;
use super::source::{Node, SceneError, Source};
use super::{MeshSource, Scene};
use std::sync::{Arc, LazyLock};

/// Files that a scene names, for whoever loads them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileReference {
    /// Path as written in the scene.
    pub path: String,
    /// Name under which the asset is expected: the path, for an animated mesh with what is asked of the file.
    pub asset: String,
    /// Whether frames of an animated mesh are expected, rather than one mesh.
    pub sequence: bool,
    /// Key in the scene, such as `cloth[0].mesh.file`.
    pub key: String,
}

static SCHEMA: LazyLock<serde_json::Value> = LazyLock::new(|| schemars::schema_for!(Scene).to_value());

impl Scene {
    /// Reads a scene file. `file_name` is named in errors only.
    ///
    /// # Errors
    /// The first defect with file, line, key, what was expected and what came: no TOML, a key that is not known (with the
    /// nearest known one), a missing key, a wrong type, a value out of range.
    pub fn parse_toml(text: &str, file_name: &str) -> Result<Self, SceneError> {
        let mut source = Source { file: Some(file_name.into()), ..Source::default() };
        let starts: Vec<usize> =
            std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        let line_of = |offset: usize| starts.partition_point(|&start| start <= offset);
        let table = toml::de::DeTable::parse(text).map_err(|error| {
            let mut e = SceneError::new(Some(&source), "", "valid TOML", error.message());
            e.line = error.span().map(|span| line_of(span.start));
            e
        })?;
        let value = toml::de::DeValue::Table(table.into_inner());
        let node = Node::from_toml(&value, 1, &line_of);
        node.collect_lines("", &mut source.lines);
        Self::from_node(&node, source)
    }

    /// Reads a scene from JSON of the same schema.
    ///
    /// # Errors
    /// As [`Scene::parse_toml`], without file and line.
    pub fn from_json(text: &str) -> Result<Self, SceneError> {
        let value: serde_json::Value = serde_json::from_str(text)
            .map_err(|error| SceneError::new(None, "", "valid JSON", error.to_string()))?;
        Self::from_node(&Node::from_json(value), Source::default())
    }

    fn from_node(node: &Node, source: Source) -> Result<Self, SceneError> {
        schema::check(&SCHEMA, node, &source)?;
        // What the schema lets pass and the types do not: integers beyond their range.
        let mut scene: Self = serde_json::from_value(node.to_json())
            .map_err(|error| SceneError::new(Some(&source), "", "values in range", error.to_string()))?;
        scene.source = Some(Arc::new(source));
        scene.check()?;
        Ok(scene)
    }

    /// The scene as a TOML file, defaults written out.
    ///
    /// # Errors
    /// [`SceneError`] if a value cannot be written as TOML (an index beyond 2⁶³).
    pub fn to_toml(&self) -> Result<String, SceneError> {
        toml::to_string_pretty(self)
            .map_err(|error| self.error("", "values that TOML can hold", error.to_string()))
    }

    /// The scene as JSON, defaults written out.
    ///
    /// # Errors
    /// [`SceneError`] if a value cannot be written as JSON.
    pub fn to_json(&self) -> Result<String, SceneError> {
        serde_json::to_string(self)
            .map_err(|error| self.error("", "values that JSON can hold", error.to_string()))
    }

    /// JSON schema of scene files.
    pub fn json_schema() -> serde_json::Value {
        SCHEMA.clone()
    }

    /// The files that the scene names, in its order.
    pub fn files(&self) -> Vec<FileReference> {
        let mut files = Vec::new();
        let mut mesh = |source: &MeshSource, key: String| {
            if let MeshSource::File(file) = source {
                let (path, asset) = (file.file.clone(), file.file.clone());
                files.push(FileReference { path, asset, sequence: false, key: key + ".file" });
            }
        };
        for (i, cloth) in self.cloth.iter().enumerate() {
            mesh(&cloth.mesh, format!("cloth[{i}].mesh"));
        }
        for (i, collider) in self.collider.iter().enumerate() {
            if let Some(source) = &collider.mesh {
                mesh(source, format!("collider[{i}].mesh"));
            }
        }
        for (i, collider) in self.collider.iter().enumerate() {
            let Some(source) = &collider.sequence else { continue };
            if let Some(path) = source.file.clone() {
                files.push(FileReference {
                    path,
                    asset: source.asset_name(),
                    sequence: true,
                    key: format!("collider[{i}].sequence.file"),
                });
            }
        }
        files
    }
}
