//! Fabrics by name, each value with its source.
//!
//! Densities and tensile stiffness (modulus times thickness, the same for warp and weft) of cotton, wool, wool-lycra and
//! polyester: [penava2014], as quoted in public code. Every other value is an estimate: of the size that textile
//! laboratories report for such a fabric, not a measurement of one.

use super::{Bending, InPlane, Material};
use crate::CoreError;

/// Where a value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Published: key of the reference.
    Published(&'static str),
    /// Of a plausible size, not measured.
    Estimate,
}

/// One value of a fabric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Provenance {
    /// Parameter, as in a scene file.
    pub name: &'static str,
    /// Its value in `unit`.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
    /// Where it comes from.
    pub source: Source,
}

/// Penava, Šimić Penava, Knezić 2014: density, thickness, modulus of woven fabrics.
const PENAVA: Source = Source::Published("penava2014");

struct Fabric {
    name: &'static str,
    /// [kg/m²]
    density: (f64, Source),
    /// Warp and weft [N/m].
    tensile: ([f64; 2], Source),
    /// [N/m], an estimate.
    shear: f64,
    /// [N m], an estimate.
    rigidity: f64,
}

/// Damping time of stretch and shear, an estimate [s].
const IN_PLANE_DAMPING: f64 = 2e-3;
/// Damping time of bending, an estimate [s].
const BENDING_DAMPING: f64 = 5e-3;

/// In alphabetical order.
const FABRICS: [Fabric; 6] = [
    Fabric {
        name: "cotton",
        density: (0.1503, PENAVA),
        tensile: ([261.0, 261.0], PENAVA),
        shear: 40.0,
        rigidity: 1.0e-5,
    },
    Fabric {
        name: "denim",
        density: (0.4, Source::Estimate),
        tensile: ([900.0, 600.0], Source::Estimate),
        shear: 90.0,
        rigidity: 8.0e-5,
    },
    Fabric {
        name: "polyester",
        density: (0.1646, PENAVA),
        tensile: ([120.0, 120.0], PENAVA),
        shear: 25.0,
        rigidity: 7.0e-6,
    },
    Fabric {
        name: "silk",
        density: (0.06, Source::Estimate),
        tensile: ([180.0, 140.0], Source::Estimate),
        shear: 15.0,
        rigidity: 2.0e-6,
    },
    Fabric {
        name: "wool",
        density: (0.2348, PENAVA),
        tensile: ([97.0, 97.0], PENAVA),
        shear: 30.0,
        rigidity: 1.5e-5,
    },
    Fabric {
        name: "wool-lycra",
        density: (0.1782, PENAVA),
        tensile: ([25.0, 25.0], PENAVA),
        shear: 15.0,
        rigidity: 8.0e-6,
    },
];

fn find(name: &str) -> Result<&'static Fabric, CoreError> {
    FABRICS
        .iter()
        .find(|f| f.name == name)
        .ok_or_else(|| CoreError::UnknownMaterial { got: name.to_owned(), known: names() })
}

/// Names of the library, in alphabetical order.
pub fn names() -> Vec<&'static str> {
    FABRICS.iter().map(|f| f.name).collect()
}

/// The fabric called `name`.
///
/// # Errors
/// [`CoreError::UnknownMaterial`] with the known names.
pub fn named(name: &str) -> Result<Material, CoreError> {
    let fabric = find(name)?;
    let [warp, weft] = fabric.tensile.0;
    Ok(Material {
        areal_density: fabric.density.0,
        in_plane: InPlane::BaraffWitkin { warp, weft, shear: fabric.shear, damping: IN_PLANE_DAMPING },
        bending: Bending::Hinge { rigidity: fabric.rigidity, damping: BENDING_DAMPING },
    })
}

/// Every value of the fabric called `name` with its unit and source.
///
/// # Errors
/// [`CoreError::UnknownMaterial`] with the known names.
pub fn provenance(name: &str) -> Result<Vec<Provenance>, CoreError> {
    let fabric = find(name)?;
    let ([warp, weft], tensile) = fabric.tensile;
    let (density, measured) = fabric.density;
    let row = |name, value, unit, source| Provenance { name, value, unit, source };
    Ok(vec![
        row("areal_density", density, "kg/m²", measured),
        row("in_plane.warp", warp, "N/m", tensile),
        row("in_plane.weft", weft, "N/m", tensile),
        row("in_plane.shear", fabric.shear, "N/m", Source::Estimate),
        row("in_plane.damping", IN_PLANE_DAMPING, "s", Source::Estimate),
        row("bending.rigidity", fabric.rigidity, "N m", Source::Estimate),
        row("bending.damping", BENDING_DAMPING, "s", Source::Estimate),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fabric_is_valid_and_fully_sourced() {
        let names = names();
        assert!(names.is_sorted());
        for name in names {
            let material = named(name).unwrap();
            material.check().unwrap();
            let rows = provenance(name).unwrap();
            assert_eq!(rows[0].value, material.areal_density);
            let InPlane::BaraffWitkin { warp, weft, shear, damping } = material.in_plane else { panic!() };
            let Bending::Hinge { rigidity, damping: bending_damping } = material.bending else { panic!() };
            let values: Vec<f64> = rows[1..].iter().map(|r| r.value).collect();
            assert_eq!(values, [warp, weft, shear, damping, rigidity, bending_damping]);
        }
    }

    #[test]
    fn unknown_names_list_the_known_ones() {
        let error = named("tweed").unwrap_err().to_string();
        assert!(error.contains("tweed") && error.contains("cotton"), "{error}");
    }
}
