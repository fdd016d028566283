//! Bounding volume hierarchy of fixed topology over the scene's triangles.
//!
//! [`build`] splits once; [`refit`] follows the motion with boxes at both ends of the step; [`traverse`] meets the
//! tree with itself and [`leaf_pair`] the features of two leaves, each feature from the one triangle that owns it;
//! [`narrow`] decides what they yield while it streams by.

mod build;
mod intersections;
mod leaf_pair;
mod narrow;
mod proximity;
mod refit;
mod traverse;
mod validate;

use crate::bounds::LANES;
use crate::contact::check_positions;
use crate::{CollisionMesh, Contacts, DetectError, Detector, Mode, Query, Vec3};
use build::Tree;
use refit::Boxes;
use std::time::Instant;
use traverse::Streaming;

/// Triangles of a full leaf: one block.
const LEAF_TRIANGLES: usize = LANES;

/// One node of the tree, in preorder: the left child is the next node.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// Right child, [`NONE`] in a leaf.
    right: u32,
    /// Leaf index, [`NONE`] in an inner node.
    leaf: u32,
    /// The body of all triangles below, [`NONE`] if there are several.
    body: u32,
}

/// A leaf: its node and the ranges of its feature blocks.
#[derive(Debug, Clone, Copy)]
struct Leaf {
    node: u32,
    vertex_blocks: [u32; 2],
    edge_blocks: [u32; 2],
}

/// A hierarchy built once per topology and refitted in every call.
///
/// The tree shape comes from the positions at the build; answers never depend on it.
#[derive(Debug, Clone)]
pub struct Bvh {
    vertex_count: usize,
    triangle_count: usize,
    tree: Tree,
    boxes: Boxes,
}

impl Bvh {
    /// The hierarchy of `mesh`; `x` \[m\] shapes the tree, not the answers.
    ///
    /// # Errors
    /// [`DetectError::Length`] and [`DetectError::NotFinite`] for `x`.
    pub fn new(mesh: &CollisionMesh, x: &[Vec3]) -> Result<Self, DetectError> {
        Self::build(mesh, x, None)
    }

    /// [`Bvh::new`] on a pool: the same tree for any number of threads.
    ///
    /// # Errors
    /// As [`Bvh::new`].
    pub fn new_in(mesh: &CollisionMesh, x: &[Vec3], pool: &rayon::ThreadPool) -> Result<Self, DetectError> {
        Self::build(mesh, x, Some(pool))
    }

    fn build(
        mesh: &CollisionMesh,
        x: &[Vec3],
        pool: Option<&rayon::ThreadPool>,
    ) -> Result<Self, DetectError> {
        check_positions("x", x, mesh.vertex_count)?;
        Ok(Self {
            vertex_count: mesh.vertex_count,
            triangle_count: mesh.triangles.len(),
            tree: build::build(mesh, x, pool),
            boxes: Boxes::default(),
        })
    }

    fn check_mesh(&self, mesh: &CollisionMesh) -> Result<(), DetectError> {
        if mesh.triangles.len() == self.triangle_count && mesh.vertex_count == self.vertex_count {
            return Ok(());
        }
        Err(DetectError::OtherMesh { expected: self.triangle_count, got: mesh.triangles.len() })
    }

    fn refit(&mut self, mesh: &CollisionMesh, query: &Query<'_>, pool: &rayon::ThreadPool) {
        let start = if query.mode == Mode::Continuous { query.x_t0 } else { query.x_t1 };
        // Two boxes meet: half the thickness each.
        self.boxes.refit(&self.tree, mesh, start, query.x_t1, 0.5 * query.thickness, query.active, pool);
    }
}

impl Detector for Bvh {
    fn name(&self) -> &'static str {
        "bvh"
    }

    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        query.check(mesh)?;
        self.check_mesh(mesh)?;
        let start = Instant::now();
        self.refit(mesh, query, pool);
        let fitted = Instant::now();
        let scene = narrow::Scene::new(mesh, query);
        let (visits, counts) = self.traverse(mesh, pool, || Streaming::new(narrow::Narrow::new(&scene)));
        let traversed = Instant::now();
        let mut out = narrow::merge(visits.into_iter().map(|v| v.sink));
        out.stats.broad_phase_tests = counts.box_tests;
        out.stats.leaf_pairs = counts.leaf_pairs;
        out.stats.seconds = vec![
            ("refit", (fitted - start).as_secs_f64()),
            ("traversal and narrow phase", (traversed - fitted).as_secs_f64()),
            ("merge", traversed.elapsed().as_secs_f64()),
        ];
        Ok(out)
    }
}
