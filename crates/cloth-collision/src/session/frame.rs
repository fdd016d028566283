//! The rigid motion that the scene follows as a whole: what all vertices do together changes no distance.
//!
//! A frame maps the middles of the balls to where they would be now, x ↦ A(x − c) + b with a rotation A. At both ends of a
//! step it is fitted to the positions; in between it is A(t) = (1−t)A₀ + tA₁ with |A(t)d|² = |d|² − t(1−t)|(A₁−A₀)d|², which
//! shortens lengths by no more than the factor s = 1 − ‖A₁−A₀‖²/4. So two features that are D apart at the middles are at
//! least s D − a_f − a_g apart during the step, with a the distances of the vertices from where the frame takes their
//! middles, the motion in between linear and so largest at an end.

use crate::{CollisionMesh, Vec3};
use cloth_mesh::NONE;

/// Vertices that a fit looks at, about.
const SAMPLES: usize = 1024;
/// Rounds of the fit; motion from frame to frame needs two.
const ROUNDS: usize = 4;
/// Angle of a round \[rad\] that is the last one.
const SMALL_TURN: f64 = 1e-6;
/// Shortening beyond which following is given up for a step.
const LEAST_SCALE: f64 = 0.99;

/// A rigid motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    rows: [Vec3; 3],
    centre: Vec3,
    to: Vec3,
}

impl Frame {
    /// What stays where it is.
    pub(super) fn at_rest() -> Self {
        Self { rows: [Vec3::x(), Vec3::y(), Vec3::z()], centre: Vec3::zeros(), to: Vec3::zeros() }
    }

    #[inline(always)]
    pub(super) fn apply(&self, x: Vec3) -> Vec3 {
        self.rotate(x - self.centre) + self.to
    }

    #[inline(always)]
    fn rotate(&self, d: Vec3) -> Vec3 {
        Vec3::new(self.rows[0].dot(&d), self.rows[1].dot(&d), self.rows[2].dot(&d))
    }

    /// What [`Frame::apply`] takes to `x`.
    #[inline(always)]
    pub(super) fn back(&self, x: Vec3) -> Vec3 {
        let d = x - self.to;
        self.rows[0] * d.x + self.rows[1] * d.y + self.rows[2] * d.z + self.centre
    }

    /// Sum of the coordinates that a point and its image carry rounding errors of, besides their own.
    #[inline(always)]
    pub(super) fn size(&self) -> f64 {
        [self.centre, self.to].iter().map(|p| p.x.abs() + p.y.abs() + p.z.abs()).sum()
    }

    /// The rigid motion near `start` that takes the points `from` near `to`, by Gauss-Newton steps of the least squares.
    fn fit(start: &Self, points: &[(Vec3, Vec3)]) -> Self {
        if points.is_empty() {
            return Self::at_rest();
        }
        let share = 1.0 / points.len() as f64;
        let (mut centre, mut to) = (Vec3::zeros(), Vec3::zeros());
        for (p, q) in points {
            centre += p * share;
            to += q * share;
        }
        let mut frame = Self { rows: start.rows, centre, to };
        for _ in 0..ROUNDS {
            let mut inertia = [Vec3::zeros(); 3];
            let mut moment = Vec3::zeros();
            for (p, q) in points {
                let r = frame.rotate(p - centre);
                moment += r.cross(&(q - to)) * share;
                let square = r.norm_squared();
                for k in 0..3 {
                    inertia[k] -= r * (r[k] * share);
                    inertia[k][k] += square * share;
                }
            }
            let turn = solve(&inertia, &moment);
            frame.turn(turn);
            // Another round would turn by about the square of this.
            if turn.norm() < SMALL_TURN {
                break;
            }
        }
        frame
    }

    /// Turns further by the rotation vector.
    fn turn(&mut self, w: Vec3) {
        let angle = w.norm();
        if !(angle > 0.0 && angle < 10.0) {
            return;
        }
        let axis = w / angle;
        let (sin, cos) = angle.sin_cos();
        // Columns of the rotation so far, turned.
        let columns = [0, 1, 2].map(|k| {
            let c = Vec3::new(self.rows[0][k], self.rows[1][k], self.rows[2][k]);
            c * cos + axis.cross(&c) * sin + axis * (axis.dot(&c) * (1.0 - cos))
        });
        // Orthogonal to the last bits, however many turns there were.
        let a = columns[0].normalize();
        let b = (columns[1] - a * a.dot(&columns[1])).normalize();
        let c = a.cross(&b);
        self.rows = [0, 1, 2].map(|k| Vec3::new(a[k], b[k], c[k]));
    }
}

/// Solves the symmetric system; zero if it is all but singular.
fn solve(rows: &[Vec3; 3], right: &Vec3) -> Vec3 {
    let [a, b, c] = rows;
    let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
    let determinant = a.dot(&bc);
    let size = a.norm() * b.norm() * c.norm();
    if !(determinant.abs() > 1e-9 * size) {
        return Vec3::zeros();
    }
    (bc * right.x + ca * right.y + ab * right.z) / determinant
}

/// Frames at both ends of a step, and what distances at the middles are to be multiplied with.
#[derive(Debug, Clone, Copy)]
pub(super) struct Following {
    pub(super) ends: [Frame; 2],
    pub(super) scale: f64,
}

impl Following {
    pub(super) fn none() -> Self {
        Self { ends: [Frame::at_rest(); 2], scale: 1.0 }
    }

    /// The frames that take `middles` (given a vertex) to the positions `x` at both ends, relative to `origin`, or none if
    /// they differ too much.
    pub(super) fn fit(
        mesh: &CollisionMesh,
        middles: impl Fn(usize) -> Vec3,
        origin: &Vec3,
        x: [&[Vec3]; 2],
        start: &Frame,
    ) -> Self {
        let is_dynamic = |v: usize| mesh.bodies[mesh.vertex_body[v] as usize].dynamic;
        let chosen: Vec<usize> = (0..mesh.vertex_count)
            .step_by(mesh.vertex_count.div_ceil(SAMPLES).max(1))
            .filter(|&v| mesh.vertex_owner[v] != NONE && is_dynamic(v))
            .collect();
        let points = |x: &[Vec3]| -> Vec<(Vec3, Vec3)> {
            chosen.iter().map(|&v| (middles(v), x[v] - origin)).collect()
        };
        let first = Frame::fit(start, &points(x[0]));
        let second = Frame::fit(&first, &points(x[1]));
        Self::between(first, second)
    }

    /// From one frame to another, or none if they differ too much.
    fn between(first: Frame, second: Frame) -> Self {
        let change: f64 = (0..3).map(|k| (first.rows[k] - second.rows[k]).norm_squared()).sum();
        // The rows are orthogonal to a few units of rounding.
        let scale = 1.0 - 0.25 * change - 1e-13;
        let is_finite = [first, second].iter().all(|f| (f.centre + f.to + f.rows[2]).norm() < f64::INFINITY);
        if !(scale > LEAST_SCALE && is_finite) {
            return Self::none();
        }
        Self { ends: [first, second], scale }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(angle: f64, to: Vec3) -> Frame {
        let mut frame = Frame::at_rest();
        frame.turn(Vec3::new(0.3, -0.8, 0.5).normalize() * angle);
        Frame { to, ..frame }
    }

    #[test]
    fn a_rigid_motion_is_found() {
        let points: Vec<Vec3> =
            (0..50).map(|k| Vec3::new(f64::from(k % 7), f64::from(k % 5), f64::from(k % 3))).collect();
        for angle in [0.0, 0.01, 0.4, 1.0] {
            let motion = turned(angle, Vec3::new(3.0, -1.0, 0.5));
            let pairs: Vec<(Vec3, Vec3)> = points.iter().map(|p| (*p, motion.apply(*p))).collect();
            let found = Frame::fit(&Frame::at_rest(), &pairs);
            for (p, q) in &pairs {
                assert!((found.apply(*p) - q).norm() < 1e-6, "{angle}: {}", (found.apply(*p) - q).norm());
            }
        }
    }

    #[test]
    fn frames_keep_lengths_and_their_mean_does_up_to_the_scale() {
        let (a, b) = (turned(0.1, Vec3::zeros()), turned(0.25, Vec3::zeros()));
        let change: f64 = (0..3).map(|k| (a.rows[k] - b.rows[k]).norm_squared()).sum();
        let scale = 1.0 - 0.25 * change;
        let mut least = 1.0f64;
        for k in 0..200 {
            let d = Vec3::new(f64::from(k % 11) - 5.0, f64::from(k % 7) - 3.0, f64::from(k % 13) - 6.0);
            if d.norm() == 0.0 {
                continue;
            }
            assert!((a.rotate(d).norm() / d.norm() - 1.0).abs() < 1e-14);
            let mean = (a.rotate(d) + b.rotate(d)) * 0.5;
            least = least.min(mean.norm() / d.norm());
        }
        assert!(least >= scale && least < 1.0 - 0.05 * change, "{least} {scale}");
    }

    #[test]
    fn points_on_a_line_or_none_at_all_give_some_rigid_motion() {
        let line: Vec<(Vec3, Vec3)> =
            (0..9).map(|k| (Vec3::x() * f64::from(k), Vec3::y() * f64::from(k))).collect();
        for points in [&line[..], &line[..1], &[]] {
            let frame = Frame::fit(&Frame::at_rest(), points);
            assert!((frame.rotate(Vec3::new(1.0, 2.0, 2.0)).norm() - 3.0).abs() < 1e-12);
        }
    }
}
