//! Data that a scene names and that is loaded elsewhere.

use crate::Vec3;
use cloth_core::mesh::TriMesh;
use std::collections::BTreeMap;

/// Frames of an animated mesh of fixed topology.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sequence {
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Vertex positions per frame [m].
    pub frames: Vec<Vec<Vec3>>,
    /// Frames per second where the file says so; the scene's word counts before it.
    pub fps: Option<f64>,
}

/// Meshes, sequences and start velocities by name. The name of a file is its path as written in the scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Assets {
    /// Meshes.
    pub meshes: BTreeMap<String, TriMesh>,
    /// Animated meshes.
    pub sequences: BTreeMap<String, Sequence>,
    /// Named groups of triangles of the meshes, by the mesh's name.
    pub groups: BTreeMap<String, BTreeMap<String, Vec<u32>>>,
    /// Start velocity of each vertex of a piece of cloth [m/s].
    pub velocities: BTreeMap<String, Vec<Vec3>>,
}
