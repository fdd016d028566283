//! Pairs of triangles that pass through each other, by the tree.

use super::build::Tree;
use super::traverse::{LeafPairs, Visit, traverse};
use super::{Bvh, leaf_pair, leaf_pair::TrianglePairs};
use crate::bounds::LANES;
use crate::ccd::filter::{filter, in_lanes};
use crate::intersect::filter::{
    Row, eight_joined_triangles_apart, eight_triangles_apart, eight_triangles_decided,
    eight_triangles_maybe_apart, rows,
};
use crate::intersect::{segment_meets_triangle, triangles_meet};
use crate::{CollisionMesh, DetectError, Mode, Query, Vec3};
use rayon::prelude::*;

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
        self.refit_still(mesh, &query, pool);
        let points = self.points(&rows(x), pool);
        let (visits, _) = traverse(&self.tree, &self.still, mesh, pool, || Meetings {
            mesh,
            tree: &self.tree,
            x,
            points: &points,
            waiting: TrianglePairs::default(),
            left: vec![],
            undecided: vec![],
            joined: vec![],
            found: vec![],
        });
        let mut found: Vec<u64> = visits.into_iter().flat_map(|v| v.found).collect();
        pool.install(|| found.par_sort_unstable());
        Ok(found.into_iter().map(|pair| [(pair >> 32) as u32, pair as u32]).collect())
    }

    /// The corners of each triangle, by its place: side by side where they are looked at together.
    fn points(&self, rows: &[Row], pool: &rayon::ThreadPool) -> Vec<[Row; 3]> {
        let mut points = vec![[Row::default(); 3]; self.tree.leaves.len() * LANES];
        let leaves = points.par_chunks_mut(LANES).zip(&self.tree.leaves).zip(&self.tree.corners);
        pool.install(|| {
            leaves.with_min_len(LEAF_CHUNK).for_each(|((points, leaf), corners)| {
                for lane in 0..leaf.count as usize {
                    for k in 0..3 {
                        points[lane][k] = rows[corners[k][lane] as usize];
                    }
                }
            });
        });
        points
    }
}

struct Meetings<'a> {
    mesh: &'a CollisionMesh,
    tree: &'a Tree,
    x: &'a [Vec3],
    /// The corners of each triangle, by its place.
    points: &'a [[Row; 3]],
    waiting: TrianglePairs,
    /// What the first filter leaves.
    left: Vec<[u32; 2]>,
    /// What the signs in single precision leave.
    undecided: Vec<[u32; 2]>,
    joined: Vec<Joined>,
    /// The lower triangle in the upper half: sorted as the pairs are.
    found: Vec<u64>,
}

/// Two triangles with a common vertex.
#[derive(Debug, Clone, Copy)]
struct Joined {
    places: [u32; 2],
    /// Which of its corners the common vertex is.
    common: [u8; 2],
}

/// The corners after each corner.
const NEXT: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];

impl Joined {
    #[inline]
    #[allow(clippy::needless_bitwise_bool, reason = "no branch: which corner it is cannot be foretold")]
    fn new(tree: &Tree, places: [u32; 2]) -> Self {
        let (first, second) = (corners(tree, places[0]), corners(tree, places[1]));
        let is_common = |v: u32| (v == second[0]) | (v == second[1]) | (v == second[2]);
        let k = usize::from(is_common(first[1])) + 2 * usize::from(is_common(first[2]));
        let j = usize::from(second[1] == first[k]) + 2 * usize::from(second[2] == first[k]);
        Self { places, common: [k as u8, j as u8] }
    }

    /// The common vertex, the other corners of the first triangle, those of the second.
    #[inline]
    fn select<'a, T>(&self, first: &'a [T; 3], second: &'a [T; 3]) -> [&'a T; 5] {
        let [k, j] = self.common;
        let ([a, b], [p, q]) = (NEXT[k as usize], NEXT[j as usize]);
        [&first[k as usize], &first[a], &first[b], &second[p], &second[q]]
    }
}

#[inline]
fn corners(tree: &Tree, place: u32) -> [u32; 3] {
    let (leaf, lane) = (&tree.corners[place as usize / LANES], place as usize % LANES);
    [leaf[0][lane], leaf[1][lane], leaf[2][lane]]
}

/// Leaves per task.
const LEAF_CHUNK: usize = 256;
/// Pairs wait until there are so many.
const FLUSH: usize = 1024;

impl Meetings<'_> {
    fn flush(&mut self) {
        let Self { mesh, tree, x, points, left, undecided, joined, found, .. } = self;
        let TrianglePairs { strangers, joined: joined_places } = &mut self.waiting;
        let triangle = |place: u32| tree.triangle_ids[place as usize / LANES][place as usize % LANES];
        let mut report = |places: [u32; 2]| {
            let (s, t) = (triangle(places[0]), triangle(places[1]));
            found.push(u64::from(s.min(t)) << 32 | u64::from(s.max(t)));
        };

        if mesh.has_attachments() {
            let is_attached = |&[s, t]: &[u32; 2]| mesh.is_attached(&corners(tree, s), &corners(tree, t));
            strangers.retain(|pair| !is_attached(pair));
            joined_places.retain(|pair| !is_attached(pair));
        }
        let points_of = |place: u32| &points[place as usize];
        let positions_of = |place: u32| {
            let [a, b, c] = corners(tree, place);
            [x[a as usize], x[b as usize], x[c as usize]]
        };
        let rows_of_pair = |&[s, t]: &[u32; 2]| {
            let ([a, b, c], [d, e, f]) = (points_of(s), points_of(t));
            [a, b, c, d, e, f]
        };
        filter(strangers, rows_of_pair, eight_triangles_maybe_apart, |pair| left.push(pair));
        in_lanes(left, rows_of_pair, eight_triangles_decided, |pair, [apart, meet], lane| {
            if meet >> lane & 1 == 1 {
                report(pair);
            } else if apart >> lane & 1 == 0 {
                undecided.push(pair);
            }
        });
        filter(undecided, rows_of_pair, eight_triangles_apart, |[s, t]| {
            if triangles_meet(&positions_of(s), &positions_of(t)) {
                report([s, t]);
            }
        });

        joined.extend(joined_places.iter().map(|&places| Joined::new(tree, places)));
        let rows_of_joined =
            |pair: &Joined| pair.select(points_of(pair.places[0]), points_of(pair.places[1]));
        filter(joined, rows_of_joined, eight_joined_triangles_apart, |pair| {
            let (first, second) = (positions_of(pair.places[0]), positions_of(pair.places[1]));
            let [&common, &a, &b, &p, &q] = pair.select(&first, &second);
            if segment_meets_triangle(&[a, b], &[common, p, q])
                || segment_meets_triangle(&[p, q], &[common, a, b])
            {
                report(pair.places);
            }
        });
        strangers.clear();
        left.clear();
        undecided.clear();
        joined_places.clear();
        joined.clear();
    }
}

impl Visit<1> for Meetings<'_> {
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_, 1>, a: u32, b: u32) {
        let TrianglePairs { strangers, joined } = &mut self.waiting;
        if strangers.len() + joined.len() > FLUSH {
            self.flush();
        }
        leaf_pair::triangles(leaves.tree, leaves.boxes, a, b, &mut self.waiting);
    }

    fn finish(&mut self, _: &LeafPairs<'_, 1>) {
        self.flush();
    }
}
