//! Balls around the vertices' paths, and how far vertices are from their middles: eight at a time.
//!
//! Plain loops over the lanes, in functions that [`Instructions`] compiles for each kind of processor: only operations that IEEE 754
//! rounds correctly, so that all give the same bits.

use super::distance::Row;
use super::frame::Frame;
use super::room::{CHUNK, ROUNDING, Room, WIDER};
use crate::ccd::instructions::{Instructions, Kernel};
use crate::ccd::lanes::{Doubles, Singles};
use crate::{CollisionMesh, Query, Vec3};
use rayon::prelude::*;

/// Vertices at a time.
pub(super) const LANES: usize = 8;
/// Numbers of these.
pub(super) type Eight = [f64; LANES];

/// The balls of some vertices.
pub(super) struct Balls {
    pub(super) middles: [Row; LANES],
    /// \[m\]
    pub(super) radii: [f32; LANES],
    /// How far the vertices are from the middles now, rounded up \[m\].
    pub(super) reach: [f32; LANES],
}

/// Coordinates relative to the origin, by axis.
#[inline(always)]
pub(super) fn relative(x: &[Vec3; LANES], origin: &Vec3) -> [Eight; 3] {
    [0, 1, 2].map(|k| x.map(|p| p[k] - origin[k]))
}

impl Room {
    /// Gives every vertex a ball for the motion of `query` and (1+α) times its length.
    pub(super) fn place(&mut self, mesh: &CollisionMesh, query: &Query<'_>, pool: &rayon::ThreadPool) {
        let (mut middles, mut radii) = (std::mem::take(&mut self.middles), std::mem::take(&mut self.radii));
        middles.resize(mesh.vertex_count, Row::default());
        radii.resize(mesh.vertex_count, 0.0);
        let (room, instructions) = (&*self, Instructions::widest());
        pool.install(|| {
            let chunks = middles.par_chunks_mut(CHUNK).zip(radii.par_chunks_mut(CHUNK)).enumerate();
            chunks.for_each(|(chunk, (middles, radii))| {
                let first = chunk * CHUNK;
                let vertices = (first..first + radii.len()).collect::<Vec<_>>();
                let place = |at: usize, balls: &Balls| {
                    let count = LANES.min(radii.len() - at);
                    middles[at..at + count].copy_from_slice(&balls.middles[..count]);
                    radii[at..at + count].copy_from_slice(&balls.radii[..count]);
                };
                instructions.run(OfVertices {
                    room,
                    mesh,
                    query,
                    alpha: room.alpha,
                    vertices: &vertices,
                    place,
                });
            });
        });
        (self.middles, self.radii) = (middles, radii);
    }

    /// Calls `place` with the balls of these vertices, eight at a time, for (1+`alpha`) times the motion of `query`.
    pub(super) fn balls(
        &self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        alpha: f64,
        vertices: &[usize],
        place: impl FnMut(usize, &Balls),
    ) {
        Instructions::widest().run(OfVertices { room: self, mesh, query, alpha, vertices, place });
    }

    #[inline(always)]
    fn eight_balls<const FOLLOWS: bool>(
        &self,
        [x_t0, x_t1]: [&[Eight; 3]; 2],
        slack: &Eight,
        alpha: f64,
    ) -> Balls {
        let [first, second] = &self.following.ends;
        let mut middles = [Row::default(); LANES];
        let mut rooms = [0.0; LANES];
        let longest = 0.5 * (1.0 + alpha);
        for lane in 0..LANES {
            let (mut start, mut end) = ([0, 1, 2].map(|k| x_t0[k][lane]), [0, 1, 2].map(|k| x_t1[k][lane]));
            if FOLLOWS {
                start = first.back(Vec3::from(start)).into();
                end = second.back(Vec3::from(end)).into();
            }
            let step: [f64; 3] = [0, 1, 2].map(|k| end[k] - start[k]);
            let length = (step[0] * step[0] + step[1] * step[1] + step[2] * step[2]).sqrt();
            let lead = if longest * length <= self.most_lead { longest } else { 0.5 };
            for k in 0..3 {
                middles[lane][k] = (start[k] + step[k] * lead) as f32;
            }
            rooms[lane] = lead * length + slack[lane];
        }
        let at: [Eight; 3] = [0, 1, 2].map(|k| middles.map(|row| f64::from(row[k])));
        let mut reach = self.distances::<FOLLOWS>(x_t0, first, &at);
        let end = self.distances::<FOLLOWS>(x_t1, second, &at);
        let mut radii = [0.0; LANES];
        for lane in 0..LANES {
            reach[lane] = if end[lane] > reach[lane] { end[lane] } else { reach[lane] };
            let room = (rooms[lane] * WIDER) as f32;
            radii[lane] = if reach[lane] > room { reach[lane] } else { room };
        }
        Balls { middles, radii, reach }
    }

    /// Distances \[m\] of positions from where the frame takes the middles of their balls, rounded up, with their share of what a
    /// frame that shortens lengths to s of them takes from a pair: s D > a + b + δ is D > a/s + b/s + δ + δ(1/s − 1).
    #[inline(always)]
    pub(super) fn distances<const FOLLOWS: bool>(
        &self,
        x: &[Eight; 3],
        frame: &Frame,
        middles: &[Eight; 3],
    ) -> [f32; LANES] {
        let longer = 1.0 / self.following.scale;
        let more = 0.5 * self.thickness * (longer - 1.0);
        let frame_size = frame.size();
        let mut out = [0.0; LANES];
        for lane in 0..LANES {
            let (p, middle) = ([0, 1, 2].map(|k| x[k][lane]), [0, 1, 2].map(|k| middles[k][lane]));
            let at = if FOLLOWS { frame.apply(Vec3::from(middle)).into() } else { middle };
            let d: [f64; 3] = [p[0] - at[0], p[1] - at[1], p[2] - at[2]];
            let size = |p: &[f64; 3]| p[0].abs() + p[1].abs() + p[2].abs();
            let rounding = ROUNDING * (size(&p) + size(&middle) + frame_size);
            let share = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt() * longer + more;
            out[lane] = (share * WIDER + rounding + f64::from(f32::MIN_POSITIVE)) as f32;
        }
        out
    }
}

struct OfVertices<'a, F> {
    room: &'a Room,
    mesh: &'a CollisionMesh,
    query: &'a Query<'a>,
    alpha: f64,
    vertices: &'a [usize],
    place: F,
}

impl<F: FnMut(usize, &Balls)> Kernel for OfVertices<'_, F> {
    type Answer = ();

    #[inline(always)]
    fn run<D: Doubles, S: Singles>(self) {
        if self.room.is_following { self.place::<true>() } else { self.place::<false>() }
    }
}

impl<F: FnMut(usize, &Balls)> OfVertices<'_, F> {
    #[inline(always)]
    fn place<const FOLLOWS: bool>(self) {
        let Self { room, mesh, query, alpha, vertices, mut place } = self;
        for (block, list) in vertices.chunks(LANES).enumerate() {
            // The last one again in the lanes that are left over.
            let vertex: [usize; LANES] = std::array::from_fn(|lane| list[lane.min(list.len() - 1)]);
            let x_t0 = relative(&vertex.map(|v| query.x_t0[v]), &room.origin);
            let x_t1 = relative(&vertex.map(|v| query.x_t1[v]), &room.origin);
            let slack = vertex.map(|v| room.slack[mesh.vertex_body[v] as usize]);
            place(block * LANES, &room.eight_balls::<FOLLOWS>([&x_t0, &x_t1], &slack, alpha));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::reach::Reach;
    use super::super::room::Weights;
    use super::super::samples::Samples;
    use super::*;
    use crate::Mode;

    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Balls of random vertices that move by `step`, and the frame after the one they were made for.
    fn scene(count: usize, turn: f64) -> (CollisionMesh, [Vec<Vec3>; 3]) {
        let mut state = 5;
        let x: Vec<Vec3> = (0..3 * count).map(|_| Vec3::from([(); 3].map(|()| random(&mut state)))).collect();
        let triangles: Vec<[u32; 3]> = (0..count as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let mut moved = |x: &[Vec3]| -> Vec<Vec3> {
            let turned = |p: &Vec3| Vec3::new(p.x - turn * p.y, p.y + turn * p.x, p.z);
            x.iter().map(|p| turned(p) + Vec3::from([(); 3].map(|()| 1e-3 * random(&mut state)))).collect()
        };
        let next = moved(&x);
        let last = moved(&next);
        (CollisionMesh::single(x.len(), &triangles).unwrap(), [x, next, last])
    }

    #[test]
    fn vertices_are_in_their_balls_and_all_instructions_agree() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        // A number of vertices that eight does not divide; at rest and following a rotation.
        for (count, turn) in [(101, 0.0), (101, 0.05)] {
            let (mesh, [x, next, last]) = scene(count, turn);
            let query =
                |a, b| Query { x_t0: a, x_t1: b, thickness: 0.01, mode: Mode::Continuous, active: None };
            let weights = Weights { alpha: 3.0, beta: 0.2, gamma: 0.1 };
            // Without any motion there is nothing to follow.
            let first = query(&x[..], if turn > 0.0 { &next[..] } else { &x[..] });
            let mut room = Room::new(&mesh, &Samples::new(&mesh), &first, weights, &pool).unwrap();
            assert_eq!(room.is_following, turn > 0.0);
            let mut reach = Reach::default();
            room.reach(&mesh, &first, true, &mut reach, &pool);
            assert!(reach.dangling.is_empty());
            let second = query(&next[..], &last[..]);
            room.reach(&mesh, &second, false, &mut reach, &pool);
            for v in 0..mesh.vertex_count {
                // In double precision, one by one.
                let middle = Vec3::from([0, 1, 2].map(|k| f64::from(room.middles[v][k])));
                let far = |x: &Vec3, frame: &Frame| (x - room.origin - frame.apply(middle)).norm();
                let [a, b] = &room.following.ends;
                let exact = far(&next[v], a).max(far(&last[v], b));
                let found = f64::from(reach.of_vertex[v]);
                let longer = 1.0 / room.following.scale;
                let most = exact * longer * 1.001 + 0.5 * room.thickness * (longer - 1.0) + 1e-6;
                assert!(found >= exact && found <= most, "{exact} {found} {most}");
            }
            let all: Vec<usize> = (0..mesh.vertex_count).collect();
            let made = |instructions: Instructions| {
                let mut out = vec![];
                let place = |_: usize, balls: &Balls| out.push((balls.middles, balls.radii, balls.reach));
                instructions.run(OfVertices {
                    room: &room,
                    mesh: &mesh,
                    query: &second,
                    alpha: 2.0,
                    vertices: &all,
                    place,
                });
                out
            };
            for &instructions in Instructions::KNOWN.iter().filter(|i| i.are_there()) {
                assert_eq!(made(instructions), made(Instructions::Plain), "{instructions:?}");
            }
        }
    }
}
