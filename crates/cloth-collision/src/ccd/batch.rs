//! Decides many pairs: the filters, then the march of those that they leave.

use super::edge_edge::EdgeEdgeMotion;
use super::filter::{FEW, MANY, apart};
use super::instructions::{Instructions, Kernel};
use super::lanes::{Doubles, Mask, Rows};
use super::march::{NEVER, march, points};
use super::vertex_triangle::VertexTriangleMotion;
use crate::StencilKind;

/// The pairs of a batch, by number; its memory is used again.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    pairs: Vec<u32>,
    times: Vec<f64>,
}

impl Batch {
    /// Decides the pairs 0..`count` with the single-pair tests' answers. `rows` names a pair's points,
    /// all finite. Returns how many the filters have left; [`Batch::contacts`] are among these.
    #[inline]
    pub(crate) fn decide<'a>(
        &mut self,
        instructions: Instructions,
        kind: StencilKind,
        count: usize,
        rows: impl Fn(u32) -> Rows<'a>,
        thickness: f64,
    ) -> usize {
        self.pairs.clear();
        self.pairs.extend(0..count as u32);
        self.times.clear();
        self.times.resize(count, NEVER);
        instructions.run(Decide { kind, rows, thickness, batch: self })
    }

    /// The pairs in contact, in their order, with their times.
    pub(crate) fn contacts(&self) -> impl Iterator<Item = (u32, f64)> {
        self.times.iter().enumerate().filter(|t| *t.1 != NEVER).map(|(pair, &t)| (pair as u32, t))
    }
}

struct Decide<'b, R> {
    kind: StencilKind,
    rows: R,
    thickness: f64,
    batch: &'b mut Batch,
}

impl<'a, R: Fn(u32) -> Rows<'a>> Kernel for Decide<'_, R> {
    type Answer = usize;

    #[inline(always)]
    fn run<D: Doubles>(self) -> usize {
        let Self { kind, rows, thickness, batch: Batch { pairs, times } } = self;
        keep_possible::<D, FEW>(kind, &rows, thickness, pairs);
        keep_possible::<D, MANY>(kind, &rows, thickness, pairs);
        let left = pairs.len();
        match kind {
            StencilKind::VertexTriangle => {
                march::<D, VertexTriangleMotion<D>, 3>(rows, thickness, pairs, times);
            }
            StencilKind::EdgeEdge => march::<D, EdgeEdgeMotion<D>, 4>(rows, thickness, pairs, times),
        }
        left
    }
}

/// Keeps the pairs that `STEPS` directions and the cubic do not show to be apart.
#[inline(always)]
fn keep_possible<'a, D: Doubles, const STEPS: usize>(
    kind: StencilKind,
    rows: &impl Fn(u32) -> Rows<'a>,
    thickness: f64,
    pairs: &mut Vec<u32>,
) {
    let (mut kept, mut first) = (0, 0);
    while first < pairs.len() {
        let count = D::COUNT.min(pairs.len() - first);
        let points = points::<D>(rows, &pairs[first..first + count]);
        let apart = apart::<D, STEPS>(kind, &points, thickness).bits();
        for lane in 0..count {
            pairs[kept] = pairs[first + lane];
            kept += (!apart >> lane & 1) as usize;
        }
        first += count;
    }
    pairs.truncate(kept);
}
