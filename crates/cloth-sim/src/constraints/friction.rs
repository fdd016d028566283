//! The kinetic force on a sliding vertex, linear in its velocity.

use super::sites::Settings;
use crate::Vec3;
use cloth_response::FrictionLaw;
use nalgebra::Matrix3;

/// Slower sliding has a direction of this speed's stiffness [m/s].
const LEAST_SPEED: f64 = 1e-5;
/// Part of the speed over which the slope of a law is taken.
const SLOPE: f64 = 1e-3;

/// p(u) = `impulse` − `drag` u [N s] at the mean velocity u of the vertex.
#[derive(Debug, Clone, Copy)]
pub(super) struct Push {
    /// Of the sliding that it opposes; a unit vector.
    pub(super) direction: Vec3,
    pub(super) impulse: Vec3,
    pub(super) drag: Matrix3<f64>,
}

/// The part of a force that one contact carries.
#[derive(Debug, Clone, Copy)]
pub(super) struct Load {
    pub(super) law: FrictionLaw,
    /// Normal impulse [N s], ≥ 0.
    pub(super) normal: f64,
    /// Area [m²].
    pub(super) area: f64,
}

/// Kinetic impulse of all `loads` at a sliding speed [N s].
pub(super) fn kinetic(loads: &[Load], speed: f64, dt: f64) -> f64 {
    loads.iter().map(|l| dt * l.law.kinetic_force(l.normal / dt, speed, l.area)).sum()
}

/// Impulse up to which `loads` stick [N s].
pub(super) fn sticking(loads: &[Load]) -> f64 {
    loads.iter().map(|l| l.law.static_coefficient() * l.normal).sum()
}

impl Push {
    /// The push that equals the kinetic impulse where the vertex slides with `slip` = speed · direction beyond `ride`, and
    /// follows it to first order: across the sliding the force turns with it, along it grows where the law grows.
    ///
    /// The law is taken at the mean of the sliding speed at the start, `speed_t0`, and at the end. Falling laws are not
    /// followed along the sliding: that would take stiffness out of the matrix.
    pub(super) fn new(
        loads: &[Load],
        direction: Vec3,
        slip: f64,
        speed_t0: f64,
        ride: &Vec3,
        tangential: &Matrix3<f64>,
        settings: &Settings,
    ) -> Self {
        let dt = settings.dt;
        let mean = 0.5 * (speed_t0 + slip);
        let force = kinetic(loads, mean, dt);
        let ahead = (SLOPE * mean).max(LEAST_SPEED);
        let slope = 0.5 * (kinetic(loads, mean + ahead, dt) - force) / ahead;
        let along = direction * direction.transpose();
        let across = if slip > 0.0 { force / slip.max(LEAST_SPEED) } else { 0.0 };
        let drag = (tangential - along) * across + along * slope.max(0.0);
        Self { direction, impulse: drag * (ride + direction * slip) - direction * force, drag }
    }

    /// p(u) [N s].
    pub(super) fn at(&self, u: &Vec3) -> Vec3 {
        self.impulse - self.drag * u
    }
}
