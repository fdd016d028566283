//! Why a query is refused.

/// A defect of a query or of its mesh, naming the element.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DetectError {
    /// A coordinate is NaN or infinite.
    #[error("{array}: expected finite coordinates, vertex {vertex} is ({}, {}, {})", position[0], position[1], position[2])]
    NotFinite {
        /// Name of the array.
        array: &'static str,
        /// Index of the first such vertex.
        vertex: usize,
        /// Its coordinates [m].
        position: [f64; 3],
    },
    /// An array has the wrong length.
    #[error("{array}: expected {expected} entries, got {got}")]
    Length {
        /// Name of the array.
        array: &'static str,
        /// Entries expected.
        expected: usize,
        /// Entries that came.
        got: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangles: expected indices in 0..{vertex_count}, triangle {triangle} of body {body} has {index}"
    )]
    IndexOutOfRange {
        /// Body of the triangle.
        body: usize,
        /// Index of the first such triangle within its body.
        triangle: usize,
        /// The index that came.
        index: u32,
        /// Number of vertices of the body.
        vertex_count: usize,
    },
    /// A triangle names a vertex twice.
    #[error(
        "triangles: expected three different vertices, triangle {triangle} of body {body} has {vertices:?}"
    )]
    RepeatedVertex {
        /// Body of the triangle.
        body: usize,
        /// Index of the first such triangle within its body.
        triangle: usize,
        /// Its vertices.
        vertices: [u32; 3],
    },
    /// The scene has more vertices, triangles or edges than a `u32` counts.
    #[error("mesh: expected fewer than {limit} {what}, got {got}")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// The limit.
        limit: usize,
        /// The number that came.
        got: usize,
    },
    /// A number is out of range.
    #[error("{parameter}: expected {expected}, got {got}")]
    Parameter {
        /// Name of the parameter.
        parameter: &'static str,
        /// What was expected, with the unit.
        expected: &'static str,
        /// What came.
        got: f64,
    },
    /// The detector was built for another mesh.
    #[error(
        "mesh: expected the topology that the detector was built for ({expected} triangles), got {got} triangles"
    )]
    OtherMesh {
        /// Triangles of the mesh that the detector was built for.
        expected: usize,
        /// Triangles of the mesh that came.
        got: usize,
    },
    /// A triangle has other vertices than when the detector was built.
    #[error("mesh: expected the topology that the detector was built for, triangle {triangle} has changed")]
    ChangedTopology {
        /// The first such triangle.
        triangle: usize,
    },
    /// The rules of the bodies are others than when the detector was built.
    #[error("mesh: expected the bodies that the detector was built for")]
    ChangedBodies,
    /// A detector that works on another device got no answer from it.
    #[error("detector \"{detector}\": {reason}")]
    Device {
        /// Name of the detector.
        detector: &'static str,
        /// What the device says.
        reason: String,
    },
    /// No detector has this name.
    #[error("detector: expected one of {known}, got \"{got}\"")]
    UnknownDetector {
        /// The names that exist.
        known: &'static str,
        /// The name that came.
        got: String,
    },
}
