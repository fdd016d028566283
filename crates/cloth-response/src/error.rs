//! Why a step was not accepted.

/// An error of the response; the caller's arrays are as they were before the call.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ResponseError {
    /// A parameter is out of range.
    #[error("{name}: expected {expected}, got {got}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// Its range.
        expected: &'static str,
        /// The value that came.
        got: f64,
    },
    /// An array has the wrong length.
    #[error("{name}: expected {expected} entries, got {got}")]
    Length {
        /// The array.
        name: &'static str,
        /// The length that is needed.
        expected: usize,
        /// The length that came.
        got: usize,
    },
    /// A position or velocity that came in is NaN or infinite.
    #[error("{name}: expected finite values, vertex {vertex} is not")]
    NotFinite {
        /// The array.
        name: &'static str,
        /// Index of the first such vertex.
        vertex: usize,
    },
    /// The side of a pair that a checkpoint has cannot be.
    #[error("side of pair {pair}: expected {expected}, got others")]
    Side {
        /// Its place in the list.
        pair: usize,
        /// What is needed.
        expected: &'static str,
    },
    /// Detection refused its input.
    #[error(transparent)]
    Detect(#[from] cloth_collision::DetectError),
    /// Collisions remain that no allowed motion avoids within this step: cloth caught between prescribed motions, or
    /// pairs in contact already at the start. Retry with a smaller step.
    #[error("{} pairs still collide after every stage, first vertices {:?}", pairs.len(), vertices.iter().take(8).collect::<Vec<_>>())]
    Unresolved {
        /// The four vertices of each pair: vertex-triangle (v, a, b, c) or edge-edge (a0, a1, b0, b1); sorted.
        pairs: Vec<[u32; 4]>,
        /// All vertices of these pairs, sorted, once each.
        vertices: Vec<u32>,
    },
    /// Something that moves is near sleeping cloth or meets it. Wake that cloth and try again.
    #[error("sleeping cloth is met, first vertices {:?}", vertices.iter().take(8).collect::<Vec<_>>())]
    Asleep {
        /// Its vertices that are met, sorted, once each.
        vertices: Vec<u32>,
    },
    /// Edges stay beyond their strain limits: prescribed motions pull them apart, or contact leaves no room. Retry with
    /// a smaller step.
    #[error("{} edges stay beyond their strain limit, by up to {excess:.1e} of their length, first {:?}", edges.len(), edges.iter().take(4).collect::<Vec<_>>())]
    Strained {
        /// Their vertices, in the order in which the limits were given.
        edges: Vec<[u32; 2]>,
        /// How far the worst of them is beyond, as a fraction of its rest length.
        excess: f64,
    },
}
