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
use crate::layout::{Entry, Grid, LengthParams};
use crate::limits::WORKGROUP;
use crate::recorder::Recorder;
use crate::stages::bounds::Scene;
use crate::stages::scan::Scan;
use crate::stages::sort::Sort;
use crate::{Length, limits::status};
use std::sync::Arc;

/// Registrations in the cells, sorted by cell: of whole triangles, or of parts of them.
#[derive(Debug)]
pub struct Cells {
    setup: Arc<Kernel>,
    count: Arc<Kernel>,
    register: Arc<Kernel>,
    roots: Arc<Kernel>,
    mark: Arc<Kernel>,
    gather: [Arc<Kernel>; 2],
    scan: Scan<u32>,
    sort: Sort,
    /// What can be registered.
    room: u32,
    is_virtual: bool,
    /// Sort the registrations of parts by triangle too, not by cell alone: the parts of a triangle follow each other, whatever their order.
    pub sorts_roots: bool,
    /// The cells: one element.
    pub grid: Array<Grid>,
    /// Home cell of each triangle.
    pub homes: Array<u32>,
    /// Control bits of each triangle.
    pub controls: Array<u32>,
    /// Cells of each triangle.
    pub counts: Array<u32>,
    /// First registration of each triangle; the last element is their number.
    pub offsets: Array<u32>,
    /// Keys of the registrations, sorted.
    pub keys: Array<u32>,
    /// Triangles of the registrations.
    pub registered: Array<u32>,
    /// Triangles that the registered parts belong to, where they are sorted by.
    pub registered_roots: Array<u32>,
    /// Which registrations of parts are kept.
    pub marks: Array<u32>,
    /// Kept registrations before each one; the last element is their number.
    pub kept: Array<u32>,
    /// The kept registrations with what their tests ask first.
    pub entries: Array<Entry>,
}

/// What is registered: spheres, how many, and, of parts, the triangles they belong to.
#[derive(Debug, Clone, Copy)]
pub struct Registered<'a> {
    /// Centre and radius.
    pub spheres: &'a Array<[f32; 4]>,
    /// How many.
    pub length: Length<'a>,
    /// Triangle of each part; None: triangles themselves.
    pub roots: Option<&'a Array<u32>>,
}

/// The texts of the kernels: setup, count, register, roots, mark, gather of triangles, gather of parts.
pub fn sources() -> [Source; 7] {
    let gather = || Source::new("cells_gather", include_str!("../../shaders/cells_gather.wgsl"));
    [
        Source::new("grid_setup", include_str!("../../shaders/grid_setup.wgsl")),
        Source::new("cells_count", include_str!("../../shaders/cells_count.wgsl")),
        Source::new("cells_register", include_str!("../../shaders/cells_register.wgsl"))
            .include(include_str!("../../shaders/control.wgsl")),
        Source::new("cells_roots", include_str!("../../shaders/cells_roots.wgsl")),
        Source::new("cells_mark", include_str!("../../shaders/cells_mark.wgsl")),
        gather(),
        gather().switch("VIRTUAL", true),
    ]
}

impl Cells {
    /// Builds the pipelines; room for so many triangles or parts, and for `capacity` registrations.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, room: u32, capacity: usize) -> Result<Self, GpuError> {
        let [setup, count, register, roots, mark, gather, gather_parts] = sources();
        let n = room as usize;
        Ok(Self {
            setup: setup.kernel(gpu)?,
            count: count.kernel(gpu)?,
            register: register.kernel(gpu)?,
            roots: roots.kernel(gpu)?,
            mark: mark.kernel(gpu)?,
            gather: [gather.kernel(gpu)?, gather_parts.kernel(gpu)?],
            scan: Scan::new(gpu)?,
            sort: Sort::new(gpu)?,
            room,
            is_virtual: false,
            sorts_roots: false,
            grid: Array::new(gpu, "grid", 1)?,
            homes: Array::new(gpu, "home cells", n)?,
            controls: Array::new(gpu, "control bits", n)?,
            counts: Array::new(gpu, "cells per triangle", n)?,
            offsets: Array::new(gpu, "first registrations", n + 1)?,
            keys: Array::new(gpu, "cell keys", capacity)?,
            registered: Array::new(gpu, "registered triangles", capacity)?,
            registered_roots: Array::new(gpu, "registered roots", 1)?,
            marks: Array::new(gpu, "marks", 1)?,
            kept: Array::new(gpu, "kept registrations", 1)?,
            entries: Array::new(gpu, "registrations by cell", capacity)?,
        })
    }

    /// Makes room for so many parts and registrations.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn grow(&mut self, gpu: &Gpu, room: u32, registrations: usize) -> Result<(), GpuError> {
        for array in [&mut self.homes, &mut self.controls, &mut self.counts] {
            array.grow(gpu, room as usize)?;
        }
        self.offsets.grow(gpu, room as usize + 1)?;
        self.room = self.room.max(room);
        self.keys.grow(gpu, registrations)?;
        self.registered.grow(gpu, registrations)?;
        self.entries.grow(gpu, registrations)
    }

    /// What can be registered.
    pub fn room(&self) -> u32 {
        self.room
    }

    /// How many entries there are, bounded by the room.
    pub fn length(&self) -> Length<'_> {
        let most = self.keys.capacity() as u32;
        if self.is_virtual {
            Length::device(most, &self.kept, most)
        } else {
            Length::device(most, &self.offsets, self.room)
        }
    }

    /// Records size and number of the cells for the largest sphere.
    pub fn record_setup(&self, recorder: &mut Recorder<'_>, scene: &Scene) {
        recorder.stage("cells");
        recorder.dispatch(&self.setup, &scene.params, &[&scene.status.raw, &self.grid.raw], 1);
    }

    /// Records the registrations of `what`, sorted by the lowest `key_bits` bits of their keys. `spheres`: of the whole
    /// triangles.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`] for scratch memory.
    pub fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        what: Registered<'_>,
        spheres: &Array<[f32; 4]>,
        key_bits: u32,
    ) -> Result<(), GpuError> {
        let gpu = recorder.gpu();
        self.is_virtual = what.roots.is_some();
        let lengths = what.length.buffer(gpu);
        let params = LengthParams { most: self.room, word: what.length.index(), ..Default::default() };
        // Whatever bounds `what` bounds the dispatch; the rest of the counts has to be zero for the scan all the same.
        let groups = self.room.div_ceil(WORKGROUP);
        let arrays = [
            lengths,
            &what.spheres.raw,
            &self.grid.raw,
            &self.homes.raw,
            &self.controls.raw,
            &self.counts.raw,
        ];
        recorder.dispatch(&self.count, &params, &arrays, groups);
        self.scan.record(recorder, &self.counts, Length::host(self.room), &self.offsets)?;
        let arrays = [
            lengths,
            &self.homes.raw,
            &self.controls.raw,
            &self.offsets.raw,
            &self.grid.raw,
            &self.keys.raw,
            &self.registered.raw,
        ];
        recorder.dispatch(&self.register, &params, &arrays, groups);

        recorder.stage("sort");
        let most = self.keys.capacity() as u32;
        let length = Length::device(most, &self.offsets, self.room);
        match what.roots.filter(|_| self.sorts_roots) {
            Some(roots) => {
                self.registered_roots.grow(gpu, most as usize)?;
                let params = LengthParams { most, word: self.room, ..Default::default() };
                let low = &self.registered_roots;
                let arrays = [&self.offsets.raw, &self.registered.raw, &roots.raw, &low.raw];
                recorder.dispatch(&self.roots, &params, &arrays, most.div_ceil(WORKGROUP));
                self.sort.record_wide(recorder, low, &self.keys, &self.registered, length, 32 + key_bits)?;
            }
            None => self.sort.record(recorder, &self.keys, &self.registered, length, key_bits)?,
        }

        recorder.stage("gather");
        let params = LengthParams { most, word: self.room, ..Default::default() };
        let groups = most.div_ceil(WORKGROUP);
        let mut arrays = vec![
            &self.offsets.raw,
            &self.keys.raw,
            &self.registered.raw,
            &spheres.raw,
            &self.controls.raw,
            &self.entries.raw,
        ];
        if let Some(roots) = what.roots {
            self.marks.grow(gpu, most as usize)?;
            self.kept.grow(gpu, most as usize + 1)?;
            let marking =
                [&self.offsets.raw, &self.keys.raw, &self.registered.raw, &roots.raw, &self.marks.raw];
            recorder.dispatch(&self.mark, &params, &marking, groups);
            self.scan.record(recorder, &self.marks, Length::host(most), &self.kept)?;
            arrays.extend([&roots.raw, &self.kept.raw]);
            recorder.dispatch(&self.gather[1], &params, &arrays, groups);
        } else {
            recorder.dispatch(&self.gather[0], &params, &arrays, groups);
        }
        Ok(())
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        let words = [
            &self.homes,
            &self.controls,
            &self.counts,
            &self.offsets,
            &self.keys,
            &self.registered,
            &self.registered_roots,
            &self.marks,
            &self.kept,
        ];
        words.map(Array::bytes).iter().sum::<u64>() + self.entries.bytes()
    }
}

/// Bits that the keys of a status have.
pub(crate) fn key_bits(words: &[u32]) -> u32 {
    words[status::KEY_BITS as usize]
}
