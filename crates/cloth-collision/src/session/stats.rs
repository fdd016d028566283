//! What the frames of a session took.

/// What a frame did before the elementary tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FrameKind {
    /// Tree update and traversal for this frame alone.
    #[default]
    Alone,
    /// The first frame of a session.
    First,
    /// A frame of a session that skips update and traversal, but for what dangles.
    Skipping,
}

/// Counts and seconds of the last call.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SessionStats {
    /// What the frame did.
    pub kind: FrameKind,
    /// n_f of the present session; 1 outside one.
    pub frames: u32,
    /// α of the present session.
    pub alpha: f64,
    /// Pairs on the pending list.
    pub pending: u64,
    /// Pairs that the distance heuristic left to the elementary tests.
    pub admissible: u64,
    /// Pairs in contact.
    pub colliding: u64,
    /// Vertices that left the room that the session had given them.
    pub dangling_vertices: u64,
    /// Triangles with such a vertex.
    pub dangling_triangles: u64,
    /// Whether these were met with the tree one by one, not all at once.
    pub one_by_one: bool,
    /// Sub-surfaces of low curvature that were not met with themselves, and the triangles in them.
    pub flat_surfaces: u64,
    /// Triangles of these.
    pub flat_triangles: u64,
    /// Weighted count of what was done.
    pub work: u64,
    /// Memory of the pairs [B].
    pub pair_bytes: u64,
    /// Tree update (BVHU) [s].
    pub update_seconds: f64,
    /// Traversal (BVHT) [s].
    pub traversal_seconds: f64,
    /// Elementary test processing (ETP), both filters [s].
    pub elementary_seconds: f64,
}
