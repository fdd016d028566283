//! One open GPU for many calls.

use super::{CPU_DEFAULT, Detected, Device, DeviceError, Reason, detect_on_cpu};
use crate::collision::{CollisionMesh, Contacts, DetectError, Detector, Query};
use crate::gpu::{AdapterChoice, Gpu, GpuError, GpuOptions, GridGpu};
use std::sync::{Arc, Mutex, PoisonError};

/// A GPU that is opened when it is first wanted and kept. Its calls compute one after the other, so that a failure belongs to one.
#[derive(Debug)]
pub struct SharedGpu {
    takes_software: bool,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// The process that opened it: a forked one inherits the memory, not the driver's threads.
    process: u32,
    gpu: Option<Arc<Gpu>>,
    /// What the search for a GPU that is no software adapter found, if it found none.
    no_hardware: Option<String>,
}

impl State {
    const fn new(process: u32) -> Self {
        Self { process, gpu: None, no_hardware: None }
    }

    fn open(&mut self, choice: AdapterChoice) -> Result<Arc<Gpu>, GpuError> {
        let gpu = Gpu::new(GpuOptions { adapter: choice, ..GpuOptions::default() })?;
        self.gpu = Some(gpu.clone());
        Ok(gpu)
    }
}

static OF_PROCESS: SharedGpu = SharedGpu::new(false);

impl SharedGpu {
    /// Nothing is opened yet. With `takes_software`, [`Device::Auto`] takes a software adapter too.
    pub const fn new(takes_software: bool) -> Self {
        Self { takes_software, state: Mutex::new(State::new(0)) }
    }

    /// The one of [`super::detect`].
    pub fn of_process() -> &'static Self {
        &OF_PROCESS
    }

    /// The GPU that is open, if one is.
    pub fn gpu(&self) -> Option<Arc<Gpu>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).gpu.clone()
    }

    /// Detects with one of [`super::GPU_METHODS`]; for [`Device::Auto`], without a GPU, on the CPU.
    ///
    /// # Errors
    /// [`DeviceError::Unavailable`], [`DeviceError::Failed`], and what the query is refused for.
    pub fn detect(
        &self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        method: &'static str,
        device: Device,
        pool: &rayon::ThreadPool,
    ) -> Result<Detected, DeviceError> {
        let reason = match self.attempt(mesh, query, method, device, pool) {
            Err(DeviceError::Unavailable { reason }) if device == Device::Auto => {
                Reason::NoGpu(format!("\"{method}\": {reason}"))
            }
            Err(DeviceError::Failed { device: adapter, reason }) if device == Device::Auto => {
                Reason::Failed(format!("\"{method}\": {adapter}: {reason}"))
            }
            answer => return answer,
        };
        detect_on_cpu(mesh, query, CPU_DEFAULT, Some(reason), pool)
    }

    fn attempt(
        &self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        method: &'static str,
        device: Device,
        pool: &rayon::ThreadPool,
    ) -> Result<Detected, DeviceError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let gpu = self.open(&mut state, device).map_err(|reason| DeviceError::Unavailable { reason })?;
        let description = gpu.description();
        match contacts(&gpu, mesh, query, method, pool) {
            Ok(contacts) => Ok(Detected { contacts, method, device: description, reason: None }),
            Err(DetectError::Device { reason, .. }) => {
                state.gpu = None;
                Err(DeviceError::Failed { device: description, reason })
            }
            Err(error) => Err(error.into()),
        }
    }

    /// The GPU for that device, opened if it is not, or why there is none.
    fn open(&self, state: &mut State, device: Device) -> Result<Arc<Gpu>, String> {
        let process = std::process::id();
        if state.process != process {
            // The parent's driver must not be closed from here.
            std::mem::forget(state.gpu.take());
            *state = State::new(process);
        }
        let hardware_only = device == Device::Auto && !self.takes_software;
        match &state.gpu {
            Some(gpu) if !(hardware_only && gpu.is_software()) => return Ok(gpu.clone()),
            None if !hardware_only => return state.open(AdapterChoice::Any).map_err(|e| e.to_string()),
            _ => {}
        }
        if let Some(reason) = &state.no_hardware {
            return Err(reason.clone());
        }
        state.open(AdapterChoice::Hardware).map_err(|error| {
            let reason = error.to_string();
            state.no_hardware = Some(reason.clone());
            reason
        })
    }
}

fn contacts(
    gpu: &Arc<Gpu>,
    mesh: &CollisionMesh,
    query: &Query<'_>,
    method: &'static str,
    pool: &rayon::ThreadPool,
) -> Result<Contacts, DetectError> {
    let detector = match method {
        "grid" => GridGpu::new(gpu.clone(), mesh),
        _ => GridGpu::virtual_subdivision(gpu.clone(), mesh),
    };
    let mut detector = detector.map_err(|error| match error {
        GpuError::Query(error) => error,
        error => DetectError::Device { detector: method, reason: error.to_string() },
    })?;
    detector.detect(mesh, query, pool)
}
