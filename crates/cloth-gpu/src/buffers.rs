//! Arrays on the device: typed, labelled, growing.

use crate::context::{Gpu, ready};
use crate::error::GpuError;
use bytemuck::Pod;
use std::marker::PhantomData;

/// An array on the device. Empty ones have room for one element, as a binding of no bytes is refused.
#[derive(Debug)]
pub struct Array<T> {
    label: &'static str,
    pub(crate) raw: wgpu::Buffer,
    capacity: usize,
    element: PhantomData<T>,
}

impl<T: Pod> Array<T> {
    /// Room for `capacity` elements; zero at first.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, label: &'static str, capacity: usize) -> Result<Self, GpuError> {
        let capacity = capacity.max(1);
        Ok(Self { label, raw: allocate::<T>(gpu, label, capacity)?, capacity, element: PhantomData })
    }

    /// An array that holds `data`.
    ///
    /// # Errors
    /// As [`Array::new`].
    pub fn with(gpu: &Gpu, label: &'static str, data: &[T]) -> Result<Self, GpuError> {
        let array = Self::new(gpu, label, data.len())?;
        array.write(gpu, data);
        Ok(array)
    }

    /// Overwrites the first elements, before the next submission runs.
    ///
    /// # Panics
    /// If `data` is longer than the array.
    pub fn write(&self, gpu: &Gpu, data: &[T]) {
        assert!(
            data.len() <= self.capacity,
            "{}: {} elements into {}",
            self.label,
            data.len(),
            self.capacity
        );
        if !data.is_empty() {
            gpu.queue.write_buffer(&self.raw, 0, bytemuck::cast_slice(data));
        }
    }

    /// Makes room for `needed` elements and a quarter more, as far as one binding goes. What was in it is lost if it grows.
    ///
    /// # Errors
    /// As [`Array::new`]. The array keeps what it had.
    pub fn grow(&mut self, gpu: &Gpu, needed: usize) -> Result<(), GpuError> {
        if needed > self.capacity {
            let capacity = (needed + needed / 4).min(Self::most(gpu)).max(needed);
            self.raw = allocate::<T>(gpu, self.label, capacity)?;
            self.capacity = capacity;
        }
        Ok(())
    }

    /// Elements there is room for.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        self.raw.size()
    }

    /// The most elements that one binding holds.
    pub fn most(gpu: &Gpu) -> usize {
        (gpu.max_binding / size_of::<T>() as u64).min(u64::from(u32::MAX)) as usize
    }
}

fn allocate<T>(gpu: &Gpu, label: &str, capacity: usize) -> Result<wgpu::Buffer, GpuError> {
    let needed = (capacity * size_of::<T>()).next_multiple_of(16) as u64;
    if needed > gpu.max_binding {
        return Err(GpuError::TooLarge { what: label.to_owned(), needed, limit: gpu.max_binding });
    }
    let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: needed,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    match ready(scope.pop()) {
        Some(Some(_)) => Err(GpuError::OutOfMemory { what: label.to_owned(), bytes: needed }),
        _ => Ok(buffer),
    }
}

/// How many elements a kernel works on: at most what the host knows, and no more than a word on the device says.
#[derive(Debug, Clone, Copy)]
pub struct Length<'a> {
    pub(crate) most: u32,
    pub(crate) word: Option<(&'a wgpu::Buffer, u32)>,
}

impl<'a> Length<'a> {
    /// Exactly `n`.
    pub fn host(n: u32) -> Self {
        Self { most: n, word: None }
    }

    /// The word `index` of `array`, at most `most`.
    pub fn device(most: u32, array: &'a Array<u32>, index: u32) -> Self {
        Self { most, word: Some((&array.raw, index)) }
    }

    /// The low word of the 64-bit number `index` of `array`, at most `most`.
    pub fn device_wide(most: u32, array: &'a Array<[u32; 2]>, index: u32) -> Self {
        Self { most, word: Some((&array.raw, 2 * index)) }
    }

    pub(crate) fn buffer(&self, gpu: &'a Gpu) -> &'a wgpu::Buffer {
        self.word.map_or(&gpu.unlimited, |w| w.0)
    }

    pub(crate) fn index(&self) -> u32 {
        self.word.map_or(0, |w| w.1)
    }
}
