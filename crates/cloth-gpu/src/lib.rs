//! What touches what, on any GPU that wgpu reaches: the broad phases of Wong 2014 (chapters 3, 5 and 6) as compute kernels.
//!
//! A [`Gpu`] is an open device. A detector built on it keeps the contract of [`cloth_collision::Detector`]: the kernels
//! find, in single precision rounded outward, a superset of the candidate pairs; `cloth_collision` decides them in double
//! precision with the code that the detectors of the CPU use. So the contacts are the same, with the same times.
//!
//! Any Vulkan, Metal or DX12 adapter will do, a software adapter too (Mesa's, package `mesa-vulkan-drivers` on Debian): the tests run
//! on it, and with `CLOTHSIM_REQUIRE_GPU=1` they fail where there is none.
//!
//! One stage has one name: `shaders/<name>.wgsl` (the kernel), [`stages`] (its wrapper), [`twin`] (the same on the CPU).

pub use cloth_collision as collision;

pub mod chunks;
pub mod kernel;
pub mod layout;
pub mod limits;
pub mod stages;
pub mod twin;

mod adapters;
mod buffers;
mod context;
mod error;
mod frame;
mod grid;
mod octree;
mod portions;
mod recorder;
mod seconds;
mod tail;
mod topology;

pub use adapters::{Adapter, AdapterChoice, adapters};
pub use buffers::{Array, Length};
pub use context::{Gpu, GpuOptions};
pub use error::GpuError;
pub use frame::Frame;
pub use grid::{Distribution, Duplicates, GridGpu, GridOptions};
pub use octree::{Levels, OctreeGpu, OctreeOptions, Thresholds};
pub use recorder::{Answer, Recorder};
pub use seconds::Seconds;
pub use tail::{Tail, TailCounts};
