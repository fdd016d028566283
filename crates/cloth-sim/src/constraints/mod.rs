//! Contact of cloth vertices with colliders as constraints of the implicit solve.
//!
//! A cloth vertex that touches a collider sticks (it moves with the surface), slides (it keeps its distance, pushed by the
//! kinetic force) or is free. Which of them is found in a few solves of the step's linear system by what the constraints
//! had to give and where the vertices went, see [`sites`]. Distances are those of the velocity filter: contact rests at the
//! thickness, deeper vertices come out by a tenth of what they lack. The filter runs afterwards as always, for what is
//! no cloth vertex on a collider, and finds these contacts as it wants them.
//!
//! Sources: Baraff and Witkin 1998, sections 5 and 6; thesis 7.3.

mod contact;
mod friction;
mod sites;
mod step;

use crate::Vec3;
use crate::bodies::Bodies;
use cloth_collision::{Bvh, CollisionMesh, DetectError, StencilKind};
use cloth_response::FrictionRule;

pub(crate) use sites::{Holds, Settings, Sites};
pub(crate) use step::failure;

/// Pairs up to this multiple of the thickness may come to touch within the step, whatever their velocity.
const BAND: f64 = 1.25;
/// Faster ones are looked up from no farther than this multiple; what comes from beyond is the velocity filter's.
const FARTHEST: f64 = 5.0;

/// What a scene with contact by constraints has beside the velocity filter.
pub(crate) struct ConstraintStage {
    thickness: f64,
    friction: FrictionRule,
    /// Area of cloth at each cloth vertex [m²].
    areas: Vec<f64>,
    /// Vertices of colliders: pairs without one are not looked up.
    active: Vec<bool>,
}

impl ConstraintStage {
    pub(crate) fn new(mesh: &CollisionMesh, thickness: f64, friction: FrictionRule, bodies: &Bodies) -> Self {
        let mut areas = vec![0.0; bodies.cloth_vertices];
        for body in &bodies.cloth {
            for (triangle, area) in body.mesh.triangles.iter().zip(&body.rest.area) {
                for &v in triangle {
                    areas[body.first_vertex + v as usize] += area / 3.0;
                }
            }
        }
        let active = (0..mesh.vertex_count).map(|v| v >= areas.len()).collect();
        Self { thickness, friction, areas, active }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        8 * self.areas.len() + self.active.len()
    }

    /// (vertex, triangle) of the cloth vertices near a collider at `x` [m], ascending; `way`: the farthest that two vertices
    /// may near each other in the step [m].
    pub(crate) fn near(
        &self,
        mesh: &CollisionMesh,
        bvh: &mut Bvh,
        x: &[Vec3],
        inv_mass: &[f64],
        way: f64,
        pool: &rayon::ThreadPool,
    ) -> Result<Vec<[u32; 2]>, DetectError> {
        // Not a number looks as far as nothing does.
        let radius = (self.thickness + way).max(BAND * self.thickness).min(FARTHEST * self.thickness);
        let stencils = bvh.proximity(mesh, x, radius, Some(&self.active), pool)?;
        let free = |v: u32| (v as usize) < self.areas.len() && inv_mass[v as usize] > 0.0;
        let mut list: Vec<[u32; 2]> = stencils
            .iter()
            .filter(|s| s.kind == StencilKind::VertexTriangle && free(s.vertices[0]))
            .filter(|s| self.active[s.vertices[1] as usize])
            .filter_map(|s| {
                let [v, a, b, c] = s.vertices;
                mesh.triangle_of([a, b, c]).map(|t| [v, t])
            })
            .collect();
        list.sort_unstable();
        Ok(list)
    }
}
