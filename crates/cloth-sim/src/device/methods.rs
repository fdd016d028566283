//! The methods of `cloth-gpu` by name, built for one topology, and the last few of them.

use super::Tuning;
use crate::collision::{CollisionMesh, DetectError, Detector};
use crate::gpu::{Distribution, Duplicates, Gpu, GpuError, GridGpu, GridOptions, OctreeGpu, OctreeOptions};
use std::sync::Arc;

/// λ of virtual subdivision where nothing else is asked for (thesis 5.3).
const CELL_FACTOR: f64 = 1.2;

/// A method of a GPU with the topology that it was built for on the device.
pub(crate) trait GpuMethod: Detector + std::fmt::Debug {
    /// Memory on the device \[B\].
    fn bytes(&self) -> u64;
}

impl GpuMethod for GridGpu {
    fn bytes(&self) -> u64 {
        Self::bytes(self)
    }
}

impl GpuMethod for OctreeGpu {
    fn bytes(&self) -> u64 {
        Self::bytes(self)
    }
}

/// Writes the topology to the device for one of [`super::GPU_METHODS`].
pub(crate) fn build(
    gpu: Arc<Gpu>,
    mesh: &CollisionMesh,
    method: &'static str,
    tuning: &Tuning,
) -> Result<Box<dyn GpuMethod>, DetectError> {
    let distribution = match tuning.distribution {
        Some("segmented-scan") => Distribution::SegmentedScan,
        _ => Distribution::BinarySearch,
    };
    let duplicates = match tuning.duplicates {
        Some("all") => Duplicates::All,
        _ => Duplicates::OneSort,
    };
    let grid = |gpu, subdivision| {
        let options = GridOptions { subdivision, distribution, duplicates, ..GridOptions::default() };
        Ok(Box::new(GridGpu::with_options(gpu, mesh, options)?) as Box<dyn GpuMethod>)
    };
    let octree = |gpu, two_stage| {
        let options = OctreeOptions { two_stage, ..OctreeOptions::default() };
        Ok(Box::new(OctreeGpu::with_options(gpu, mesh, options)?) as Box<dyn GpuMethod>)
    };
    let built = match method {
        "grid" => grid(gpu, None),
        "octree-single" => octree(gpu, false),
        "octree" => octree(gpu, true),
        _ => grid(gpu, Some(tuning.cell_factor.unwrap_or(CELL_FACTOR) as f32)),
    };
    built.map_err(|error| match error {
        GpuError::Query(error) => error,
        error => DetectError::Device { detector: method, reason: error.to_string() },
    })
}

/// How many are kept.
const KEPT: usize = 2;

/// The methods that were used last with their topologies, so that a call for the same topology finds it on the device.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    /// The last one first.
    entries: Vec<Entry>,
    built: u64,
}

#[derive(Debug)]
struct Entry {
    method: &'static str,
    tuning: Tuning,
    mesh: CollisionMesh,
    built: Box<dyn GpuMethod>,
}

impl Kept {
    /// How often a topology was written to the device.
    #[cfg(test)]
    pub(crate) fn built(&self) -> u64 {
        self.built
    }

    /// The one for this topology, built if it is not among those kept; the oldest then goes.
    pub(crate) fn get(
        &mut self,
        gpu: &Arc<Gpu>,
        mesh: &CollisionMesh,
        method: &'static str,
        tuning: &Tuning,
    ) -> Result<&mut dyn GpuMethod, DetectError> {
        let known = |e: &Entry| e.method == method && e.tuning == *tuning && e.mesh == *mesh;
        let entry = if let Some(at) = self.entries.iter().position(known) {
            self.entries.remove(at)
        } else {
            // Room on the device before what needs it.
            self.entries.truncate(KEPT - 1);
            self.built += 1;
            let built = build(gpu.clone(), mesh, method, tuning)?;
            Entry { method, tuning: *tuning, mesh: mesh.clone(), built }
        };
        self.entries.insert(0, entry);
        Ok(self.entries[0].built.as_mut())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::collision::{Mode, Query};
    use crate::device::{Device, SharedGpu};

    static SHARED: SharedGpu = SharedGpu::new(true);

    /// Two triangles, one above the other, in either order.
    fn mesh(swapped: bool) -> CollisionMesh {
        let (a, b) = ([0, 1, 2], [3, 4, 5]);
        CollisionMesh::single(6, &if swapped { [b, a] } else { [a, b] }).unwrap()
    }

    #[test]
    fn a_topology_is_written_once_and_never_taken_for_another() {
        let x: Vec<Vec3> =
            [[0., 0., 0.], [1., 0., 0.], [0., 0., 1.], [0.2, 0.1, 0.2], [1.2, 1., 0.2], [0.2, 1., 1.2]]
                .map(Vec3::from)
                .to_vec();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let query = Query { x_t0: &x, x_t1: &x, thickness: 0.2, mode: Mode::Discrete, active: None };
        let mut found = vec![];
        for (swapped, tuning) in [
            (false, Tuning::default()),
            (true, Tuning::default()),
            (false, Tuning { cell_factor: Some(3.0), ..Tuning::default() }),
            (false, Tuning::default()),
            (false, Tuning::default()),
        ] {
            let answer =
                SHARED.detect(&mesh(swapped), &query, "virtual-subdivision", &tuning, Device::Gpu, &pool);
            let Ok(detected) = answer else {
                assert!(std::env::var("CLOTHSIM_REQUIRE_GPU").is_err(), "{answer:?}");
                return;
            };
            found.push(detected.contacts.vertex_triangle[0]);
        }
        assert_eq!(found, [[3, 0], [3, 1], [3, 0], [3, 0], [3, 0]]);
        assert_eq!(SHARED.uploads(), 4, "the last call found its topology on the device; the fourth did not");
    }
}
