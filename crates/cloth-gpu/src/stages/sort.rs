//! Stable radix sort, least significant digit first.

use crate::buffers::{Array, Length};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::kernel::{Kernel, Source};
use crate::layout::LengthParams;
use crate::limits::{DIGIT_BITS, RADIX, SORT_BLOCK};
use crate::recorder::Recorder;
use crate::stages::scan::Scan;
use std::sync::Arc;

/// Keys of 32 or 64 bits with a 32-bit value each, sorted in place on the device.
///
/// Three dispatches and a scan per digit of 4 bits: count, scan, scatter. No workgroup waits for another one. After an odd number of
/// passes the result is copied back to where the input was.
#[derive(Debug)]
pub struct Sort {
    count: Arc<Kernel>,
    scatter: Arc<Kernel>,
    scatter_high: Arc<Kernel>,
    scan: Scan<u32>,
    counts: Array<u32>,
    offsets: Array<u32>,
    /// Keys, values, high words on the way.
    other: [Array<u32>; 3],
}

/// The texts of both kernels: count, scatter.
pub fn sources(subgroups: bool, high: bool) -> [Source; 2] {
    [
        Source::new("radix_count", include_str!("../../shaders/radix_count.wgsl")),
        Source::new("radix_scatter", include_str!("../../shaders/radix_scatter.wgsl"))
            .include(include_str!("../../shaders/sum.wgsl"))
            .include(include_str!("../../shaders/workgroup_scan.wgsl"))
            .switch("PACKED", true)
            .switch("SUBGROUP", subgroups)
            .switch("HIGH", high),
    ]
}

/// Passes that sort by the lowest `bits` bits.
pub(crate) fn passes(bits: u32) -> u32 {
    bits.div_ceil(DIGIT_BITS)
}

impl Sort {
    /// Builds the pipelines.
    ///
    /// # Errors
    /// [`GpuError::Shader`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let [count, scatter] = sources(gpu.has_subgroups, false);
        let [_, scatter_high] = sources(gpu.has_subgroups, true);
        let array = |label| Array::new(gpu, label, 1);
        Ok(Self {
            count: count.kernel(gpu)?,
            scatter: scatter.kernel(gpu)?,
            scatter_high: scatter_high.kernel(gpu)?,
            scan: Scan::new(gpu)?,
            counts: array("digit counts")?,
            offsets: array("digit offsets")?,
            other: [array("keys on the way")?, array("values on the way")?, array("high words on the way")?],
        })
    }

    /// Records the sort of `keys` by their lowest `bits` bits (at most 32), with their values; equal keys keep their
    /// order.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`] for the second copy.
    ///
    /// # Panics
    /// If an array has no room for n elements, or for more bits than there are.
    pub fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        keys: &Array<u32>,
        values: &Array<u32>,
        n: Length<'_>,
        bits: u32,
    ) -> Result<(), GpuError> {
        assert!(bits <= 32, "{bits} bits of 32");
        self.record_words(recorder, keys, None, values, n, bits)
    }

    /// Records the sort of 64-bit keys, given as low and high words, by their lowest `bits` bits (at most 64).
    ///
    /// # Errors
    /// As [`Sort::record`].
    ///
    /// # Panics
    /// As [`Sort::record`].
    pub fn record_wide(
        &mut self,
        recorder: &mut Recorder<'_>,
        low: &Array<u32>,
        high: &Array<u32>,
        values: &Array<u32>,
        n: Length<'_>,
        bits: u32,
    ) -> Result<(), GpuError> {
        assert!(bits <= 64, "{bits} bits of 64");
        self.record_words(recorder, low, Some(high), values, n, bits)
    }

    fn record_words(
        &mut self,
        recorder: &mut Recorder<'_>,
        keys: &Array<u32>,
        high: Option<&Array<u32>>,
        values: &Array<u32>,
        n: Length<'_>,
        bits: u32,
    ) -> Result<(), GpuError> {
        let most = n.most as usize;
        for array in [Some(keys), high, Some(values)].into_iter().flatten() {
            assert!(most <= array.capacity(), "sort of {most} in {}", array.capacity());
        }
        if most == 0 {
            return Ok(());
        }
        let gpu = recorder.gpu();
        let lengths = n.buffer(gpu);
        let blocks = n.most.div_ceil(SORT_BLOCK);
        let counters = (RADIX * blocks) as usize;
        self.counts.grow(gpu, counters)?;
        self.offsets.grow(gpu, counters + 1)?;
        let used = if high.is_some() { 3 } else { 2 };
        for array in &mut self.other[..used] {
            array.grow(gpu, most)?;
        }
        let [keys_b, values_b, high_b] = self.other.each_ref().map(|a| &a.raw);
        let here = (&keys.raw, &values.raw, high.map(|h| &h.raw));
        let there = (keys_b, values_b, high.map(|_| high_b));
        for pass in 0..passes(bits) {
            let (from, to) = if pass % 2 == 0 { (here, there) } else { (there, here) };
            let shift = pass * DIGIT_BITS;
            let word = if shift < 32 { from.0 } else { from.2.unwrap_or(from.0) };
            let count_shift = shift % 32;
            let params = LengthParams { most: n.most, word: n.index(), shift: count_shift, extra: blocks };
            recorder.dispatch(&self.count, &params, &[lengths, word, &self.counts.raw], blocks);
            self.scan.record(recorder, &self.counts, Length::host(counters as u32), &self.offsets)?;
            let params = LengthParams { shift, ..params };
            let mut arrays = vec![lengths, &self.offsets.raw, from.0, from.1, to.0, to.1];
            if let (Some(from), Some(to)) = (from.2, to.2) {
                arrays.extend([from, to]);
                recorder.dispatch(&self.scatter_high, &params, &arrays, blocks);
            } else {
                recorder.dispatch(&self.scatter, &params, &arrays, blocks);
            }
        }
        if passes(bits) % 2 == 1 {
            for (from, to) in self.other.iter().zip([Some(keys), Some(values), high]) {
                if let Some(to) = to {
                    recorder.copy(from, to, most);
                }
            }
        }
        Ok(())
    }
}
