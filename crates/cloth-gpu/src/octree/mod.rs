//! The methods "octree-single" and "octree": the adaptive octree grid (thesis, chapter 6), single-stage and two-stage.

mod core;

use crate::collision::{CollisionMesh, Contacts, DetectError, Detector, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::limits::MAX_LEVELS;
pub use crate::stages::octree::{Levels, Thresholds};
use crate::topology::Topology;
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
    /// Most visits to pages and most registrations: then the tree loses a level. None: 2^24, or what one binding holds.
    pub max_registrations: Option<u32>,
    /// Most tests per submission, at least 1. None: 2^24 on a software adapter, else 2^28.
    pub max_tests: Option<u32>,
    /// Most triangles at a time; what is larger goes in chunks. None: as many as the bindings hold with four registrations each.
    pub max_triangles: Option<u32>,
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
            max_triangles: None,
        }
    }
}

/// Detects contacts with an octree on the device; [`Detector::name`] is `"octree"` or `"octree-single"`.
///
/// The device finds candidates; [`crate::collision::NarrowPhase`] decides them. What overflows is grown and done again; what is too
/// much for one portion is taken in several; a scene that is too large for the device's bindings is taken in chunks
/// ([`crate::chunks`]), whose levels do not adapt.
///
/// Among the counts of [`crate::collision::DetectStats`]: `registrations` of triangles in cells, `registrations_level_0` to `_10` by
/// level, the root first, and `leaves` that hold triangles, in chunks those of all; of a scene that goes whole, `coarsest_level` and
/// `finest_level` of the tree.
#[derive(Debug)]
pub struct OctreeGpu {
    topology: Topology<Core>,
}

impl OctreeGpu {
    /// Two-stage, with the levels and thresholds of the thesis.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::Lost`].
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
        let topology = Topology::new(gpu, mesh, options, options.max_triangles)?;
        Ok(Self { topology })
    }

    /// Levels of the next call's tree; None where the scene goes in chunks.
    pub fn levels(&self) -> Option<Levels> {
        self.topology.whole().map(Core::levels)
    }

    /// Memory on the device, scratch memory of sorts and scans not counted [B]; 0 where the scene goes in chunks, which keep none.
    pub fn bytes(&self) -> u64 {
        self.topology.bytes()
    }
}

impl Detector for OctreeGpu {
    fn name(&self) -> &'static str {
        if self.topology.options().two_stage { "octree" } else { "octree-single" }
    }

    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        let mut contacts = self.topology.detect(self.name(), mesh, query, pool)?;
        if self.topology.whole().is_none() {
            // Every chunk has its own levels.
            contacts.stats.counts.retain(|c| !["coarsest_level", "finest_level"].contains(&c.0));
        }
        Ok(contacts)
    }
}
