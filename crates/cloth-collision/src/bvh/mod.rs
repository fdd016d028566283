//! Bounding volume hierarchy of fixed topology over the scene's triangles.
//!
//! [`build`] splits once, into blocks of eight; [`refit`] follows the motion with boxes at both ends of the step;
//! [`traverse`] meets the tree with itself, [`diagonals`] part leaves whose boxes overlap, and [`places`] (for detection) or [`leaf_pair`] (for everything else) the features
//! of two leaves, each feature from the one triangle that owns it; [`narrow`] decides what they yield while it streams by.

pub(crate) mod build;
mod deciding;
pub(crate) mod diagonals;
mod flatness;
mod intersections;
pub(crate) mod leaf_pair;
mod leaves;
pub(crate) mod narrow;
pub(crate) mod places;
mod proximity;
pub(crate) mod refit;
pub(crate) mod traverse;
mod validate;

use crate::bounds::{LANES, MovingBox, middle};
use crate::contact::check_positions;
use crate::{CollisionMesh, Contacts, DetectError, Detector, Mode, Query, Vec3};
use build::Tree;
use deciding::Deciding;
use diagonals::Diagonals;
use flatness::Flatness;
use refit::Boxes;
use std::time::Instant;
use traverse::traverse;

/// Triangles of a full leaf: one block.
const LEAF_TRIANGLES: usize = LANES;

/// A hierarchy built once per topology and refitted in every call.
///
/// The tree shape comes from the positions at the build; answers never depend on it.
#[derive(Debug, Clone)]
pub struct Bvh {
    vertex_count: usize,
    triangle_count: usize,
    pub(crate) tree: Tree,
    pub(crate) moving: Boxes<2>,
    pub(crate) still: Boxes<1>,
    flatness: Option<Flatness>,
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
            moving: Boxes::default(),
            still: Boxes::default(),
            flatness: None,
        })
    }

    /// Memory of the tree and of the boxes of a moving and of a resting query, fitted or not yet \[B\].
    pub fn bytes(&self) -> usize {
        self.tree.bytes()
            + Boxes::<2>::bytes(&self.tree, self.vertex_count)
            + Boxes::<1>::bytes(&self.tree, self.vertex_count)
            + self.tree.leaves.len() * size_of::<Diagonals<2>>()
            + self.flatness.as_ref().map_or(0, Flatness::bytes)
    }

    /// Whether [`Bvh::proximity`] passes over surfaces that certainly do not meet themselves: normals in a cone and a contour that
    /// does not come near itself prove it. Costs a pass over the triangles; no answer depends on it.
    pub fn prove_flatness(&mut self, on: bool) {
        self.flatness = on.then(Flatness::default);
    }

    /// Triangles of surfaces that the last [`Bvh::proximity`] did not search against themselves.
    pub fn flat_triangles(&self) -> u64 {
        self.flatness.as_ref().map_or(0, |f| f.found.triangles)
    }

    pub(crate) fn check_mesh(&self, mesh: &CollisionMesh) -> Result<(), DetectError> {
        if mesh.triangles.len() == self.triangle_count && mesh.vertex_count == self.vertex_count {
            return Ok(());
        }
        Err(DetectError::OtherMesh { expected: self.triangle_count, got: mesh.triangles.len() })
    }

    /// Fits the boxes at rest to the end of the step.
    pub(crate) fn refit_still(&mut self, mesh: &CollisionMesh, query: &Query<'_>, pool: &rayon::ThreadPool) {
        let (origin, margin) = (middle(query.x_t1), margin(query));
        let of_vertex = |v: usize| MovingBox::of_vertex(&[query.x_t1], v, &origin, margin);
        self.still.refit(&self.tree, mesh, of_vertex, query.active, pool);
    }

    /// Fits the moving boxes to the step.
    pub(crate) fn refit_moving(&mut self, mesh: &CollisionMesh, query: &Query<'_>, pool: &rayon::ThreadPool) {
        let (x, origin, margin) = ([query.x_t0, query.x_t1], middle(query.x_t0), margin(query));
        let of_vertex = |v: usize| MovingBox::of_vertex(&x, v, &origin, margin);
        self.moving.refit(&self.tree, mesh, of_vertex, query.active, pool);
    }
}

/// Two boxes meet: half the thickness each.
fn margin(query: &Query<'_>) -> f64 {
    0.5 * query.thickness
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
        let is_moving = query.mode == Mode::Continuous;
        if is_moving {
            self.refit_moving(mesh, query, pool);
            self.moving.refit_diagonals(&self.tree, pool);
        } else {
            self.refit_still(mesh, query, pool);
        }
        let fitted = Instant::now();
        let scene = narrow::Scene::by_rank(mesh, query, &self.tree.vertex_order, pool);
        let visit = || Deciding::new(narrow::Narrow::new(&scene));
        let (visits, counts) = if is_moving {
            traverse(&self.tree, &self.moving, mesh, pool, visit)
        } else {
            traverse(&self.tree, &self.still, mesh, pool, visit)
        };
        let traversed = Instant::now();
        let mut out = pool.install(|| narrow::merge(visits.into_iter().map(|v| v.narrow)));
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
