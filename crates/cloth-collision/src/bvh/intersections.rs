//! Pairs of triangles that pass through each other, by the tree.

use super::traverse::{LeafPairs, Visit};
use super::{Bvh, leaf_pair};
use crate::intersect::triangles_meet;
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
        let (visits, _) = self.traverse(mesh, pool, || Meetings { mesh, x, waiting: vec![], found: vec![] });
        let mut found: Vec<[u32; 2]> = visits.into_iter().flat_map(|v| v.found).collect();
        found.sort_unstable();
        Ok(found)
    }
}

struct Meetings<'a> {
    mesh: &'a CollisionMesh,
    x: &'a [Vec3],
    waiting: Vec<[u32; 2]>,
    found: Vec<[u32; 2]>,
}

impl Visit for Meetings<'_> {
    fn leaf_pair(&mut self, leaves: &LeafPairs<'_>, a: u32, b: u32) {
        leaf_pair::triangles(leaves.tree, leaves.boxes, a, b, &mut self.waiting);
        for [s, t] in self.waiting.drain(..) {
            if s == NONE || t == NONE || !self.mesh.triangles_admissible(s, t) {
                continue;
            }
            let (first, second) = (self.mesh.triangles[s as usize], self.mesh.triangles[t as usize]);
            if triangles_meet(first, second, self.x) {
                self.found.push([s.min(t), s.max(t)]);
            }
        }
    }

    fn finish(&mut self) {}
}
