//! What cloth is made of, in SI units.

mod bending;
pub mod library;

pub use bending::{Bending, HingeCoupling, HysteresisBending, NonlinearBending, PlasticBending};

use crate::CoreError;

/// A fabric: mass per area and the two laws of its deformation.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Mass per area [kg/m²].
    pub areal_density: f64,
    /// Resistance to stretch and shear.
    pub in_plane: InPlane,
    /// Resistance to bending.
    #[serde(default)]
    pub bending: Bending,
}

/// In-plane law.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(tag = "model", rename_all = "kebab-case", deny_unknown_fields)]
pub enum InPlane {
    /// Linear springs along the edges (3.1), damped along their axis (3.2).
    Spring {
        /// Stiffness of each edge [N/m].
        stiffness: f64,
        /// Damping of each edge [N s/m].
        #[serde(default)]
        damping: f64,
    },
    /// Stretch along warp and weft (3.6) and shear (3.7) of each triangle, damped as in (3.8).
    BaraffWitkin {
        /// Stiffness along the warp (u) [N/m].
        warp: f64,
        /// Stiffness along the weft (v) [N/m].
        weft: f64,
        /// Shear stiffness [N/m].
        shear: f64,
        /// Damping time [s]: each k_d of (3.8) is this times the stiffness it belongs to.
        #[serde(default)]
        damping: f64,
    },
}

impl Material {
    /// Refuses values that are not finite, a density that is not positive, and negative stiffness or damping.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] naming the first such value.
    pub fn check(&self) -> Result<(), CoreError> {
        const STIFFNESS: &str = "a value ≥ 0 in N/m";
        const TIME: &str = "a value ≥ 0 in s";
        const AXIAL: &str = "a value ≥ 0 in N s/m";
        if !(self.areal_density.is_finite() && self.areal_density > 0.0) {
            return Err(CoreError::Parameter {
                name: "areal_density",
                expected: "a value > 0 in kg/m²",
                got: self.areal_density,
            });
        }
        match self.in_plane {
            InPlane::Spring { stiffness, damping } => not_negative(&[
                ("in_plane.stiffness", STIFFNESS, stiffness),
                ("in_plane.damping", AXIAL, damping),
            ])?,
            InPlane::BaraffWitkin { warp, weft, shear, damping } => not_negative(&[
                ("in_plane.warp", STIFFNESS, warp),
                ("in_plane.weft", STIFFNESS, weft),
                ("in_plane.shear", STIFFNESS, shear),
                ("in_plane.damping", TIME, damping),
            ])?,
        }
        self.bending.check()
    }
}

/// Refuses the first of some (name, expectation, value) that is negative or not finite.
fn not_negative(values: &[(&'static str, &'static str, f64)]) -> Result<(), CoreError> {
    values
        .iter()
        .find(|(_, _, got)| !(got.is_finite() && *got >= 0.0))
        .map_or(Ok(()), |&(name, expected, got)| Err(CoreError::Parameter { name, expected, got }))
}
