//! Energies for reports.

use std::ops::AddAssign;

/// Mechanical energy of a state by kind [J].
#[derive(
    Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
pub struct Energy {
    /// ½ Σ m |v|².
    pub kinetic: f64,
    /// Springs along edges, or stretch along warp and weft; and the stitches of seams.
    pub stretch: f64,
    /// Shear between warp and weft.
    pub shear: f64,
    /// Hinges or bending springs.
    pub bending: f64,
    /// −Σ m g·x, zero at the origin.
    pub gravity: f64,
}

impl Energy {
    /// Sum of all kinds [J].
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic() + self.gravity
    }

    /// Sum of what deformation stores [J].
    pub fn elastic(&self) -> f64 {
        self.stretch + self.shear + self.bending
    }
}

impl AddAssign for Energy {
    fn add_assign(&mut self, other: Self) {
        self.kinetic += other.kinetic;
        self.stretch += other.stretch;
        self.shear += other.shear;
        self.bending += other.bending;
        self.gravity += other.gravity;
    }
}
