//! A body that moves as prescribed.

use super::{Friction, Keyframe, MeshSource, Rotation, Up};
use cloth_collision::shapes::Shape;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A body that moves as prescribed and that cloth meets. Exactly one of `shape`, `mesh` and `sequence`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Collider {
    /// Name, unique among all bodies.
    pub name: String,
    /// A simple shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<ShapeSource>,
    /// A rigid triangle mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh: Option<MeshSource>,
    /// An animated mesh: vertices per frame, linear in between.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<SequenceSource>,
    /// Position of its origin [m].
    #[serde(default)]
    pub position: [f64; 3],
    /// Rotation about its origin, before the position is added.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<Rotation>,
    /// Poses over time; without them it stands still. Not with `sequence`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keyframes: Vec<Keyframe>,
    /// Friction of cloth on this collider: Coulomb's coefficient [-], ≥ 0, or a table with a law; by default the cloth's
    /// `friction`, then `contact.friction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<Friction>,
}

/// A simple shape, centred at its origin, axis along +y, and how closely triangles follow it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ShapeSource {
    /// Sphere.
    Sphere {
        /// Radius [m].
        radius: f64,
        /// Largest distance between triangles and the true surface [m].
        #[serde(default = "default_tolerance")]
        tolerance: f64,
    },
    /// Capsule about the y-axis.
    Capsule {
        /// Radius [m].
        radius: f64,
        /// Half the length of the straight part [m].
        half_height: f64,
        /// Largest distance between triangles and the true surface [m].
        #[serde(default = "default_tolerance")]
        tolerance: f64,
    },
    /// Box.
    Box {
        /// Half the size along x, y, z [m].
        half_extents: [f64; 3],
    },
    /// Square in the plane y = 0, normal +y.
    Plane {
        /// Half the side [m].
        half_size: f64,
    },
    /// Cone, apex up.
    Cone {
        /// Radius of the base [m].
        radius: f64,
        /// Height [m].
        height: f64,
        /// Largest distance between triangles and the true surface [m].
        #[serde(default = "default_tolerance")]
        tolerance: f64,
    },
}

/// Half a millimetre: less than the thickness of any cloth worth naming.
const DEFAULT_TOLERANCE: f64 = 5e-4;

fn default_tolerance() -> f64 {
    DEFAULT_TOLERANCE
}

impl ShapeSource {
    /// The shape and its tolerance [m].
    pub fn parts(&self) -> (Shape, f64) {
        match *self {
            Self::Sphere { radius, tolerance } => (Shape::Sphere { radius }, tolerance),
            Self::Capsule { radius, half_height, tolerance } => {
                (Shape::Capsule { radius, half_height }, tolerance)
            }
            Self::Box { half_extents } => (Shape::Box { half_extents }, DEFAULT_TOLERANCE),
            Self::Plane { half_size } => (Shape::Plane { half_size }, DEFAULT_TOLERANCE),
            Self::Cone { radius, height, tolerance } => (Shape::Cone { radius, height }, tolerance),
        }
    }
}

/// An animated mesh. Exactly one of `file` and `asset`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SequenceSource {
    /// Path of the frames, relative to the scene file: a NumPy archive (.npz), a folder or a pattern (`walk/*.obj`) of OBJ, PLY or STL
    /// files, glTF with skin or morph targets, or USD.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Name of an asset with the frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asset: Option<String>,
    /// Frames per second, > 0. Files of glTF and USD are sampled so often; by default 60 times, or once per time code.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fps: Option<f64>,
    /// Time of the first frame [s]; before it and after the last the mesh stands still.
    #[serde(default)]
    pub start: f64,
    /// Metres per unit of the file, > 0, on top of the unit that the file says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// The axis that points up in the file; by default what the file says, else that of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<Up>,
    /// Name of the animation in a glTF file; by default the only one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub animation: Option<String>,
    /// Name of a glTF node or path of a USD prim: only the meshes at and below it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
}

impl SequenceSource {
    /// Name under which its frames are expected among the assets: that of the asset, or the file's path with what is asked of
    /// the file, so that one file may serve several colliders.
    pub fn asset_name(&self) -> String {
        let Some(file) = &self.file else { return self.asset.clone().unwrap_or_default() };
        let up = self.up.map(|up| if up == Up::Z { "z" } else { "y" }.to_owned());
        // The frames of an archive are the same at any rate.
        let is_archive = Path::new(file).extension().is_some_and(|suffix| suffix.eq_ignore_ascii_case("npz"));
        let fps = self.fps.filter(|_| !is_archive).map(|fps| fps.to_string());
        let asked = [
            ("fps", fps),
            ("scale", self.scale.map(|scale| scale.to_string())),
            ("up", up),
            ("animation", self.animation.clone()),
            ("part", self.part.clone()),
        ];
        asked.into_iter().fold(file.clone(), |name, (key, value)| match value {
            Some(value) => format!("{name}#{key}={value}"),
            None => name,
        })
    }
}
