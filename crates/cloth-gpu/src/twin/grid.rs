//! The method "grid" made of the twins: the kernels' answer without a device.

use crate::collision::{CollisionMesh, Contacts, DetectError, Detector, NarrowPhase, Query};
use crate::frame::Frame;
use crate::layout::SceneParams;
use crate::limits::REACH;
use crate::stages::bounds::{active_words, feature_words, triangle_words};
use crate::twin::{bounds, cells, features, pairs, sort};
use std::time::Instant;

/// Detects contacts with the uniform grid, kernel by kernel, on the CPU: one thread but for the narrow phase. Not fast.
#[derive(Debug, Clone, Copy)]
pub struct GridTwin {
    /// What radii are multiplied by for registration: [`REACH`], or contacts are lost.
    pub reach: f32,
}

impl Default for GridTwin {
    fn default() -> Self {
        Self { reach: REACH }
    }
}

impl GridTwin {
    /// Candidates (vertex, triangle) and (edge, edge), and the number of tests.
    pub fn candidates(
        &self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        frame: &Frame,
    ) -> (Vec<[u32; 2]>, Vec<[u32; 2]>, u64) {
        let params = SceneParams {
            triangles: mesh.triangles.len() as u32,
            second: frame.second,
            all_active: query.active.is_none().into(),
            low: frame.half.map(|h| -h),
            high: frame.half,
            ..Default::default()
        };
        let (triangles, owned) = (triangle_words(mesh), feature_words(mesh));
        let active = query.active.map(active_words).unwrap_or_default();
        let (boxes, spheres, radius) =
            bounds::triangle_bounds(&params, &triangles, &frame.positions, &active);
        let (grid, key_bits) = cells::grid_setup(&params, radius);
        let (homes, controls) = cells::cells_count(&grid, &spheres, self.reach);
        let registrations = sort::sort(&cells::cells_register(&grid, &homes, &controls), key_bits);
        let entries = cells::cells_gather(&registrations, &spheres, &controls);
        let keys: Vec<u32> = registrations.iter().map(|r| r.0 as u32).collect();
        let counts = pairs::pairs_count(&keys);
        let tests = counts.iter().map(|&c| u64::from(c)).sum();
        let found = pairs::pairs_test(&counts, &entries, &boxes, 0, tests, pairs::SPHERE_FACTOR);
        let (vertex_triangle, edge_edge) =
            features::feature_pairs(&params, &triangles, &owned, &frame.positions, &active, &found, None);
        (vertex_triangle, edge_edge, tests)
    }
}

impl Detector for GridTwin {
    fn name(&self) -> &'static str {
        "grid"
    }

    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        let start = Instant::now();
        let mut narrow = NarrowPhase::new(mesh, query)?;
        let frame = Frame::new(query, pool);
        let (vertex_triangle, edge_edge, tests) = self.candidates(mesh, query, &frame);
        let broad = start.elapsed().as_secs_f64();
        narrow.decide(&vertex_triangle, &edge_edge, pool);
        let mut out = narrow.finish();
        out.stats.broad_phase_tests = tests;
        let narrow = start.elapsed().as_secs_f64() - broad;
        out.stats.seconds = vec![("broad phase", broad), ("narrow phase", narrow)];
        Ok(out)
    }
}
