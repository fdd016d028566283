//! The methods of `cloth-gpu` by name, built for one topology, and the last few of them.

use super::Tuning;
use crate::collision::{CollisionMesh, Contacts, DetectError, Detector, Query};
use crate::gpu::{Gpu, GpuError, GridGpu, GridOptions};
use std::sync::Arc;

/// λ of virtual subdivision where nothing else is asked for (thesis 5.3).
const CELL_FACTOR: f64 = 1.2;

/// A method of a GPU with the topology that it was built for on the device.
#[derive(Debug)]
pub(crate) enum GpuMethod {
    Grid(Box<GridGpu>),
}

impl GpuMethod {
    /// Writes the topology to the device.
    pub(crate) fn new(
        gpu: Arc<Gpu>,
        mesh: &CollisionMesh,
        method: &'static str,
        tuning: &Tuning,
    ) -> Result<Self, DetectError> {
        let subdivision = match method {
            "virtual-subdivision" => Some(tuning.cell_factor.unwrap_or(CELL_FACTOR) as f32),
            _ => None,
        };
        let options = GridOptions { subdivision, ..GridOptions::default() };
        let grid = GridGpu::with_options(gpu, mesh, options).map_err(|error| match error {
            GpuError::Query(error) => error,
            error => DetectError::Device { detector: method, reason: error.to_string() },
        })?;
        Ok(Self::Grid(Box::new(grid)))
    }

    pub(crate) fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        match self {
            Self::Grid(grid) => grid.detect(mesh, query, pool),
        }
    }

    /// Memory on the device \[B\].
    pub(crate) fn bytes(&self) -> u64 {
        match self {
            Self::Grid(grid) => grid.bytes(),
        }
    }

    /// What the last call counted beside [`crate::collision::DetectStats`], and the memory on the device \[B\].
    pub(crate) fn counts(&self) -> Vec<(&'static str, u64)> {
        match self {
            Self::Grid(grid) => vec![
                ("registrations", grid.registrations()),
                ("parts", grid.parts()),
                ("bytes", grid.bytes()),
            ],
        }
    }
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
    built: GpuMethod,
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
    ) -> Result<&mut GpuMethod, DetectError> {
        let known = |e: &Entry| e.method == method && e.tuning == *tuning && e.mesh == *mesh;
        let entry = if let Some(at) = self.entries.iter().position(known) {
            self.entries.remove(at)
        } else {
            // Room on the device before what needs it.
            self.entries.truncate(KEPT - 1);
            self.built += 1;
            let built = GpuMethod::new(gpu.clone(), mesh, method, tuning)?;
            Entry { method, tuning: *tuning, mesh: mesh.clone(), built }
        };
        self.entries.insert(0, entry);
        Ok(&mut self.entries[0].built)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::collision::Mode;
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
            (false, Tuning { cell_factor: Some(3.0) }),
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
