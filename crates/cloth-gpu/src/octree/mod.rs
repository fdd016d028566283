//! The methods "octree-single" and "octree": the adaptive octree grid (thesis, chapter 6), single-stage and two-stage.

mod core;

use crate::collision::{CollisionMesh, Contacts, DetectError, Detector, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::limits::MAX_LEVELS;
pub use crate::stages::octree::{Levels, Thresholds};
use core::Core;
use std::sync::Arc;

/// Levels, room and portions; the contacts never depend on them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OctreeOptions {
    /// Divide each cell as well as can be (`"octree"`), else only where a single division pays (`"octree-single"`).
    pub two_stage: bool,
    /// Finest level of the first tree, 1 to 10, as far as the device binds it; the root is level 0. None: nine as in the thesis,
    /// fewer for fewer than some ten thousand triangles.
    pub levels: Option<u32>,
    /// When levels are added and dropped from call to call; None: each tree has the levels of the first.
    pub thresholds: Option<Thresholds>,
    /// Room for visits, registrations, triangle pairs and candidates at first. None: by the number of triangles.
    pub first_capacity: Option<u32>,
    /// Most triangle pairs and most candidates of a kind at a time. None: 2^23, or what one binding holds.
    pub max_capacity: Option<u32>,
    /// Most visits and most registrations: then the tree loses a level. None: 2^24, or what one binding holds.
    pub max_registrations: Option<u32>,
    /// Most tests per submission, at least 1. None: 2^24 on a software adapter, else 2^28.
    pub max_tests: Option<u32>,
}

impl Default for OctreeOptions {
    fn default() -> Self {
        Self {
            two_stage: true,
            levels: None,
            thresholds: Some(Thresholds::default()),
            first_capacity: None,
            max_capacity: None,
            max_registrations: None,
            max_tests: None,
        }
    }
}

/// Detects contacts with an octree on the device; [`Detector::name`] is `"octree"` or `"octree-single"`.
///
/// The device finds candidates; [`crate::collision::NarrowPhase`] decides them. What overflows is grown and done again; what is too
/// much for one portion is taken in several.
#[derive(Debug)]
pub struct OctreeGpu {
    is_two_stage: bool,
    vertex_count: usize,
    triangle_count: usize,
    core: Core,
}

impl OctreeGpu {
    /// Two-stage, with the levels and thresholds of the thesis.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`], [`GpuError::Shader`].
    pub fn new(gpu: Arc<Gpu>, mesh: &CollisionMesh) -> Result<Self, GpuError> {
        Self::with_options(gpu, mesh, OctreeOptions::default())
    }

    /// Single-stage.
    ///
    /// # Errors
    /// As [`OctreeGpu::new`].
    pub fn single(gpu: Arc<Gpu>, mesh: &CollisionMesh) -> Result<Self, GpuError> {
        Self::with_options(gpu, mesh, OctreeOptions { two_stage: false, ..OctreeOptions::default() })
    }

    /// [`OctreeGpu::new`] with other levels, room and portions.
    ///
    /// # Errors
    /// As [`OctreeGpu::new`]; [`GpuError::Query`] for levels outside 1 to 10.
    pub fn with_options(
        gpu: Arc<Gpu>,
        mesh: &CollisionMesh,
        options: OctreeOptions,
    ) -> Result<Self, GpuError> {
        if let Some(levels) = options.levels.filter(|l| !(1..=MAX_LEVELS).contains(l)) {
            return Err(GpuError::Query(DetectError::Parameter {
                parameter: "levels",
                expected: "1 to 10",
                got: levels.into(),
            }));
        }
        Ok(Self {
            is_two_stage: options.two_stage,
            vertex_count: mesh.vertex_count,
            triangle_count: mesh.triangles.len(),
            core: Core::new(gpu, mesh, &options)?,
        })
    }

    /// Levels of the next call's tree.
    pub fn levels(&self) -> Levels {
        self.core.levels()
    }

    /// What the last call counted.
    pub fn counted(&self) -> OctreeCounts {
        self.core.counted()
    }

    /// Memory on the device, scratch memory of sorts and scans not counted [B].
    pub fn bytes(&self) -> u64 {
        self.core.bytes()
    }
}

/// What a call counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct OctreeCounts {
    /// Coarsest and finest level of the tree.
    pub levels: [u32; 2],
    /// Triangles in leaves.
    pub registrations: u64,
    /// Leaves that hold a triangle.
    pub leaves: u64,
    /// Triangles in leaves of each level.
    pub per_level: [u32; MAX_LEVELS as usize + 1],
}

impl Detector for OctreeGpu {
    fn name(&self) -> &'static str {
        if self.is_two_stage { "octree" } else { "octree-single" }
    }

    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        query.check(mesh)?;
        if mesh.triangles.len() != self.triangle_count || mesh.vertex_count != self.vertex_count {
            return Err(DetectError::OtherMesh { expected: self.triangle_count, got: mesh.triangles.len() });
        }
        if mesh.triangles.is_empty() {
            return Ok(Contacts::default());
        }
        let detector = self.name();
        self.core.run(mesh, query, pool).map_err(|error| match error {
            GpuError::Query(error) => error,
            error => DetectError::Device { detector, reason: error.to_string() },
        })
    }
}
