//! A GPU's method as the detector of one simulation.

use super::methods::{GpuMethod, build};
use super::shared::Open;
use super::{Device, DeviceError, SharedGpu, Tuning};
use crate::collision::{CollisionMesh, Contacts, DetectError, Detector, Query};
use crate::gpu::Gpu;
use std::sync::Arc;

/// A method with its topology on a GPU that others use too. After a failure the next call opens a GPU anew.
#[derive(Debug)]
pub(crate) struct GpuDetector {
    shared: &'static SharedGpu,
    device: Device,
    method: &'static str,
    built: Option<Built>,
}

#[derive(Debug)]
struct Built {
    /// Where the GPU was opened: a forked process has no drivers' threads.
    process: u32,
    gpu: Arc<Gpu>,
    method: Box<dyn GpuMethod>,
}

impl Built {
    fn is_here(&self) -> bool {
        self.process == std::process::id()
    }
}

impl GpuDetector {
    /// Opens the GPU unless it is open, and writes the topology to it; with the GPU's description.
    pub(crate) fn new(
        shared: &'static SharedGpu,
        mesh: &CollisionMesh,
        method: &'static str,
        device: Device,
    ) -> Result<(Self, String), DeviceError> {
        let mut detector = Self { shared, device, method, built: None };
        let ((), description) = shared.with(device, |open| detector.on(open, mesh).map(|_| ()))?;
        Ok((detector, description))
    }

    /// Memory on the device, as far as the last call needed it \[B\].
    pub(crate) fn bytes(&self) -> u64 {
        self.built.as_ref().map_or(0, |built| built.method.bytes())
    }

    /// The method on this GPU.
    fn on(&mut self, open: &Open, mesh: &CollisionMesh) -> Result<&mut dyn GpuMethod, DetectError> {
        if self.built.as_ref().is_some_and(|b| !b.is_here() || !Arc::ptr_eq(&b.gpu, &open.gpu)) {
            self.leave();
        }
        let built = match &mut self.built {
            Some(built) => built,
            none => {
                let method = build(open.gpu.clone(), mesh, self.method, &Tuning::default())?;
                none.insert(Built { process: std::process::id(), gpu: open.gpu.clone(), method })
            }
        };
        Ok(built.method.as_mut())
    }

    /// Gives the memory on the device back, unless it is another process's.
    fn leave(&mut self) {
        if let Some(built) = self.built.take()
            && !built.is_here()
        {
            std::mem::forget(built);
        }
    }
}

impl Drop for GpuDetector {
    fn drop(&mut self) {
        self.leave();
    }
}

impl Detector for GpuDetector {
    fn name(&self) -> &'static str {
        self.method
    }

    /// Every stage on the device is over all triangles.
    fn narrows(&self) -> bool {
        false
    }

    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        let (shared, device) = (self.shared, self.device);
        let answer = shared.with(device, |open| self.on(open, mesh)?.detect(mesh, query, pool));
        answer.map(|(contacts, _)| contacts).map_err(|error| match error {
            DeviceError::Query(error) => error,
            error => {
                self.leave();
                DetectError::Device { detector: self.method, reason: reason(error) }
            }
        })
    }
}

/// What the GPU says, without its name.
fn reason(error: DeviceError) -> String {
    match error {
        DeviceError::Failed { reason, .. } | DeviceError::Unavailable { reason } => reason,
        other => other.to_string(),
    }
}
