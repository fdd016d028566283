//! Why a mesh is refused.

/// A defect of a mesh, naming the element.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A vertex coordinate is NaN or infinite.
    #[error("vertices: expected finite coordinates, vertex {vertex} is ({}, {}, {})", position[0], position[1], position[2])]
    NotFinite {
        /// Index of the first such vertex.
        vertex: usize,
        /// Its coordinates [m].
        position: [f64; 3],
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangles: expected indices in 0..{vertex_count}, triangle {triangle} has {index}")]
    IndexOutOfRange {
        /// Index of the first such triangle.
        triangle: usize,
        /// The index that came.
        index: i64,
        /// Number of vertices.
        vertex_count: usize,
    },
    /// A triangle has no area (repeated vertex, or three vertices on a line).
    #[error("triangles: expected non-zero area, triangle {triangle} (vertices {vertices:?}) has {area:e} m²")]
    ZeroArea {
        /// Index of the first such triangle.
        triangle: usize,
        /// Its vertices.
        vertices: [u32; 3],
        /// Its area [m²].
        area: f64,
    },
    /// An edge belongs to more than two triangles.
    #[error("triangles: expected at most two triangles on an edge, edge ({}, {}) has {count}: {triangles:?}", edge[0], edge[1])]
    NonManifoldEdge {
        /// The edge's vertices.
        edge: [u32; 2],
        /// How many triangles share it.
        count: usize,
        /// The first of them (at most eight).
        triangles: Vec<u32>,
    },
    /// A vertex belongs to no triangle.
    #[error("vertices: expected every vertex in a triangle, {count} are in none (first: vertex {vertex})")]
    Unreferenced {
        /// Index of the first such vertex.
        vertex: usize,
        /// How many there are.
        count: usize,
    },
    /// A per-corner array has the wrong length.
    #[error("uv: expected one entry per triangle ({expected}), got {got}")]
    UvLength {
        /// Number of triangles.
        expected: usize,
        /// Entries that came.
        got: usize,
    },
    /// A material coordinate is NaN or infinite.
    #[error("uv: expected finite coordinates, triangle {triangle} has {uv:?}")]
    UvNotFinite {
        /// Index of the first such triangle.
        triangle: usize,
        /// Its three corners [m].
        uv: [[f64; 2]; 3],
    },
    /// A triangle's UV panel has no area.
    #[error("uv: expected panels with non-zero area, triangle {triangle} has {area:e} m²")]
    ZeroAreaUv {
        /// Index of the first such triangle.
        triangle: usize,
        /// Its area in the panel [m²].
        area: f64,
    },
    /// The same three vertices make two triangles, so the angle between them is not defined.
    #[error("triangles: expected each triangle once, triangles {} and {} have the same vertices {vertices:?}", triangles[0], triangles[1])]
    DuplicateTriangle {
        /// The two triangles.
        triangles: [u32; 2],
        /// Their vertices.
        vertices: [u32; 3],
    },
    /// A generator's parameter is out of range.
    #[error("{parameter}: expected {expected}, got {got}")]
    Parameter {
        /// Name of the parameter.
        parameter: &'static str,
        /// What was expected, with the unit.
        expected: &'static str,
        /// What came.
        got: f64,
    },
    /// There is nothing to work with.
    #[error("mesh: expected at least one triangle, got none")]
    Empty,
}
