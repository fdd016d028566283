//! One open GPU for many calls.

use super::methods::Kept;
use super::{CPU_DEFAULT, Detected, Device, DeviceError, Reason, Tuning, detect_on_cpu};
use crate::collision::{CollisionMesh, DetectError, Query};
use crate::gpu::{AdapterChoice, Gpu, GpuError, GpuOptions};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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
    open: Option<Open>,
    /// What the search for a GPU that is no software adapter found, if it found none.
    no_hardware: Option<String>,
}

#[derive(Debug)]
struct Open {
    gpu: Arc<Gpu>,
    kept: Kept,
}

impl State {
    const fn new(process: u32) -> Self {
        Self { process, open: None, no_hardware: None }
    }
}

impl Open {
    fn new(choice: AdapterChoice) -> Result<Self, GpuError> {
        let gpu = Gpu::new(GpuOptions { adapter: choice, ..GpuOptions::default() })?;
        Ok(Self { gpu, kept: Kept::default() })
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
        self.lock().open.as_ref().map(|open| open.gpu.clone())
    }

    #[cfg(test)]
    pub(crate) fn uploads(&self) -> u64 {
        self.lock().open.as_ref().map_or(0, |open| open.kept.built())
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
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
        tuning: &Tuning,
        device: Device,
        pool: &rayon::ThreadPool,
    ) -> Result<Detected, DeviceError> {
        let reason = match self.attempt(mesh, query, method, tuning, device, pool) {
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
        tuning: &Tuning,
        device: Device,
        pool: &rayon::ThreadPool,
    ) -> Result<Detected, DeviceError> {
        let mut state = self.lock();
        let open = self.open(&mut state, device).map_err(|reason| DeviceError::Unavailable { reason })?;
        let description = open.gpu.description();
        let answer = open.kept.get(&open.gpu, mesh, method, tuning).and_then(|kept| {
            let contacts = kept.detect(mesh, query, pool)?;
            Ok((contacts, kept.counts()))
        });
        match answer {
            Ok((contacts, counts)) => {
                Ok(Detected { contacts, method, device: description, counts, reason: None })
            }
            Err(DetectError::Device { reason, .. }) => {
                state.open = None;
                Err(DeviceError::Failed { device: description, reason })
            }
            Err(error) => Err(error.into()),
        }
    }

    /// The GPU for that device, opened if it is not, or why there is none.
    fn open<'s>(&self, state: &'s mut State, device: Device) -> Result<&'s mut Open, String> {
        let process = std::process::id();
        if state.process != process {
            // The parent's driver must not be closed from here.
            std::mem::forget(state.open.take());
            *state = State::new(process);
        }
        let hardware_only = device == Device::Auto && !self.takes_software;
        if hardware_only && state.open.as_ref().is_none_or(|open| open.gpu.is_software()) {
            if let Some(reason) = &state.no_hardware {
                return Err(reason.clone());
            }
            return match Open::new(AdapterChoice::Hardware) {
                Ok(open) => Ok(state.open.insert(open)),
                Err(error) => Err(state.no_hardware.insert(error.to_string()).clone()),
            };
        }
        match &mut state.open {
            Some(open) => Ok(open),
            none => Ok(none.insert(Open::new(AdapterChoice::Any).map_err(|error| error.to_string())?)),
        }
    }
}
