//! How far the vertices are from the middles of their balls, and what else a frame needs to know of all positions: one pass
//! over them, eight vertices at a time.

use super::balls::{Eight, LANES, relative};
use super::distance::Row;
use super::room::{CHUNK, Room};
use crate::ccd::instructions::{Instructions, Kernel};
use crate::ccd::lanes::{Doubles, Singles};
use crate::{CollisionMesh, Query, Vec3};
use cloth_mesh::NONE;
use rayon::prelude::*;

/// How far the vertices are from the middles of their balls during a step.
#[derive(Debug, Clone, Default)]
pub(super) struct Reach {
    /// Of each vertex, rounded up [m]; 0 for one of no triangle.
    pub(super) of_vertex: Vec<f32>,
    /// Vertices beyond their radius, ascending.
    pub(super) dangling: Vec<u32>,
    /// Tells two starts of a step from each other.
    pub(super) signature: u64,
    /// Largest coordinate of the vertices looked at, relative to the room's origin [m].
    pub(super) extent: f64,
}

/// Of a chunk of vertices.
#[derive(Debug, Default, PartialEq)]
struct Found {
    dangling: Vec<u32>,
    signature: u64,
    extent: f64,
}

impl Reach {
    /// Measures the vertices of `query` against the balls of `room`.
    pub(super) fn measure(
        &mut self,
        room: &Room,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) {
        self.of_vertex.resize(room.radii.len(), 0.0);
        let instructions = Instructions::widest();
        let parts: Vec<Found> = pool.install(|| {
            let chunks = self.of_vertex.par_chunks_mut(CHUNK).enumerate();
            let of_chunk = |(chunk, out): (usize, &mut [f32])| {
                instructions.run(OfChunk { room, mesh, query, first: chunk * CHUNK, out })
            };
            chunks.map(of_chunk).collect()
        });
        (self.signature, self.extent) = (0, 0.0);
        self.dangling.clear();
        for found in parts {
            self.dangling.extend(found.dangling);
            self.signature = self.signature.rotate_left(7) ^ found.signature;
            self.extent = self.extent.max(found.extent);
        }
    }
}

/// The measure of some vertices from `first` on.
struct OfChunk<'a> {
    room: &'a Room,
    mesh: &'a CollisionMesh,
    query: &'a Query<'a>,
    first: usize,
    out: &'a mut [f32],
}

impl Kernel for OfChunk<'_> {
    type Answer = Found;

    #[inline(always)]
    fn run<D: Doubles, S: Singles>(self) -> Found {
        if self.room.is_following { self.measure::<true>() } else { self.measure::<false>() }
    }
}

impl OfChunk<'_> {
    /// `FOLLOWS`: the scene's rigid motion is other than rest.
    #[inline(always)]
    fn measure<const FOLLOWS: bool>(self) -> Found {
        let Self { room, mesh, query, first, out } = self;
        let range = first..first + out.len();
        let (x_t0, x_t1) = (&query.x_t0[range.clone()], &query.x_t1[range.clone()]);
        let (middles, radii) = (&room.middles[range.clone()], &room.radii[range.clone()]);
        let owners = &mesh.vertex_owner[range];
        let mut all = Total { extent: [0.0; LANES], signature: [0; LANES] };
        let mut dangling = vec![];
        let mut at = 0;
        while at < out.len() {
            // The last ones once more where there are fewer than eight: in the lanes after them, which are left out.
            let count = LANES.min(out.len() - at);
            let vertex: [usize; LANES] = std::array::from_fn(|lane| at + lane.min(count - 1));
            let is_full = count == LANES;
            let block = Block {
                start: pick(x_t0, at, &vertex, is_full),
                end: pick(x_t1, at, &vertex, is_full),
                middles: pick(middles, at, &vertex, is_full),
                radii: pick(radii, at, &vertex, is_full),
                counts: std::array::from_fn(|lane| lane < count && owners[vertex[lane]] != NONE),
            };
            let (far, beyond) = block.measure::<FOLLOWS>(room, query, &mut all);
            out[at..at + count].copy_from_slice(&far[..count]);
            if beyond.contains(&true) {
                dangling.extend((0..count).filter(|&k| beyond[k]).map(|k| (first + at + k) as u32));
            }
            at += LANES;
        }
        let signature =
            |sum: u64, lane: &u64| (sum ^ lane).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
        Found {
            dangling,
            signature: all.signature.iter().fold(0, signature),
            extent: all.extent.into_iter().fold(0.0, f64::max),
        }
    }
}

#[inline(always)]
fn pick<T: Copy>(list: &[T], at: usize, vertex: &[usize; LANES], is_full: bool) -> [T; LANES] {
    match list[at..].first_chunk() {
        Some(block) if is_full => *block,
        _ => vertex.map(|v| list[v]),
    }
}

/// What the lanes have added up to.
struct Total {
    extent: Eight,
    signature: [u64; LANES],
}

struct Block {
    start: [Vec3; LANES],
    end: [Vec3; LANES],
    middles: [Row; LANES],
    radii: [f32; LANES],
    counts: [bool; LANES],
}

impl Block {
    /// How far the vertices are, and which are beyond their radius.
    #[inline(always)]
    fn measure<const FOLLOWS: bool>(
        &self,
        room: &Room,
        query: &Query<'_>,
        all: &mut Total,
    ) -> ([f32; LANES], [bool; LANES]) {
        let middles: [Eight; 3] = [0, 1, 2].map(|k| self.middles.map(|row| f64::from(row[k])));
        let [first, second] = &room.following.ends;
        let end = relative(&self.end, &room.origin);
        let mut far = room.distances::<FOLLOWS>(&end, second, &middles);
        let mut extent = largest(&end);
        if query.mode == crate::Mode::Continuous {
            let start = relative(&self.start, &room.origin);
            let far_start = room.distances::<FOLLOWS>(&start, first, &middles);
            let extent_start = largest(&start);
            for lane in 0..LANES {
                far[lane] = if far_start[lane] > far[lane] { far_start[lane] } else { far[lane] };
                let other = extent_start[lane];
                extent[lane] = if other > extent[lane] { other } else { extent[lane] };
            }
        }
        let mut beyond = [false; LANES];
        for lane in 0..LANES {
            far[lane] = if self.counts[lane] { far[lane] } else { 0.0 };
            extent[lane] = if self.counts[lane] { extent[lane] } else { 0.0 };
            beyond[lane] = far[lane] > self.radii[lane];
            all.extent[lane] = if extent[lane] > all.extent[lane] { extent[lane] } else { all.extent[lane] };
            // Any mixing that no ordinary motion undoes.
            let x = &self.start[lane];
            let bits = x.x.to_bits() ^ x.y.to_bits().rotate_left(21) ^ x.z.to_bits().rotate_left(42);
            all.signature[lane] = all.signature[lane].rotate_left(29).wrapping_add(bits);
        }
        (far, beyond)
    }
}

/// The largest coordinate of each.
#[inline(always)]
fn largest(x: &[Eight; 3]) -> Eight {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        let (a, b, c) = (x[0][lane].abs(), x[1][lane].abs(), x[2][lane].abs());
        let most = if a > b { a } else { b };
        out[lane] = if c > most { c } else { most };
    }
    out
}
