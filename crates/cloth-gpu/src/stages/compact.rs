//! Compaction: keeps the marked values, in their order.

use crate::buffers::{Array, Length};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::kernel::{Kernel, Source};
use crate::layout::LengthParams;
use crate::limits::WORKGROUP;
use crate::recorder::Recorder;
use crate::stages::scan::Scan;
use std::sync::Arc;

/// Moves the values whose flag is 1 together, on the device.
#[derive(Debug)]
pub struct Compact {
    kernel: Arc<Kernel>,
    scan: Scan<u32>,
}

/// The kernel's text.
pub fn source() -> Source {
    Source::new("compact", include_str!("../../shaders/compact.wgsl"))
}

impl Compact {
    /// Builds the pipelines.
    ///
    /// # Errors
    /// [`GpuError::Shader`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        Ok(Self { kernel: source().kernel(gpu)?, scan: Scan::new(gpu)? })
    }

    /// Records `kept` = the values i < n with `flags[i]` = 1. `offsets` receives the scan of the flags: how many were kept is
    /// `offsets[n]`.
    ///
    /// # Errors
    /// As [`Scan::record`].
    ///
    /// # Panics
    /// If an array has no room for n elements, or `offsets` for n + 1.
    pub fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        flags: &Array<u32>,
        values: &Array<u32>,
        n: Length<'_>,
        offsets: &Array<u32>,
        kept: &Array<u32>,
    ) -> Result<(), GpuError> {
        for array in [values, kept] {
            assert!(n.most as usize <= array.capacity(), "{} values in {}", n.most, array.capacity());
        }
        self.scan.record(recorder, flags, n, offsets)?;
        let params = LengthParams { most: n.most, word: n.index(), ..Default::default() };
        let lengths = n.buffer(recorder.gpu());
        let arrays = [lengths, &flags.raw, &offsets.raw, &values.raw, &kept.raw];
        recorder.dispatch(&self.kernel, &params, &arrays, n.most.div_ceil(WORKGROUP));
        Ok(())
    }
}
