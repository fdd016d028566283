//! Why a simulation is not built, not resumed or stops.

use crate::SceneError;

/// How many elements an error's text lists.
const SHOWN: usize = 8;

/// An error of the engine. After one that stops a run ([`SimError::Diverged`], [`SimError::Stuck`]) the simulation
/// holds the last good state.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimError {
    /// The scene has a wrong value, or an asset does not fit it.
    #[error(transparent)]
    InvalidScene(#[from] SceneError),
    /// The start state has intersections and the scene does not allow them.
    #[error(
        "start state: expected no intersections, got {count} pairs of triangles that pass through each other; the first: {}; \
         {}contact.allow_intersections runs all the same",
        list(names),
        match tangled {
            Some(before) => format!("start = \"untangle\" leaves these of {before}: it moves no vertex far; "),
            None => "start = \"untangle\" repairs small ones, ".into(),
        }
    )]
    StartIntersections {
        /// How many pairs of triangles.
        count: usize,
        /// The first pairs, as triangles of the global list (at most 64).
        pairs: Vec<[u32; 2]>,
        /// The first pairs in words: body and triangle of each.
        names: Vec<String>,
        /// With `start = "untangle"`: how many pairs there were before; those listed could not be resolved.
        tangled: Option<usize>,
    },
    /// The state became non-finite or ran away, at every step size tried.
    #[error("diverged at t = {time} s: {reason}{}", if vertices.is_empty() { String::new() } else { format!("; vertices {}", list(vertices)) })]
    Diverged {
        /// Time of the last good state [s].
        time: f64,
        /// What was seen.
        reason: String,
        /// The vertices concerned (global indices).
        vertices: Vec<u32>,
    },
    /// Collisions remain that no allowed motion avoids, at every step size tried.
    #[error(
        "stuck at t = {time} s: {} pairs still collide after every stage, the first of vertices {:?}; vertices {}",
        pairs.len(), pairs.first().unwrap_or(&[0; 4]), list(vertices)
    )]
    Stuck {
        /// Time of the last good state [s].
        time: f64,
        /// The four vertices of each pair (global indices).
        pairs: Vec<[u32; 4]>,
        /// The vertices concerned (global indices).
        vertices: Vec<u32>,
    },
    /// Bytes are no checkpoint of this version, or are damaged.
    #[error("checkpoint: expected {expected}, got {got}")]
    InvalidCheckpoint {
        /// What was expected.
        expected: String,
        /// What came.
        got: String,
    },
    /// An argument is out of range.
    #[error("{name}: expected {expected}, got {got}")]
    InvalidArgument {
        /// Name of the argument.
        name: &'static str,
        /// What was expected, with the unit.
        expected: &'static str,
        /// What came.
        got: String,
    },
    /// The GPU is missing or gave no answer; the state is the last good one, and the next step asks it again.
    #[error(transparent)]
    Device(#[from] crate::device::DeviceError),
    /// A stage refused what it was given for a reason that is not the scene's.
    #[error("{stage}: {message}")]
    Stage {
        /// The stage.
        stage: &'static str,
        /// Its message.
        message: String,
    },
}

fn list<T: std::fmt::Display>(items: &[T]) -> String {
    let text = items.iter().take(SHOWN).map(ToString::to_string).collect::<Vec<_>>().join(", ");
    if items.len() > SHOWN { format!("{text}, … ({} in all)", items.len()) } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_are_cut() {
        let error =
            SimError::Diverged { time: 0.5, reason: "not finite".into(), vertices: (0..100).collect() };
        let text = error.to_string();
        assert!(
            text.contains("t = 0.5 s") && text.contains("0, 1, 2, 3, 4, 5, 6, 7, … (100 in all)"),
            "{text}"
        );
    }
}
