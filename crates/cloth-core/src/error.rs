//! Why a system is not built or a step is not taken.

use crate::solver::SolveError;

/// A defect of the input, naming the element or the parameter.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CoreError {
    /// A parameter is out of range.
    #[error("{name}: expected {expected}, got {got}")]
    Parameter {
        /// Name of the parameter, as in a scene file (`in_plane.warp`).
        name: &'static str,
        /// What was expected, with the unit.
        expected: &'static str,
        /// What came.
        got: f64,
    },
    /// A parameter is not given that is needed beside those that are.
    #[error("{name}: expected {expected}, got nothing")]
    Missing {
        /// Name of the parameter.
        name: &'static str,
        /// What was expected, with the unit.
        expected: &'static str,
    },
    /// An entry of an array is not a finite number.
    #[error("{name}: expected finite numbers, entry {index} is {got}")]
    NotFinite {
        /// Name of the array.
        name: &'static str,
        /// The first such entry.
        index: usize,
        /// What it holds.
        got: f64,
    },
    /// The library has no material of this name.
    #[error("material: expected one of {known:?}, got \"{got}\"")]
    UnknownMaterial {
        /// The name that came.
        got: String,
        /// Names in the library.
        known: Vec<&'static str>,
    },
    /// The library has no bending law of this name.
    #[error("bending: expected one of {known:?}, got \"{got}\"")]
    UnknownLaw {
        /// The name that came.
        got: String,
        /// Names of the laws.
        known: Vec<&'static str>,
    },
    /// An element has no extent in its rest shape, so its law is not defined.
    #[error(
        "{model}: expected elements with an extent, element {element} (vertices {vertices:?}) has {measure} {got:e}"
    )]
    Degenerate {
        /// The force model.
        model: &'static str,
        /// Index of the first such element: edge, triangle or hinge of its mesh.
        element: usize,
        /// Its vertices in the mesh.
        vertices: Vec<u32>,
        /// What is too small, with the unit.
        measure: &'static str,
        /// Its value.
        got: f64,
    },
    /// The mesh does not allow the law.
    #[error(transparent)]
    Mesh(#[from] crate::mesh::MeshError),
    /// Arrays that belong together have different lengths.
    #[error("{name}: expected length {expected}, got {got}")]
    Length {
        /// Name of the array.
        name: &'static str,
        /// Expected length.
        expected: usize,
        /// Its length.
        got: usize,
    },
    /// A vertex of the cloth range belongs to no part, so it has no mass.
    #[error("vertices: expected every cloth vertex in a triangle of a part, vertex {vertex} is in none")]
    Massless {
        /// Index of the first such vertex.
        vertex: usize,
    },
}

/// Why a step was not taken. Positions and velocities are as before the call.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepError {
    /// The step is not positive and finite.
    #[error("dt: expected a positive finite step in s, got {got}")]
    TimeStep {
        /// What came [s].
        got: f64,
    },
    /// State arrays are shorter than the system.
    #[error("{name}: expected at least {expected} vertices, got {got}")]
    Length {
        /// Name of the array.
        name: &'static str,
        /// Vertices of the system.
        expected: usize,
        /// What came.
        got: usize,
    },
    /// Pins are not sorted, not unique, out of range, or of unequal lengths.
    #[error("pins: expected ascending cloth vertices with one target each, entry {entry} is wrong")]
    Pins {
        /// Index of the first wrong entry.
        entry: usize,
    },
    /// A constraint is out of range, or the method takes none.
    #[error("constraints: expected {expected}, entry {entry} is not")]
    Constraint {
        /// Index of the first wrong entry.
        entry: usize,
        /// What was expected of it.
        expected: &'static str,
    },
    /// The linear solver broke down.
    #[error("{error}")]
    Solver {
        /// Why.
        error: SolveError,
        /// Where: the cloth vertices whose forces or couplings are not finite, else those whose own block of the matrix
        /// is not positive definite, else the few that outweigh their neighbours least; ascending.
        vertices: Vec<u32>,
    },
}
