//! What surrounds the cloth: gravity and air.

use crate::{CoreError, mesh::Vec3};

/// Gravity and air, the same for all cloth of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Environment {
    /// Acceleration of gravity [m/s²].
    pub gravity: Vec3,
    /// Velocity of the air [m/s].
    pub wind: Vec3,
    /// Density of the air [kg/m³].
    pub air_density: f64,
    /// Drag coefficient of the cloth's surface, dimensionless.
    pub drag: f64,
    /// Lift coefficient of the cloth's surface, dimensionless.
    pub lift: f64,
    /// Damping relative to the air's velocity, proportional to mass: f = −c m (v − wind) [1/s].
    pub air_damping: f64,
}

impl Default for Environment {
    /// 9.81 m/s² towards −y, air at rest with 1.2 kg/m³, no drag, lift or damping.
    fn default() -> Self {
        Self {
            gravity: Vec3::new(0.0, -9.81, 0.0),
            wind: Vec3::zeros(),
            air_density: 1.2,
            drag: 0.0,
            lift: 0.0,
            air_damping: 0.0,
        }
    }
}

impl Environment {
    /// Refuses values that are not finite, and negative densities and coefficients.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] naming the first such value.
    pub fn check(&self) -> Result<(), CoreError> {
        for (name, expected, vector) in [
            ("gravity", "finite components in m/s²", self.gravity),
            ("air.wind", "finite components in m/s", self.wind),
        ] {
            if let Some(&got) = vector.iter().find(|c| !c.is_finite()) {
                return Err(CoreError::Parameter { name, expected, got });
            }
        }
        for (name, expected, got) in [
            ("air.density", "a value ≥ 0 in kg/m³", self.air_density),
            ("air.drag", "a value ≥ 0", self.drag),
            ("air.lift", "a value ≥ 0", self.lift),
            ("air.damping", "a value ≥ 0 in 1/s", self.air_damping),
        ] {
            if !(got.is_finite() && got >= 0.0) {
                return Err(CoreError::Parameter { name, expected, got });
            }
        }
        Ok(())
    }
}
