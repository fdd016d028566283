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
    owners: Option<Owners>,
    /// Tests that each registration begins.
    pub counts: Array<u32>,
    /// Tests before each registration, (low, high), and their number.
    pub sums: Array<[u32; 2]>,
    /// Triangle pairs that passed, unordered.
    pub found: Array<[u32; 2]>,
}

/// The registration that begins each test, by a scan over the tests.
#[derive(Debug)]
struct Owners {
    mark: Arc<Kernel>,
    scan: Scan<u32>,
    /// How many registrations later each test begins than the one before.
    marks: Array<u32>,
    /// Sums of the marks.
    scanned: Array<u32>,
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

/// The texts of the kernels: count, tests by control bits and by tokens, both by owners, owners.
pub fn sources() -> [Source; 6] {
    let test = |tokens: bool, owners: bool| {
        let duplicates = if tokens {
            include_str!("../../shaders/octree_token.wgsl")
        } else {
            include_str!("../../shaders/control.wgsl")
        };
        Source::new("pairs_test", include_str!("../../shaders/pairs_test.wgsl"))
            .include(include_str!("../../shaders/boxes.wgsl"))
            .include(duplicates)
            .switch("TOKEN", tokens)
            .switch("OWNERS", owners)
    };
    [
        Source::new("pairs_count", include_str!("../../shaders/pairs_count.wgsl")),
        test(false, false),
        test(true, false),
        test(false, true),
        test(true, true),
        Source::new("pairs_owners", include_str!("../../shaders/pairs_owners.wgsl")),
    ]
}

impl Pairs {
    /// Builds the pipelines; room for `capacity` pairs. `by_scan`: tests find the registrations that begin them by a scan over all
    /// tests of a portion, else by binary search.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, capacity: usize, by_scan: bool) -> Result<Self, GpuError> {
        let [count, by_control, by_token, by_control_owners, by_token_owners, mark] = sources();
        let test = if by_scan { [by_control_owners, by_token_owners] } else { [by_control, by_token] };
        let owners = || {
            Ok::<_, GpuError>(Owners {
                mark: mark.kernel(gpu)?,
                scan: Scan::new(gpu)?,
                marks: Array::new(gpu, "steps between owners", 1)?,
                scanned: Array::new(gpu, "owners of the tests", 2)?,
            })
        };
        Ok(Self {
            count: count.kernel(gpu)?,
            test: [test[0].kernel(gpu)?, test[1].kernel(gpu)?],
            scan: Scan::new(gpu)?,
            owners: if by_scan { Some(owners()?) } else { None },
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
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn record_tests<'a>(
        &mut self,
        recorder: &mut Recorder<'_>,
        scene: &Scene,
        cells: impl Into<Entries<'a>>,
        start: u64,
        count: u32,
    ) -> Result<(), GpuError> {
        let gpu = recorder.gpu();
        let Entries { entries, length: n, has_tokens } = cells.into();
        let params = PairParams {
            most: n.most,
            word: n.index(),
            start_low: start as u32,
            start_high: (start >> 32) as u32,
            count,
            ..Default::default()
        };
        if let Some(Owners { mark, scan, marks, scanned }) = &mut self.owners {
            marks.grow(gpu, count as usize)?;
            scanned.grow(gpu, count as usize + 1)?;
            recorder.clear(marks, 0..count.into());
            recorder.stage("owners of tests");
            let arrays = [n.buffer(gpu), &self.sums.raw, &marks.raw];
            recorder.dispatch(mark, &params, &arrays, n.most.div_ceil(WORKGROUP));
            scan.record(recorder, marks, Length::host(count), scanned)?;
        }
        recorder.stage("triangle pairs");
        let mut arrays = vec![
            n.buffer(gpu),
            &self.sums.raw,
            &entries.raw,
            &scene.bounds.raw,
            &self.found.raw,
            &scene.status.raw,
        ];
        arrays.extend(self.owners.iter().map(|owners| &owners.scanned.raw));
        let test = &self.test[usize::from(has_tokens)];
        recorder.dispatch(test, &params, &arrays, count.div_ceil(PAIR_BLOCK));
        Ok(())
    }

    /// Of the tests recorded last: element k ≥ 1 is the registration that begins test k − 1 of them. None: they are searched for.
    pub fn owners(&self) -> Option<&Array<u32>> {
        self.owners.as_ref().map(|owners| &owners.scanned)
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        let owners = self.owners.as_ref().map_or(0, |o| o.marks.bytes() + o.scanned.bytes());
        self.counts.bytes() + self.sums.bytes() + self.found.bytes() + owners
    }
}
