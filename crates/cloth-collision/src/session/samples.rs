//! Some vertices and edges that stand for all: from them the size of the balls is chosen, nothing that an answer depends on.

use super::frame::Following;
use crate::{CollisionMesh, Query, Vec3};
use cloth_mesh::NONE;

/// Vertices of a body that stand for it, about.
const OF_BODY: usize = 4096;
/// Edges of the dynamic bodies that stand for them, about.
const EDGES: usize = 8192;

/// Found once per topology.
#[derive(Debug, Clone)]
pub(super) struct Samples {
    /// Of each body: how many of its vertices are on its surface, and some of these.
    bodies: Vec<(usize, Vec<u32>)>,
    /// Of the dynamic bodies.
    edges: Vec<[u32; 2]>,
}

impl Samples {
    pub(super) fn new(mesh: &CollisionMesh) -> Self {
        let mut of_body: Vec<Vec<u32>> = vec![vec![]; mesh.bodies.len()];
        for v in 0..mesh.vertex_count {
            if mesh.vertex_owner[v] != NONE {
                of_body[mesh.vertex_body[v] as usize].push(v as u32);
            }
        }
        let thinned = |list: Vec<u32>| {
            let stride = list.len().div_ceil(OF_BODY).max(1);
            (list.len(), list.into_iter().step_by(stride).collect())
        };
        let is_dynamic = |e: &&[u32; 2]| mesh.bodies[mesh.vertex_body[e[0] as usize] as usize].dynamic;
        let stride = mesh.edges.iter().filter(is_dynamic).count().div_ceil(EDGES).max(1);
        let edges = mesh.edges.iter().filter(is_dynamic).step_by(stride).copied().collect();
        Self { bodies: of_body.into_iter().map(thinned).collect(), edges }
    }

    /// Mean length of the dynamic bodies' edges \[m\].
    pub(super) fn mean_edge(&self, x: &[Vec3]) -> f64 {
        let length = |[a, b]: &[u32; 2]| (x[*a as usize] - x[*b as usize]).norm();
        self.edges.iter().map(length).sum::<f64>() / self.edges.len().max(1) as f64
    }
}

/// The steps of the bodies' vertices.
pub(super) struct Steps {
    /// Vertices on a surface, 0 for a body that is not dynamic.
    pub(super) count: Vec<usize>,
    /// Mean length of a step of each body \[m\], relative to the frames if that is less over all.
    pub(super) mean: Vec<f64>,
    pub(super) is_less_following: bool,
}

impl Steps {
    pub(super) fn new(
        samples: &Samples,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        origin: &Vec3,
        following: &Following,
    ) -> Self {
        let [first, second] = &following.ends;
        // Of each body, as the steps are and relative to the frames.
        let mean = |(_, list): &(usize, Vec<u32>)| {
            let mut lengths = [0.0; 2];
            for &v in list {
                let (x_t0, x_t1) = (query.x_t0[v as usize] - origin, query.x_t1[v as usize] - origin);
                lengths[0] += (x_t1 - x_t0).norm();
                lengths[1] += (second.back(x_t1) - first.back(x_t0)).norm();
            }
            lengths.map(|sum| sum / list.len().max(1) as f64)
        };
        let means: Vec<[f64; 2]> = samples.bodies.iter().map(mean).collect();
        let counts = || samples.bodies.iter().map(|body| body.0);
        let total = |k: usize| counts().zip(&means).map(|(count, mean)| count as f64 * mean[k]).sum::<f64>();
        let is_less_following = total(1) < total(0);
        let count = counts().zip(&mesh.bodies).map(|(count, body)| if body.dynamic { count } else { 0 });
        Self {
            count: count.collect(),
            mean: means.iter().map(|mean| mean[usize::from(is_less_following)]).collect(),
            is_less_following,
        }
    }

    /// Mean over the dynamic bodies' vertices of a number of each body; 0 without such vertices.
    pub(super) fn mean_over_dynamic(&self, of_body: &[f64]) -> f64 {
        let counted: f64 = self.count.iter().map(|&n| n as f64).sum();
        let sum: f64 = self.count.iter().zip(of_body).map(|(&n, x)| n as f64 * x).sum();
        if counted > 0.0 { sum / counted } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Body;

    #[test]
    fn every_body_has_samples_and_its_own_count() {
        let soup =
            |count: u32| -> Vec<[u32; 3]> { (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect() };
        let (many, few) = (soup(4000), soup(1));
        let body = |dynamic| Body { dynamic, self_collision: false };
        // The last vertex of the second body is in no triangle.
        let mesh = CollisionMesh::new(&[(body(true), 12_000, &many), (body(false), 4, &few)]).unwrap();
        let samples = Samples::new(&mesh);
        assert_eq!((samples.bodies[0].0, samples.bodies[0].1.len()), (12_000, 4000));
        assert_eq!(samples.bodies[1], (3, vec![12_000, 12_001, 12_002]));
        let x: Vec<Vec3> = (0..12_004).map(|v| Vec3::new(f64::from(v % 3), 0.0, 0.0)).collect();
        // Edges of 1, 1 and 2 in the dynamic body.
        assert!((samples.mean_edge(&x) - 4.0 / 3.0).abs() < 0.01, "{}", samples.mean_edge(&x));
    }
}
