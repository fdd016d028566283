//! Pairs that collide during the step: found, judged, answered by impulses.

use crate::ResponseError;
use crate::friction::kernel::Kernel;
use crate::impulse::{Contact, NormalLaw};
use crate::motion::Motion;
use crate::repulsion::{push_fraction, rest_gap};
use crate::sides::{Side, Sides};
use crate::{ResponseParams, Resting, Vec3};
use cloth_collision::{
    Bvh, CollisionMesh, Contacts, DetectError, Detector, Mode, Query, StencilKind, edge_edge_ccd,
    stencil_at_contact, vertex_triangle_ccd,
};

/// Impulse passes look for pairs that come nearer than this fraction of the thickness (h/1000 in the thesis), so
/// that accepted gaps do not shrink to rounding level. What is accepted is judged at distance 0.
pub(crate) const APPROACH: f64 = 1e-3;
/// A colliding pair ends the step at no less than this fraction of its rest gap.
const LEAST_GAP: f64 = 0.1;
/// Up to there it is pushed this many times as fast as an overlap is undone: at once in steps of 5 ms.
const LEAST_PUSH: f64 = 10.0;
/// Impulse of that push at most, on top of what contact carries, where repulsion's spring gives less: in units of what moves the two
/// points alone. Two pushes that have no room for both would else grow with the number of sweeps.
const MOST_PUSH: f64 = 4.0;

/// One pair in contact during the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hit {
    pub(crate) kind: StencilKind,
    /// (vertex, triangle) or (edge, edge).
    pub(crate) pair: [u32; 2],
    /// (v, a, b, c) or (a0, a1, b0, b1).
    pub(crate) vertices: [u32; 4],
    /// Fraction of the step, not later than the first contact.
    pub(crate) time: f64,
}

impl Hit {
    /// What names the pair.
    pub(crate) fn key(&self) -> (StencilKind, [u32; 2]) {
        (self.kind, self.pair)
    }

    /// Whether the pair may touch (distance 0) while its vertices go straight from `x_t0` to `x_t1`.
    pub(crate) fn collides(&self, x_t0: &[Vec3], x_t1: &[Vec3]) -> bool {
        let (start, end) = (self.vertices.map(|v| x_t0[v as usize]), self.vertices.map(|v| x_t1[v as usize]));
        let p = [start[0], start[1], start[2], start[3], end[0], end[1], end[2], end[3]];
        match self.kind {
            StencilKind::VertexTriangle => vertex_triangle_ccd(&p, 0.0).is_some(),
            StencilKind::EdgeEdge => edge_edge_ccd(&p, 0.0).is_some(),
        }
    }

    /// Whether the pair touches already at rest at `x_t0`.
    pub(crate) fn touches_at_start(&self, x_t0: &[Vec3]) -> bool {
        self.time <= 0.0 && self.collides(x_t0, x_t0)
    }

    /// The contact at the time of impact: along its normal the pair ends the step at its rest gap, or at its gap at
    /// the start where that is less, but no nearer than a tenth of the rest gap, in steps of 5 ms and more. `None` if all vertices are prescribed.
    pub(crate) fn contact<K: Kernel>(
        &self,
        mesh: &CollisionMesh,
        params: &ResponseParams,
        rest_x: &[Vec3],
        motion: &Motion<'_>,
        kernel: &K,
        sides: &Sides,
    ) -> Option<Contact<K::State>> {
        let (x_t0, x_t1) = (motion.x_t0, &motion.buffers.end);
        let known = sides.get(self.kind, self.vertices).map_or(0, Side::sign);
        let stencil = stencil_at_contact(self.kind, self.vertices, self.time, x_t0, x_t1, known);
        let gap = rest_gap(&stencil, mesh, params, rest_x);
        let start: Vec3 = (0..4).map(|k| x_t0[stencil.vertices[k] as usize] * stencil.weights[k]).sum();
        let gap_t0 = stencil.normal.dot(&start);
        let to = |gap_t1: f64| (gap_t1 - gap_t0) / motion.dt;
        let friction = kernel.state(&params.friction, mesh, self.vertices[0], self.vertices[3]);
        if gap_t0 >= LEAST_GAP * gap {
            let law = NormalLaw::inelastic(to(gap_t0.min(gap)));
            return Contact::new(&stencil, motion.inv_mass, law, friction);
        }
        // Up to there it is a push, which gives no velocity.
        let from = gap_t0.max(0.0);
        let up = (LEAST_PUSH * push_fraction(motion.dt)).min(1.0) * (LEAST_GAP * gap - from);
        let spring = motion.dt * params.repulsion_stiffness * (gap - from);
        let law = NormalLaw { least: to(from), spring, on_top: true, rubs: true, cap: to(from + up) };
        let mut contact = Contact::new(&stencil, motion.inv_mass, law, friction)?;
        contact.law.spring = spring.max(MOST_PUSH * contact.mass * up / motion.dt);
        Some(contact)
    }
}

/// Which continuous detection answers: the hierarchy that also finds proximities, or another method.
pub(crate) struct Detection<'a> {
    pub(crate) mesh: &'a CollisionMesh,
    pub(crate) bvh: &'a mut Bvh,
    pub(crate) other: Option<&'a mut dyn Detector>,
    /// With sleeping cloth: what moves and what sleeps.
    pub(crate) resting: Option<Resting<'a>>,
    pub(crate) pool: &'a rayon::ThreadPool,
}

impl Detection<'_> {
    /// Everything that comes within `thickness` on the straight motion, of the pairs that have a vertex in `only`.
    pub(crate) fn hits(
        &mut self,
        motion: &Motion<'_>,
        thickness: f64,
        only: Option<&[bool]>,
        out: &mut Vec<Hit>,
    ) -> Result<(), DetectError> {
        let query = Query {
            x_t0: motion.x_t0,
            x_t1: &motion.buffers.end,
            thickness,
            mode: Mode::Continuous,
            active: only,
        };
        let contacts = match &mut self.other {
            Some(detector) if only.is_none() || detector.narrows() => {
                detector.detect(self.mesh, &query, self.pool)?
            }
            _ => self.bvh.detect(self.mesh, &query, self.pool)?,
        };
        push_hits(self.mesh, &contacts, out);
        Ok(())
    }
}

fn push_hits(mesh: &CollisionMesh, contacts: &Contacts, out: &mut Vec<Hit>) {
    for (&pair, &time) in contacts.vertex_triangle.iter().zip(&contacts.time_vertex_triangle) {
        let [a, b, c] = mesh.triangles[pair[1] as usize];
        out.push(Hit { kind: StencilKind::VertexTriangle, pair, vertices: [pair[0], a, b, c], time });
    }
    for (&pair, &time) in contacts.edge_edge.iter().zip(&contacts.time_edge_edge) {
        let ([a0, a1], [b0, b1]) = (mesh.edges[pair[0] as usize], mesh.edges[pair[1] as usize]);
        out.push(Hit { kind: StencilKind::EdgeEdge, pair, vertices: [a0, a1, b0, b1], time });
    }
}

/// Looks again: keeps the hits none of whose vertices changed (they stand as they were), finds those of pairs with
/// a changed vertex anew, and forgets the marks. Sorted by kind and pair.
pub(crate) fn look_again(
    detection: &mut Detection<'_>,
    motion: &mut Motion<'_>,
    thickness: f64,
    hits: &mut Vec<Hit>,
) -> Result<(), DetectError> {
    let changed = &motion.buffers.changed;
    hits.retain(|hit| !hit.vertices.iter().any(|&v| changed[v as usize]));
    detection.hits(motion, thickness, Some(&motion.buffers.changed), hits)?;
    hits.sort_by_key(Hit::key);
    motion.clear_changed();
    Ok(())
}

/// The error that names what still collides.
pub(crate) fn unresolved(hits: &[Hit]) -> ResponseError {
    let mut pairs: Vec<[u32; 4]> = hits.iter().map(|hit| hit.vertices).collect();
    pairs.sort_unstable();
    let mut vertices: Vec<u32> = pairs.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    ResponseError::Unresolved { pairs, vertices }
}
