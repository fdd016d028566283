//! Decides many pairs: two filters in single precision, the first of which also finds the pairs that touch from the start, then
//! the march of those that they leave, whose answers the filter in double precision may overrule.

use super::coarse;
use super::edge_edge::EdgeEdgeMotion;
use super::filter::{self, Points};
use super::instructions::{Instructions, Kernel};
use super::lanes::{Doubles, MAX_DOUBLES, MAX_SINGLES, Mask, Singles, SmallRow, Vector};
use super::march::{NEVER, march, points};
use super::motions::Motions;
use super::vertex_triangle::VertexTriangleMotion;
use crate::StencilKind;

/// Share of the pairs that the second filter leaves from which on it is of little use.
const MOST_LEFT: f64 = 0.75;

/// The pairs to decide, by number.
pub(crate) trait Pairs {
    fn count(&self) -> usize;
    /// The four vertices of a pair, as the [`Motions`] number them. Implementations are `#[inline(always)]`.
    fn vertices(&self, pair: usize) -> [u32; 4];
}

impl Pairs for [[u32; 4]] {
    #[inline(always)]
    fn count(&self) -> usize {
        self.len()
    }
    #[inline(always)]
    fn vertices(&self, pair: usize) -> [u32; 4] {
        self[pair]
    }
}

/// The pairs of a batch that the filters have left; its memory is used again.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    /// Their numbers, but for those that touch from the start.
    numbers: Vec<u32>,
    /// The numbers of these.
    touching: Vec<u32>,
    vertices: Vec<[u32; 4]>,
    times: Vec<f64>,
    /// Those that wait for an answer, by their place here.
    waiting: Vec<u32>,
}

impl Batch {
    /// Decides the pairs, with the single-pair tests' answers, which [`Batch::contacts`] lists. Returns how many neither were
    /// apart by the filters nor touch from the start: contacts later than 0 are among these.
    #[inline]
    pub(crate) fn decide<P: Pairs + ?Sized>(
        &mut self,
        instructions: Instructions,
        kind: StencilKind,
        motions: &Motions,
        pairs: &P,
    ) -> usize {
        instructions.run(Decide { kind, motions, pairs, batch: self })
    }

    /// The pairs in contact with their times, in no particular order.
    pub(crate) fn contacts(&self) -> impl Iterator<Item = (u32, f64)> {
        let marched = self.numbers.iter().copied().zip(self.times.iter().copied()).filter(|c| c.1 != NEVER);
        self.touching.iter().map(|&number| (number, 0.0)).chain(marched)
    }
}

struct Decide<'b, P: ?Sized> {
    kind: StencilKind,
    motions: &'b Motions,
    pairs: &'b P,
    batch: &'b mut Batch,
}

impl<P: Pairs + ?Sized> Kernel for Decide<'_, P> {
    type Answer = usize;

    #[inline(always)]
    fn run<D: Doubles, S: Singles>(self) -> usize {
        let Self { kind, motions, pairs, batch } = self;
        batch.coarse_filter::<S, P>(kind, motions, pairs);
        let left = batch.numbers.len();
        batch.second_filter::<S, P>(kind, motions, pairs);
        // Where single precision tells few pairs apart, those that double precision does leave before the march.
        let is_blunt = batch.numbers.len() as f64 > MOST_LEFT * left as f64;
        if is_blunt {
            batch.fine_filter::<D>(kind, motions);
        }
        let Batch { vertices, times, waiting, .. } = batch;
        waiting.clear();
        waiting.extend(0..vertices.len() as u32);
        times.clear();
        times.resize(vertices.len(), NEVER);
        let rows = |place: u32| motions.rows(&vertices[place as usize]);
        let thickness = motions.thickness;
        match kind {
            StencilKind::VertexTriangle => {
                march::<D, VertexTriangleMotion<D>, 3>(rows, thickness, !is_blunt, waiting, times)
            }
            StencilKind::EdgeEdge => {
                march::<D, EdgeEdgeMotion<D>, 4>(rows, thickness, !is_blunt, waiting, times)
            }
        }
    }
}

impl Batch {
    /// Lists the pairs that [`coarse`] does not show to be apart: those that touch from the start by themselves.
    #[inline(always)]
    fn coarse_filter<S: Singles, P: Pairs + ?Sized>(
        &mut self,
        kind: StencilKind,
        motions: &Motions,
        pairs: &P,
    ) {
        let Self { numbers: list, touching, .. } = self;
        let (count, is_thick) = (pairs.count(), motions.thickness > 0.0);
        // Room for whole groups behind those that are kept.
        list.clear();
        list.resize(count + MAX_SINGLES, 0);
        touching.clear();
        touching.resize(if is_thick { count + MAX_SINGLES } else { 0 }, 0);
        let (mut kept, mut kept_touching, mut first) = (0, 0, 0);
        let mut rows = [[&ORIGIN; 4]; MAX_SINGLES];
        let mut numbers = [0; MAX_SINGLES];
        while first < count {
            let lanes = S::COUNT.min(count - first);
            for lane in 0..S::COUNT {
                let number = first + lane.min(lanes - 1);
                numbers[lane] = number as u32;
                rows[lane] = motions.small_rows(&pairs.vertices(number));
            }
            let points = small_points::<S>(&rows);
            let mut left = !coarse::apart(kind, &points, motions.small_thickness, coarse::UNIT);
            if is_thick && left.any() {
                let touches = coarse::touching(kind, &points, motions.small_thickness, coarse::UNIT);
                kept_touching += keep::<S>(left & touches, lanes, &numbers, &mut touching[kept_touching..]);
                left = left & !touches;
            }
            kept += keep::<S>(left, lanes, &numbers, &mut list[kept..]);
            first += lanes;
        }
        list.truncate(kept);
        touching.truncate(kept_touching);
    }

    /// Keeps the pairs that more directions do not show to be apart, and lists their vertices.
    #[inline(always)]
    fn second_filter<S: Singles, P: Pairs + ?Sized>(
        &mut self,
        kind: StencilKind,
        motions: &Motions,
        pairs: &P,
    ) {
        let Self { numbers: list, vertices, .. } = self;
        let (mut kept, mut first, count) = (0, 0, list.len());
        list.resize(count + MAX_SINGLES, 0);
        let mut rows = [[&ORIGIN; 4]; MAX_SINGLES];
        while first < count {
            let lanes = S::COUNT.min(count - first);
            let mut numbers = [0; MAX_SINGLES];
            numbers[..S::COUNT].copy_from_slice(&list[first..first + S::COUNT]);
            for lane in 0..S::COUNT {
                rows[lane] = motions.small_rows(&pairs.vertices(numbers[lane.min(lanes - 1)] as usize));
            }
            let points = small_points::<S>(&rows);
            let apart = coarse::apart_by_more(kind, &points, motions.small_thickness, coarse::UNIT);
            // What is written over has been read.
            kept += keep::<S>(!apart, lanes, &numbers, &mut list[kept..]);
            first += lanes;
        }
        list.truncate(kept);
        vertices.clear();
        vertices.extend(list.iter().map(|&number| pairs.vertices(number as usize)));
    }

    /// Keeps the pairs that [`filter`] does not show to be apart.
    #[inline(always)]
    fn fine_filter<D: Doubles>(&mut self, kind: StencilKind, motions: &Motions) {
        let Self { numbers, vertices, .. } = self;
        let (mut kept, mut first) = (0, 0);
        // Every pair is written, and the next one over it if it is apart: no branch on what is hard to foresee.
        while first < vertices.len() {
            let count = D::COUNT.min(vertices.len() - first);
            let rows = |place: u32| motions.rows(&vertices[place as usize]);
            let mut places = [0; MAX_DOUBLES];
            for lane in 0..count {
                places[lane] = (first + lane) as u32;
            }
            let points = points::<D>(&rows, &places[..count]);
            let apart = filter::apart::<D>(kind, &points, motions.thickness).bits();
            for lane in 0..count {
                (numbers[kept], vertices[kept]) = (numbers[first + lane], vertices[first + lane]);
                kept += (!apart >> lane & 1) as usize;
            }
            first += count;
        }
        numbers.truncate(kept);
        vertices.truncate(kept);
    }
}

/// Writes the numbers of the first `lanes` lanes that are set, in their order; what comes behind them has no meaning. Returns
/// how many they are.
#[inline(always)]
fn keep<S: Singles>(set: S::Mask, lanes: usize, numbers: &[u32; MAX_SINGLES], out: &mut [u32]) -> usize {
    let set = set.bits() & ((1 << lanes) - 1);
    S::compress(set, numbers, out.first_chunk_mut().expect("room for a group"));
    set.count_ones() as usize
}

static ORIGIN: SmallRow = [0.0; 8];

#[inline(always)]
fn small_points<S: Singles>(rows: &[[&SmallRow; 4]; MAX_SINGLES]) -> Points<S> {
    let mut points = [Vector([S::splat(0.0); 3]); 8];
    for k in 0..4 {
        [points[k], points[k + 4]] = S::gather(rows, k);
    }
    points
}
