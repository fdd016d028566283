//! Choices within a GPU's method, by name.

use super::{DeviceError, unknown};
use crate::collision::DetectError;

/// The methods that have a distribution.
const GRIDS: &[&str] = &["grid", "virtual-subdivision"];
/// The method that has λ, and parts of triangles.
const SUBDIVIDING: &[&str] = &["virtual-subdivision"];

/// The contacts never depend on them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tuning {
    /// λ of `"virtual-subdivision"` (thesis Eq. 5.1): cells are 3 λ times the average radius. From 0.1 to 100; by default 1.2.
    pub cell_factor: Option<f64>,
    /// How invocations find their tests, one of [`Tuning::DISTRIBUTIONS`]; by default the first. Of `"grid"` and
    /// `"virtual-subdivision"`.
    pub distribution: Option<&'static str>,
    /// How superfluous registrations of a triangle's parts are found, one of [`Tuning::DUPLICATES`]; by default the first. Of
    /// `"virtual-subdivision"`.
    pub duplicates: Option<&'static str>,
}

impl Tuning {
    /// Binary search in the sums of the tests' counts; a scan over all tests (thesis 5.3.4).
    pub const DISTRIBUTIONS: [&'static str; 2] = ["binary-search", "segmented-scan"];
    /// One sort, by cell; sorts by triangle and by cell (thesis 5.3.3).
    pub const DUPLICATES: [&'static str; 2] = ["one-sort", "all"];

    /// Looks the names up.
    ///
    /// # Errors
    /// [`DeviceError::Unknown`], with the nearest name.
    pub fn new(
        cell_factor: Option<f64>,
        distribution: Option<&str>,
        duplicates: Option<&str>,
    ) -> Result<Self, DeviceError> {
        let find = |parameter, name: Option<&str>, known: &[&'static str]| {
            let found = |name| known.iter().copied().find(|&k| k == name);
            name.map(|name| found(name).ok_or_else(|| unknown(parameter, name, known))).transpose()
        };
        Ok(Self {
            cell_factor,
            distribution: find("distribution", distribution, &Self::DISTRIBUTIONS)?,
            duplicates: find("duplicates", duplicates, &Self::DUPLICATES)?,
        })
    }

    /// Whether the method of that name has what is chosen.
    pub(super) fn check(&self, method: &str) -> Result<(), DeviceError> {
        if let Some(got) = self.cell_factor.filter(|factor| !(0.1..=100.0).contains(factor)) {
            let (parameter, expected) = ("cell_factor", "λ from 0.1 to 100");
            return Err(DetectError::Parameter { parameter, expected, got }.into());
        }
        for (parameter, is_chosen, owners) in [
            ("cell_factor", self.cell_factor.is_some(), SUBDIVIDING),
            ("distribution", self.distribution.is_some(), GRIDS),
            ("duplicates", self.duplicates.is_some(), SUBDIVIDING),
        ] {
            if is_chosen && !owners.contains(&method) {
                return Err(DeviceError::OtherMethod { parameter, owners, method: method.to_owned() });
            }
        }
        Ok(())
    }
}
