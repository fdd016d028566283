//! Prescribed rigid motion as it stands in a scene.

use serde::{Deserialize, Serialize};

/// A rotation about an axis through the origin of the body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// Axis, of any length but zero.
    #[serde(default = "up_axis")]
    pub axis: [f64; 3],
    /// Angle, right-handed about the axis [rad]; may exceed a full turn.
    pub angle: f64,
}

fn up_axis() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

/// A pose at a time. In between, positions and angles about one axis are interpolated linearly, other rotations along
/// the shortest arc; before the first and after the last keyframe the pose is held.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// Time [s], later than that of the keyframe before.
    pub time: f64,
    /// Position [m]: of a collider, by default its own `position`; of a pin, the displacement, by default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// Rotation: of a collider, by default its own `rotation`; of a pin about its pivot, by default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<Rotation>,
}
