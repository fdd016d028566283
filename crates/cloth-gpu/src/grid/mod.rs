//! The methods "grid", the traditional uniform grid with control bits (thesis 3.3.1), and "virtual-subdivision" (thesis 5.3), both
//! with the workload distribution of 5.3.4.

mod core;

use crate::collision::{CollisionMesh, Contacts, DetectError, Detector, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::topology::Topology;
use core::Core;
use std::sync::Arc;

/// How tests are found for invocations, each of which has one at a time (thesis 5.3.4).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Distribution {
    /// By binary search in the sums of the tests' counts: no memory.
    #[default]
    BinarySearch,
    /// By a scan over all tests, in which each one finds the registration that begins it: two words per test (Fan et al. 2011).
    SegmentedScan,
}

/// How registrations of several parts of one triangle in one cell are found (thesis 5.3.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Duplicates {
    /// After one sort, by cell: the parts of a triangle follow each other.
    #[default]
    OneSort,
    /// After sorts by triangle and by cell. Here, where parts are made in the order of their triangles, it finds no more.
    All,
}

/// Room, portions and variants; the contacts never depend on them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridOptions {
    /// λ of the virtual subdivision, 1.1 to 1.3 in the thesis (Eq. 5.1): cells are 3 λ times the average radius, and larger triangles are
    /// registered in parts. None: cells are 3 times the largest radius, and triangles stay whole.
    pub subdivision: Option<f32>,
    /// Room for parts, registrations, triangle pairs and candidates at first. None: by the number of triangles.
    pub first_capacity: Option<u32>,
    /// Most triangle pairs and most candidates of a kind at a time. None: 2^23, or what one binding holds.
    pub max_capacity: Option<u32>,
    /// Most tests per submission, at least 1. None: 2^24 on a software adapter, else 2^28.
    pub max_tests: Option<u32>,
    /// Most triangles at a time; what is larger goes in chunks. None: as many as the bindings hold with four registrations each.
    pub max_triangles: Option<u32>,
    /// How invocations find their tests.
    pub distribution: Distribution,
    /// How superfluous registrations are found.
    pub duplicates: Duplicates,
    /// Compare 18-DOPs of triangles, edges and vertices after their boxes.
    pub dops: bool,
    /// Filter candidates on the device before the narrow phase decides them.
    pub device_filter: bool,
}

impl Default for GridOptions {
    fn default() -> Self {
        Self {
            subdivision: None,
            first_capacity: None,
            max_capacity: None,
            max_tests: None,
            max_triangles: None,
            distribution: Distribution::default(),
            duplicates: Duplicates::default(),
            dops: true,
            device_filter: true,
        }
    }
}

/// λ that the thesis settles on.
const LAMBDA: f32 = 1.2;
/// Least and most λ: beyond, cells hold nothing or everything.
const LAMBDAS: [f32; 2] = [0.1, 100.0];
/// Detects contacts with a uniform grid on the device; [`Detector::name`] is `"grid"` or `"virtual-subdivision"`.
///
/// The device finds candidates; [`crate::collision::NarrowPhase`] decides them. What overflows is grown and done again; what is too
/// much for one portion is taken in several, which are decided as they come and not kept; a scene that is too large for the
/// device's bindings is taken in chunks ([`crate::chunks`]).
///
/// Among the counts of [`crate::collision::DetectStats`]: `registrations` of triangles in cells; the `parts` that these come to, at
/// least as many as triangles.
#[derive(Debug)]
pub struct GridGpu {
    topology: Topology<Core>,
}

impl GridGpu {
    /// Writes the topology to the device.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::Lost`].
    pub fn new(gpu: Arc<Gpu>, mesh: &CollisionMesh) -> Result<Self, GpuError> {
        Self::with_options(gpu, mesh, GridOptions::default())
    }

    /// Virtual subdivision with the thesis's λ = 1.2.
    ///
    /// # Errors
    /// As [`GridGpu::new`].
    pub fn virtual_subdivision(gpu: Arc<Gpu>, mesh: &CollisionMesh) -> Result<Self, GpuError> {
        let options = GridOptions { subdivision: Some(LAMBDA), ..GridOptions::default() };
        Self::with_options(gpu, mesh, options)
    }

    /// [`GridGpu::new`] with other room, portions and variants.
    ///
    /// # Errors
    /// As [`GridGpu::new`]; [`GpuError::Query`] for a λ outside 0.1 to 100.
    pub fn with_options(gpu: Arc<Gpu>, mesh: &CollisionMesh, options: GridOptions) -> Result<Self, GpuError> {
        let lambda = options.subdivision.unwrap_or(LAMBDA);
        if !(LAMBDAS[0]..=LAMBDAS[1]).contains(&lambda) {
            return Err(GpuError::Query(DetectError::Parameter {
                parameter: "subdivision",
                expected: "λ from 0.1 to 100",
                got: lambda.into(),
            }));
        }
        let topology = Topology::new(gpu, mesh, options, options.max_triangles)?;
        Ok(Self { topology })
    }

    /// Memory on the device, scratch memory of sorts and scans not counted [B]; 0 where the scene goes in chunks, which keep none.
    pub fn bytes(&self) -> u64 {
        self.topology.bytes()
    }
}

impl Detector for GridGpu {
    fn name(&self) -> &'static str {
        if self.topology.options().subdivision.is_some() { "virtual-subdivision" } else { "grid" }
    }

    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        self.topology.detect(self.name(), mesh, query, pool)
    }
}
