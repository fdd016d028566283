//! From registrations to triangle pairs whose boxes overlap: counts, sums, tests.

use crate::buffers::{Array, Length};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::kernel::{Kernel, Source};
use crate::layout::{Entry, LengthParams, PairParams};
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
    /// By control bits, by tokens.
    test: [Arc<Kernel>; 2],
    scan: Scan<[u32; 2]>,
    /// Tests that each registration begins.
    pub counts: Array<u32>,
    /// Tests before each registration, (low, high), and their number.
    pub sums: Array<[u32; 2]>,
    /// Triangle pairs that passed, unordered.
    pub found: Array<[u32; 2]>,
}

/// Registrations whose pairs are tested.
#[derive(Debug, Clone, Copy)]
pub struct Entries<'a> {
    /// Sorted by key.
    pub entries: &'a Array<Entry>,
    /// How many.
    pub length: Length<'a>,
    /// Which of several cells tests a pair: told by tokens (`octree_token.wgsl`), else by control bits.
    pub has_tokens: bool,
}

impl<'a> From<&'a Cells> for Entries<'a> {
    fn from(cells: &'a Cells) -> Self {
        Self { entries: &cells.entries, length: cells.length(), has_tokens: false }
    }
}

/// The texts of the kernels: count, test by control bits, test by tokens.
pub fn sources() -> [Source; 3] {
    let test = || {
        Source::new("pairs_test", include_str!("../../shaders/pairs_test.wgsl"))
            .include(include_str!("../../shaders/boxes.wgsl"))
    };
    [
        Source::new("pairs_count", include_str!("../../shaders/pairs_count.wgsl")),
        test().include(include_str!("../../shaders/control.wgsl")),
        test().include(include_str!("../../shaders/octree_token.wgsl")).switch("TOKEN", true),
    ]
}

impl Pairs {
    /// Builds the pipelines; room for `capacity` pairs.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, capacity: usize) -> Result<Self, GpuError> {
        let [count, test, test_tokens] = sources();
        Ok(Self {
            count: count.kernel(gpu)?,
            test: [test.kernel(gpu)?, test_tokens.kernel(gpu)?],
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
    pub fn record_counts<'a>(
        &mut self,
        recorder: &mut Recorder<'_>,
        cells: impl Into<Entries<'a>>,
    ) -> Result<(), GpuError> {
        let gpu = recorder.gpu();
        let Entries { entries, length: n, .. } = cells.into();
        self.counts.grow(gpu, n.most as usize)?;
        self.sums.grow(gpu, n.most as usize + 1)?;
        recorder.stage("workload");
        let params = LengthParams { most: n.most, word: n.index(), ..Default::default() };
        let arrays = [n.buffer(gpu), &entries.raw, &self.counts.raw];
        recorder.dispatch(&self.count, &params, &arrays, n.most.div_ceil(WORKGROUP));
        self.scan.record(recorder, &self.counts, n, &self.sums)
    }

    /// Records `count` tests from `start` on.
    pub fn record_tests<'a>(
        &self,
        recorder: &mut Recorder<'_>,
        scene: &Scene,
        cells: impl Into<Entries<'a>>,
        start: u64,
        count: u32,
    ) {
        let Entries { entries, length: n, has_tokens } = cells.into();
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
            &entries.raw,
            &scene.bounds.raw,
            &self.found.raw,
            &scene.status.raw,
        ];
        recorder.dispatch(&self.test[usize::from(has_tokens)], &params, &arrays, count.div_ceil(PAIR_BLOCK));
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        self.counts.bytes() + self.sums.bytes() + self.found.bytes()
    }
}
