//! Rigid motions over one step: of a free zone (by its momentum) and of a prescribed body (by its positions).
//!
//! Vertices go straight from x to c₁ + R (x − c₀): at the fraction t of the step all of them are at the affine image
//! ((1 − t) I + t R) of where they were, which is invertible for every t unless R turns by π. So what did not
//! intersect at the start does not intersect on the way, whatever the number of vertices.

use crate::Vec3;
use nalgebra::{Matrix3, Rotation3, SymmetricEigen};

/// Largest turn of a zone in one step [rad]: below π, where the straight paths would pass through one point.
pub(crate) const MAX_TURN: f64 = 2.0;
/// Principal moments below this fraction of the largest are those of a line (or two vertices): no turn about it.
const FLAT_INERTIA: f64 = 1e-8;
/// Singular values below this fraction of the largest give no direction.
const FLAT_SPREAD: f64 = 1e-9;

/// x ↦ `to` + `turn` (x − `from`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RigidMap {
    pub(crate) from: Vec3,
    pub(crate) to: Vec3,
    pub(crate) turn: Matrix3<f64>,
}

impl RigidMap {
    /// The map that leaves everything where it is.
    pub(crate) fn still() -> Self {
        Self { from: Vec3::zeros(), to: Vec3::zeros(), turn: Matrix3::identity() }
    }

    pub(crate) fn apply(&self, x: &Vec3) -> Vec3 {
        self.to + self.turn * (x - self.from)
    }

    /// Angle of the turn [rad], in \[0, π\].
    pub(crate) fn angle(&self) -> f64 {
        Rotation3::from_matrix_unchecked(self.turn).angle()
    }

    /// The motion of a free rigid body with the vertices' momentum and angular momentum:
    /// c₁ = c + dt v_c, R = rotation by dt I⁺ L with the pseudo-inverse I⁺ of the inertia, at most [`MAX_TURN`].
    ///
    /// Momentum is kept. Angular momentum of the straight motion is kept to first order in the angle θ of the turn: its
    /// part along the axis is L sin θ/θ, and an axis that is not principal adds (1 − cos θ)/θ times the products of
    /// inertia across it (the axis would turn with the body within the step).
    ///
    /// Iterates over (mass, position, velocity).
    pub(crate) fn of_free(points: impl Iterator<Item = (f64, Vec3, Vec3)> + Clone, dt: f64) -> Self {
        let (mut mass, mut x_sum, mut v_sum) = (0.0, Vec3::zeros(), Vec3::zeros());
        for (m, x, v) in points.clone() {
            mass += m;
            x_sum += x * m;
            v_sum += v * m;
        }
        let (centre, velocity) = (x_sum / mass, v_sum / mass);
        let (mut momentum, mut inertia) = (Vec3::zeros(), Matrix3::zeros());
        for (m, x, v) in points {
            let r = x - centre;
            momentum += r.cross(&(v - velocity)) * m;
            inertia += (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * m;
        }
        let eigen = SymmetricEigen::new(inertia);
        let largest = eigen.eigenvalues.max();
        let mut spin = Vec3::zeros();
        for k in 0..3 {
            let (moment, axis) = (eigen.eigenvalues[k], eigen.eigenvectors.column(k));
            if moment > FLAT_INERTIA * largest {
                spin += axis * (axis.dot(&momentum) / moment);
            }
        }
        let mut turn = spin * dt;
        if turn.norm() > MAX_TURN {
            turn *= MAX_TURN / turn.norm();
        }
        Self {
            from: centre,
            to: centre + velocity * dt,
            turn: Rotation3::from_scaled_axis(turn).into_inner(),
        }
    }

    /// The rigid map nearest to x ↦ y over the given pairs (least squares), and its largest deviation [m].
    ///
    /// Pairs on one line turn by the least angle that takes line to line; a single pair translates.
    pub(crate) fn fit(pairs: impl Iterator<Item = (Vec3, Vec3)> + Clone) -> (Self, f64) {
        let (mut count, mut from, mut to) = (0.0, Vec3::zeros(), Vec3::zeros());
        for (x, y) in pairs.clone() {
            count += 1.0;
            from += x;
            to += y;
        }
        if count == 0.0 {
            return (Self::still(), 0.0);
        }
        (from, to) = (from / count, to / count);
        let mut spread = Matrix3::zeros();
        let mut size = 0.0_f64;
        for (x, y) in pairs.clone() {
            spread += (y - to) * (x - from).transpose();
            size = size.max((x - from).norm_squared());
        }
        let svd = spread.svd(true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
            return (Self { from, to, turn: Matrix3::identity() }, f64::INFINITY);
        };
        let turn = if svd.singular_values[0] <= FLAT_SPREAD * FLAT_SPREAD * size {
            Matrix3::identity()
        } else if svd.singular_values[1] <= FLAT_SPREAD * svd.singular_values[0] {
            let (before, after) = (v_t.row(0).transpose(), u.column(0).into_owned());
            Rotation3::rotation_between(&before, &after).map_or(Matrix3::identity(), Rotation3::into_inner)
        } else {
            let mirror = if (u * v_t).determinant() < 0.0 { -1.0 } else { 1.0 };
            u * Matrix3::from_diagonal(&Vec3::new(1.0, 1.0, mirror)) * v_t
        };
        let map = Self { from, to, turn };
        let deviation = pairs.map(|(x, y)| (map.apply(&x) - y).norm()).fold(0.0, f64::max);
        (map, deviation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of positions of size 1, summed over a few vertices.
    const ROUNDING: f64 = 1e-13;

    fn rotated(points: &[Vec3], axis_angle: Vec3, shift: Vec3) -> Vec<Vec3> {
        let turn = Rotation3::from_scaled_axis(axis_angle);
        points.iter().map(|p| turn * p + shift).collect()
    }

    fn cloud() -> Vec<Vec3> {
        [[0.3, 0.1, 0.9], [-0.2, 0.7, 0.4], [0.5, -0.6, 0.2], [1.0, 0.3, -0.8], [0.1, 0.2, 0.3]]
            .map(Vec3::from)
            .to_vec()
    }

    /// Recover a rotation and shift from volumes, planes, lines and points; a planted deformation shows as deviation.
    #[test]
    fn fit_recovers_rigid_motion() {
        let (axis_angle, shift) = (Vec3::new(0.3, -1.1, 0.4), Vec3::new(5.0, -2.0, 0.1));
        let plane: Vec<Vec3> = cloud().iter().map(|p| Vec3::new(p.x, 0.0, p.z)).collect();
        let line: Vec<Vec3> = cloud().iter().map(|p| Vec3::new(1.0, 2.0, -1.0) * p.x).collect();
        for points in [cloud(), plane, line, cloud()[..1].to_vec(), cloud()[..2].to_vec()] {
            let moved = rotated(&points, axis_angle, shift);
            let (map, deviation) = RigidMap::fit(points.iter().copied().zip(moved.iter().copied()));
            assert!(deviation < ROUNDING, "{deviation}");
            assert!((map.turn.determinant() - 1.0).abs() < ROUNDING);
            if points.len() > 2 {
                let mut bent = moved;
                bent[0] += Vec3::new(0.01, 0.02, 0.0);
                let (_, deviation) = RigidMap::fit(points.iter().copied().zip(bent.iter().copied()));
                assert!(deviation > 1e-3, "a deformation of 2 cm must show, got {deviation}");
            }
        }
    }

    fn free(points: &[Vec3], velocities: &[Vec3], dt: f64) -> RigidMap {
        RigidMap::of_free(points.iter().zip(velocities).map(|(x, v)| (0.5, *x, *v)), dt)
    }

    /// A body in rigid motion goes on turning about its axis by ω dt.
    #[test]
    fn free_body_keeps_its_spin() {
        let (omega, velocity, dt) = (Vec3::new(2.0, -1.0, 0.5), Vec3::new(1.0, 2.0, 3.0), 0.1);
        let velocities: Vec<Vec3> = cloud().iter().map(|p| velocity + omega.cross(p)).collect();
        let map = free(&cloud(), &velocities, dt);
        assert!((map.angle() - omega.norm() * dt).abs() < ROUNDING);
        let centre: Vec3 = cloud().iter().sum::<Vec3>() / 5.0;
        assert!((map.apply(&centre) - centre - (velocity + omega.cross(&centre)) * dt).norm() < ROUNDING);
    }

    /// Momentum, and angular momentum about the centre, of straight motions along a map.
    fn momenta(map: &RigidMap, masses: &[f64], points: &[Vec3], dt: f64) -> (Vec3, Vec3) {
        let mut sums = (Vec3::zeros(), Vec3::zeros());
        for (&m, x) in masses.iter().zip(points) {
            let v = (map.apply(x) - x) / dt;
            sums.0 += v * m;
            sums.1 += (x - map.from).cross(&v) * m;
        }
        sums
    }

    /// A zone keeps its momentum; its angular momentum as the formula says.
    #[test]
    fn a_free_zone_keeps_its_momenta() {
        let masses = [0.5, 2.0, 1.0, 0.1, 3.0];
        let velocities =
            [[1.0, 0.0, 0.2], [-2.0, 0.5, 0.0], [0.0, 3.0, 1.0], [0.4, 0.4, -5.0], [0.3, -1.0, 0.0]]
                .map(Vec3::from);
        let free = |points: &[Vec3], velocities: &[Vec3], dt: f64| {
            let list = masses.iter().zip(points).zip(velocities).map(|((m, x), v)| (*m, *x, *v));
            RigidMap::of_free(list, dt)
        };
        let exact = |points: &[Vec3], velocities: &[Vec3]| {
            let total: f64 = masses.iter().sum();
            let centre = masses.iter().zip(points).map(|(m, x)| x * *m).sum::<Vec3>() / total;
            let parts = masses.iter().zip(points).zip(velocities);
            parts.fold((Vec3::zeros(), Vec3::zeros()), |(p, l), ((m, x), v)| {
                (p + v * *m, l + (x - centre).cross(v) * *m)
            })
        };
        let (p, l) = exact(&cloud(), &velocities);
        let mut errors = Vec::new();
        for dt in [0.2, 0.1, 0.05] {
            let map = free(&cloud(), &velocities, dt);
            let (p_zone, l_zone) = momenta(&map, &masses, &cloud(), dt);
            assert!((p_zone - p).norm() < ROUNDING * p.norm(), "{p_zone} {p}");
            errors.push((l_zone - l).norm() / l.norm());
            assert!(errors[errors.len() - 1] < map.angle(), "{errors:?} at {}", map.angle());
        }
        // First order: about half the error with half the turn.
        assert!(errors[1] < 0.6 * errors[0] && errors[2] < 0.6 * errors[1], "{errors:?}");

        // In a plane the axis is principal: L sin θ/θ.
        let flat: Vec<Vec3> = cloud().iter().map(|x| Vec3::new(x.x, 0.0, x.z)).collect();
        let spun = |(v, x): (&Vec3, &Vec3)| Vec3::new(v.x, 0.0, v.z) + Vec3::new(0.0, 5.0, 0.0).cross(x);
        let fast: Vec<Vec3> = velocities.iter().zip(&flat).map(spun).collect();
        let (dt, (_, l)) = (0.2, exact(&flat, &fast));
        let map = free(&flat, &fast, dt);
        let (angle, (_, l_zone)) = (map.angle(), momenta(&map, &masses, &flat, dt));
        assert!(angle > 0.5 && (l_zone - l * (angle.sin() / angle)).norm() < ROUNDING * l.norm(), "{angle}");
    }

    /// Two vertices and collinear zones have a singular inertia: finite, no turn about the line, lengths kept.
    #[test]
    fn lines_have_a_pseudo_inverse() {
        for count in [2, 4] {
            let points: Vec<Vec3> = (0..count).map(|i| Vec3::new(i as f64, 0.0, 0.0)).collect();
            let velocities: Vec<Vec3> =
                (0..count).map(|i| Vec3::new(0.0, i as f64, 0.0) + Vec3::z()).collect();
            let map = free(&points, &velocities, 0.25);
            assert!((map.angle() - 0.25).abs() < ROUNDING, "ω = 1 about z");
            assert!((map.apply(&points[1]) - map.apply(&points[0])).norm() - 1.0 < ROUNDING);
        }
    }

    /// No angular momentum: a translation, no division by |ω| = 0. One vertex goes on alone.
    #[test]
    fn no_spin_translates() {
        let v = Vec3::new(0.5, 0.0, -0.5);
        for points in [&cloud()[..], &cloud()[..1]] {
            let map = free(points, &vec![v; points.len()], 0.1);
            assert!((map.turn - Matrix3::identity()).norm() < ROUNDING);
            assert!((map.apply(&points[0]) - points[0] - v * 0.1).norm() < ROUNDING);
        }
    }

    /// A turn of more than the cap is cut: half a turn would send all paths through one point.
    #[test]
    fn turns_are_capped() {
        let velocities: Vec<Vec3> = cloud().iter().map(|p| Vec3::new(0.0, 100.0, 0.0).cross(p)).collect();
        assert!((free(&cloud(), &velocities, 0.1).angle() - MAX_TURN).abs() < ROUNDING);
    }
}
