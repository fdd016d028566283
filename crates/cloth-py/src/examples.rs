//! The example scenes of the repository, for those who have the wheel alone.

use pyo3::prelude::*;

/// Name and text of each scene in `examples/` that needs no other file.
const SCENES: [(&str, &str); 11] = [
    ("cantilever", include_str!("../../../examples/cantilever.toml")),
    ("card", include_str!("../../../examples/card.toml")),
    ("crease", include_str!("../../../examples/crease.toml")),
    ("drape", include_str!("../../../examples/drape.toml")),
    ("flag", include_str!("../../../examples/flag.toml")),
    ("hanging", include_str!("../../../examples/hanging.toml")),
    ("napkin", include_str!("../../../examples/napkin.toml")),
    ("pinned_turn", include_str!("../../../examples/pinned_turn.toml")),
    ("ringing", include_str!("../../../examples/ringing.toml")),
    ("slope", include_str!("../../../examples/slope.toml")),
    ("twist", include_str!("../../../examples/twist.toml")),
];

/// Name and text of each example scene, by name.
#[pyfunction]
pub(crate) fn example_scenes() -> Vec<(&'static str, &'static str)> {
    SCENES.to_vec()
}
