//! Fabrics by name, each value with its unit and its source.
//!
//! A value is either published, with the key of its reference in [`SOURCES`], or an estimate that says what it rests on.
//! Each fabric has what [`Material`] needs under any of the [`LAWS`] of bending; which one it gets is the caller's choice,
//! so that a scene pays for the hysteresis of its fabrics only where it asks for it.

mod fabrics;

use super::{Bending, HingeCoupling, HysteresisBending, InPlane, Material, NonlinearBending};
use crate::CoreError;
use fabrics::{BENDING_DAMPING, FABRICS, IN_PLANE_DAMPING};

pub use fabrics::SOURCES;

/// Where a value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Published.
    Published {
        /// Key of the reference, one of [`SOURCES`].
        key: &'static str,
        /// Where in the reference.
        at: &'static str,
    },
    /// Not measured on this fabric; what it rests on.
    Estimate(&'static str),
}

/// A reference that values are taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reference {
    /// Key, as in `REFERENCES.bib`.
    pub key: &'static str,
    /// Authors, year, title, and how its values were read.
    pub about: &'static str,
}

/// A value in the SI unit of its place, with its source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// The value.
    pub value: f64,
    /// Where it comes from.
    pub source: Source,
}

/// A fabric of the library.
///
/// Bending is isotropic in the engine. Where a source gives the two directions, both bending values are the geometric
/// means √(warp · weft); where it gives one value, that one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fabric {
    /// Name, as in a scene file.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Mass per area [kg/m²].
    pub areal_density: Quantity,
    /// Thickness under the light pressure of a gauge [m].
    pub thickness: Option<Quantity>,
    /// Stiffness along warp and weft per width [N/m].
    pub tensile: [Quantity; 2],
    /// Shear force per width over shear angle [N/m].
    pub shear: Quantity,
    /// Bending rigidity B per width, the slope once friction is overcome [N m].
    pub rigidity: Quantity,
    /// Coercive couple 2HB per width, the gap between the straight sides of the loop [N m/m].
    pub coercive_couple: Quantity,
    /// Curvature at which the first loading becomes straight [1/m].
    pub transition_curvature: Quantity,
    /// Kinetic friction coefficient on itself.
    pub friction: Option<Quantity>,
}

/// One row of a fabric's table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Property {
    /// Name of the property.
    pub name: &'static str,
    /// SI unit; `1` for a pure number.
    pub unit: &'static str,
    /// The value and its source.
    pub quantity: Quantity,
}

/// Bending laws that [`named_with`] knows.
pub const LAWS: [&str; 4] = ["none", "linear", "nonlinear", "hysteresis"];

impl Fabric {
    /// All known values, in the order of the struct; the two damping times, the same for all fabrics, come last.
    pub fn properties(&self) -> Vec<Property> {
        let row = |name, unit, quantity| Some(Property { name, unit, quantity });
        [
            row("areal_density", "kg/m²", self.areal_density),
            self.thickness.and_then(|quantity| row("thickness", "m", quantity)),
            row("tensile_warp", "N/m", self.tensile[0]),
            row("tensile_weft", "N/m", self.tensile[1]),
            row("shear", "N/m", self.shear),
            row("bending_rigidity", "N m", self.rigidity),
            row("coercive_couple", "N m/m", self.coercive_couple),
            row("transition_curvature", "1/m", self.transition_curvature),
            self.friction.and_then(|quantity| row("friction", "1", quantity)),
            row("in_plane_damping", "s", IN_PLANE_DAMPING),
            row("bending_damping", "s", BENDING_DAMPING),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// The fabric under a bending law: `linear` has B alone; `nonlinear` and `hysteresis` have the loop too. Hysteresis
    /// dissipates by itself and has no damping time; plasticity and fatigue are 0.
    ///
    /// # Errors
    /// [`CoreError::UnknownLaw`] with the [`LAWS`].
    pub fn material(&self, law: &str) -> Result<Material, CoreError> {
        let rigidity = Some(self.rigidity.value);
        let coercive_couple = Some(self.coercive_couple.value);
        let transition_curvature = Some(self.transition_curvature.value);
        let damping = BENDING_DAMPING.value;
        let bending = match law {
            "none" => Bending::None,
            "linear" => {
                Bending::Hinge { rigidity: self.rigidity.value, damping, hinges: HingeCoupling::Coupled }
            }
            "nonlinear" => Bending::Nonlinear(NonlinearBending {
                rigidity,
                coercive_couple,
                transition_curvature,
                damping,
                ..NonlinearBending::default()
            }),
            "hysteresis" => Bending::Hysteresis(HysteresisBending {
                rigidity,
                coercive_couple,
                transition_curvature,
                ..HysteresisBending::default()
            }),
            _ => return Err(CoreError::UnknownLaw { got: law.to_owned(), known: LAWS.to_vec() }),
        };
        Ok(Material {
            areal_density: self.areal_density.value,
            in_plane: InPlane::BaraffWitkin {
                warp: self.tensile[0].value,
                weft: self.tensile[1].value,
                shear: self.shear.value,
                damping: IN_PLANE_DAMPING.value,
            },
            bending,
        })
    }
}

/// Names of the library, in alphabetical order.
pub fn names() -> Vec<&'static str> {
    FABRICS.iter().map(|f| f.name).collect()
}

/// All values of the fabric called `name`.
///
/// # Errors
/// [`CoreError::UnknownMaterial`] with the known names.
pub fn fabric(name: &str) -> Result<&'static Fabric, CoreError> {
    FABRICS
        .iter()
        .find(|f| f.name == name)
        .ok_or_else(|| CoreError::UnknownMaterial { got: name.to_owned(), known: names() })
}

/// The fabric called `name` with linear bending.
///
/// # Errors
/// [`CoreError::UnknownMaterial`] with the known names.
pub fn named(name: &str) -> Result<Material, CoreError> {
    named_with(name, "linear")
}

/// The fabric called `name` under one of the [`LAWS`] of bending.
///
/// # Errors
/// [`CoreError::UnknownMaterial`] with the known names, [`CoreError::UnknownLaw`] with the known laws.
pub fn named_with(name: &str, law: &str) -> Result<Material, CoreError> {
    fabric(name)?.material(law)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bending::Curve;

    /// The range that the stability tests of the engine cover, areal density [kg/m²] and bending rigidity [N m]: what
    /// 251 measured fabrics span [feng2022].
    const DENSITIES: std::ops::RangeInclusive<f64> = 0.015..=0.9;
    const RIGIDITIES: std::ops::RangeInclusive<f64> = 1e-6..=3e-4;

    const REFERENCES: &str = include_str!("../../../../../REFERENCES.bib");

    /// Keys in square brackets.
    fn cited(text: &str) -> Vec<&str> {
        text.split('[').skip(1).map(|rest| rest.split(']').next().unwrap()).collect()
    }

    fn in_references(key: &str) -> bool {
        REFERENCES.contains(&format!("{{{key},"))
    }

    #[test]
    fn every_fabric_is_valid_under_every_law() {
        assert!(FABRICS.len() >= 10);
        assert!(FABRICS.is_sorted_by(|a, b| a.name < b.name), "in alphabetical order, each name once");
        for fabric in &FABRICS {
            for law in LAWS {
                named_with(fabric.name, law).unwrap().check().unwrap();
            }
            assert!(DENSITIES.contains(&fabric.areal_density.value), "{}", fabric.name);
            let (rigidity, couple) = (fabric.rigidity.value, fabric.coercive_couple.value);
            let curve = Curve::measured(rigidity, couple, fabric.transition_curvature.value).unwrap();
            assert!(RIGIDITIES.contains(&curve.b2()) && RIGIDITIES.contains(&curve.b1()), "{}", fabric.name);
        }
    }

    #[test]
    fn every_value_has_a_unit_and_a_source() {
        for fabric in &FABRICS {
            assert!(!fabric.about.is_empty());
            for Property { name, unit, quantity } in fabric.properties() {
                assert!(quantity.value > 0.0 && quantity.value.is_finite(), "{} {name}", fabric.name);
                assert!(!unit.is_empty(), "{name}");
                match quantity.source {
                    Source::Published { key, at } => {
                        assert!(SOURCES.iter().any(|s| s.key == key), "{} {name}: {key}", fabric.name);
                        assert!(!at.is_empty());
                    }
                    Source::Estimate(basis) => {
                        assert!(basis.len() > 10, "{} {name}", fabric.name);
                        for key in cited(basis) {
                            assert!(in_references(key), "{} {name}: {key}", fabric.name);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn sources_are_in_the_references_and_in_use() {
        assert!(!in_references("nobody1900"));
        for Reference { key, about } in SOURCES {
            assert!(in_references(key), "{key}");
            assert!(cited(about).into_iter().all(in_references), "{about}");
            let used = |f: &Fabric| {
                f.properties()
                    .iter()
                    .any(|p| matches!(p.quantity.source, Source::Published { key: k, .. } if k == key))
            };
            assert!(FABRICS.iter().any(used), "{key}");
        }
    }

    #[test]
    fn a_law_gets_the_values_it_needs() {
        let fabric = fabric("acrylic-twill").unwrap();
        assert_eq!(named("cotton").unwrap(), named_with("cotton", "linear").unwrap());
        let Bending::Hinge { rigidity, .. } = fabric.material("linear").unwrap().bending else { panic!() };
        assert_eq!(rigidity, fabric.rigidity.value);
        let Bending::Hysteresis(law) = fabric.material("hysteresis").unwrap().bending else { panic!() };
        assert_eq!((law.plasticity, law.fatigue, law.damping), (0.0, 0.0, 0.0));
        let Bending::Nonlinear(nonlinear) = fabric.material("nonlinear").unwrap().bending else { panic!() };
        assert_eq!(nonlinear.curve().unwrap(), *law.law().unwrap().curve());
        assert_eq!(fabric.material("none").unwrap().bending, Bending::None);
    }

    /// The three measured values of the acrylic twill give back the coefficients that the thesis prints for figure 4.7,
    /// in its units: b in gf cm²/cm, c_1 in gf cm³/cm.
    #[test]
    fn acrylic_twill_is_the_loop_of_the_thesis() {
        const GF_CM: f64 = 9.806_65e-5;
        let Bending::Hysteresis(law) = named_with("acrylic-twill", "hysteresis").unwrap().bending else {
            panic!()
        };
        let curve = *law.law().unwrap().curve();
        for (ours, thesis) in
            [(curve.b1() / GF_CM, 0.76), (curve.b2() / GF_CM, 0.26), (curve.c1() / (GF_CM * 1e-2), -0.38)]
        {
            // Roundings of the conversion there and back.
            assert!((ours / thesis - 1.0).abs() < 1e-13, "{ours} {thesis}");
        }
    }

    #[test]
    fn unknown_names_and_laws_list_the_known_ones() {
        let error = named("tweed").unwrap_err().to_string();
        assert!(error.contains("tweed") && error.contains("cotton"), "{error}");
        let error = named_with("cotton", "rubber").unwrap_err().to_string();
        assert!(error.contains("rubber") && error.contains("hysteresis"), "{error}");
    }
}
