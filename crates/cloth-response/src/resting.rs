//! Sleeping cloth: what of it is met, and which bodies are near each other.

use crate::ResponseError;
use cloth_collision::{CollisionMesh, Stencil};
use std::collections::BTreeSet;

/// Which vertices move in a step and which are of sleeping cloth; one entry per vertex of all bodies.
#[derive(Debug, Clone, Copy)]
pub struct Resting<'a> {
    /// May end the step elsewhere than they start it: awake cloth, colliders under way.
    pub moving: &'a [bool],
    /// Of sleeping cloth, whose inverse mass is 0 in this step.
    pub asleep: &'a [bool],
}

impl Resting<'_> {
    /// The sleeping ones among the vertices.
    pub(crate) fn sleepers(self, vertices: [u32; 4]) -> impl Iterator<Item = u32> {
        vertices.into_iter().filter(move |&v| self.asleep[v as usize])
    }
}

/// The error of the vertices that are met, if there are any.
pub(crate) fn wake(met: &BTreeSet<u32>) -> Result<(), ResponseError> {
    if met.is_empty() {
        Ok(())
    } else {
        Err(ResponseError::Asleep { vertices: met.iter().copied().collect() })
    }
}

/// Pairs of different bodies with near features, the lower first; sorted, once each.
pub(crate) fn meetings(mesh: &CollisionMesh, near: &[Stencil]) -> Vec<[u32; 2]> {
    let body = |v: u32| mesh.vertex_body[v as usize];
    let mut list: Vec<[u32; 2]> = near
        .iter()
        .map(|s| [body(s.vertices[0]), body(s.vertices[3])])
        .filter(|[a, b]| a != b)
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    list.sort_unstable();
    list.dedup();
    list
}
