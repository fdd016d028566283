//! What makes a garment of a mesh: parts with a material of their own, and seams.

use super::{BoxRegion, MaterialChoice};
use serde::{Deserialize, Serialize};

/// Triangles of a cloth with a material of their own. Exactly one of `group`, `triangles`, `vertices` and `box`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Name of a library material, or a table of its own.
    pub material: MaterialChoice,
    /// Name of a group of faces in the mesh file: OBJ's `g`, `o` or `usemtl`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Triangle indices of this cloth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub triangles: Option<Vec<u32>>,
    /// Vertex indices of this cloth: the triangles whose corners are all among them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertices: Option<Vec<u32>>,
    /// The triangles whose corners all start inside this box (scene coordinates, borders included).
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub region: Option<BoxRegion>,
}

/// Vertices of a cloth that are sewn to each other. Exactly one of `pairs` and `edges`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Seam {
    /// Pairs of vertices of this cloth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pairs: Option<Vec<[u32; 2]>>,
    /// Two runs along the boundary, each by two or more vertices on it in order; between two of them the run takes the shorter way.
    /// The first vertex of one run is sewn to the first of the other, the last to the last, and each vertex between of the run that
    /// has fewer to the one at the nearest share of the length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edges: Option<[Vec<u32>; 2]>,
    /// Time at which it begins to close [s], ≥ 0.
    #[serde(default)]
    pub start: f64,
    /// How long it takes to close [s], ≥ 0.
    #[serde(default = "default_duration")]
    pub duration: f64,
    /// Stiffness of each stitch [N/m], > 0; by default the largest in-plane stiffness of the cloth's material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
}

fn default_duration() -> f64 {
    1.0
}
