//! What the response did in one step.

use crate::Vec3;

/// Counts and seconds of one accepted step.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ResponseInfo {
    /// Pairs within the thickness at `x_t0`.
    pub proximities: usize,
    /// Those of them whose side is remembered.
    pub remembered: usize,
    /// Pairs whose normal their side decided: they touch but for rounding, or went through.
    pub by_side: usize,
    /// Continuous detections over the step, the first (over all pairs) included.
    pub passes: usize,
    /// Triangles that were not searched against their own surface for near pairs, as that proved flat
    /// ([`cloth_collision::Bvh::prove_flatness`]).
    pub flat_triangles: u64,
    /// Vertices that the first continuous detection looked at: all, or with [`crate::ResponseParams::skip_proved`] those that could
    /// carry a pair across its gap; 0: it was left out.
    pub looked_at: usize,
    /// Pairs that collided in the first of them: what the repulsion left.
    pub collisions: usize,
    /// Contacts that carry an impulse in the end.
    pub impulses: usize,
    /// Sweeps over the contacts, all passes together.
    pub sweeps: usize,
    /// Largest error of a contact's relative velocity after the last sweep [m/s].
    pub residual: f64,
    /// Rigid impact zones.
    pub zones: usize,
    /// Vertices in them.
    pub zone_vertices: usize,
    /// Vertices whose motion was held back (partly or fully).
    pub held_vertices: usize,
    /// Pairs exempt because they are in contact already at `x_t0` (known-intersecting starts only).
    pub exempt: usize,
    /// Pairs that still collide, exempt ones aside: always 0 in an accepted step.
    pub remaining: usize,
    /// Contacts with friction that carry an impulse and stick.
    pub sticking: usize,
    /// Contacts with friction that carry an impulse and slide.
    pub sliding: usize,
    /// Friction was Coulomb's with the coefficients at rest, as no contact was fast enough for more
    /// ([`crate::ResponseParams::friction_tolerance`]).
    pub slow_friction: bool,
    /// Σ m times the way that pushes moved a vertex [kg m]: what repulsion does against gravity is −g times this.
    pub pushed: Vec3,
    /// Edges of cloth that strain limiting pulled or pushed.
    pub limited_edges: usize,
    /// Times that the strain limits were linearised anew.
    pub strain_passes: usize,
    /// Largest stretch l/l₀ − 1 of a limited edge after the step [-]; 0 without limits.
    pub largest_stretch: f64,
    /// Largest compression 1 − l/l₀ of an edge whose compression is limited, after the step [-]; 0 without limits.
    pub largest_compression: f64,
    /// Pairs of bodies with near features, the lower first, where some cloth may sleep ([`crate::Responder::respond_resting`]).
    pub meetings: Vec<[u32; 2]>,
    /// Seconds per stage, in the order in which the stages run.
    pub seconds: Vec<(&'static str, f64)>,
}

impl ResponseInfo {
    /// Adds seconds to a stage, which keeps the place of its first mention.
    pub(crate) fn add_seconds(&mut self, stage: &'static str, seconds: f64) {
        match self.seconds.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum += seconds,
            None => self.seconds.push((stage, seconds)),
        }
    }
}
