//! Exclusive scan: reduce, scan the totals, apply.

use crate::buffers::{Array, Length};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::kernel::{Kernel, Source};
use crate::layout::LengthParams;
use crate::limits::SCAN_BLOCK;
use crate::recorder::Recorder;
use bytemuck::Pod;
use std::sync::Arc;

/// What is added up: words (wrapping at 2^32), or words into 64-bit numbers as (low, high).
pub trait Sum: Pod {
    /// Switch of the kernels.
    const SWITCH: &'static str;
    /// Whether subgroup operations know it.
    const HAS_SUBGROUPS: bool;
}

impl Sum for u32 {
    const SWITCH: &'static str = "NARROW";
    const HAS_SUBGROUPS: bool = true;
}

impl Sum for [u32; 2] {
    const SWITCH: &'static str = "WIDE";
    const HAS_SUBGROUPS: bool = false;
}

/// Exclusive scan of `u32` counts into sums of type `S`, on the device.
///
/// Level k scans the block totals of level k − 1 until one block is left, then the totals are added back: no block waits for
/// another one. With 2048 elements per block, 2 levels cover 4 million elements and 3 levels what a `u32` counts.
#[derive(Debug)]
pub struct Scan<S> {
    first: [Arc<Kernel>; 2],
    upper: [Arc<Kernel>; 2],
    /// Per level: totals of its blocks, and their scan.
    levels: Vec<[Array<S>; 2]>,
}

/// The texts of both kernels: reduce, apply.
pub fn sources<S: Sum>(subgroups: bool, first: bool) -> [Source; 2] {
    [
        ("scan_reduce", include_str!("../../shaders/scan_reduce.wgsl")),
        ("scan_apply", include_str!("../../shaders/scan_apply.wgsl")),
    ]
    .map(|(name, text)| {
        Source::new(name, text)
            .include(include_str!("../../shaders/sum.wgsl"))
            .include(include_str!("../../shaders/workgroup_scan.wgsl"))
            .switch(S::SWITCH, true)
            .switch("SUBGROUP", subgroups && S::HAS_SUBGROUPS)
            .switch("FIRST", first)
    })
}

impl<S: Sum> Scan<S> {
    /// Builds the pipelines.
    ///
    /// # Errors
    /// [`GpuError::Shader`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let build = |first| -> Result<[Arc<Kernel>; 2], GpuError> {
            let [reduce, apply] = sources::<S>(gpu.has_subgroups, first);
            Ok([reduce.kernel(gpu)?, apply.kernel(gpu)?])
        };
        Ok(Self { first: build(true)?, upper: build(false)?, levels: vec![] })
    }

    /// Records `output[i] = Σ input[..i]` for i ≤ n: the last one is the total. n = 0 gives `output[0] = 0`.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`] for the totals.
    ///
    /// # Panics
    /// If `input` has no room for n elements or `output` for n + 1.
    pub fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        input: &Array<u32>,
        n: Length<'_>,
        output: &Array<S>,
    ) -> Result<(), GpuError> {
        assert!(n.most as usize <= input.capacity(), "scan of {} in {}", n.most, input.capacity());
        assert!((n.most as usize) < output.capacity(), "scan of {} into {}", n.most, output.capacity());
        let gpu = recorder.gpu();
        let lengths = n.buffer(gpu);
        let mut blocks = vec![];
        let mut elements = n.most;
        while elements > SCAN_BLOCK {
            elements = elements.div_ceil(SCAN_BLOCK);
            blocks.push(elements);
        }
        for (level, &count) in blocks.iter().enumerate() {
            if level == self.levels.len() {
                let (totals, bases) = ("block totals", "block bases");
                self.levels.push([Array::new(gpu, totals, 1)?, Array::new(gpu, bases, 1)?]);
            }
            for array in &mut self.levels[level] {
                array.grow(gpu, count as usize + 1)?;
            }
        }
        let params = |level: usize, extra: bool| LengthParams {
            most: n.most,
            word: n.index(),
            shift: level as u32 * SCAN_BLOCK.ilog2(),
            extra: extra.into(),
        };
        for (level, &count) in blocks.iter().enumerate() {
            let [totals, _] = &self.levels[level];
            if level == 0 {
                let arrays = [lengths, &input.raw, &totals.raw];
                recorder.dispatch(&self.first[0], &params(0, false), &arrays, count);
            } else {
                let arrays = [lengths, &self.levels[level - 1][0].raw, &totals.raw];
                recorder.dispatch(&self.upper[0], &params(level, false), &arrays, count);
            }
        }
        for level in (0..=blocks.len()).rev() {
            let has_base = level < blocks.len();
            let bases = if has_base { &self.levels[level][1].raw } else { &gpu.unlimited };
            let count = if has_base { blocks[level] } else { 1 };
            if level == 0 {
                let arrays = [lengths, &input.raw, bases, &output.raw];
                recorder.dispatch(&self.first[1], &params(0, has_base), &arrays, count);
            } else {
                let [totals, scanned] = &self.levels[level - 1];
                let arrays = [lengths, &totals.raw, bases, &scanned.raw];
                recorder.dispatch(&self.upper[1], &params(level, has_base), &arrays, count);
            }
        }
        Ok(())
    }
}

/// Whether the device scans right with subgroup operations, which take for granted that a subgroup's lanes are
/// neighbours and that all subgroups are full.
pub(crate) fn subgroups_work(gpu: &Gpu) -> bool {
    let n = 2 * SCAN_BLOCK + 77;
    let input: Vec<u32> = (0..n).map(|i| i.wrapping_mul(2_654_435_761) >> 20).collect();
    let wide: Vec<u64> = input.iter().map(|&x| x.into()).collect();
    let expected: Vec<u32> = crate::twin::scan::scan(&wide).iter().map(|&x| x as u32).collect();
    let run = || -> Result<Vec<u32>, GpuError> {
        let input = Array::with(gpu, "self-test", &input)?;
        let output = Array::<u32>::new(gpu, "self-test", n as usize + 1)?;
        let mut recorder = Recorder::new(gpu);
        Scan::<u32>::new(gpu)?.record(&mut recorder, &input, Length::host(n), &output)?;
        let copy = recorder.download(&output, 0..n as usize + 1);
        Ok(recorder.run()?.read(copy))
    };
    run().is_ok_and(|got| got == expected)
}
