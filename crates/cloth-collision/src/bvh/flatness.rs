//! Surfaces that certainly do not meet themselves at one state, passed over by [`Bvh::proximity`](super::Bvh::proximity).
//!
//! The proof is that of a session's first frame ([`crate::session::flat`]), with balls no larger than rounding.

use super::build::Tree;
use super::refit::Boxes;
use crate::bounds::middle;
use crate::session::contour::{Contours, is_simple};
use crate::session::distance::Row;
use crate::session::flat::{Found, Whereabouts, mark};
use crate::{CollisionMesh, Vec3};

/// Relative error of a coordinate in single precision, of a difference in double precision, and of the radius itself; in all less
/// than 2⁻²³.
const ROUNDING: f64 = 1.0 / (1 << 23) as f64;
/// Coordinates beyond this [m], relative to the middle of the scene, stay out of single precision's squares.
const FARTHEST: f64 = 1e15;

/// The contours of the tree's blocks, found once, and what the last state let be proved.
#[derive(Debug, Clone, Default)]
pub(super) struct Flatness {
    contours: Option<Contours>,
    middles: Vec<Row>,
    radii: Vec<f32>,
    pub(super) found: Found,
}

impl Flatness {
    /// Marks in `boxes` what does not come within `thickness` \[m\] of itself at `x` \[m\].
    pub(super) fn mark(
        &mut self,
        boxes: &mut Boxes<1>,
        tree: &Tree,
        mesh: &CollisionMesh,
        x: &[Vec3],
        thickness: f64,
        pool: &rayon::ThreadPool,
    ) {
        self.found = Found::default();
        if !tree.roots.iter().any(|r| mesh.bodies_meet(r.body, r.body)) {
            return;
        }
        let Self { contours, middles, radii, found } = self;
        let origin = middle(x);
        middles.clear();
        radii.clear();
        for p in x {
            let p = p - origin;
            if !(p.amax() < FARTHEST) {
                return;
            }
            let size = p.x.abs() + p.y.abs() + p.z.abs() + origin.amax() * f64::EPSILON;
            middles.push([p.x as f32, p.y as f32, p.z as f32, 0.0]);
            radii.push((size * ROUNDING) as f32 + f32::MIN_POSITIVE);
        }
        let contours = contours.get_or_insert_with(|| Contours::new(tree, mesh));
        let within = Whereabouts { middles, radii, thickness };
        let simple = |loops: &[Vec<u32>], axis: &Vec3, at: &(dyn Fn(u32) -> Vec3 + Sync), clearance: f64| {
            is_simple(loops, axis, at, clearance)
        };
        *found = mark(boxes, tree, mesh, &within, contours, simple, pool);
    }

    /// Memory \[B\].
    pub(super) fn bytes(&self) -> usize {
        self.middles.capacity() * size_of::<Row>()
            + self.radii.capacity() * size_of::<f32>()
            + self.contours.as_ref().map_or(0, Contours::bytes)
    }
}
