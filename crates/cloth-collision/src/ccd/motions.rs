//! The motion of all vertices of a scene, as the filters and the march read it.

use super::filter::row;
use super::lanes::{Doubles, Row, Rows, SmallRow};
use crate::Vec3;
use rayon::prelude::*;

/// Vertices of one task at least.
const VERTEX_CHUNK: usize = 4096;

/// Both ends of a vertex's motion, in one cache line.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Motion([Row; 2]);

/// The same in single precision.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Small(SmallRow);

/// Both ends of the motion of all vertices, in double precision and in single precision relative to the scene's middle.
#[derive(Debug, Clone, Default)]
pub(crate) struct Motions {
    doubles: Vec<Motion>,
    small: Vec<Small>,
    /// Distance that counts as contact [m].
    pub(crate) thickness: f64,
    /// The thickness in the units of the small coordinates.
    pub(crate) small_thickness: f64,
}

impl Motions {
    /// Of vertices that move from `start` to `end` \[m\], all finite.
    pub(crate) fn new(start: &[Vec3], end: &[Vec3], thickness: f64) -> Self {
        let small = Smaller::new(start, end);
        Self {
            doubles: start.iter().zip(end).map(|(a, b)| Motion([row(a), row(b)])).collect(),
            small: start.iter().zip(end).map(|(a, b)| small.motion(a, b)).collect(),
            thickness,
            small_thickness: thickness * small.factor,
        }
    }

    /// [`Motions::new`] on a pool.
    pub(crate) fn new_in(start: &[Vec3], end: &[Vec3], thickness: f64, pool: &rayon::ThreadPool) -> Self {
        let small = Smaller::new(start, end);
        let both = || start.par_iter().zip(end).with_min_len(VERTEX_CHUNK);
        pool.install(|| Self {
            doubles: both().map(|(a, b)| Motion([row(a), row(b)])).collect(),
            small: both().map(|(a, b)| small.motion(a, b)).collect(),
            thickness,
            small_thickness: thickness * small.factor,
        })
    }

    /// [`Motions::new_in`] in the same memory, of the vertices that `wanted` marks; what there is of others has no meaning. No
    /// vertex is farther than `reach` \[m\] from `middle` along an axis.
    pub(crate) fn refill(
        &mut self,
        [start, end]: [&[Vec3]; 2],
        thickness: f64,
        (middle, reach): (Vec3, f64),
        wanted: &[bool],
        pool: &rayon::ThreadPool,
    ) {
        let small = Smaller::about(middle, reach);
        (self.thickness, self.small_thickness) = (thickness, thickness * small.factor);
        self.doubles.resize(start.len(), Motion([[0.0; 4]; 2]));
        self.small.resize(start.len(), Small([0.0; 8]));
        let Self { doubles, small: smalls, .. } = self;
        pool.install(|| {
            let chunks = doubles.par_chunks_mut(VERTEX_CHUNK).zip(smalls.par_chunks_mut(VERTEX_CHUNK));
            chunks.enumerate().for_each(|(chunk, (doubles, smalls))| {
                let first = chunk * VERTEX_CHUNK;
                for k in (0..doubles.len()).filter(|k| wanted[first + k]) {
                    let (a, b) = (&start[first + k], &end[first + k]);
                    (doubles[k], smalls[k]) = (Motion([row(a), row(b)]), small.motion(a, b));
                }
            });
        });
    }

    /// [`Motions::new_in`] of the vertices in `order`, which number the motions.
    pub(crate) fn ordered_in(
        start: &[Vec3],
        end: &[Vec3],
        order: &[u32],
        thickness: f64,
        pool: &rayon::ThreadPool,
    ) -> Self {
        let small = Smaller::new(start, end);
        let both =
            || order.par_iter().with_min_len(VERTEX_CHUNK).map(|&v| (&start[v as usize], &end[v as usize]));
        pool.install(|| Self {
            doubles: both().map(|(a, b)| Motion([row(a), row(b)])).collect(),
            small: both().map(|(a, b)| small.motion(a, b)).collect(),
            thickness,
            small_thickness: thickness * small.factor,
        })
    }

    #[inline(always)]
    pub(crate) fn rows(&self, vertices: &[u32; 4]) -> Rows<'_> {
        let (a, b) = (&self.doubles[vertices[0] as usize].0, &self.doubles[vertices[1] as usize].0);
        let (c, d) = (&self.doubles[vertices[2] as usize].0, &self.doubles[vertices[3] as usize].0);
        [&a[0], &b[0], &c[0], &d[0], &a[1], &b[1], &c[1], &d[1]]
    }

    #[inline(always)]
    pub(crate) fn small_rows(&self, vertices: &[u32; 4]) -> [&SmallRow; 4] {
        let (a, b) = (&self.small[vertices[0] as usize].0, &self.small[vertices[1] as usize].0);
        let (c, d) = (&self.small[vertices[2] as usize].0, &self.small[vertices[3] as usize].0);
        [a, b, c, d]
    }
}

/// What makes coordinates small: the middle of the scene, and a power of two that makes none larger than 1.
struct Smaller {
    middle: Vec3,
    factor: f64,
}

impl Smaller {
    fn new(start: &[Vec3], end: &[Vec3]) -> Self {
        let (mut lo, mut hi) = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
        for p in start.iter().chain(end) {
            for axis in 0..3 {
                lo[axis] = if p[axis] < lo[axis] { p[axis] } else { lo[axis] };
                hi[axis] = if p[axis] > hi[axis] { p[axis] } else { hi[axis] };
            }
        }
        // Halves before the sum: no overflow.
        let middle = lo * 0.5 + hi * 0.5;
        Self::about(middle, (hi - middle).amax().max((middle - lo).amax()))
    }

    /// Of coordinates that differ from the middle's by no more than `reach`.
    fn about(middle: Vec3, reach: f64) -> Self {
        // Where there is no such power, coordinates that are no numbers: a filter that rejects nothing.
        let factor = match 0.5 * reach.inverse_exponent() {
            factor if reach * factor <= 1.0 && factor.is_normal() => factor,
            _ => f64::NAN,
        };
        Self { middle, factor }
    }

    fn motion(&self, start: &Vec3, end: &Vec3) -> Small {
        let (a, b) = ((start - self.middle) * self.factor, (end - self.middle) * self.factor);
        Small([a.x as f32, a.y as f32, a.z as f32, 0.0, b.x as f32, b.y as f32, b.z as f32, 0.0])
    }
}
