//! A piece of cloth: mesh, material, start, pins.

use super::{Friction, Keyframe, Region, Rotation, Seam, StrainLimitSource};
use cloth_core::{Bending, CoreError, HingeCoupling, Material, material::library};
use serde::{Deserialize, Serialize};

/// A piece of cloth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cloth {
    /// Name, unique among all bodies.
    pub name: String,
    /// Where the mesh comes from.
    pub mesh: MeshSource,
    /// Name of a library material, or a table of its own.
    pub material: MaterialChoice,
    /// What the undeformed shape is.
    #[serde(default)]
    pub rest: RestSource,
    /// Direction of the warp in the mesh's coordinates, projected into each triangle; not read with `rest = "uv"`.
    #[serde(default = "x_axis")]
    pub warp: [f64; 3],
    /// Start position, added to the mesh's coordinates after the rotation [m].
    #[serde(default)]
    pub position: [f64; 3],
    /// Start rotation about the origin of the mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<Rotation>,
    /// Start velocity of all vertices [m/s].
    #[serde(default)]
    pub velocity: [f64; 3],
    /// Name of an asset with the start velocity of each vertex [m/s], added to `velocity`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocities: Option<String>,
    /// Whether it meets itself (if `contact.self` says so too).
    #[serde(default = "yes")]
    pub self_collision: bool,
    /// Friction of this cloth on colliders that have none of their own: Coulomb's coefficient [-], ≥ 0, or a table with a
    /// law; by default `contact.friction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<Friction>,
    /// Friction of this cloth on itself, as `friction`; by default `contact.self_friction`. On other cloth the smoother of
    /// the two counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub self_friction: Option<Friction>,
    /// Largest strain of its edges: the stretch [-], > 0, or a table; without it edges are not limited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strain_limit: Option<StrainLimitSource>,
    /// Vertices whose motion is prescribed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pins: Vec<Pin>,
    /// Triangles with a material of their own; where two regions have the same triangle, the later one counts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<Region>,
    /// Vertices that are sewn to each other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seams: Vec<Seam>,
}

fn x_axis() -> [f64; 3] {
    [1.0, 0.0, 0.0]
}

fn yes() -> bool {
    true
}

/// Where a mesh comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum MeshSource {
    /// Made by formula.
    Generated(Generator),
    /// Read from a file.
    File(MeshFile),
    /// Given as arrays.
    Asset(MeshAsset),
}

/// A mesh file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFile {
    /// Path, relative to the scene file.
    pub file: String,
}

/// A mesh given as arrays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshAsset {
    /// Name of the asset.
    pub asset: String,
}

/// A mesh made by formula. Lengths in m; axes along +y, sheets in the xz-plane with the front up (+y).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "generator", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Generator {
    /// Rectangle of `nx` × `ny` vertices, row by row from −z, within a row from −x; u along x.
    Grid {
        /// Size along x [m].
        width: f64,
        /// Size along z [m].
        height: f64,
        /// Vertices along x.
        nx: usize,
        /// Vertices along z.
        ny: usize,
        /// How cells are cut.
        #[serde(default)]
        diagonals: DiagonalPattern,
    },
    /// Flat disc.
    Disc {
        /// Radius [m].
        radius: f64,
        /// Rings of vertices around the middle.
        rings: usize,
    },
    /// Strip along x, twisted about it.
    Ribbon {
        /// Size along x [m].
        length: f64,
        /// Size across [m].
        width: f64,
        /// Vertices along x.
        nx: usize,
        /// Vertices across.
        ny: usize,
        /// Angle from one end to the other [rad].
        #[serde(default)]
        twist: f64,
    },
    /// Tube about the y-axis, closed with `caps = true`.
    Cylinder {
        /// Radius [m].
        radius: f64,
        /// Height [m].
        height: f64,
        /// Segments around the axis.
        segments: usize,
        /// Bands along the axis.
        rows: usize,
        /// Whether the ends are closed.
        #[serde(default)]
        caps: bool,
    },
    /// Closed sphere.
    Sphere {
        /// Radius [m].
        radius: f64,
        /// Times an icosahedron is subdivided: 20·4ⁿ triangles.
        subdivisions: u32,
    },
    /// Closed capsule about the y-axis.
    Capsule {
        /// Radius [m].
        radius: f64,
        /// Half the length of the straight part [m].
        half_height: f64,
        /// Segments around the axis.
        segments: usize,
        /// Bands in each half sphere.
        rings: usize,
    },
    /// Closed cone, apex up.
    Cone {
        /// Radius of the base [m].
        radius: f64,
        /// Height [m].
        height: f64,
        /// Segments around the axis.
        segments: usize,
    },
    /// Closed box.
    Box {
        /// Size along x, y, z [m].
        size: [f64; 3],
        /// Cells along x, y, z.
        cells: [usize; 3],
    },
}

/// How a grid's cells are cut into triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DiagonalPattern {
    /// Like the fields of a chessboard (union jack).
    #[default]
    Alternating,
    /// All parallel.
    OneWay,
    /// Both, with a vertex in the middle.
    Crossed,
}

/// Name of a library material, or a table of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum MaterialChoice {
    /// A material of the library.
    Named(String),
    /// A material of the library under a bending law of its loop.
    Fabric(FabricChoice),
    /// Its own parameters.
    Given(Material),
}

/// A material of the library under a bending law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FabricChoice {
    /// Name of the material.
    pub fabric: String,
    /// Its bending law; B, 2HB and the transition curvature come from the library.
    #[serde(default)]
    pub bending: FabricBending,
    /// λ in [0, 1]: share of a residual curvature that stays (`hysteresis`).
    #[serde(default)]
    pub plasticity: f64,
    /// μ in [0, 1]: share of the friction that a full cycle takes away (`hysteresis`).
    #[serde(default)]
    pub fatigue: f64,
    /// Whether the elastic part of the law acts across the hinges of a triangle.
    #[serde(default)]
    pub hinges: HingeCoupling,
}

/// Bending law of a library material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FabricBending {
    /// No resistance to bending.
    None,
    /// B alone.
    #[default]
    Linear,
    /// The curve of first loading, there and back.
    Nonlinear,
    /// The loop.
    Hysteresis,
}

impl FabricChoice {
    /// The material that is chosen.
    ///
    /// # Errors
    /// [`CoreError`] naming the parameter that does not fit.
    pub fn material(&self) -> Result<Material, CoreError> {
        let law = match self.bending {
            FabricBending::None => "none",
            FabricBending::Linear => "linear",
            FabricBending::Nonlinear => "nonlinear",
            FabricBending::Hysteresis => "hysteresis",
        };
        let mut material = library::named_with(&self.fabric, law)?;
        let shares = [("plasticity", self.plasticity), ("fatigue", self.fatigue)];
        if let Bending::Hysteresis(law) = &mut material.bending {
            (law.plasticity, law.fatigue) = (self.plasticity, self.fatigue);
        } else if let Some((name, got)) = shares.into_iter().find(|(_, value)| *value != 0.0) {
            return Err(CoreError::Parameter { name, expected: "0 without bending = \"hysteresis\"", got });
        }
        material.bending = material.bending.with_hinges(self.hinges);
        material.check()?;
        Ok(material)
    }
}

/// What the undeformed shape is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RestSource {
    /// The mesh's 3D positions.
    #[default]
    Mesh,
    /// The mesh's UV panels, in metres.
    Uv,
}

/// Vertices whose motion is prescribed: held fixed, moved by keyframes, or carried by a collider.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pin {
    /// Vertex indices of this cloth. Either this or `box`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertices: Option<Vec<u32>>,
    /// All vertices that start inside this box (scene coordinates, borders included).
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub region: Option<BoxRegion>,
    /// Rigid motion of the pinned vertices relative to their start.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keyframes: Vec<Keyframe>,
    /// Point about which keyframes rotate [m]; by default the mean of the pinned vertices' start positions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pivot: Option<[f64; 3]>,
    /// Name of the collider that carries the vertices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub collider: Option<String>,
}

/// An axis-aligned box [m].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxRegion {
    /// Lowest corner [m].
    pub min: [f64; 3],
    /// Highest corner [m].
    pub max: [f64; 3],
}
