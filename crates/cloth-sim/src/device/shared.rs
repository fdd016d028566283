//! One open GPU for many calls.

use super::methods::Kept;
use super::{CPU_DEFAULT, Detected, Device, DeviceError, Reason, Tuning, detect_on_cpu, hardware};
use crate::collision::{CollisionMesh, DetectError, Query};
use crate::gpu::{AdapterChoice, Gpu, GpuError, GpuOptions};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A GPU that is opened when it is first wanted and kept. Its calls compute one after the other, so that a failure belongs to one.
#[derive(Debug)]
pub struct SharedGpu {
    takes_software: AtomicBool,
    /// None: the defaults.
    options: Option<GpuOptions>,
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

/// An open GPU.
#[derive(Debug)]
pub(super) struct Open {
    pub(super) gpu: Arc<Gpu>,
    pub(super) kept: Kept,
}

impl State {
    const fn new(process: u32) -> Self {
        Self { process, open: None, no_hardware: None }
    }
}

static OF_PROCESS: SharedGpu = SharedGpu::new(false);

impl SharedGpu {
    /// Nothing is opened yet. With `takes_software`, [`Device::Auto`] takes a software adapter too.
    pub const fn new(takes_software: bool) -> Self {
        Self {
            takes_software: AtomicBool::new(takes_software),
            options: None,
            state: Mutex::new(State::new(0)),
        }
    }

    /// [`SharedGpu::new`] that opens devices with other options, whose choice of an adapter counts for nothing.
    pub const fn with_options(takes_software: bool, options: GpuOptions) -> Self {
        let mut shared = Self::new(takes_software);
        shared.options = Some(options);
        shared
    }

    /// The one of the process: of [`super::detect`], and of simulations unless they are given another.
    pub fn of_process() -> &'static Self {
        &OF_PROCESS
    }

    /// Whether from here on [`Device::Auto`] takes a software adapter too. For tests: it is slower than the CPU.
    pub fn set_takes_software(&self, takes: bool) {
        self.takes_software.store(takes, Ordering::Relaxed);
    }

    /// The GPU that is open, if one is.
    pub fn gpu(&self) -> Option<Arc<Gpu>> {
        self.lock().open.as_ref().map(|open| open.gpu.clone())
    }

    /// Whether a GPU is open that is no software adapter.
    pub fn is_hardware(&self) -> bool {
        self.gpu().is_some_and(|gpu| !gpu.is_software())
    }

    /// Closes the GPU under whoever works with it, as if its driver had gone; whether one was open. For tests.
    pub fn lose(&self) -> bool {
        self.gpu().map(|gpu| gpu.close()).is_some()
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
        let answer = self.with(device, |open| {
            let kept = open.kept.get(&open.gpu, mesh, method, tuning)?;
            let mut contacts = kept.detect(mesh, query, pool)?;
            contacts.stats.counts.push(("bytes", kept.bytes()));
            Ok(contacts)
        });
        let reason = match answer {
            Ok((contacts, device)) => return Ok(Detected { contacts, method, device, reason: None }),
            Err(DeviceError::Unavailable { reason }) if device == Device::Auto => {
                Reason::NoGpu(format!("\"{method}\": {reason}"))
            }
            Err(DeviceError::Failed { device: adapter, reason }) if device == Device::Auto => {
                Reason::Failed(format!("\"{method}\": {adapter}: {reason}"))
            }
            Err(error) => return Err(error),
        };
        detect_on_cpu(mesh, query, CPU_DEFAULT, Some(reason), pool)
    }

    /// What `work` gives on the GPU for that device, opened if it is not, and the GPU's description. Nobody else computes on it
    /// meanwhile. A GPU that fails is closed.
    pub(super) fn with<T>(
        &self,
        device: Device,
        work: impl FnOnce(&mut Open) -> Result<T, DetectError>,
    ) -> Result<(T, String), DeviceError> {
        let mut state = self.lock();
        let open = self.open(&mut state, device).map_err(|reason| DeviceError::Unavailable { reason })?;
        let description = open.gpu.description();
        match work(open) {
            Ok(answer) => Ok((answer, description)),
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
        let hardware_only = device == Device::Auto && !self.takes_software.load(Ordering::Relaxed);
        if hardware_only && state.open.as_ref().is_none_or(|open| open.gpu.is_software()) {
            if state.no_hardware.is_none() {
                match hardware::absent().map_or_else(|| self.build(AdapterChoice::Hardware), Err) {
                    Ok(open) => return Ok(state.open.insert(open)),
                    Err(reason) => state.no_hardware = Some(reason),
                }
            }
            return Err(state.no_hardware.clone().unwrap_or_default());
        }
        match &mut state.open {
            Some(open) => Ok(open),
            none => Ok(none.insert(self.build(AdapterChoice::Any)?)),
        }
    }

    fn build(&self, adapter: AdapterChoice) -> Result<Open, String> {
        let options = GpuOptions { adapter, ..self.options.unwrap_or_default() };
        let gpu = Gpu::new(options).map_err(|error: GpuError| error.to_string())?;
        Ok(Open { gpu, kept: Kept::default() })
    }
}
