//! Pairs of triangles that pass through each other, by the tree.

use super::traverse::{LeafPairs, Visit};
use super::{Bvh, leaf_pair};
use crate::ccd::filter::{Row, filter, four_segment_triangles_apart, four_triangles_apart, row};
use crate::intersect::{segment_meets_triangle, triangles_meet};
use crate::{CollisionMesh, DetectError, Mode, Query, Vec3};
use cloth_mesh::NONE;

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
            sides: vec![],
            found: vec![],
        });
        let mut found: Vec<[u32; 2]> = visits.into_iter().flat_map(|v| v.found).collect();
        // Both sides of a pair with a common vertex may have met.
        found.sort_unstable();
        found.dedup();
        Ok(found)
    }
}

struct Meetings<'a> {
    mesh: &'a CollisionMesh,
    x: &'a [Vec3],
    rows: &'a [Row],
    waiting: Vec<[u32; 2]>,
    /// Pairs of triangles without a common vertex.
    strangers: Vec<[u32; 2]>,
    /// A triangle's side opposite to the vertex that it shares with another triangle, and that other.
    sides: Vec<Side>,
    found: Vec<[u32; 2]>,
}

#[derive(Debug, Clone, Copy)]
struct Side {
    pair: [u32; 2],
    ends: [u32; 2],
    triangle: [u32; 3],
}

/// Pairs wait until there are so many.
const FLUSH: usize = 1024;

impl Meetings<'_> {
    fn flush(&mut self) {
        let Self { mesh, x, rows, strangers, sides, found, .. } = self;
        let row = |v: u32| &rows[v as usize];
        filter(
            strangers,
            |pair| {
                let [[a, b, c], [p, q, r]] = pair.map(|t| mesh.triangles[t as usize].map(row));
                [a, b, c, p, q, r]
            },
            |rows| four_triangles_apart(rows, 0.0),
            |pair| {
                let [first, second] = pair.map(|t| mesh.triangles[t as usize].map(|v| x[v as usize]));
                if triangles_meet(&first, &second) {
                    found.push(pair);
                }
            },
        );
        filter(
            sides,
            |item| {
                let ([p, q], [a, b, c]) = (item.ends.map(row), item.triangle.map(row));
                [p, q, a, b, c]
            },
            |rows| four_segment_triangles_apart(rows, 0.0),
            |item| {
                if segment_meets_triangle(
                    &item.ends.map(|v| x[v as usize]),
                    &item.triangle.map(|v| x[v as usize]),
                ) {
                    found.push(item.pair);
                }
            },
        );
        strangers.clear();
        sides.clear();
    }
}

impl Visit for Meetings<'_> {
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_>, a: u32, b: u32) {
        leaf_pair::triangles(leaves.tree, leaves.boxes, a, b, &mut self.waiting);
        for [s, t] in self.waiting.drain(..) {
            // The traversal has seen to the bodies.
            if s == NONE || t == NONE {
                continue;
            }
            let (first, second) = (self.mesh.triangles[s as usize], self.mesh.triangles[t as usize]);
            if self.mesh.is_attached(&first, &second) {
                continue;
            }
            let pair = [s.min(t), s.max(t)];
            let (mut shared, mut corners) = (0, (0, 0));
            for i in 0..3 {
                for j in 0..3 {
                    if first[i] == second[j] {
                        shared += 1;
                        corners = (i, j);
                    }
                }
            }
            match shared {
                0 => self.strangers.push(pair),
                1 => {
                    let opposite = |tri: [u32; 3], k: usize| [tri[(k + 1) % 3], tri[(k + 2) % 3]];
                    self.sides.push(Side { pair, ends: opposite(first, corners.0), triangle: second });
                    self.sides.push(Side { pair, ends: opposite(second, corners.1), triangle: first });
                }
                _ => {}
            }
        }
        if self.strangers.len() + self.sides.len() > FLUSH {
            self.flush();
        }
    }

    fn finish(&mut self) {
        self.flush();
    }
}
