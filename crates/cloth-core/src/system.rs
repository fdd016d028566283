//! All force models of all cloth of a scene.

use crate::{
    CoreError, Energy, Environment, Material,
    mesh::{RestShape, Topology, TriMesh, Vec3},
};

/// One piece of cloth and where its vertices lie in the global arrays.
#[derive(Debug, Clone, Copy)]
pub struct ClothPart<'a> {
    /// Its mesh; rest angles of hinges are read from these positions.
    pub mesh: &'a TriMesh,
    /// Connectivity of the mesh.
    pub topology: &'a Topology,
    /// Undeformed geometry of its triangles.
    pub rest: &'a RestShape,
    /// What it is made of.
    pub material: &'a Material,
    /// Global index of its vertex 0.
    pub first_vertex: usize,
}

/// An effect that is built: how much of it there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EffectInfo {
    /// Name of the effect.
    pub name: &'static str,
    /// Number of elements: edges, triangles, hinges or vertices.
    pub elements: usize,
    /// Memory of its per-element data [B].
    pub bytes: usize,
}

/// The force models of all parts over one global vertex array.
pub struct ClothSystem {
    masses: Vec<f64>,
}

impl ClothSystem {
    /// Builds what the parts' materials and the environment call for, over the global vertices
    /// `0..cloth_vertex_count`.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] for a value out of range, [`CoreError::Degenerate`] naming an element without extent,
    /// [`CoreError::Length`] for arrays that do not belong together, [`CoreError::Massless`] for a vertex in no triangle.
    pub fn new(
        _parts: &[ClothPart<'_>],
        _env: &Environment,
        _cloth_vertex_count: usize,
    ) -> Result<Self, CoreError> {
        todo!()
    }

    /// Number of cloth vertices.
    pub fn vertex_count(&self) -> usize {
        self.masses.len()
    }

    /// Mass of each vertex, a third of each of its triangles' [kg].
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// Energies of a state (positions [m], velocities [m/s]).
    pub fn energy(&self, _x: &[Vec3], _v: &[Vec3]) -> Energy {
        todo!()
    }

    /// Forces on the cloth vertices [N] in a state, written over `out[..vertex_count]`.
    pub fn forces(&self, _x: &[Vec3], _v: &[Vec3], _out: &mut [Vec3], _pool: &rayon::ThreadPool) {
        todo!()
    }

    /// What is built, in the order in which it is evaluated.
    pub fn effects(&self) -> Vec<EffectInfo> {
        todo!()
    }
}
