//! Fabrics by name.

use super::Material;
use crate::CoreError;

/// Names of the library, in alphabetical order.
pub fn names() -> Vec<&'static str> {
    todo!()
}

/// The fabric called `name`.
///
/// # Errors
/// [`CoreError::UnknownMaterial`] with the known names.
pub fn named(_name: &str) -> Result<Material, CoreError> {
    todo!()
}
