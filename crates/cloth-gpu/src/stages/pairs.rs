//! From registrations to triangle pairs whose boxes overlap: counts, sums, tests.

use crate::buffers::Array;
use crate::context::Gpu;
use crate::error::GpuError;
use crate::kernel::{Kernel, Source};
use crate::layout::{LengthParams, PairParams};
use crate::limits::{PAIR_BLOCK, WORKGROUP};
use crate::recorder::Recorder;
use crate::stages::bounds::Scene;
use crate::stages::cells::Cells;
use crate::stages::scan::Scan;
use std::sync::Arc;

/// Tests of the triangle pairs that share a cell.
#[derive(Debug)]
pub struct Pairs {
    count: Arc<Kernel>,
    test: Arc<Kernel>,
    scan: Scan<[u32; 2]>,
    /// Tests that each registration begins.
    pub counts: Array<u32>,
    /// Tests before each registration, (low, high), and their number.
    pub sums: Array<[u32; 2]>,
    /// Triangle pairs that passed, unordered.
    pub found: Array<[u32; 2]>,
}

/// The texts of both kernels: count, test.
pub fn sources() -> [Source; 2] {
    [
        Source::new("pairs_count", include_str!("../../shaders/pairs_count.wgsl")),
        Source::new("pairs_test", include_str!("../../shaders/pairs_test.wgsl"))
            .include(include_str!("../../shaders/boxes.wgsl"))
            .include(include_str!("../../shaders/control.wgsl")),
    ]
}

impl Pairs {
    /// Builds the pipelines; room for `capacity` pairs.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, capacity: usize) -> Result<Self, GpuError> {
        let [count, test] = sources();
        Ok(Self {
            count: count.kernel(gpu)?,
            test: test.kernel(gpu)?,
            scan: Scan::new(gpu)?,
            counts: Array::new(gpu, "tests per registration", 1)?,
            sums: Array::new(gpu, "tests before each registration", 1)?,
            found: Array::new(gpu, "triangle pairs", capacity)?,
        })
    }

    /// Records how many tests there are.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn record_counts(&mut self, recorder: &mut Recorder<'_>, cells: &Cells) -> Result<(), GpuError> {
        let gpu = recorder.gpu();
        let n = cells.length();
        self.counts.grow(gpu, n.most as usize)?;
        self.sums.grow(gpu, n.most as usize + 1)?;
        recorder.stage("workload");
        let params = LengthParams { most: n.most, word: n.index(), ..Default::default() };
        let arrays = [n.buffer(gpu), &cells.entries.raw, &self.counts.raw];
        recorder.dispatch(&self.count, &params, &arrays, n.most.div_ceil(WORKGROUP));
        self.scan.record(recorder, &self.counts, n, &self.sums)
    }

    /// Records `count` tests from `start` on.
    pub fn record_tests(
        &self,
        recorder: &mut Recorder<'_>,
        scene: &Scene,
        cells: &Cells,
        start: u64,
        count: u32,
    ) {
        let n = cells.length();
        recorder.stage("triangle pairs");
        let params = PairParams {
            most: n.most,
            word: n.index(),
            start_low: start as u32,
            start_high: (start >> 32) as u32,
            count,
            ..Default::default()
        };
        let arrays = [
            n.buffer(recorder.gpu()),
            &self.sums.raw,
            &cells.entries.raw,
            &scene.bounds.raw,
            &self.found.raw,
            &scene.status.raw,
        ];
        recorder.dispatch(&self.test, &params, &arrays, count.div_ceil(PAIR_BLOCK));
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        self.counts.bytes() + self.sums.bytes() + self.found.bytes()
    }
}
