//! Every pair against every pair: the oracle.

use crate::ccd::narrow_test;
use crate::ccd::separation::WIDENED;
use crate::{CollisionMesh, Contacts, DetectError, Detector, Query, Vec3};
use std::time::Instant;

/// Tests every admissible pair whose swept boxes overlap, O(n²), on one thread. The oracle of the fast methods.
#[derive(Debug, Clone, Copy, Default)]
pub struct BruteForce;

impl Detector for BruteForce {
    fn name(&self) -> &'static str {
        "brute"
    }

    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        _pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        query.check(mesh)?;
        let start = Instant::now();
        let mut out = Contacts::default();
        let is_active =
            |vertices: &[u32]| query.active.is_none_or(|m| vertices.iter().any(|&v| m[v as usize]));

        for v in 0..mesh.vertex_count as u32 {
            if mesh.vertex_owner[v as usize] == cloth_mesh::NONE {
                continue;
            }
            for (t, tri) in mesh.triangles.iter().enumerate() {
                let [a, b, c] = *tri;
                if !mesh.vertex_triangle_admissible(v, t as u32) || !is_active(&[v, a, b, c]) {
                    continue;
                }
                if !boxes_overlap(query, &[v], tri) {
                    continue;
                }
                out.stats.candidates_vertex_triangle += 1;
                if let Some(time) = narrow_test::vertex_triangle(query, [v, a, b, c]) {
                    out.vertex_triangle.push([v, t as u32]);
                    out.time_vertex_triangle.push(time);
                }
            }
        }
        for i in 0..mesh.edges.len() {
            for j in i + 1..mesh.edges.len() {
                let ([a0, a1], [b0, b1]) = (mesh.edges[i], mesh.edges[j]);
                if !mesh.edge_edge_admissible(i as u32, j as u32) || !is_active(&[a0, a1, b0, b1]) {
                    continue;
                }
                if !boxes_overlap(query, &[a0, a1], &[b0, b1]) {
                    continue;
                }
                out.stats.candidates_edge_edge += 1;
                if let Some(time) = narrow_test::edge_edge(query, [a0, a1, b0, b1]) {
                    out.edge_edge.push([i as u32, j as u32]);
                    out.time_edge_edge.push(time);
                }
            }
        }
        out.stats.seconds.push(("all pairs", start.elapsed().as_secs_f64()));
        Ok(out)
    }
}

/// Whether the swept boxes of two features come within the thickness along every axis, to the rounding of the narrow phase, which
/// answers for the pairs at the very thickness.
fn boxes_overlap(query: &Query<'_>, first: &[u32], second: &[u32]) -> bool {
    let threshold = query.thickness * WIDENED;
    (0..3).all(|axis| {
        let range = |vertices: &[u32]| {
            let mut range = (f64::INFINITY, f64::NEG_INFINITY);
            let mut grow = |x: &[Vec3], v: u32| {
                range = (range.0.min(x[v as usize][axis]), range.1.max(x[v as usize][axis]));
            };
            for &v in vertices {
                if query.mode == crate::Mode::Continuous {
                    grow(query.x_t0, v);
                }
                grow(query.x_t1, v);
            }
            range
        };
        let (a, b) = (range(first), range(second));
        a.0 - b.1 <= threshold && b.0 - a.1 <= threshold
    })
}
