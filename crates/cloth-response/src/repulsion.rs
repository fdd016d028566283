//! Pairs that are near at the start of the step: resting contact and elastic repulsion (3.34–3.36).
//!
//! With the distance δ at `x_t0` and the pair's rest gap g, the overlap is d = g − δ.
//!
//! - d < 0: the pair may approach by −d within the step and no further, v_n ≥ d/dt. Cloth lands at its rest gap.
//! - d ≥ 0: it does not approach, v_n ≥ 0, and is pushed apart elastically by dt k_r d, at most until v_n = 0.1 d/dt.
//!
//! A pair with 0 ≤ d ≤ F/k_r under the pressing force F is at rest exactly: stopping it needs more than the spring gives.
//! Deeper pairs move out by at most a tenth of d per step, so nothing bounces and nothing leaves the band. Pairs are
//! looked up to [`BAND`] h, so that a resting pair does not drop in and out.
//!
//! Rest gap: h for a vertex on a triangle. For two edges it is [`EDGE_GAP`] h: where surfaces are flat the vertices carry,
//! and the edges between them, which add nothing but redundant contacts, stay idle; at a sharp edge the edges carry.

use crate::impulse::{Contact, NormalLaw};
use crate::{ResponseParams, Vec3};
use cloth_collision::{CollisionMesh, Stencil, StencilKind};

/// Pairs up to this multiple of the thickness are looked at: falling from the rest gap by g dt² in one step
/// (0.6 mm at 8 ms) stays inside it for cloth of some millimetres.
pub(crate) const BAND: f64 = 1.25;
/// Rest gap of two edges as a fraction of the thickness.
pub(crate) const EDGE_GAP: f64 = 0.75;
/// Pairs of one cloth rest at no more than this fraction of their distance in the undeformed shape.
const REST_FRACTION: f64 = 0.5;
/// The fraction of the overlap that one step may undo (3.36).
const PUSH_FRACTION: f64 = 0.1;

/// The pair's rest gap [m].
///
/// `rest_x`: undeformed positions, or empty.
pub(crate) fn rest_gap(stencil: &Stencil, mesh: &CollisionMesh, thickness: f64, rest_x: &[Vec3]) -> f64 {
    let mut gap = thickness;
    let body = |k: usize| mesh.vertex_body[stencil.vertices[k] as usize];
    if !rest_x.is_empty() && body(0) == body(3) {
        let apart: Vec3 = (0..4).map(|k| rest_x[stencil.vertices[k] as usize] * stencil.weights[k]).sum();
        gap = gap.min(REST_FRACTION * apart.norm());
    }
    match stencil.kind {
        StencilKind::VertexTriangle => gap,
        StencilKind::EdgeEdge => EDGE_GAP * gap,
    }
}

/// The law of a pair at the distance `distance` with the rest gap `gap`.
pub(crate) fn law(distance: f64, gap: f64, stiffness: f64, dt: f64) -> NormalLaw {
    let overlap = gap - distance;
    if overlap < 0.0 {
        NormalLaw { least: overlap / dt, spring: 0.0, cap: f64::NEG_INFINITY }
    } else {
        NormalLaw { least: 0.0, spring: dt * stiffness * overlap, cap: PUSH_FRACTION * overlap / dt }
    }
}

/// The contact of a near pair; `None` if it cannot act or all its vertices are prescribed.
pub(crate) fn contact(
    stencil: &Stencil,
    mesh: &CollisionMesh,
    params: &ResponseParams,
    rest_x: &[Vec3],
    inv_mass: &[f64],
    dt: f64,
) -> Option<Contact> {
    let gap = rest_gap(stencil, mesh, params.thickness, rest_x);
    if stencil.distance > BAND * gap {
        return None;
    }
    let friction = params.friction.coefficient(mesh, stencil.vertices[0], stencil.vertices[3]);
    Contact::new(stencil, inv_mass, law(stencil.distance, gap, params.repulsion_stiffness, dt), friction)
}
