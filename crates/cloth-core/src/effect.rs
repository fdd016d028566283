//! What the plan and the report are told of a force model.

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
