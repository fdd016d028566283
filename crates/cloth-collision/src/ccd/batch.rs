//! Decides many pairs: the filters, then the march of those that they leave.

use super::coarse;
use super::edge_edge::EdgeEdgeMotion;
use super::filter;
use super::instructions::{Instructions, Kernel};
use super::lanes::{Doubles, MAX_SINGLES, Mask, Singles, SmallRow, Vector};
use super::march::{NEVER, march, points};
use super::motions::Motions;
use super::vertex_triangle::VertexTriangleMotion;
use crate::StencilKind;

/// The pairs of a batch, by number; its memory is used again.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    pairs: Vec<u32>,
    times: Vec<f64>,
}

impl Batch {
    /// Decides the pairs with these `vertices`, with the single-pair tests' answers. Returns how many the filters have
    /// left; [`Batch::contacts`] are among these.
    #[inline]
    pub(crate) fn decide(
        &mut self,
        instructions: Instructions,
        kind: StencilKind,
        motions: &Motions,
        vertices: &[[u32; 4]],
    ) -> usize {
        self.times.clear();
        self.times.resize(vertices.len(), NEVER);
        instructions.run(Decide { kind, motions, vertices, batch: self })
    }

    /// The pairs in contact, in their order, with their times.
    pub(crate) fn contacts(&self) -> impl Iterator<Item = (u32, f64)> {
        self.times.iter().enumerate().filter(|t| *t.1 != NEVER).map(|(pair, &t)| (pair as u32, t))
    }
}

struct Decide<'b> {
    kind: StencilKind,
    motions: &'b Motions,
    vertices: &'b [[u32; 4]],
    batch: &'b mut Batch,
}

impl Kernel for Decide<'_> {
    type Answer = usize;

    #[inline(always)]
    fn run<D: Doubles, S: Singles>(self) -> usize {
        let Self { kind, motions, vertices, batch: Batch { pairs, times } } = self;
        let thickness = motions.thickness;
        coarse_filter::<S>(kind, motions, vertices, pairs);
        fine_filter::<D>(kind, motions, vertices, pairs);
        let left = pairs.len();
        let rows = |pair: u32| motions.rows(&vertices[pair as usize]);
        match kind {
            StencilKind::VertexTriangle => {
                march::<D, VertexTriangleMotion<D>, 3>(rows, thickness, pairs, times);
            }
            StencilKind::EdgeEdge => march::<D, EdgeEdgeMotion<D>, 4>(rows, thickness, pairs, times),
        }
        left
    }
}

/// Lists the pairs that [`coarse`] does not show to be apart.
#[inline(always)]
fn coarse_filter<S: Singles>(
    kind: StencilKind,
    motions: &Motions,
    vertices: &[[u32; 4]],
    pairs: &mut Vec<u32>,
) {
    static ORIGIN: SmallRow = [0.0; 8];
    pairs.clear();
    pairs.resize(vertices.len(), 0);
    let mut kept = 0;
    let mut rows = [[&ORIGIN; 4]; MAX_SINGLES];
    for (group, vertices) in vertices.chunks(S::COUNT).enumerate() {
        for lane in 0..S::COUNT {
            rows[lane] = motions.small_rows(&vertices[lane.min(vertices.len() - 1)]);
        }
        let mut points = [Vector([S::splat(0.0); 3]); 8];
        for k in 0..4 {
            [points[k], points[k + 4]] = S::gather(&rows, k);
        }
        let apart = coarse::apart(kind, &points, motions.small_thickness, coarse::UNIT).bits();
        for lane in 0..vertices.len() {
            pairs[kept] = (group * S::COUNT + lane) as u32;
            kept += (!apart >> lane & 1) as usize;
        }
    }
    pairs.truncate(kept);
}

/// Keeps the pairs that [`filter`] does not show to be apart.
#[inline(always)]
fn fine_filter<D: Doubles>(
    kind: StencilKind,
    motions: &Motions,
    vertices: &[[u32; 4]],
    pairs: &mut Vec<u32>,
) {
    let rows = |pair: u32| motions.rows(&vertices[pair as usize]);
    let (mut kept, mut first) = (0, 0);
    while first < pairs.len() {
        let count = D::COUNT.min(pairs.len() - first);
        let points = points::<D>(&rows, &pairs[first..first + count]);
        let apart = filter::apart::<D>(kind, &points, motions.thickness).bits();
        for lane in 0..count {
            pairs[kept] = pairs[first + lane];
            kept += (!apart >> lane & 1) as usize;
        }
        first += count;
    }
    pairs.truncate(kept);
}
