//! The device: which adapter, what it allows, what went wrong with it.

use crate::adapters::{AdapterChoice, best, check_limits, description};
use crate::error::GpuError;
use crate::kernel::Kernel;
use std::collections::BTreeMap;
use std::future::Future;
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

/// How to open a device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpuOptions {
    /// Which adapters will do.
    pub adapter: AdapterChoice,
    /// Use subgroup operations where the device has them and passes the self-test of [`Gpu::new`].
    pub subgroups: bool,
    /// Measure the seconds of each stage on the device, where it can.
    pub timestamps: bool,
    /// Longest wait for one submission.
    pub timeout: Duration,
    /// Bind no more bytes than this, though the device would.
    pub max_binding_bytes: Option<u64>,
    /// Dispatch no more workgroups per dimension than this, though the device would.
    pub max_workgroups_per_dimension: Option<u32>,
    /// Let wgpu guard every access and every loop of the kernels. Without, a kernel may rely on its own bounds.
    pub shader_checks: bool,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self {
            adapter: AdapterChoice::Any,
            subgroups: true,
            timestamps: true,
            timeout: Duration::from_mins(1),
            max_binding_bytes: None,
            max_workgroups_per_dimension: None,
            shader_checks: true,
        }
    }
}

/// An open device with its compiled kernels.
///
/// Every wait has an end ([`GpuOptions::timeout`]); a lost device or a refused command is an error of the next call.
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) options: GpuOptions,
    /// Largest array [B].
    pub(crate) max_binding: u64,
    pub(crate) max_workgroups: u32,
    pub(crate) uniform_alignment: u32,
    pub(crate) has_subgroups: bool,
    pub(crate) has_timestamps: bool,
    info: wgpu::AdapterInfo,
    failure: Arc<Mutex<Option<GpuError>>>,
    kernels: Mutex<BTreeMap<String, Arc<Kernel>>>,
    pub(crate) spare: Mutex<Spare>,
    /// One word, all ones: the count of a length that only the host bounds.
    pub(crate) unlimited: wgpu::Buffer,
}

/// Buffers between submissions.
#[derive(Debug, Default)]
pub(crate) struct Spare {
    pub(crate) arenas: Vec<wgpu::Buffer>,
    pub(crate) staging: Option<wgpu::Buffer>,
    pub(crate) queries: Option<(wgpu::QuerySet, wgpu::Buffer)>,
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu").field("adapter", &self.description()).finish_non_exhaustive()
    }
}

impl Gpu {
    /// Opens the best adapter of the wanted kind.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`], [`GpuError::NoDevice`], [`GpuError::Limit`]. A failed self-test of the subgroup
    /// operations is no error: the device then works without them.
    pub fn new(options: GpuOptions) -> Result<Arc<Self>, GpuError> {
        let mut gpu = Self::open(options)?;
        if gpu.has_subgroups && !crate::stages::scan::subgroups_work(&gpu) {
            gpu.has_subgroups = false;
        }
        gpu.failure()?;
        Ok(Arc::new(gpu))
    }

    fn open(options: GpuOptions) -> Result<Self, GpuError> {
        let adapter = best(options.adapter)?;
        let info = adapter.get_info();
        let limits = adapter.limits();
        check_limits(&limits)?;
        let wanted = wgpu::Features::SUBGROUP | wgpu::Features::TIMESTAMP_QUERY;
        let features = adapter.features() & wanted;
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("clothsim"),
            required_features: features,
            required_limits: limits.clone(),
            ..Default::default()
        });
        let no_device = |reason: String| GpuError::NoDevice { adapter: info.name.clone(), reason };
        let (device, queue) = ready(request)
            .ok_or_else(|| no_device("the request does not end".to_owned()))?
            .map_err(|e| no_device(e.to_string()))?;

        let failure = Arc::new(Mutex::new(None));
        let first = failure.clone();
        device.on_uncaptured_error(Arc::new(move |error| {
            lock(&first).get_or_insert(GpuError::Device { message: error.to_string() });
        }));
        let lost = failure.clone();
        device.set_device_lost_callback(move |reason, message| {
            *lock(&lost) = Some(GpuError::Lost { reason: format!("{reason:?}: {message}") });
        });

        let unlimited = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("unlimited"),
            size: 16,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        queue.write_buffer(&unlimited, 0, &[0xff; 16]);
        let max_binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        Ok(Self {
            max_binding: options.max_binding_bytes.map_or(max_binding, |m| m.min(max_binding)),
            max_workgroups: options
                .max_workgroups_per_dimension
                .map_or(limits.max_compute_workgroups_per_dimension, |m| {
                    m.min(limits.max_compute_workgroups_per_dimension)
                }),
            uniform_alignment: limits.min_uniform_buffer_offset_alignment,
            has_subgroups: options.subgroups && features.contains(wgpu::Features::SUBGROUP),
            has_timestamps: options.timestamps && features.contains(wgpu::Features::TIMESTAMP_QUERY),
            device,
            queue,
            options,
            info,
            failure,
            kernels: Mutex::default(),
            spare: Mutex::default(),
            unlimited,
        })
    }

    /// Adapter, driver and back end, for reports.
    pub fn description(&self) -> String {
        description(&self.info)
    }

    /// Whether the device is a processor that plays a GPU.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Whether kernels use subgroup operations.
    pub fn has_subgroups(&self) -> bool {
        self.has_subgroups
    }

    /// Whether reports hold seconds measured on the device.
    pub fn has_timestamps(&self) -> bool {
        self.has_timestamps
    }

    /// Largest array that the device binds [B].
    pub fn max_binding_bytes(&self) -> u64 {
        self.max_binding
    }

    /// Closes the device: every later call on it fails with [`GpuError::Lost`], as if the driver had gone.
    pub fn close(&self) {
        self.device.destroy();
    }

    /// What went wrong since the last call, if anything did. A lost device stays lost.
    pub(crate) fn failure(&self) -> Result<(), GpuError> {
        let mut failure = lock(&self.failure);
        match failure.clone() {
            None => Ok(()),
            Some(error) => {
                if !matches!(error, GpuError::Lost { .. }) {
                    *failure = None;
                }
                Err(error)
            }
        }
    }

    /// Kernels compiled so far: each once, whatever asks for it.
    pub fn compiled(&self) -> usize {
        lock(&self.kernels).len()
    }

    /// The kernel of that key, compiled at the first call.
    pub(crate) fn kernel(
        &self,
        key: &str,
        compile: impl FnOnce() -> Result<Kernel, GpuError>,
    ) -> Result<Arc<Kernel>, GpuError> {
        if let Some(kernel) = lock(&self.kernels).get(key) {
            return Ok(kernel.clone());
        }
        let kernel = Arc::new(compile()?);
        lock(&self.kernels).insert(key.to_owned(), kernel.clone());
        Ok(kernel)
    }

    /// Waits for a submission, or for the timeout.
    pub(crate) fn wait(&self, submission: wgpu::SubmissionIndex) -> Result<(), GpuError> {
        let timeout = self.options.timeout;
        let poll = wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(timeout) };
        match self.device.poll(poll) {
            Ok(_) => self.failure(),
            Err(wgpu::PollError::Timeout) => {
                self.failure()?;
                Err(GpuError::Timeout { seconds: timeout.as_secs_f64() })
            }
            Err(error) => {
                // A device that is gone takes no submission, so there is none to wait for: the cause comes by itself.
                let _ = self.device.poll(wgpu::PollType::Poll);
                self.failure()?;
                Err(GpuError::Device { message: error.to_string() })
            }
        }
    }
}

/// The outcome of a future of wgpu that is ready at once, as all are off the web.
pub(crate) fn ready<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}

/// A panic elsewhere leaves nothing half-done behind these locks.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
