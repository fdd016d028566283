//! Finds a state that must not be written: non-finite, or run away.
//!
//! Edges are looked at only when one may have become too long: none grows by more than its two ends have moved since all were
//! looked at, and that is at most the sum of the longest ways of the attempts in between.

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
    /// Least that an edge could still grow by when all were looked at [m].
    room: f64,
    /// The most that a vertex may have moved since [m].
    moved: f64,
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
        Self { edges, travel, room: 0.0, moved: f64::INFINITY }
    }

    /// Whether the step `x_t0` → `x_t1`, ending with velocities `v`, may be written. `x_t0` has been written.
    pub(crate) fn check(&mut self, x_t0: &[Vec3], x_t1: &[Vec3], v: &[Vec3]) -> Result<(), Alarm> {
        // Zero times a number that is not finite is not zero.
        let zeros = |sum: Vec3, list: &[Vec3]| list.iter().fold(sum, |sum, p| sum + p * 0.0);
        if zeros(zeros(Vec3::zeros(), x_t1), v) != Vec3::zeros() {
            let finite = |p: &Vec3| p.iter().all(|c| c.is_finite());
            alarm("not finite", (0..x_t1.len()).filter(|&i| !finite(&x_t1[i]) || !finite(&v[i])))?;
        }
        let (mut first, mut longest) = (0, 0.0_f64);
        for &(end, way) in &self.travel {
            let square = |i: usize| (x_t1[i] - x_t0[i]).norm_squared();
            let most = (first..end).fold(0.0, |most, i| if square(i) > most { square(i) } else { most });
            if most > way {
                let far = (first..end).filter(|&i| square(i) > way);
                alarm("moved more than 1000 times the cloth's size within one step", far)?;
            }
            (first, longest) = (end, longest.max(most));
        }
        self.moved += longest.sqrt();
        // Rounding of lengths is far below the half that is kept.
        if 2.0 * self.moved < 0.5 * self.room {
            return Ok(());
        }
        let square = |[a, b]: &[u32; 2]| (x_t1[*a as usize] - x_t1[*b as usize]).norm_squared();
        let long = self.edges.iter().filter(|(edge, limit)| square(edge) > *limit);
        alarm(
            "stretched to more than 100 times the rest length",
            long.flat_map(|(edge, _)| edge.map(|v| v as usize)),
        )?;
        let room = |(edge, limit): &([u32; 2], f64)| limit.sqrt() - square(edge).sqrt();
        self.room = self.edges.iter().map(room).fold(f64::INFINITY, f64::min);
        // The next attempt may begin where this one did.
        self.moved = longest.sqrt();
        Ok(())
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
        let (mut guard, x) = guard();
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
        let (mut guard, x) = guard();
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
    #[test]
    fn an_edge_that_grows_step_by_step_is_seen_in_the_step_in_which_it_is_too_long() {
        // Corner 0 leaves along its edges, with attempts that are given up in between; edges of 0.5 m may be 50 m long.
        let (mut guard, mut x) = guard();
        let v = vec![Vec3::zeros(); 9];
        let mut looks = 0;
        for step in 0..200 {
            let mut refused = x.clone();
            refused[8] += Vec3::new(0.0, 0.3, 0.0);
            assert_eq!(guard.check(&x, &refused, &v), Ok(()));
            let mut next = x.clone();
            next[0] -= Vec3::new(0.4, 0.0, 0.0);
            let long = next[1].x - next[0].x > 50.0;
            let moved = guard.moved;
            let result = guard.check(&x, &next, &v);
            assert_eq!(result.is_err(), long, "step {step}");
            looks += usize::from(guard.moved < moved);
            if long {
                assert!((100..140).contains(&step), "{step}");
                assert!((2..40).contains(&looks), "most steps look at no edge: {looks} of {step}");
                return;
            }
            x = next;
        }
        panic!("it is never too long");
    }
}
