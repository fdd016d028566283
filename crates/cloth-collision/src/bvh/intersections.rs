//! Pairs of triangles that pass through each other, by the tree.

use super::traverse::{LeafPairs, Visit};
use super::{Bvh, leaf_pair, leaf_pair::TrianglePair};
use crate::ccd::filter::{
    Row, filter, four_joined_triangles_apart, four_triangles_beside_planes, four_triangles_maybe_apart, row,
};
use crate::intersect::{segment_meets_triangle, triangles_meet};
use crate::{CollisionMesh, DetectError, Mode, Query, Vec3};
use cloth_mesh::NONE;
use rayon::slice::ParallelSliceMut;

impl Bvh {
    /// As [`crate::intersections`], with this tree.
    ///
    /// # Errors
    /// As [`crate::intersections`], and [`DetectError::OtherMesh`].
    pub fn intersections(
        &mut self,
        mesh: &CollisionMesh,
        x: &[Vec3],
        pool: &rayon::ThreadPool,
    ) -> Result<Vec<[u32; 2]>, DetectError> {
        let query = Query { x_t0: x, x_t1: x, thickness: 0.0, mode: Mode::Discrete, active: None };
        query.check(mesh)?;
        self.check_mesh(mesh)?;
        self.refit(mesh, &query, pool);
        let rows: Vec<Row> = x.iter().map(row).collect();
        let (visits, _) = self.traverse(mesh, pool, || Meetings {
            mesh,
            x,
            rows: &rows,
            waiting: vec![],
            strangers: vec![],
            joined: vec![],
            left: vec![],
            found: vec![],
        });
        let mut found: Vec<[u32; 2]> = visits.into_iter().flat_map(|v| v.found).collect();
        pool.install(|| found.par_sort_unstable());
        Ok(found)
    }
}

struct Meetings<'a> {
    mesh: &'a CollisionMesh,
    x: &'a [Vec3],
    rows: &'a [Row],
    waiting: Vec<TrianglePair>,
    /// Pairs of triangles without a common vertex.
    strangers: Vec<TrianglePair>,
    /// Pairs of triangles with one common vertex.
    joined: Vec<Joined>,
    /// What the first round of the filter leaves.
    left: Vec<TrianglePair>,
    found: Vec<[u32; 2]>,
}

#[derive(Debug, Clone, Copy)]
struct Joined {
    pair: [u32; 2],
    common: u32,
    /// The other corners.
    first: [u32; 2],
    second: [u32; 2],
}

/// Bit per corner of `one`: `other` has it too.
#[allow(
    clippy::needless_bitwise_bool,
    reason = "most pairs are strangers: nine comparisons without a branch"
)]
fn common_corners(one: &[u32; 3], other: &[u32; 3]) -> u8 {
    let bit = |k: usize| u8::from((one[k] == other[0]) | (one[k] == other[1]) | (one[k] == other[2])) << k;
    bit(0) | bit(1) | bit(2)
}

fn sorted([s, t]: [u32; 2]) -> [u32; 2] {
    [s.min(t), s.max(t)]
}

/// Pairs wait until there are so many.
const FLUSH: usize = 1024;

impl Meetings<'_> {
    fn flush(&mut self) {
        let Self { x, rows, strangers, joined, left, found, .. } = self;
        let row = |v: u32| &rows[v as usize];
        let rows_of_pair = |pair: &TrianglePair| {
            let (s, t) = (&pair.first, &pair.second);
            [row(s[0]), row(s[1]), row(s[2]), row(t[0]), row(t[1]), row(t[2])]
        };
        filter(strangers, rows_of_pair, |rows| four_triangles_maybe_apart(rows, 0.0), |pair| left.push(pair));
        filter(
            left,
            rows_of_pair,
            |rows| four_triangles_beside_planes(rows, 0.0),
            |pair| {
                let points = |t: &[u32; 3]| [x[t[0] as usize], x[t[1] as usize], x[t[2] as usize]];
                if triangles_meet(&points(&pair.first), &points(&pair.second)) {
                    found.push(sorted(pair.triangles));
                }
            },
        );
        let rows_of_joined = |pair: &Joined| {
            let ([a, b], [p, q]) = (pair.first, pair.second);
            [row(pair.common), row(a), row(b), row(p), row(q)]
        };
        filter(
            joined,
            rows_of_joined,
            |rows| four_joined_triangles_apart(rows, 0.0),
            |pair| {
                let point = |v: u32| x[v as usize];
                let common = point(pair.common);
                let (a, b) = (pair.first.map(point), pair.second.map(point));
                if segment_meets_triangle(&a, &[common, b[0], b[1]])
                    || segment_meets_triangle(&b, &[common, a[0], a[1]])
                {
                    found.push(pair.pair);
                }
            },
        );
        left.clear();
        joined.clear();
        strangers.clear();
    }
}

impl Visit for Meetings<'_> {
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_>, a: u32, b: u32) {
        leaf_pair::triangles(leaves.tree, leaves.boxes, a, b, &mut self.waiting);
        for pair in self.waiting.drain(..) {
            let TrianglePair { triangles, first, second } = pair;
            // The traversal has seen to the bodies.
            if triangles.contains(&NONE) || self.mesh.is_attached(&first, &second) {
                continue;
            }
            let corners = common_corners(&first, &second);
            match corners.count_ones() {
                0 => self.strangers.push(pair),
                1 => {
                    let others =
                        |tri: [u32; 3], k: u32| [tri[(k as usize + 1) % 3], tri[(k as usize + 2) % 3]];
                    let (k, j) = (corners.trailing_zeros(), common_corners(&second, &first).trailing_zeros());
                    self.joined.push(Joined {
                        pair: sorted(triangles),
                        common: first[k as usize],
                        first: others(first, k),
                        second: others(second, j),
                    });
                }
                _ => {}
            }
        }
        if self.strangers.len() + self.joined.len() > FLUSH {
            self.flush();
        }
    }

    fn finish(&mut self) {
        self.flush();
    }
}
