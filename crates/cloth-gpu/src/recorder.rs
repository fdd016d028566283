//! Commands of one submission: dispatches in stages, copies back, and the wait for both.

use crate::buffers::Array;
use crate::context::{Gpu, lock};
use crate::error::GpuError;
use crate::kernel::{Kernel, MAX_PARAMS};
use bytemuck::Pod;
use std::ops::Range;
use std::sync::mpsc;

/// Stages of one submission whose seconds are measured; further ones run unmeasured.
const MAX_STAGES: u32 = 64;
/// Dispatches whose parameters one arena holds.
const ARENA_SLOTS: u64 = 256;

/// Records the commands of one submission.
#[derive(Debug)]
pub struct Recorder<'a> {
    gpu: &'a Gpu,
    encoder: wgpu::CommandEncoder,
    pass: Option<wgpu::ComputePass<'static>>,
    queries: Option<(wgpu::QuerySet, wgpu::Buffer)>,
    stages: Vec<&'static str>,
    arenas: Vec<wgpu::Buffer>,
    params: Vec<u8>,
    copies: Vec<(wgpu::Buffer, Range<u64>)>,
    failed: Option<GpuError>,
}

/// What came back from a submission.
#[derive(Debug, Default)]
pub struct Answer {
    bytes: Vec<u8>,
    parts: Vec<Range<usize>>,
    /// Seconds on the device per stage, in order; empty where the device cannot tell.
    pub seconds: Vec<(&'static str, f64)>,
}

impl Answer {
    /// The elements of the copy `index`.
    ///
    /// # Panics
    /// If no such copy was recorded.
    pub fn read<T: Pod>(&self, index: usize) -> Vec<T> {
        bytemuck::pod_collect_to_vec(&self.bytes[self.parts[index].clone()])
    }
}

impl<'a> Recorder<'a> {
    /// An empty submission.
    pub fn new(gpu: &'a Gpu) -> Self {
        let queries = gpu.has_timestamps.then(|| {
            lock(&gpu.spare).queries.take().unwrap_or_else(|| {
                let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("stages"),
                    ty: wgpu::QueryType::Timestamp,
                    count: 2 * MAX_STAGES,
                });
                let resolved = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("stage times"),
                    size: u64::from(2 * MAX_STAGES) * 8,
                    usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                });
                (set, resolved)
            })
        });
        Self {
            gpu,
            encoder: gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default()),
            pass: None,
            queries,
            stages: vec![],
            arenas: vec![],
            params: vec![],
            copies: vec![],
            failed: None,
        }
    }

    /// The device.
    pub fn gpu(&self) -> &'a Gpu {
        self.gpu
    }

    /// Begins a stage: what is dispatched from here on is measured under this name.
    pub fn stage(&mut self, name: &'static str) {
        self.pass = None;
        let index = self.stages.len() as u32;
        let timestamp_writes = match &self.queries {
            Some((query_set, _)) if index < MAX_STAGES => Some(wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(2 * index),
                end_of_pass_write_index: Some(2 * index + 1),
            }),
            _ => None,
        };
        let descriptor = wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes };
        self.pass = Some(self.encoder.begin_compute_pass(&descriptor).forget_lifetime());
        self.stages.push(name);
    }

    /// Dispatches `groups` workgroups of a kernel, folded to two dimensions where one does not hold them. The kernel sees
    /// `x + y · (groups along x)` and ignores numbers past its own count. No groups: nothing is recorded.
    pub(crate) fn dispatch<P: Pod>(
        &mut self,
        kernel: &Kernel,
        params: &P,
        arrays: &[&wgpu::Buffer],
        groups: u32,
    ) {
        assert_eq!(arrays.len(), kernel.arrays, "arrays of {}", kernel.name);
        if groups == 0 {
            return;
        }
        let widest = self.gpu.max_workgroups;
        let rows = groups.div_ceil(widest);
        if rows > widest {
            self.failed.get_or_insert(GpuError::TooManyWorkgroups {
                kernel: kernel.name,
                needed: groups.into(),
                limit: u64::from(widest) * u64::from(widest),
            });
            return;
        }
        let (arena, offset) = self.put(bytemuck::bytes_of(params));
        let arena = &self.arenas[arena];
        let mut entries = vec![wgpu::BindGroupEntry {
            binding: 0,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: arena,
                offset: 0,
                size: std::num::NonZeroU64::new(MAX_PARAMS),
            }),
        }];
        entries.extend(arrays.iter().enumerate().map(|(k, array)| wgpu::BindGroupEntry {
            binding: k as u32 + 1,
            resource: array.as_entire_binding(),
        }));
        let group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(kernel.name),
            layout: &kernel.bindings,
            entries: &entries,
        });
        if self.pass.is_none() {
            self.stage(kernel.name);
        }
        if let Some(pass) = &mut self.pass {
            pass.set_pipeline(&kernel.pipeline);
            pass.set_bind_group(0, &group, &[offset]);
            pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
        }
    }

    /// Sets the elements of an array to zero.
    pub(crate) fn clear<T>(&mut self, array: &Array<T>, elements: Range<u64>) {
        self.pass = None;
        let size = size_of::<T>() as u64;
        self.encoder.clear_buffer(
            &array.raw,
            elements.start * size,
            Some((elements.end - elements.start) * size),
        );
    }

    /// Copies the first elements of an array into another one.
    pub(crate) fn copy<T>(&mut self, from: &Array<T>, to: &Array<T>, elements: usize) {
        self.pass = None;
        let bytes = (elements * size_of::<T>()) as u64;
        self.encoder.copy_buffer_to_buffer(&from.raw, 0, &to.raw, 0, bytes);
    }

    /// Copies elements back to the host; returns the index to ask the [`Answer`] with.
    ///
    /// # Panics
    /// If the array has no such elements.
    pub fn download<T: Pod>(&mut self, array: &Array<T>, elements: Range<usize>) -> usize {
        assert!(elements.start <= elements.end && elements.end <= array.capacity(), "{elements:?}");
        let size = size_of::<T>() as u64;
        self.copies.push((array.raw.clone(), elements.start as u64 * size..elements.end as u64 * size));
        self.copies.len() - 1
    }

    /// Runs it and waits for what comes back.
    ///
    /// # Errors
    /// [`GpuError::Timeout`], [`GpuError::Lost`], [`GpuError::Device`], [`GpuError::TooManyWorkgroups`],
    /// [`GpuError::OutOfMemory`].
    pub fn run(mut self) -> Result<Answer, GpuError> {
        self.pass = None;
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        let gpu = self.gpu;
        gpu.failure()?;
        self.write_params();
        let measured = (self.stages.len() as u32).min(MAX_STAGES);
        if let Some((set, resolved)) = self.queries.as_ref().filter(|_| measured > 0) {
            self.encoder.resolve_query_set(set, 0..2 * measured, resolved, 0);
            self.copies.push((resolved.clone(), 0..u64::from(2 * measured) * 8));
        }

        let total: u64 = self.copies.iter().map(|c| c.1.end - c.1.start).sum();
        let staging = self.staging(total)?;
        let mut at = 0;
        let mut parts = vec![];
        for (buffer, range) in &self.copies {
            let size = range.end - range.start;
            if size > 0 {
                self.encoder.copy_buffer_to_buffer(buffer, range.start, &staging, at, size);
            }
            parts.push(at as usize..(at + size) as usize);
            at += size;
        }
        let submission = gpu.queue.submit([self.encoder.finish()]);
        let (sender, receiver) = mpsc::channel();
        if total > 0 {
            staging.map_async(wgpu::MapMode::Read, 0..total, move |result| {
                // The receiver lives until the wait below is over.
                let _ = sender.send(result);
            });
        }
        gpu.wait(submission)?;
        let mut bytes = vec![];
        if total > 0 {
            let message = |message: String| GpuError::Device { message };
            receiver
                .try_recv()
                .map_err(|e| message(format!("copy back: {e}")))?
                .map_err(|e| message(format!("copy back: {e}")))?;
            let view = staging.get_mapped_range(0..total).map_err(|e| message(e.to_string()))?;
            bytes = view.to_vec();
            drop(view);
            staging.unmap();
        }
        let mut answer = Answer { bytes, parts, seconds: vec![] };
        if self.queries.is_some() && measured > 0 {
            let ticks: Vec<u64> = answer.read(answer.parts.len() - 1);
            let period = 1e-9 * f64::from(gpu.queue.get_timestamp_period());
            answer.seconds = self
                .stages
                .iter()
                .zip(ticks.chunks_exact(2))
                .map(|(&name, t)| (name, t[1].saturating_sub(t[0]) as f64 * period))
                .collect();
        }
        let mut spare = lock(&gpu.spare);
        spare.arenas.append(&mut self.arenas);
        spare.staging = Some(staging);
        spare.queries = self.queries.take();
        Ok(answer)
    }

    fn slot(&self) -> u64 {
        MAX_PARAMS.next_multiple_of(u64::from(self.gpu.uniform_alignment))
    }

    /// Keeps parameters until the submission; returns their arena and the offset in it.
    fn put(&mut self, params: &[u8]) -> (usize, u32) {
        assert!(params.len() as u64 <= MAX_PARAMS, "parameters of {} bytes", params.len());
        let (slot, at) = (self.slot(), self.params.len() as u64);
        let (arena, offset) = (at / (slot * ARENA_SLOTS), at % (slot * ARENA_SLOTS));
        if arena as usize == self.arenas.len() {
            let spare = lock(&self.gpu.spare).arenas.pop();
            self.arenas.push(spare.unwrap_or_else(|| {
                self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("parameters"),
                    size: slot * ARENA_SLOTS,
                    usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                })
            }));
        }
        self.params.extend_from_slice(params);
        self.params.resize((at + slot) as usize, 0);
        (arena as usize, offset as u32)
    }

    fn write_params(&self) {
        let arena = (self.slot() * ARENA_SLOTS) as usize;
        for (buffer, bytes) in self.arenas.iter().zip(self.params.chunks(arena)) {
            self.gpu.queue.write_buffer(buffer, 0, bytes);
        }
    }

    /// A buffer that the host can read, of at least `bytes`.
    fn staging(&self, bytes: u64) -> Result<wgpu::Buffer, GpuError> {
        let spare = lock(&self.gpu.spare).staging.take();
        if let Some(buffer) = spare.filter(|b| b.size() >= bytes) {
            return Ok(buffer);
        }
        let most = self.gpu.device.limits().max_buffer_size;
        if bytes > most {
            return Err(GpuError::TooLarge { what: "staging".to_owned(), needed: bytes, limit: most });
        }
        let size = bytes.next_power_of_two().clamp(1 << 16, most);
        let scope = self.gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("staging"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        match crate::context::ready(scope.pop()) {
            Some(Some(_)) => Err(GpuError::OutOfMemory { what: "staging".to_owned(), bytes: size }),
            _ => Ok(buffer),
        }
    }
}
