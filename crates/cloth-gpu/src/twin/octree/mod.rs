//! Twins of the kernels `octree_*.wgsl`: whole trees of all levels, without pages, by the definition.

mod method;

use crate::layout::{Bounds, Entry, OctreeParams};
use crate::limits::TALLY_LENGTH;
pub use method::{OctreeTwin, octree_pairs};

/// A cell by its place along each axis.
pub type Place = [u32; 3];

/// Cells of the base level that a triangle's box meets: lowest and highest.
pub type Range = [Place; 2];

/// Ten bits per axis.
pub fn pack(place: Place) -> u32 {
    place[0] | place[1] << 10 | place[2] << 20
}

/// Number of a cell among those of its level.
pub fn cell_number(level: u32, place: Place) -> u32 {
    place[0] | place[1] << level | place[2] << (2 * level)
}

/// Place of a cell among those of its level.
pub fn cell_place(level: u32, cell: u32) -> Place {
    [0, 1, 2].map(|k| cell >> (k * level) & ((1 << level) - 1))
}

fn up(place: Place, levels: u32) -> Place {
    place.map(|x| x >> levels)
}

/// Every place from the lowest to the highest, x fastest.
fn places([low, high]: Range) -> impl Iterator<Item = Place> {
    let [xs, ys, zs] = [0, 1, 2].map(|k| low[k]..=high[k]);
    zs.flat_map(move |z| {
        let xs = xs.clone();
        ys.clone().flat_map(move |y| xs.clone().map(move |x| [x, y, z]))
    })
}

/// The ranges of the triangles.
pub fn octree_ranges(params: &OctreeParams, bounds: &[Bounds]) -> Vec<Range> {
    let last = ((1u32 << params.base) - 1) as f32;
    let place = |x: f32, k: usize| ((x - params.low[k]) * params.inverse[k]).floor().clamp(0.0, last) as u32;
    let range = |b: &Bounds| {
        [
            [0, 1, 2].map(|k| place(b.low_0[k].min(b.low_1[k]), k)),
            [0, 1, 2].map(|k| place(b.high_0[k].max(b.high_1[k]), k)),
        ]
    };
    bounds.iter().map(range).collect()
}

/// The visits to pages (triangle, page), in the order in which the kernels number them.
pub fn octree_visits(params: &OctreeParams, ranges: &[Range]) -> Vec<(u32, u32)> {
    let depth = params.base - params.page;
    let visit = |(t, range): (usize, &Range)| {
        places(range.map(|p| up(p, depth)))
            .map(move |place| (t as u32, cell_number(params.page, place)))
            .collect::<Vec<_>>()
    };
    ranges.iter().enumerate().flat_map(visit).collect()
}

/// Number of triangles per cell of a level.
pub fn octree_counts(params: &OctreeParams, ranges: &[Range], level: u32) -> Vec<u32> {
    let mut counts = vec![0; 1 << (3 * level)];
    for range in ranges {
        for place in places(range.map(|p| up(p, params.base - level))) {
            counts[cell_number(level, place) as usize] += 1;
        }
    }
    counts
}

/// Pairs of n triangles.
pub fn tests_of(n: u32) -> u64 {
    u64::from(n) * u64::from(n.saturating_sub(1)) / 2
}

/// Counter tree and type tree, level by level; levels coarser than the top one are empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tree {
    /// Triangles per cell.
    pub counts: Vec<Vec<u32>>,
    /// Tests per cell: of its best division (two-stage), or of the whole cell (single-stage).
    pub costs: Vec<Vec<u64>>,
    /// Which cells cost less divided.
    pub is_divided: Vec<Vec<bool>>,
}

/// The bottom-up stage. `tests`: what a cell of n triangles costs; the kernels have [`tests_of`].
pub fn octree_tree(params: &OctreeParams, ranges: &[Range], tests: fn(u32) -> u64) -> Tree {
    let levels = params.base as usize + 1;
    let mut tree =
        Tree { counts: vec![vec![]; levels], costs: vec![vec![]; levels], is_divided: vec![vec![]; levels] };
    for level in (params.top..=params.base).rev() {
        let l = level as usize;
        let counts = octree_counts(params, ranges, level);
        let mut costs: Vec<u64> = counts.iter().map(|&n| tests(n)).collect();
        let mut is_divided = vec![false; counts.len()];
        if level < params.base {
            for (cell, cost) in costs.iter_mut().enumerate() {
                let low = cell_place(level, cell as u32).map(|x| 2 * x);
                let children = places([low, low.map(|x| x + 1)]);
                let divided =
                    children.map(|c| tree.costs[l + 1][cell_number(level + 1, c) as usize]).sum::<u64>();
                is_divided[cell] = divided < *cost;
                if params.two_stage != 0 {
                    *cost = divided.min(*cost);
                }
            }
        }
        tree.counts[l] = counts;
        tree.costs[l] = costs;
        tree.is_divided[l] = is_divided;
    }
    tree
}

/// The top-down stage: level of the leaf that a cell of the base level lies in.
pub fn octree_leaf(params: &OctreeParams, tree: &Tree, place: Place) -> u32 {
    let is_leaf = |&level: &u32| {
        let cell = cell_number(level, up(place, params.base - level));
        !tree.is_divided[level as usize][cell as usize]
    };
    (params.top..params.base).find(is_leaf).unwrap_or(params.base)
}

/// A triangle in a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Registration {
    /// 2 · number of the leaf's lowest cell of the base level.
    pub key: u32,
    /// The triangle.
    pub triangle: u32,
    /// Level of the leaf.
    pub level: u32,
}

/// The registrations, sorted by leaf, then by triangle.
pub fn octree_register(params: &OctreeParams, ranges: &[Range], tree: &Tree) -> Vec<Registration> {
    let mut out = vec![];
    for (t, range) in ranges.iter().enumerate() {
        let mut own: Vec<Registration> = places(*range)
            .map(|place| {
                let level = octree_leaf(params, tree, place);
                let up = params.base - level;
                let key = 2 * cell_number(params.base, place.map(|x| x >> up << up));
                Registration { key, triangle: t as u32, level }
            })
            .collect();
        own.sort_unstable();
        own.dedup();
        out.append(&mut own);
    }
    out.sort_unstable();
    out
}

/// The registrations with what their tests ask first; registrations per level, then leaves.
pub fn octree_gather(
    params: &OctreeParams,
    registrations: &[Registration],
    ranges: &[Range],
    spheres: &[[f32; 4]],
) -> (Vec<Entry>, Vec<u32>) {
    let mut tally = vec![0; TALLY_LENGTH as usize];
    let mut before = None;
    let entry = |r: &Registration| {
        let [x, y, z, radius] = spheres[r.triangle as usize];
        tally[r.level as usize] += 1;
        tally[TALLY_LENGTH as usize - 1] += u32::from(before != Some(r.key));
        before = Some(r.key);
        Entry {
            centre: [x, y, z],
            radius,
            triangle: r.triangle,
            control: cell_number(params.base, ranges[r.triangle as usize][0]),
            key: r.key,
            level: (params.base - r.level) | params.base << 8,
        }
    };
    let entries = registrations.iter().map(entry).collect();
    (entries, tally)
}

/// Whether the pair is tested in the leaf of both.
pub fn holds_token(a: &Entry, b: &Entry) -> bool {
    let (up, base) = (a.level & 255, a.level >> 8);
    let [x, y, leaf] = [a.control, b.control, a.key / 2].map(|cell| cell_place(base, cell));
    (0..3).all(|k| x[k].max(y[k]) >> up == leaf[k] >> up)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u64) -> u32 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 40) as u32
    }

    /// Small ranges, most of them about one corner, and a few large ones.
    fn scene(n: u32, params: &OctreeParams, state: &mut u64) -> Vec<Range> {
        let last = (1u32 << params.base) - 1;
        let mut range = |t: u32| {
            let low = [(); 3].map(|()| {
                let x = random(state) & last;
                if t.is_multiple_of(3) { x } else { x / 8 }
            });
            let size = if t % 17 == 1 { last } else { 1 };
            [low, low.map(|x| (x + random(state) % (size + 1)).min(last))]
        };
        (0..n).map(&mut range).collect()
    }

    fn levels(top: u32, base: u32, two_stage: u32) -> OctreeParams {
        OctreeParams { top, base, page: base.saturating_sub(3), two_stage, ..Default::default() }
    }

    fn entries(params: &OctreeParams, ranges: &[Range], tests: fn(u32) -> u64) -> Vec<Entry> {
        let registrations = octree_register(params, ranges, &octree_tree(params, ranges, tests));
        octree_gather(params, &registrations, ranges, &vec![[0.0; 4]; ranges.len()]).0
    }

    fn tests(entries: &[Entry]) -> u64 {
        entries.chunk_by(|a, b| a.key == b.key).map(|leaf| tests_of(leaf.len() as u32)).sum()
    }

    /// How often each pair of ranges that meet is tested: never, once, more often.
    fn turns(ranges: &[Range], entries: &[Entry], has_token: bool) -> [usize; 3] {
        let mut counts = std::collections::BTreeMap::new();
        for leaf in entries.chunk_by(|a, b| a.key == b.key) {
            for (i, a) in leaf.iter().enumerate() {
                for b in leaf[i + 1..].iter().filter(|b| !has_token || holds_token(a, b)) {
                    *counts.entry((a.triangle, b.triangle)).or_insert(0usize) += 1;
                }
            }
        }
        let mut out = [0; 3];
        for (i, a) in ranges.iter().enumerate() {
            for (j, b) in ranges.iter().enumerate().skip(i + 1) {
                if (0..3).all(|k| a[0][k] <= b[1][k] && b[0][k] <= a[1][k]) {
                    out[counts.get(&(i as u32, j as u32)).copied().unwrap_or(0).min(2)] += 1;
                }
            }
        }
        out
    }

    #[test]
    fn ranges_that_meet_are_tested_once_and_twice_without_the_token() {
        let mut state = 1;
        for (top, base) in [(0, 0), (0, 1), (0, 4), (2, 4), (4, 4), (1, 5)] {
            for two_stage in [0, 1] {
                let params = levels(top, base, two_stage);
                let ranges = scene(150, &params, &mut state);
                let entries = entries(&params, &ranges, tests_of);
                let [never, once, more] = turns(&ranges, &entries, true);
                assert_eq!((never, more), (0, 0), "{top}..{base}");
                assert!(once > 100);
                let [never, _, more] = turns(&ranges, &entries, false);
                assert!(never == 0 && (more > 0 || base < 4), "{top}..{base}: the token must matter");
            }
        }
    }

    /// Every way to divide a cell, by brute force.
    fn least(params: &OctreeParams, counts: &[Vec<u32>], level: u32, place: Place) -> u64 {
        let whole = tests_of(counts[level as usize][cell_number(level, place) as usize]);
        if level == params.base {
            return whole;
        }
        let low = place.map(|x| 2 * x);
        let divided = places([low, low.map(|x| x + 1)]).map(|c| least(params, counts, level + 1, c)).sum();
        if level < params.top { divided } else { whole.min(divided) }
    }

    #[test]
    fn two_stage_is_the_least_and_never_above_single_stage() {
        let (mut state, mut gained, mut wrong) = (7, 0, 0);
        for (top, base) in [(0, 1), (0, 3), (1, 4), (0, 5), (3, 5)] {
            let ranges = scene(200, &levels(top, base, 1), &mut state);
            let cost = |two_stage, count| tests(&entries(&levels(top, base, two_stage), &ranges, count));
            let params = levels(top, base, 1);
            let counts: Vec<Vec<u32>> = (0..=base).map(|l| octree_counts(&params, &ranges, l)).collect();
            let [two, single] = [1, 0].map(|two_stage| cost(two_stage, tests_of));
            assert_eq!(two, least(&params, &counts, 0, [0; 3]));
            assert!(two <= single, "{two}, {single}");
            gained += usize::from(two < single);
            // A count that is off: cells as if every triangle met half of the others only once.
            wrong += usize::from(cost(1, |n| u64::from(n)) > two);
        }
        assert!(gained > 1, "some scene must show the difference");
        assert!(wrong > 1, "a wrong cost must show");
    }

    #[test]
    fn numbers_and_places_are_inverse() {
        for level in 0..=10 {
            let last = (1 << level) - 1;
            for place in [[0; 3], [last; 3], [last, 0, last / 2]] {
                assert_eq!(cell_place(level, cell_number(level, place)), place);
            }
        }
    }
}
