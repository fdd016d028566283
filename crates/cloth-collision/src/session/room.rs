//! The room that a session gives to each vertex: a ball that it is expected to stay in for n_f frames.
//!
//! d_e(P) = (α v + β v′) Δt + γ t′, with v the vertex' speed, v′ the mean speed of its body and t′ the mean edge length of
//! the dynamic bodies. The vertex' own part α v Δt has a direction: with the step v Δt of the first frame the path is from x to
//! x + (1+α) v Δt. The ball lies about its middle, where half the radius covers the same path:
//! e = ½(1+α) v Δt + β v′Δt + γ t′. Speeds are relative to the rigid motion of the whole scene ([`super::frame`]), if that makes
//! them less. What has moved by more than its ball allows *dangles*. That is decided by
//! the position itself, at both ends of every step, so that no change of speed can lose a contact.

use super::balls::LANES;
use super::distance::Row;
use super::flat::Whereabouts;
use super::frame::{Following, Frame};
use super::reach::Reach;
use super::samples::{Samples, Steps};
use crate::bounds::middle;
use crate::{CollisionMesh, Query, Vec3};

/// Mean radius, in mean edge lengths, up to which sessions pay: α is lowered to that, and without α a frame beyond
/// it stands alone.
const MOST_ROOM: f64 = 0.35;
/// Radius, in mean edge lengths, beyond which the path of a single vertex is not followed further than its present step.
const MOST_LEAD: f64 = 2.0;
/// Coordinates beyond this [m], relative to the middle of the scene, stay out of single precision's squares.
pub(super) const FARTHEST: f64 = 1e15;
/// Vertices per task; fixed, and sums are taken in its order.
pub(super) const CHUNK: usize = 4096;
/// Widens a length for its narrowing to single precision.
pub(super) const WIDER: f64 = 1.0 + 1.0 / (1 << 22) as f64;
/// Of the coordinates of a difference: several roundings in double precision.
pub(super) const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// α, β, γ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weights {
    pub(super) alpha: f64,
    pub(super) beta: f64,
    pub(super) gamma: f64,
}

/// The balls, and for what thickness they are.
#[derive(Debug, Clone)]
pub(super) struct Room {
    pub(super) thickness: f64,
    /// α after its limit.
    pub(super) alpha: f64,
    pub(super) origin: Vec3,
    /// Middles relative to the origin [m].
    pub(super) middles: Vec<Row>,
    /// Radii [m].
    pub(super) radii: Vec<f32>,
    /// β v′Δt + γ t′ of each body [m].
    pub(super) slack: Vec<f64>,
    /// Longer paths are followed for the present step only [m].
    pub(super) most_lead: f64,
    pub(super) is_following: bool,
    /// The scene's rigid motion in the present step.
    pub(super) following: Following,
}

/// How far the bodies move in a step, relative to the rigid motion of the whole scene if that is less.
struct Motion {
    origin: Vec3,
    following: Following,
    steps: Steps,
    /// Mean length of the dynamic bodies' edges \[m\].
    edge: f64,
}

impl Motion {
    fn new(mesh: &CollisionMesh, samples: &Samples, query: &Query<'_>) -> Self {
        let Query { x_t0, x_t1, .. } = *query;
        let origin = middle(x_t0);
        let before = |v: usize| x_t0[v] - origin;
        let following = Following::fit(mesh, before, &origin, [x_t0, x_t1], &Frame::at_rest());
        let steps = Steps::new(samples, mesh, query, &origin, &following);
        let following = if steps.is_less_following { following } else { Following::none() };
        Self { origin, following, steps, edge: samples.mean_edge(x_t1) }
    }
}

/// Mean step of the dynamic vertices in `query`, in mean edge lengths, as a session would see it.
pub(super) fn steps_in_edges(mesh: &CollisionMesh, samples: &Samples, query: &Query<'_>) -> f64 {
    let Motion { steps, edge, .. } = Motion::new(mesh, samples, query);
    steps.mean_over_dynamic(&steps.mean) / edge
}

impl Room {
    /// Balls for the motion of `query` and (1+α) times its length; None if they had to be too large.
    pub(super) fn new(
        mesh: &CollisionMesh,
        samples: &Samples,
        query: &Query<'_>,
        weights: Weights,
        pool: &rayon::ThreadPool,
    ) -> Option<Self> {
        let Motion { origin, following, steps, edge } = Motion::new(mesh, samples, query);
        let is_following = steps.is_less_following;
        // What does not move at all needs no room; a frame that is followed comes with its rounding.
        let moves = |mean: f64| is_following || mean > 0.0;
        let slack_of = |mean: f64| if moves(mean) { weights.beta * mean + weights.gamma * edge } else { 0.0 };
        let slack: Vec<f64> = steps.mean.iter().map(|&mean| slack_of(mean)).collect();
        // Mean over the dynamic vertices of ½(1+α) v Δt + slack ≤ most.
        let (mean_step, mean_slack) = (steps.mean_over_dynamic(&steps.mean), steps.mean_over_dynamic(&slack));
        let mut alpha = weights.alpha;
        if 0.5 * (1.0 + alpha) * mean_step + mean_slack > MOST_ROOM * edge {
            alpha = 2.0 * (MOST_ROOM * edge - mean_slack) / mean_step - 1.0;
            if !(alpha >= 0.0) {
                return None;
            }
        }
        let mut room = Self {
            thickness: query.thickness,
            alpha,
            origin,
            middles: vec![],
            radii: vec![],
            slack,
            most_lead: MOST_LEAD * edge,
            is_following,
            following,
        };
        room.place(mesh, query, pool);
        Some(room)
    }

    /// The balls, for what only asks where vertices are.
    pub(super) fn whereabouts(&self) -> Whereabouts<'_> {
        Whereabouts { middles: &self.middles, radii: &self.radii, thickness: self.thickness }
    }

    /// Where the vertices of `query` are in their balls. `is_first`: the balls were made for it.
    pub(super) fn reach(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        is_first: bool,
        out: &mut Reach,
        pool: &rayon::ThreadPool,
    ) {
        if self.is_following && !is_first {
            let middles = |v: usize| Vec3::from([0, 1, 2].map(|k| f64::from(self.middles[v][k])));
            let start = &self.following.ends[1];
            self.following = Following::fit(mesh, middles, &self.origin, [query.x_t0, query.x_t1], start);
        }
        out.measure(self, mesh, query, pool);
    }

    /// Gives each dangling vertex a ball around its path from here, for so many further steps, and measures its reach again.
    pub(super) fn move_balls(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        reach: &mut Reach,
        steps_left: u32,
    ) {
        let vertices: Vec<usize> = reach.dangling.iter().map(|&v| v as usize).collect();
        let mut made = vec![];
        self.balls(mesh, query, f64::from(steps_left), &vertices, |at, balls| {
            let lanes = vertices[at..].iter().enumerate().take(LANES);
            made.extend(lanes.map(|(k, &v)| (v, balls.middles[k], balls.radii[k], balls.reach[k])));
        });
        for (v, middle, radius, far) in made {
            (self.middles[v], self.radii[v], reach.of_vertex[v]) = (middle, radius, far);
        }
    }
}
