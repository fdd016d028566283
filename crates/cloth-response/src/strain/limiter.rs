//! Strain limits in the response: an edge beyond its limit is one more contact.
//!
//! Stretched too far, the ends of an edge may not move apart; compressed too far, not together: a one-sided condition on
//! the relative velocity of two vertices, with an impulse of one sign, as for two points that collide. So these join the
//! contacts of the step and are relaxed with them: a fold that a taut cloth presses on a table feels both, and the passes of
//! continuous detection then see the motion as limited.
//!
//! The impulse acts along the edge as it is at the start of the step: linear and angular momentum of the straight motion
//! are both kept. Where the edge turns by more than [`LEAST_AGREEMENT`] within the step (about 25°), it acts along the edge as it
//! would be at the end, and angular momentum is kept to first order in that turn only. Contact may turn the edge once more: then the
//! impulse is given up and another made, as one across the edge cannot keep it, and several across theirs throw a vertex away.
//!
//! The length is not linear in the impulse: the condition is made anew, exact for the edge alone, from what the sweeps gave,
//! until all edges are inside. It aims a hair inside of the limit ([`MARGIN`]); the limit itself is what is kept.
//!
//! Sources: Provot 1995, "Deformation constraints in a mass-spring model to describe rigid cloth behavior"; Bridson,
//! Marino, Fedkiw 2003, "Simulation of clothing with folds and wrinkles", §4.2 (momentum-conserving, as impulses).

use super::LimitedEdge;
use crate::friction::kernel::Kernel;
use crate::impulse::{Contact, NormalLaw};
use crate::motion::{Motion, bytes_of};
use crate::sweeps::ContactSet;
use crate::{ResponseInfo, Vec3};
use cloth_collision::mesh::NONE;
use cloth_collision::{Stencil, StencilKind};

/// How far inside of its limit an edge is drawn, as a fraction of l₀; at most a hundredth of the limit.
const MARGIN: f64 = 1e-4;
/// Edges that come nearer to their limit than this fraction of it are relaxed with the others: they are next.
const NEAR: f64 = 0.05;
/// Least cosine between an edge at the start and at the end of the step for the impulse to act along the former.
const LEAST_AGREEMENT: f64 = 0.9;
/// What an edge that starts beyond its limit has to give back of the excess in one step, at least.
const GIVEN_BACK: f64 = 0.1;
/// Rounding of lengths, relative.
const ROUNDING: f64 = 1e-12;

/// Stretch or compression of an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Side {
    Stretch,
    Compression,
}

/// The limited edges and their contacts in this step.
#[derive(Debug, Default)]
pub(crate) struct Limiter {
    edges: Vec<LimitedEdge>,
    /// Contact of each edge against stretch and against compression, or [`NONE`].
    contacts: Vec<[u32; 2]>,
}

impl Limiter {
    pub(crate) fn new(edges: Vec<LimitedEdge>) -> Self {
        Self { contacts: vec![[NONE; 2]; edges.len()], edges }
    }

    pub(crate) fn is_off(&self) -> bool {
        self.edges.is_empty()
    }

    pub(crate) fn bytes(&self) -> usize {
        bytes_of(&self.edges) + bytes_of(&self.contacts)
    }

    /// Before the first sweep of a step.
    pub(crate) fn begin(&mut self) {
        self.contacts.fill([NONE; 2]);
    }

    /// Makes the condition of every edge beyond or near its limit from the motion as it is; the largest excess, as a fraction of
    /// l₀, or 0 where no edge is beyond.
    pub(crate) fn linearise<K: Kernel>(&mut self, set: &mut ContactSet<K>, motion: &Motion<'_>) -> f64 {
        let mut worst = 0.0_f64;
        for (edge, slots) in self.edges.iter().zip(&mut self.contacts) {
            let [a, b] = edge.vertices.map(|v| v as usize);
            if motion.inv_mass[a] + motion.inv_mass[b] == 0.0 {
                continue;
            }
            let (d0, d1) = (motion.x_t0[a] - motion.x_t0[b], motion.buffers.end[a] - motion.buffers.end[b]);
            for side in [Side::Stretch, Side::Compression] {
                let Some(bound) = bound(edge, side, d0.norm()) else { continue };
                let slot = &mut slots[side as usize];
                if bound.broken_by(d1.norm()) {
                    worst = worst.max((d1.norm() - bound.limit).abs() / edge.rest_length);
                    // Across its own direction an impulse does not shorten an edge: that one is given up for another.
                    if *slot != NONE && !agrees(&set.contact(*slot).normal, &d1) {
                        set.set_least(*slot, f64::NEG_INFINITY);
                        *slot = NONE;
                    }
                }
                if *slot == NONE {
                    if !bound.near(d1.norm()) {
                        continue;
                    }
                    let Some(contact) = new_contact(edge, side, d0, d1, motion, set.kernel.frictionless())
                    else {
                        continue;
                    };
                    *slot = set.push(contact);
                }
                let contact = set.contact(*slot);
                let n = contact.normal;
                let v_n = n.dot(&contact.relative(&motion.buffers.velocity));
                let least = v_n + bound.way(&d1, &n) / motion.dt;
                set.set_least(*slot, least);
            }
        }
        worst
    }

    /// Writes the strains after the step.
    pub(crate) fn measure<K: Kernel>(
        &self,
        set: &ContactSet<K>,
        motion: &Motion<'_>,
        info: &mut ResponseInfo,
    ) {
        let acts = |contact: &Contact<K::State>| contact.impulse != Vec3::zeros() || contact.push != 0.0;
        let loaded = |slot: &u32| *slot != NONE && acts(set.contact(*slot));
        info.limited_edges = self.contacts.iter().filter(|slots| slots.iter().any(loaded)).count();
        for edge in &self.edges {
            let [a, b] = edge.vertices.map(|v| v as usize);
            let strain = (motion.buffers.end[a] - motion.buffers.end[b]).norm() / edge.rest_length - 1.0;
            info.largest_stretch = info.largest_stretch.max(strain);
            if edge.limit.compression.is_some() {
                info.largest_compression = info.largest_compression.max(-strain);
            }
        }
    }

    /// The edges beyond their limits, and the largest excess as a fraction of l₀.
    pub(crate) fn beyond(&self, motion: &Motion<'_>) -> (Vec<[u32; 2]>, f64) {
        let mut list = Vec::new();
        let mut worst = 0.0_f64;
        for edge in &self.edges {
            let [a, b] = edge.vertices.map(|v| v as usize);
            if motion.inv_mass[a] + motion.inv_mass[b] == 0.0 {
                continue;
            }
            let length = (motion.buffers.end[a] - motion.buffers.end[b]).norm();
            let start = (motion.x_t0[a] - motion.x_t0[b]).norm();
            for side in [Side::Stretch, Side::Compression] {
                if let Some(bound) = bound(edge, side, start)
                    && bound.broken_by(length)
                {
                    list.push(edge.vertices);
                    worst = worst.max((length - bound.limit).abs() / edge.rest_length);
                }
            }
        }
        (list, worst)
    }
}

/// The bound of one side of an edge in this step [m].
#[derive(Debug, Clone, Copy)]
struct Bound {
    side: Side,
    limit: f64,
    target: f64,
    near: f64,
}

/// `None`: not bounded on that side.
fn bound(edge: &LimitedEdge, side: Side, length_t0: f64) -> Option<Bound> {
    let (rest, sign, fraction) = match side {
        Side::Stretch => (edge.rest_length, 1.0, edge.limit.stretch),
        Side::Compression => (edge.rest_length, -1.0, edge.limit.compression?),
    };
    let limit = rest * (1.0 + sign * fraction);
    // Beyond it already: back by a share of the excess at least.
    let excess = (sign * (length_t0 - limit)).max(0.0);
    let limit = limit + sign * (1.0 - GIVEN_BACK) * excess;
    let target = limit - sign * rest * MARGIN.min(0.01 * fraction);
    Some(Bound { side, limit, target, near: target - sign * rest * NEAR * fraction })
}

impl Bound {
    fn broken_by(&self, length: f64) -> bool {
        match self.side {
            Side::Stretch => length > self.limit * (1.0 + ROUNDING),
            Side::Compression => length < self.limit * (1.0 - ROUNDING),
        }
    }

    fn near(&self, length: f64) -> bool {
        match self.side {
            Side::Stretch => length > self.near,
            Side::Compression => length < self.near,
        }
    }

    /// How far the first vertex has to move along `n`, against the second, for the edge `d` to have its target length [m];
    /// −∞: it cannot be beyond.
    fn way(&self, d: &Vec3, n: &Vec3) -> f64 {
        let along = d.dot(n);
        let inside = along * along - d.norm_squared() + self.target * self.target;
        match (self.side, inside > 0.0) {
            (Side::Stretch, true) => -along - inside.sqrt(),
            // Across the edge it is too long already: as short as it gets.
            (Side::Stretch, false) => -along,
            (Side::Compression, true) => -along + inside.sqrt(),
            (Side::Compression, false) => f64::NEG_INFINITY,
        }
    }
}

/// Whether the unit vector `n` is near the line of the edge `d`.
fn agrees(n: &Vec3, d: &Vec3) -> bool {
    n.dot(d).abs() > LEAST_AGREEMENT * d.norm()
}

/// The contact of an edge, without its condition. `None` if both vertices are prescribed.
fn new_contact<S: Copy>(
    edge: &LimitedEdge,
    side: Side,
    d0: Vec3,
    d1: Vec3,
    motion: &Motion<'_>,
    friction: S,
) -> Option<Contact<S>> {
    let (l0, l1) = (d0.norm(), d1.norm());
    let along = if d0.dot(&d1) > 0.0 && agrees(&(d0 / l0), &d1) { d0 / l0 } else { d1 / l1 };
    if !along.iter().all(|c| c.is_finite()) {
        return None;
    }
    let [a, b] = edge.vertices;
    let stencil = Stencil {
        kind: StencilKind::EdgeEdge,
        vertices: [a, b, a, b],
        weights: [1.0, -1.0, 0.0, 0.0],
        normal: match side {
            Side::Stretch => -along,
            Side::Compression => along,
        },
        distance: l1,
    };
    let law = NormalLaw::inelastic(f64::NEG_INFINITY);
    Contact::new(&stencil, motion.inv_mass, law, friction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::StrainLimit;
    use crate::friction::kernel::Coulomb;
    use crate::motion::MotionBuffers;

    /// One edge of 1 m, limited to 1.1 m, that the motion stretches along x to 2 m; then something turns it, and it is 1.5 m
    /// long along y. `planted`: the impulse along x is kept. Its length after the sweeps [m].
    fn turned(planted: bool) -> f64 {
        let limit = StrainLimit { stretch: 0.1, compression: None };
        let mut limiter = Limiter::new(vec![LimitedEdge { vertices: [0, 1], rest_length: 1.0, limit }]);
        limiter.begin();
        let (inv_mass, dt) = ([0.0, 1.0], 0.1);
        let x_t0 = [Vec3::zeros(), Vec3::x()];
        let mut buffers = MotionBuffers::default();
        let mut motion = Motion::new(&mut buffers, &inv_mass, &x_t0, &[Vec3::zeros(), Vec3::x() * 2.0], dt);
        let mut set = ContactSet::new(Coulomb::default());
        assert!(limiter.linearise(&mut set, &motion) > 0.8);
        let first = limiter.contacts[0][Side::Stretch as usize];
        motion.set_end(1, Vec3::y() * 1.5);
        for _ in 0..4 {
            if planted {
                let least =
                    set.contact(first).normal.dot(&set.contact(first).relative(&motion.buffers.velocity));
                set.set_least(first, least);
            } else if limiter.linearise(&mut set, &motion) == 0.0 {
                break;
            }
            set.relax(&mut motion, 1e-9, 15);
            motion.write_ends();
        }
        if !planted {
            let now = limiter.contacts[0][Side::Stretch as usize];
            assert!(now != first && set.contact(now).normal.y.abs() > 0.99, "along the edge as it lies");
            assert_eq!(set.contact(first).law.least, f64::NEG_INFINITY, "the other asks for nothing");
        }
        motion.buffers.end[1].norm()
    }

    /// An edge that contact turned is brought back along itself; across it no impulse does.
    #[test]
    fn an_edge_that_was_turned_is_pulled_along_itself() {
        assert!(turned(false) <= 1.1 * (1.0 + ROUNDING), "{}", turned(false));
        assert!(turned(true) > 1.2, "planted: {}", turned(true));
    }
}
