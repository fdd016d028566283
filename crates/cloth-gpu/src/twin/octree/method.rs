//! The octree methods made of the twins: the kernels' answer without a device.

use super::{holds_token, octree_gather, octree_ranges, octree_register, octree_tree, tests_of};
use crate::collision::{CollisionMesh, Query};
use crate::frame::Frame;
use crate::layout::{Bounds, Entry, OctreeParams, SceneParams};
use crate::stages::bounds::{active_words, triangle_words};
use crate::stages::octree::{Levels, params};
use crate::twin::bounds::{MovingBox, triangle_bounds};
use crate::twin::pairs::{SPHERE_FACTOR, bodies_meet, spheres_touch};

/// Finds triangle pairs with the octree, kernel by kernel, on the CPU. Not fast.
#[derive(Debug, Clone, Copy)]
pub struct OctreeTwin {
    /// Two-stage, else single-stage.
    pub is_two_stage: bool,
    /// Levels of the tree.
    pub levels: Levels,
    /// Test a pair where its token is; without, in every leaf of both.
    pub has_token: bool,
}

/// The triangle pairs of the leaves whose boxes overlap, in the order of the leaves. `factor`: that of the sphere test.
pub fn octree_pairs(entries: &[Entry], bounds: &[Bounds], has_token: bool, factor: f32) -> Vec<[u32; 2]> {
    let mut out = vec![];
    for leaf in entries.chunk_by(|a, b| a.key == b.key) {
        for (i, a) in leaf.iter().enumerate() {
            for b in &leaf[i + 1..] {
                let (x, y) = (&bounds[a.triangle as usize], &bounds[b.triangle as usize]);
                if spheres_touch(a, b, factor)
                    && (!has_token || holds_token(a, b))
                    && (x.is_active | y.is_active) != 0
                    && bodies_meet(x.body, y.body)
                    && MovingBox::from(x).may_touch(&y.into())
                {
                    out.push([a.triangle, b.triangle]);
                }
            }
        }
    }
    out
}

impl OctreeTwin {
    /// The triangle pairs, and the number of tests.
    pub fn pairs(&self, mesh: &CollisionMesh, query: &Query<'_>, frame: &Frame) -> (Vec<[u32; 2]>, u64) {
        let scene = SceneParams {
            triangles: mesh.triangles.len() as u32,
            second: frame.second,
            all_active: query.active.is_none().into(),
            low: frame.half.map(|h| -h),
            high: frame.half,
            ..Default::default()
        };
        let active = query.active.map(active_words).unwrap_or_default();
        let (bounds, spheres, _) = triangle_bounds(&scene, &triangle_words(mesh), &frame.positions, &active);
        let params: OctreeParams = params(&scene, frame.reach(), self.levels, u32::MAX, self.is_two_stage);
        let ranges = octree_ranges(&params, &bounds);
        let tree = octree_tree(&params, &ranges, tests_of);
        let registrations = octree_register(&params, &ranges, &tree);
        let (entries, _) = octree_gather(&params, &registrations, &ranges, &spheres);
        let leaves = entries.chunk_by(|a, b| a.key == b.key);
        let tests = leaves.map(|leaf| tests_of(leaf.len() as u32)).sum();
        (octree_pairs(&entries, &bounds, self.has_token, SPHERE_FACTOR), tests)
    }
}
