//! The contract of every detection method, and their names.

use crate::{
    BruteForce, Bvh, CollisionMesh, Contacts, DetectError, Query, SessionOptions, SkippingSession, Vec3,
};

const KNOWN: &str = "\"brute\", \"bvh\", \"session\"";

/// Finds every admissible pair in contact; see the crate's head for the contract.
pub trait Detector: Send {
    /// The method's name, as [`detector`] takes it.
    fn name(&self) -> &'static str;

    /// Whether a query with few active vertices takes less than one of all. Where it does not, a caller that looks again at a few may
    /// ask [`Bvh`] instead: the answer is the same.
    fn narrows(&self) -> bool {
        true
    }

    /// All contacts of the query: unique, sorted, the same bits for any number of threads.
    ///
    /// # Errors
    /// What [`Query::check`] refuses; [`DetectError::OtherMesh`].
    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError>;
}

/// The detector of that name for `mesh`, whose positions are now `x` \[m\] (they shape the tree, not the answers).
///
/// # Errors
/// [`DetectError::UnknownDetector`] with the names that exist; what [`Bvh::new`] refuses.
pub fn detector(name: &str, mesh: &CollisionMesh, x: &[Vec3]) -> Result<Box<dyn Detector>, DetectError> {
    match name {
        "brute" => Ok(Box::new(BruteForce)),
        "bvh" => Ok(Box::new(Bvh::new(mesh, x)?)),
        "session" => Ok(Box::new(SkippingSession::new(mesh, x, SessionOptions::default())?)),
        _ => Err(DetectError::UnknownDetector { known: KNOWN, got: name.to_owned() }),
    }
}

/// [`detector`], made on a pool where the method can: the same detector for any number of threads.
///
/// # Errors
/// As [`detector`].
pub fn detector_in(
    name: &str,
    mesh: &CollisionMesh,
    x: &[Vec3],
    pool: &rayon::ThreadPool,
) -> Result<Box<dyn Detector>, DetectError> {
    match name {
        "bvh" => Ok(Box::new(Bvh::new_in(mesh, x, pool)?)),
        _ => detector(name, mesh, x),
    }
}
