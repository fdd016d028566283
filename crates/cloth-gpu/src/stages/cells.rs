//! The uniform grid: which triangles are registered in which cells.
//!
//! A cell is 1.5 times the largest sphere's diameter (3 radii; thesis 3.3.1). A triangle is registered in its home cell, which
//! holds its sphere's centre, and in the cells that the sphere touches once its radius is multiplied by √2.
//!
//! **Why √2.** Tests are begun only where one triangle of the pair is at home (thesis 3.3.1). Let the
//! spheres (a, r) and (b, s) overlap, with homes A ≠ B. Along each axis in which A and B differ there is one cell plane between a and
//! b, at distances d from a and e from b, so |a − b|² ≥ Σ (d + e)² ≥ Σ d² + Σ e² = dist(a, B)² + dist(b, A)². If a were not
//! registered in B nor b in A, that would exceed 2 r² + 2 s² ≥ (r + s)²: no overlap. With the plain radius the claim is false (two
//! spheres across a cell edge may meet in a third cell only), and contacts would be lost.
//!
//! **Twice at most.** 2√2 radii are less than a cell, so a triangle lies in at most two cells along an axis and the pair's common
//! home cells are among A and B. The control bits tell exactly whether both meet in the other one (`control.wgsl`); then the cell of
//! the lower type has the test.
//!
//! Sources: \[wong2014\] 3.3.1; \[legrand2007\], which scales spheres by √2 too.

use crate::buffers::Array;
use crate::context::Gpu;
use crate::error::GpuError;
use crate::kernel::{Kernel, Source};
use crate::layout::{Entry, Grid, LengthParams, SceneParams};
use crate::limits::WORKGROUP;
use crate::recorder::Recorder;
use crate::stages::bounds::Scene;
use crate::stages::scan::Scan;
use crate::stages::sort::Sort;
use crate::{Length, limits::status};
use std::sync::Arc;

/// Registrations of the triangles in the cells, sorted by cell.
#[derive(Debug)]
pub struct Cells {
    setup: Arc<Kernel>,
    count: Arc<Kernel>,
    register: Arc<Kernel>,
    gather: Arc<Kernel>,
    scan: Scan<u32>,
    sort: Sort,
    triangles: u32,
    /// The cells: one element.
    pub grid: Array<Grid>,
    /// Home cell of each triangle.
    pub homes: Array<u32>,
    /// Control bits of each triangle.
    pub controls: Array<u32>,
    /// Cells of each triangle.
    pub counts: Array<u32>,
    /// First registration of each triangle, and their number.
    pub offsets: Array<u32>,
    /// Keys of the registrations, sorted.
    pub keys: Array<u32>,
    /// Triangles of the registrations.
    pub registered: Array<u32>,
    /// The registrations with what their tests ask first.
    pub entries: Array<Entry>,
}

/// The texts of the kernels: setup, count, register, gather.
pub fn sources() -> [Source; 4] {
    [
        Source::new("grid_setup", include_str!("../../shaders/grid_setup.wgsl")),
        Source::new("cells_count", include_str!("../../shaders/cells_count.wgsl")),
        Source::new("cells_register", include_str!("../../shaders/cells_register.wgsl"))
            .include(include_str!("../../shaders/control.wgsl")),
        Source::new("cells_gather", include_str!("../../shaders/cells_gather.wgsl")),
    ]
}

impl Cells {
    /// Builds the pipelines; room for `capacity` registrations.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, triangles: u32, capacity: usize) -> Result<Self, GpuError> {
        let [setup, count, register, gather] = sources();
        let n = triangles as usize;
        Ok(Self {
            setup: setup.kernel(gpu)?,
            count: count.kernel(gpu)?,
            register: register.kernel(gpu)?,
            gather: gather.kernel(gpu)?,
            scan: Scan::new(gpu)?,
            sort: Sort::new(gpu)?,
            triangles,
            grid: Array::new(gpu, "grid", 1)?,
            homes: Array::new(gpu, "home cells", n)?,
            controls: Array::new(gpu, "control bits", n)?,
            counts: Array::new(gpu, "cells per triangle", n)?,
            offsets: Array::new(gpu, "first registrations", n + 1)?,
            keys: Array::new(gpu, "cell keys", capacity)?,
            registered: Array::new(gpu, "registered triangles", capacity)?,
            entries: Array::new(gpu, "registrations by cell", capacity)?,
        })
    }

    /// Makes room for `needed` registrations.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn grow(&mut self, gpu: &Gpu, needed: usize) -> Result<(), GpuError> {
        self.keys.grow(gpu, needed)?;
        self.registered.grow(gpu, needed)?;
        self.entries.grow(gpu, needed)
    }

    /// How many registrations there are, bounded by the room.
    pub fn length(&self) -> Length<'_> {
        Length::device(self.keys.capacity() as u32, &self.offsets, self.triangles)
    }

    /// Records the registrations, sorted by the lowest `key_bits` bits of their keys.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`] for scratch memory.
    pub fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        scene: &Scene,
        key_bits: u32,
    ) -> Result<(), GpuError> {
        let params: &SceneParams = &scene.params;
        let groups = self.triangles.div_ceil(WORKGROUP);
        recorder.stage("cells");
        recorder.dispatch(&self.setup, params, &[&scene.status.raw, &self.grid.raw], 1);
        let arrays =
            [&scene.spheres.raw, &self.grid.raw, &self.homes.raw, &self.controls.raw, &self.counts.raw];
        recorder.dispatch(&self.count, params, &arrays, groups);
        self.scan.record(recorder, &self.counts, Length::host(self.triangles), &self.offsets)?;
        let arrays = [
            &self.homes.raw,
            &self.controls.raw,
            &self.offsets.raw,
            &self.grid.raw,
            &self.keys.raw,
            &self.registered.raw,
        ];
        recorder.dispatch(&self.register, params, &arrays, groups);
        recorder.stage("sort");
        let most = self.keys.capacity() as u32;
        let length = Length::device(most, &self.offsets, self.triangles);
        self.sort.record(recorder, &self.keys, &self.registered, length, key_bits)?;
        let params = LengthParams { most, word: self.triangles, ..Default::default() };
        let arrays = [
            &self.offsets.raw,
            &self.keys.raw,
            &self.registered.raw,
            &scene.spheres.raw,
            &self.controls.raw,
            &self.entries.raw,
        ];
        recorder.dispatch(&self.gather, &params, &arrays, most.div_ceil(WORKGROUP));
        Ok(())
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        [&self.homes, &self.controls, &self.counts, &self.offsets, &self.keys, &self.registered]
            .map(Array::bytes)
            .iter()
            .sum::<u64>()
            + self.entries.bytes()
    }
}

/// Bits that the keys of a status have.
pub(crate) fn key_bits(words: &[u32]) -> u32 {
    words[status::KEY_BITS as usize]
}
