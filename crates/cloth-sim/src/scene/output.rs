//! What a run writes.

use serde::{Deserialize, Serialize};

/// What a run writes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[allow(clippy::struct_excessive_bools, reason = "independent switches, as a scene file writes them")]
pub struct Output {
    /// Frames per second of simulated time, > 0.
    pub fps: f64,
    /// All frames in one NumPy archive.
    pub npz: bool,
    /// One OBJ file per frame.
    pub obj: bool,
    /// One PLY file per frame.
    pub ply: bool,
    /// Time-sampled USD.
    pub usd: bool,
    /// Binary glTF whose morph targets are the frames.
    pub gltf: bool,
    /// A mesh and a point cache (PC2) per body.
    pub pc2: bool,
    /// VTK files with a ParaView collection.
    pub vtk: bool,
    /// Velocities of the cloth beside the positions in the NumPy archive: a run can then go on from any frame as it went.
    pub velocities: bool,
    /// Every so many frames, and at the last one, the full state is kept, from which `clothsim run --from` goes on to the same bits,
    /// also with an edited scene; 0: none.
    pub states: u32,
    /// A picture of several frames side by side.
    pub film_strip: bool,
    /// Energies and timings over time.
    pub plots: bool,
    /// Simulated time between checkpoints [s]; 0: none.
    pub checkpoint_interval: f64,
}

impl Default for Output {
    fn default() -> Self {
        Self {
            fps: 60.0,
            npz: true,
            obj: false,
            ply: false,
            usd: true,
            gltf: false,
            pc2: false,
            vtk: false,
            velocities: false,
            states: 0,
            film_strip: true,
            plots: true,
            checkpoint_interval: 0.5,
        }
    }
}
