//! The features of two leaves against each other, for the narrow phase of the same tree: pairs are named by places.
//!
//! The place of a feature is its block times [`LANES`] plus its lane. What the narrow phase asks of a pair, the ranks of
//! its vertices, lies by place beside that of its neighbours.

#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(test)]
mod tests;

use super::build::Tree;
use super::refit::Boxes;
#[cfg(target_arch = "x86_64")]
use crate::bounds::avx::Avx2;
use crate::bounds::{Compare, LANES, Plain, lanes};
use cloth_mesh::NONE;

/// Pairs of places.
#[derive(Debug, Default)]
pub(crate) struct PlacePairs {
    pub(crate) first: Vec<u32>,
    pub(crate) second: Vec<u32>,
}

impl PlacePairs {
    pub(crate) fn len(&self) -> usize {
        self.first.len()
    }

    #[inline(always)]
    pub(crate) fn get(&self, pair: usize) -> [u32; 2] {
        [self.first[pair], self.second[pair]]
    }

    /// Keeps those that are `wanted`, in their order.
    pub(crate) fn retain(&mut self, wanted: impl Fn([u32; 2]) -> bool) {
        let mut kept = 0;
        for pair in 0..self.len() {
            let [first, second] = self.get(pair);
            (self.first[kept], self.second[kept]) = (first, second);
            kept += usize::from(wanted([first, second]));
        }
        self.first.truncate(kept);
        self.second.truncate(kept);
    }

    pub(crate) fn clear(&mut self) {
        self.first.clear();
        self.second.clear();
    }

    /// Room for so many more.
    #[inline(always)]
    pub(crate) fn reserve(&mut self, count: usize) {
        self.first.reserve(count);
        self.second.reserve(count);
    }
}

/// Candidates of one task, waiting for the narrow phase.
#[derive(Debug, Default)]
pub(crate) struct Places {
    /// (vertex, triangle)
    pub(crate) vertex_triangle: PlacePairs,
    /// (edge, edge), the one with the lower number first
    pub(crate) edge_edge: PlacePairs,
}

/// What pairs features by their places. A value exists only where the processor has its instructions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pairing(Kind);

#[derive(Debug, Clone, Copy)]
enum Kind {
    Plain,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// With AVX-512 F and VL, BMI 1 and 2 and POPCNT.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Pairing {
    /// Those that this processor has the instructions for, the fastest first.
    fn there() -> impl Iterator<Item = Self> {
        let kinds = [
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512,
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2,
            Kind::Plain,
        ];
        kinds.into_iter().filter(|kind| kind.is_there()).map(Self)
    }

    /// The fastest of this processor.
    pub(crate) fn fastest() -> Self {
        Self::there().next().unwrap_or(Self(Kind::Plain))
    }

    /// Appends the pairs of features of the leaves `a` and `b` (once each if they are equal) that share no vertex and whose
    /// boxes overlap.
    #[inline]
    pub(crate) fn features<const ENDS: usize>(
        self,
        tree: &Tree,
        boxes: &Boxes<ENDS>,
        a: u32,
        b: u32,
        out: &mut Places,
    ) {
        match self.0 {
            Kind::Plain => features_with(tree, boxes, a, b, out, Plain),
            // SAFETY: the processor has AVX2.
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => unsafe { features_avx2(tree, boxes, a, b, out) },
            // SAFETY: the processor has the instructions.
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512 => unsafe { avx512::features(tree, boxes, a, b, out) },
        }
    }
}

impl Kind {
    fn is_there(self) -> bool {
        match self {
            Self::Plain => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => std::arch::is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                std::arch::is_x86_feature_detected!("avx512f")
                    && std::arch::is_x86_feature_detected!("avx512vl")
                    && std::arch::is_x86_feature_detected!("bmi1")
                    && std::arch::is_x86_feature_detected!("bmi2")
                    && std::arch::is_x86_feature_detected!("popcnt")
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn features_avx2<const ENDS: usize>(tree: &Tree, boxes: &Boxes<ENDS>, a: u32, b: u32, out: &mut Places) {
    // SAFETY: this function runs only where the processor has AVX2.
    features_with(tree, boxes, a, b, out, unsafe { Avx2::new() });
}

#[inline(always)]
fn features_with<const ENDS: usize>(
    tree: &Tree,
    boxes: &Boxes<ENDS>,
    a: u32,
    b: u32,
    out: &mut Places,
    compare: impl Compare,
) {
    // A loop, not a closure called twice: what is not inlined here knows nothing of the vector instructions.
    let sides = [(a, b), (b, a)];
    for &(leaf, other) in &sides[..if a == b { 1 } else { 2 }] {
        let (triangles, corners) = (&boxes.blocks[other as usize], &tree.corners[other as usize]);
        let (hull, used) = (&boxes.hulls[other as usize], boxes.lanes[other as usize].used);
        let [first, end] = tree.leaves[leaf as usize].vertex_blocks;
        for block in first..end {
            let (vertices, ids) = (&boxes.vertex_blocks[block as usize], &tree.vertex_ids[block as usize]);
            let unused = compare.has_corner(NONE, std::array::from_ref(ids));
            for lane in lanes(compare.overlaps(hull, vertices) & !unused) {
                let hits = compare.overlaps(&(vertices, lane), triangles) & used;
                let hits = hits & !compare.has_corner(ids[lane], corners);
                let own = block * LANES as u32 + lane as u32;
                compare.push_places(hits, 0, own, other * LANES as u32, &mut out.vertex_triangle);
            }
        }
    }

    let [first_a, end_a] = tree.leaves[a as usize].edge_blocks;
    let [first_b, end_b] = tree.leaves[b as usize].edge_blocks;
    for block_a in first_a..end_a {
        let (edges, ids) = (&boxes.edge_blocks[block_a as usize], &tree.edge_ids[block_a as usize]);
        let [starts, ends] = &tree.edge_ends[block_a as usize];
        let unused = compare.has_corner(NONE, std::array::from_ref(ids));
        for lane in lanes(compare.overlaps(&boxes.hulls[b as usize], edges) & !unused) {
            let own = block_a * LANES as u32 + lane as u32;
            for block_b in if a == b { block_a } else { first_b }..end_b {
                let ids_b = &tree.edge_ids[block_b as usize];
                let ends_b = &tree.edge_ends[block_b as usize];
                let mut hits = compare.overlaps(&(edges, lane), &boxes.edge_blocks[block_b as usize])
                    & !compare.has_corner(starts[lane], ends_b)
                    & !compare.has_corner(ends[lane], ends_b)
                    & !compare.has_corner(NONE, std::array::from_ref(ids_b));
                if block_a == block_b {
                    hits &= !0 << (lane + 1);
                }
                let lower = compare.below(ids[lane], ids_b);
                compare.push_places(hits, lower, own, block_b * LANES as u32, &mut out.edge_edge);
            }
        }
    }
}
