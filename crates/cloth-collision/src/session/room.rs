//! The room that a session gives to each vertex: a ball that it is expected to stay in for n_f frames.
//!
//! d_e(P) = (α v + β v′) Δt + γ t′, with v the vertex' speed, v′ the mean speed of its body and t′ the mean edge length of
//! the dynamic bodies. The vertex' own part α v Δt has a direction: with the step v Δt of the first frame the path is from x to
//! x + (1+α) v Δt. The ball lies about its middle, where half the radius covers the same path:
//! e = ½(1+α) v Δt + β v′Δt + γ t′. Speeds are relative to the rigid motion of the whole scene ([`super::frame`]), if that makes
//! them less. What has moved by more than its ball allows *dangles*. That is decided by
//! the position itself, at both ends of every step, so that no change of speed can lose a contact.

use super::distance::Row;
use super::flat::Balls;
use super::frame::{Following, Frame};
use crate::bounds::middle;
use crate::{CollisionMesh, Query, Vec3};
use cloth_mesh::NONE;
use rayon::prelude::*;

/// Mean radius, in mean edge lengths, up to which sessions pay: α is lowered to that, and without α a frame beyond
/// it stands alone.
const MOST_ROOM: f64 = 0.35;
/// Radius, in mean edge lengths, beyond which the path of a single vertex is not followed further than its present step.
const MOST_LEAD: f64 = 2.0;
/// Coordinates beyond this [m], relative to the middle of the scene, stay out of single precision's squares.
const FARTHEST: f64 = 1e15;
/// Every so many edges are measured for the mean length.
const EDGE_STRIDE: usize = 16;
/// Vertices per task; fixed, and sums are taken in its order.
const CHUNK: usize = 4096;
/// Widens a length for its narrowing to single precision.
const WIDER: f64 = 1.0 + 1.0 / (1 << 22) as f64;
/// Of the coordinates of a difference: several roundings in double precision.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

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
    origin: Vec3,
    /// Middles relative to the origin [m].
    pub(super) middles: Vec<Row>,
    /// Radii [m].
    pub(super) radii: Vec<f32>,
    /// β v′Δt + γ t′ of each body [m].
    slack: Vec<f64>,
    /// Longer paths are followed for the present step only [m].
    most_lead: f64,
    is_following: bool,
    /// The scene's rigid motion in the present step.
    following: Following,
}

/// How far the vertices are from the middles of their balls during a step.
#[derive(Debug, Clone, Default)]
pub(super) struct Reach {
    /// Of each vertex, rounded up [m].
    pub(super) of_vertex: Vec<f32>,
    /// The largest one [m].
    pub(super) largest: f32,
    /// Vertices beyond their radius, ascending.
    pub(super) dangling: Vec<u32>,
    /// Tells two starts of a step from each other.
    pub(super) signature: u64,
}

impl Room {
    /// Balls for the motion of `query` and (1+α) times its length; None if they had to be too large.
    pub(super) fn new(
        mesh: &CollisionMesh,
        query: &Query<'_>,
        weights: Weights,
        pool: &rayon::ThreadPool,
    ) -> Option<Self> {
        let Query { x_t0, x_t1, .. } = *query;
        let origin = middle(x_t0);
        let before = |v: usize| x_t0[v] - origin;
        let following = Following::fit(mesh, before, &origin, [x_t0, x_t1], &Frame::at_rest());
        let steps = Steps::new(mesh, query, &origin, &following, pool);
        if !(steps.extent < FARTHEST) {
            return None;
        }
        let is_following = steps.is_less_following;
        let following = if is_following { following } else { Following::none() };
        let edge = mean_edge(mesh, x_t1);
        // What does not move at all needs no room; a frame that is followed comes with its rounding.
        let moves = |mean: f64| is_following || mean > 0.0;
        let slack_of = |mean: f64| if moves(mean) { weights.beta * mean + weights.gamma * edge } else { 0.0 };
        let slack: Vec<f64> = steps.mean.iter().map(|&mean| slack_of(mean)).collect();
        // Mean over the dynamic vertices of ½(1+α) v Δt + slack ≤ most.
        let weigh = |of_body: &dyn Fn(usize) -> f64| {
            let counted: f64 = steps.count.iter().map(|&n| n as f64).sum();
            let sum: f64 = (0..mesh.bodies.len()).map(|b| steps.count[b] as f64 * of_body(b)).sum();
            if counted > 0.0 { sum / counted } else { 0.0 }
        };
        let (mean_step, mean_slack) = (weigh(&|b| steps.mean[b]), weigh(&|b| slack[b]));
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
            middles: vec![Row::default(); x_t0.len()],
            radii: vec![0.0; x_t0.len()],
            slack,
            most_lead: MOST_LEAD * edge,
            is_following,
            following,
        };
        let (mut middles, mut radii) = (std::mem::take(&mut room.middles), std::mem::take(&mut room.radii));
        pool.install(|| {
            let balls = middles.par_chunks_mut(CHUNK).zip(radii.par_chunks_mut(CHUNK)).enumerate();
            balls.for_each(|(chunk, (middles, radii))| {
                for (k, (middle, radius)) in middles.iter_mut().zip(radii).enumerate() {
                    (*middle, *radius) = room.ball(mesh, query, chunk * CHUNK + k, alpha);
                }
            });
        });
        (room.middles, room.radii) = (middles, radii);
        Some(room)
    }

    /// The balls, for what only asks where vertices are.
    pub(super) fn balls(&self) -> Balls<'_> {
        Balls { middles: &self.middles, radii: &self.radii, thickness: self.thickness }
    }

    /// Middle and radius of the ball around the path of a vertex over (1+α) steps like that of `query`.
    #[inline]
    fn ball(&self, mesh: &CollisionMesh, query: &Query<'_>, v: usize, alpha: f64) -> (Row, f32) {
        let (x_t0, x_t1) = (query.x_t0[v] - self.origin, query.x_t1[v] - self.origin);
        let [first, second] = &self.following.ends;
        let start = first.back(x_t0);
        let step = second.back(x_t1) - start;
        let length = step.norm();
        let mut lead = 0.5 * (1.0 + alpha);
        if !(lead * length <= self.most_lead) {
            lead = 0.5;
        }
        let middle = start + step * lead;
        let row = [middle.x as f32, middle.y as f32, middle.z as f32, 0.0];
        let room = lead * length + self.slack[mesh.vertex_body[v] as usize];
        let now = self.distance(&x_t0, first, &row).max(self.distance(&x_t1, second, &row));
        (row, ((room * WIDER) as f32).max(now))
    }

    /// Distance [m] of a position from where the frame takes a ball's middle, rounded up, with its share of what a frame that
    /// shortens lengths to s of them takes from a pair: s D > a + b + δ is D > a/s + b/s + δ + δ(1/s − 1).
    #[inline]
    fn distance(&self, x: &Vec3, frame: &Frame, row: &Row) -> f32 {
        let middle = Vec3::new(f64::from(row[0]), f64::from(row[1]), f64::from(row[2]));
        let d = x - frame.apply(middle);
        let size = |p: &Vec3| p.x.abs() + p.y.abs() + p.z.abs();
        let rounding = ROUNDING * (size(x) + size(&middle) + frame.size());
        let longer = 1.0 / self.following.scale;
        let share = d.norm() * longer + 0.5 * self.thickness * (longer - 1.0);
        (share * WIDER + rounding + f64::from(f32::MIN_POSITIVE)) as f32
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
        let is_moving = query.mode == crate::Mode::Continuous;
        if self.is_following && !is_first {
            let middles = |v: usize| Vec3::from([0, 1, 2].map(|k| f64::from(self.middles[v][k])));
            let start = &self.following.ends[1];
            self.following = Following::fit(mesh, middles, &self.origin, [query.x_t0, query.x_t1], start);
        }
        let room = &*self;
        out.of_vertex.resize(self.radii.len(), 0.0);
        let parts: Vec<(Vec<u32>, f32, u64)> = pool.install(|| {
            let chunks = out.of_vertex.par_chunks_mut(CHUNK).enumerate();
            chunks
                .map(|(chunk, reach)| {
                    let (mut dangling, mut largest, mut signature) = (vec![], 0.0f32, 0u64);
                    for (k, reach) in reach.iter_mut().enumerate() {
                        let v = chunk * CHUNK + k;
                        if mesh.vertex_owner[v] == NONE {
                            continue;
                        }
                        let [first, second] = &room.following.ends;
                        let (start, row) = (&query.x_t0[v], &room.middles[v]);
                        let mut far = room.distance(&(query.x_t1[v] - room.origin), second, row);
                        if is_moving {
                            far = far.max(room.distance(&(start - room.origin), first, row));
                        }
                        *reach = far;
                        largest = largest.max(far);
                        if far > room.radii[v] {
                            dangling.push(v as u32);
                        }
                        // Any mixing that no ordinary motion undoes.
                        let bits = start.x.to_bits() ^ start.y.to_bits().rotate_left(21);
                        let bits = bits ^ start.z.to_bits().rotate_left(42);
                        signature = (signature ^ bits).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
                    }
                    (dangling, largest, signature)
                })
                .collect()
        });
        (out.largest, out.signature) = (0.0, 0);
        out.dangling.clear();
        for (dangling, largest, signature) in parts {
            out.dangling.extend(dangling);
            out.largest = out.largest.max(largest);
            out.signature = out.signature.rotate_left(7) ^ signature;
        }
    }

    /// Gives each dangling vertex a ball around its path from here, for so many further steps, and measures its reach again.
    pub(super) fn move_balls(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        reach: &mut Reach,
        steps_left: u32,
    ) {
        for &v in &reach.dangling {
            let k = v as usize;
            (self.middles[k], self.radii[k]) = self.ball(mesh, query, k, f64::from(steps_left));
            let (row, [first, second]) = (&self.middles[k], &self.following.ends);
            let at = |x: &[Vec3], frame| self.distance(&(x[k] - self.origin), frame, row);
            reach.of_vertex[k] = at(query.x_t0, first).max(at(query.x_t1, second));
        }
        reach.largest = reach.of_vertex.iter().copied().fold(0.0, f32::max);
    }
}

/// Of some vertices of a body: how many, and their steps' lengths, as they are and relative to the frames [m].
type Lengths = (usize, [f64; 2]);

/// The steps of the bodies' vertices.
struct Steps {
    /// Vertices on a surface, 0 for a body that is not dynamic.
    count: Vec<usize>,
    /// Mean length of a step of each body [m], relative to the frames if that is less over all.
    mean: Vec<f64>,
    is_less_following: bool,
    /// Largest coordinate at both ends, relative to the origin [m].
    extent: f64,
}

impl Steps {
    fn new(
        mesh: &CollisionMesh,
        query: &Query<'_>,
        origin: &Vec3,
        following: &Following,
        pool: &rayon::ThreadPool,
    ) -> Self {
        let bodies = mesh.bodies.len();
        let chunk_count = mesh.vertex_count.div_ceil(CHUNK);
        let [first, second] = &following.ends;
        let of_chunk = |chunk: usize| {
            let (mut sums, mut extent) = (vec![(0, [0.0; 2]); bodies], 0.0f64);
            for v in chunk * CHUNK..((chunk + 1) * CHUNK).min(mesh.vertex_count) {
                if mesh.vertex_owner[v] == NONE {
                    continue;
                }
                let (x_t0, x_t1) = (query.x_t0[v] - origin, query.x_t1[v] - origin);
                let (count, lengths) = &mut sums[mesh.vertex_body[v] as usize];
                *count += 1;
                lengths[0] += (x_t1 - x_t0).norm();
                lengths[1] += (second.back(x_t1) - first.back(x_t0)).norm();
                for d in [x_t0, x_t1] {
                    extent = extent.max(d.x.abs()).max(d.y.abs()).max(d.z.abs());
                }
            }
            (sums, extent)
        };
        let parts: Vec<(Vec<Lengths>, f64)> =
            pool.install(|| (0..chunk_count).into_par_iter().map(of_chunk).collect());
        let (mut count, mut sums, mut extent) = (vec![0; bodies], vec![[0.0; 2]; bodies], 0.0f64);
        for (of_bodies, part) in parts {
            for (b, (n, lengths)) in of_bodies.into_iter().enumerate() {
                count[b] += n;
                sums[b][0] += lengths[0];
                sums[b][1] += lengths[1];
            }
            extent = extent.max(part);
        }
        let total = |k: usize| sums.iter().map(|s| s[k]).sum::<f64>();
        let is_less_following = total(1) < total(0);
        let mean =
            (0..bodies).map(|b| sums[b][usize::from(is_less_following)] / count[b].max(1) as f64).collect();
        for b in 0..bodies {
            if !mesh.bodies[b].dynamic {
                count[b] = 0;
            }
        }
        Self { count, mean, is_less_following, extent }
    }
}

/// Mean length of the dynamic bodies' edges [m], from a part of them.
fn mean_edge(mesh: &CollisionMesh, x: &[Vec3]) -> f64 {
    let is_dynamic = |e: &&[u32; 2]| mesh.bodies[mesh.vertex_body[e[0] as usize] as usize].dynamic;
    let (mut sum, mut count) = (0.0, 0usize);
    for [a, b] in mesh.edges.iter().filter(is_dynamic).step_by(EDGE_STRIDE) {
        sum += (x[*a as usize] - x[*b as usize]).norm();
        count += 1;
    }
    sum / count.max(1) as f64
}
