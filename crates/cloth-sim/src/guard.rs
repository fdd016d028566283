//! Finds a state that must not be written: non-finite, or run away.

use crate::Vec3;
use crate::bodies::Bodies;

/// A cloth edge longer than this many times its rest length is a diverged simulation: woven cloth tears below 2, and
/// an unstable step passes any bound within a few steps.
const MAX_STRETCH: f64 = 100.0;

/// A vertex that travels more than this many times the size of its cloth within one step is a diverged simulation.
const MAX_TRAVEL: f64 = 1000.0;

/// At most this many vertices are named.
const MAX_NAMED: usize = 64;

/// Limits of a scene's cloth.
pub(crate) struct Guard {
    /// Edges (global vertices) and the square of their longest allowed length [m²].
    edges: Vec<([u32; 2], f64)>,
    /// Per cloth: end of its vertices and the square of the longest way in one step [m²].
    travel: Vec<(usize, f64)>,
}

/// What the guard saw.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Alarm {
    pub(crate) reason: String,
    pub(crate) vertices: Vec<u32>,
}

impl Guard {
    pub(crate) fn new(bodies: &Bodies) -> Self {
        let (mut edges, mut travel) = (Vec::new(), Vec::new());
        for body in &bodies.cloth {
            // The longer of the rest length and the length at the start: a cloth may start stretched.
            let mut limit = vec![0.0_f64; body.topology.edges.len()];
            for (sides, lengths) in body.topology.triangle_edges.iter().zip(&body.rest.side_lengths) {
                for k in 0..3 {
                    let edge = sides[k] as usize;
                    limit[edge] = limit[edge].max(lengths[k]);
                }
            }
            for (&[a, b], rest) in body.topology.edges.iter().zip(limit) {
                let start = (body.x[a as usize] - body.x[b as usize]).norm();
                let longest = MAX_STRETCH * rest.max(start);
                let first = body.first_vertex as u32;
                edges.push(([a + first, b + first], longest * longest));
            }
            let (lo, hi) = body.mesh.bounds().unwrap_or_default();
            let way = MAX_TRAVEL * (hi - lo).norm();
            travel.push((body.first_vertex + body.x.len(), way * way));
        }
        Self { edges, travel }
    }

    /// Whether the step `x_t0` → `x_t1`, ending with velocities `v`, may be written.
    pub(crate) fn check(&self, x_t0: &[Vec3], x_t1: &[Vec3], v: &[Vec3]) -> Result<(), Alarm> {
        let finite = |p: &Vec3| p.iter().all(|c| c.is_finite());
        alarm("not finite", (0..x_t1.len()).filter(|&i| !finite(&x_t1[i]) || !finite(&v[i])))?;
        let mut first = 0;
        for &(end, way) in &self.travel {
            let far = (first..end).filter(|&i| (x_t1[i] - x_t0[i]).norm_squared() > way);
            alarm("moved more than 1000 times the cloth's size within one step", far)?;
            first = end;
        }
        let long = self
            .edges
            .iter()
            .filter(|([a, b], limit)| (x_t1[*a as usize] - x_t1[*b as usize]).norm_squared() > *limit)
            .flat_map(|(edge, _)| edge.map(|v| v as usize));
        alarm("stretched to more than 100 times the rest length", long)
    }
}

fn alarm(reason: &str, vertices: impl Iterator<Item = usize>) -> Result<(), Alarm> {
    let mut vertices: Vec<u32> = vertices.take(MAX_NAMED).map(|v| v as u32).collect();
    if vertices.is_empty() {
        return Ok(());
    }
    vertices.sort_unstable();
    vertices.dedup();
    Err(Alarm { reason: reason.into(), vertices })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Assets, Scene};

    fn guard() -> (Guard, Vec<Vec3>) {
        let text = "duration = 1.0\n[[cloth]]\nname = \"a\"\n\
            mesh = { generator = \"grid\", width = 1.0, height = 1.0, nx = 3, ny = 3 }\n\
            material = { areal_density = 0.1, in_plane = { model = \"spring\", stiffness = 10.0 } }\n";
        let scene = Scene::parse_toml(text, "test.toml").unwrap();
        let bodies = Bodies::new(&scene, &Assets::default()).unwrap();
        let x = bodies.cloth[0].x.clone();
        (Guard::new(&bodies), x)
    }

    #[test]
    fn what_is_not_finite_is_named() {
        let (guard, x) = guard();
        let v = vec![Vec3::zeros(); 9];
        assert_eq!(guard.check(&x, &x, &v), Ok(()));
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut wrong = x.clone();
            wrong[4].y = bad;
            let alarm = guard.check(&x, &wrong, &v).unwrap_err();
            assert_eq!((alarm.reason.as_str(), &alarm.vertices[..]), ("not finite", &[4][..]));
            let mut wrong = v.clone();
            wrong[7].z = bad;
            assert_eq!(guard.check(&x, &x, &wrong).unwrap_err().vertices, [7]);
        }
    }

    #[test]
    fn what_runs_away_is_named() {
        let (guard, x) = guard();
        let v = vec![Vec3::zeros(); 9];
        let far: Vec<Vec3> = x.iter().map(|p| p + Vec3::new(2000.0, 0.0, 0.0)).collect();
        assert_eq!(guard.check(&x, &far, &v).unwrap_err().vertices.len(), 9);
        let mut long = x.clone();
        long[0] += Vec3::new(0.0, 60.0, 0.0);
        let alarm = guard.check(&x, &long, &v).unwrap_err();
        assert!(alarm.reason.contains("stretched") && alarm.vertices.contains(&0), "{alarm:?}");
        long[0] = x[0] + Vec3::new(0.0, 40.0, 0.0);
        assert_eq!(guard.check(&x, &long, &v), Ok(()), "below the limit");
    }
}
