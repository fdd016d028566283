//! Pairs that are near at the start of the step: resting contact and elastic repulsion (3.34–3.36).
//!
//! With the gap (distance) δ at `x_t0` and the pair's rest gap g, the overlap is d = g − δ.
//!
//! - d < 0: the gap may shrink to g within the step and no further. Cloth lands at its rest gap.
//! - d ≥ 0: the gap does not shrink, and the pair is pushed apart elastically by dt k_r d, at most until the gap has
//!   grown by 0.1 d, or by d dt/50 ms in steps of less than 5 ms.
//!
//! In velocities, with the gap linear about the candidate end of the step: v_n ≥ `least` and v_n ≤ `least` + 0.1 d/dt
//! for the elastic part; for closest points that do not move, `least` is 0 or d/dt, as in 3.36. The elastic part moves
//! and leaves no velocity, see [`crate::impulse`].
//!
//! A pair with 0 ≤ d ≤ F/k_r under the pressing force F is at rest exactly: stopping it needs more than the spring gives.
//! Deeper pairs move out by at most a tenth of d per step, so nothing bounces and nothing leaves the band. Pairs are
//! looked up to [`BAND`] h, so that a resting pair does not drop in and out.
//!
//! Rest gap: h for a vertex on a triangle. For two edges it is [`EDGE_GAP`] h: where surfaces are flat the vertices carry,
//! and the edges between them, which add nothing but redundant contacts, stay idle; at a sharp edge the edges carry.

use crate::friction::kernel::Kernel;
use crate::impulse::{Contact, NormalLaw};
use crate::landing::Landed;
use crate::motion::Motion;
use crate::{ResponseParams, Vec3};
use cloth_collision::{CollisionMesh, Stencil, StencilKind};

/// Pairs up to this multiple of the thickness are looked at: falling from the rest gap by g dt² in one step
/// (0.6 mm at 8 ms) stays inside it for cloth of some millimetres.
pub(crate) const BAND: f64 = 1.25;
/// Rest gap of two edges as a fraction of the thickness.
pub(crate) const EDGE_GAP: f64 = 0.75;
/// Rest gap of what does not carry where [`ResponseParams::vertices_carry`], as a fraction of the thickness.
const CARRIED_GAP: f64 = 0.5;
/// Pairs of one cloth rest at no more than this fraction of their distance in the undeformed shape.
const REST_FRACTION: f64 = 0.5;
/// The fraction of the overlap that one step may undo (3.36).
const PUSH_FRACTION: f64 = 0.1;
/// Time that undoing an overlap takes at least [s]: what steps of 5 ms give. Where pushes meet what holds against them, a fraction per
/// step would do work without bound as steps get smaller.
const PUSH_TIME: f64 = 0.05;

/// Overlap, as a fraction of the rest gap, from which a push has friction. What has no room for its thickness on both sides is nearer to
/// one of them than half of it.
const DEEP: f64 = 0.45;

/// The fraction of the overlap that a step of `dt` \[s\] may undo.
pub(crate) fn push_fraction(dt: f64) -> f64 {
    PUSH_FRACTION.min(dt / PUSH_TIME)
}

/// The pair's rest gap [m].
///
/// `rest_x`: undeformed positions, or empty.
pub(crate) fn rest_gap(
    stencil: &Stencil,
    mesh: &CollisionMesh,
    params: &ResponseParams,
    rest_x: &[Vec3],
) -> f64 {
    let mut gap = params.thickness;
    let body = |k: usize| mesh.vertex_body[stencil.vertices[k] as usize];
    if params.vertices_carry {
        let [first, second] = [0, 3].map(|k| mesh.bodies[body(k) as usize].dynamic);
        if first != second && !(first && stencil.kind == StencilKind::VertexTriangle) {
            return CARRIED_GAP * gap;
        }
    }
    if !rest_x.is_empty() && body(0) == body(3) {
        let apart: Vec3 = (0..4).map(|k| rest_x[stencil.vertices[k] as usize] * stencil.weights[k]).sum();
        gap = gap.min(REST_FRACTION * apart.norm());
    }
    match stencil.kind {
        StencilKind::VertexTriangle => gap,
        StencilKind::EdgeEdge => EDGE_GAP * gap,
    }
}

/// The law of a pair that is `gap_t0` apart now and would be `gap_t1` apart after the step, at the normal velocity
/// `v_n`; its rest gap is `gap`.
fn law(gap_t0: f64, gap_t1: f64, v_n: f64, gap: f64, stiffness: f64, dt: f64) -> NormalLaw {
    let overlap = gap - gap_t0;
    // The end gap is gap_t1 + dt (v_n' - v_n).
    let least = v_n + (gap.min(gap_t0) - gap_t1) / dt;
    if overlap < 0.0 {
        NormalLaw::inelastic(least)
    } else {
        let (spring, cap) = (dt * stiffness * overlap, least + push_fraction(dt) * overlap / dt);
        NormalLaw { least, spring, on_top: false, rubs: overlap > DEEP * gap, cap }
    }
}

/// The contact of a near pair; `None` if it cannot act or all its vertices are prescribed.
pub(crate) fn contact<K: Kernel>(
    landed: &Landed,
    mesh: &CollisionMesh,
    params: &ResponseParams,
    rest_x: &[Vec3],
    motion: &Motion<'_>,
    kernel: &K,
) -> Option<Contact<K::State>> {
    let stencil = &landed.start;
    let gap = rest_gap(stencil, mesh, params, rest_x);
    let gap_t0 = stencil.distance;
    if gap_t0 > BAND * gap {
        return None;
    }
    let normal_velocity = |s: &Stencil| -> f64 {
        let u: Vec3 = (0..4).map(|k| motion.buffers.velocity[s.vertices[k] as usize] * s.weights[k]).sum();
        s.normal.dot(&u)
    };
    let dt = motion.dt;
    let (stencil, gap_t1) = match landed.end {
        Some(end) => (end, end.distance),
        None => (*stencil, gap_t0 + dt * normal_velocity(stencil)),
    };
    let law = law(gap_t0, gap_t1, normal_velocity(&stencil), gap, params.repulsion_stiffness, dt);
    let friction = kernel.state(&params.friction, mesh, stencil.vertices[0], stencil.vertices[3]);
    Contact::new(&stencil, motion.inv_mass, law, friction)
}
