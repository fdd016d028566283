//! What is asked of a detector and what it answers.

use crate::{CollisionMesh, DetectError, Vec3};

/// Which positions a query looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// The straight motion of every vertex from `x_t0` to `x_t1`, ends included.
    Continuous,
    /// The end state `x_t1` alone (`x_t0` is checked and otherwise not looked at).
    Discrete,
}

/// One question to a [`crate::Detector`].
#[derive(Debug, Clone, Copy)]
pub struct Query<'a> {
    /// Positions at the start of the step [m], one per vertex.
    pub x_t0: &'a [Vec3],
    /// Positions at the end of the step [m], one per vertex.
    pub x_t1: &'a [Vec3],
    /// Distance up to which (inclusive) two features are in contact [m], ≥ 0.
    pub thickness: f64,
    /// Continuous or discrete.
    pub mode: Mode,
    /// Only pairs with at least one vertex marked here are reported (None: all pairs).
    pub active: Option<&'a [bool]>,
}

impl Query<'_> {
    /// Refuses what no detector can answer.
    ///
    /// # Errors
    /// [`DetectError::Parameter`] for a thickness that is negative, NaN or infinite; [`DetectError::Length`];
    /// [`DetectError::NotFinite`] naming the first such vertex.
    pub fn check(&self, mesh: &CollisionMesh) -> Result<(), DetectError> {
        check_thickness(self.thickness)?;
        check_positions("x_t0", self.x_t0, mesh.vertex_count)?;
        check_positions("x_t1", self.x_t1, mesh.vertex_count)?;
        check_active(self.active, mesh.vertex_count)
    }
}

pub(crate) fn check_thickness(thickness: f64) -> Result<(), DetectError> {
    if thickness >= 0.0 && thickness.is_finite() {
        return Ok(());
    }
    Err(DetectError::Parameter {
        parameter: "thickness", expected: "a finite length ≥ 0 m", got: thickness
    })
}

pub(crate) fn check_active(active: Option<&[bool]>, vertex_count: usize) -> Result<(), DetectError> {
    match active {
        Some(mask) if mask.len() != vertex_count => {
            Err(DetectError::Length { array: "active", expected: vertex_count, got: mask.len() })
        }
        _ => Ok(()),
    }
}

#[allow(clippy::needless_bitwise_bool, reason = "a branch per coordinate costs more than the comparisons")]
pub(crate) fn check_positions(
    array: &'static str,
    x: &[Vec3],
    vertex_count: usize,
) -> Result<(), DetectError> {
    if x.len() != vertex_count {
        return Err(DetectError::Length { array, expected: vertex_count, got: x.len() });
    }
    let is_finite = |p: &Vec3| p.x.is_finite() & p.y.is_finite() & p.z.is_finite();
    // Block by block without a branch per vertex.
    let are_finite = |block: &[Vec3]| block.iter().fold(true, |all, p| all & is_finite(p));
    if x.chunks(1024).all(are_finite) {
        return Ok(());
    }
    match x.iter().position(|p| !is_finite(p)) {
        Some(vertex) => Err(DetectError::NotFinite { array, vertex, position: x[vertex].into() }),
        None => Ok(()),
    }
}

/// Every pair in contact, each once.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Contacts {
    /// (vertex, triangle), sorted.
    pub vertex_triangle: Vec<[u32; 2]>,
    /// Time of each vertex-triangle contact as a fraction of the step, not later than the true first time; 1 in
    /// discrete mode.
    pub time_vertex_triangle: Vec<f64>,
    /// (edge, edge), the lower index first, sorted.
    pub edge_edge: Vec<[u32; 2]>,
    /// Time of each edge-edge contact, as above.
    pub time_edge_edge: Vec<f64>,
    /// What it took.
    pub stats: DetectStats,
}

/// Counts and seconds of one call.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DetectStats {
    /// Pairs of tree nodes compared.
    pub broad_phase_tests: u64,
    /// Pairs of leaves whose boxes overlap.
    pub leaf_pairs: u64,
    /// Admissible vertex-triangle pairs handed to the narrow phase.
    pub candidates_vertex_triangle: u64,
    /// Admissible edge-edge pairs handed to the narrow phase.
    pub candidates_edge_edge: u64,
    /// Candidates whose time had to be searched: neither rejected by the filters nor in contact from the start.
    pub root_searches: u64,
    /// Further counts of the method, by name, in order.
    pub counts: Vec<(&'static str, u64)>,
    /// Seconds per stage, in order.
    pub seconds: Vec<(&'static str, f64)>,
}

impl DetectStats {
    /// The further count of that name; 0 if the method has none.
    pub fn count(&self, name: &str) -> u64 {
        self.counts.iter().find(|c| c.0 == name).map_or(0, |c| c.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_position_that_is_not_finite_is_named_wherever_it_is() {
        let mut x = vec![Vec3::zeros(); 3000];
        assert_eq!(check_positions("x", &x, 3000), Ok(()));
        x[2999].z = f64::INFINITY;
        for vertex in [2999, 1024, 1023, 0] {
            x[vertex].y = f64::NAN;
            assert!(matches!(
                check_positions("x", &x, 3000),
                Err(DetectError::NotFinite { array: "x", vertex: found, .. }) if found == vertex
            ));
        }
    }
}
