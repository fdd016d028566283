//! The adaptive octree grid (thesis, chapter 6): which triangles are registered in which leaves.
//!
//! The root is the scene's box, level l has 2^l cells along each axis. **Counter tree**: how many triangles meet each cell. **Bottom-up
//! stage**: a cell of n triangles costs n (n − 1) / 2 tests; it is divided if its children cost less, each divided as well as
//! it can be (two-stage) or not at all (single-stage). **Type tree**: which cells are divided. **Top-down stage**: the coarsest cell
//! that is not divided is a leaf and takes all below it. Every triangle is registered in each leaf that its box meets, over the whole
//! step.
//!
//! **Two-stage never costs more than single-stage** for the same levels: by induction from the base its cost of a cell is the least over
//! all ways to divide it, and the single-stage leaves are one of them.
//!
//! **Nothing is lost, nothing tested twice.** Boxes are rounded to ranges of cells of the base level by a function that does not
//! decrease, so ranges of boxes that meet do meet. The leaves hold every cell that any triangle meets once. The token of a pair lies in
//! both ranges, hence in exactly one leaf, where both are registered (`octree_token.wgsl`).
//!
//! **Levels of triangles.** The thesis registers triangles first in all cells of the base level. Here they are registered in pages,
//! cells a few levels above it, and the trees below a page are built in a workgroup's memory. A triangle belongs to every level that
//! has a leaf that it meets, as in the thesis, whatever its size.
//!
//! **Paging.** The thesis's trees of nine levels take 576 MB. Only the levels down to the pages are held as whole trees (2.4 MB for nine
//! levels); of what is below, only 73 bits per page are kept. So all levels up to [`MAX_LEVELS`] fit into a binding of 25 MB; where
//! less can be bound there are fewer levels.
//!
//! Sources: \[wong2014\] chapter 6; \[fan2011\].

mod levels;

use crate::buffers::{Array, Length};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::kernel::{Kernel, Source};
use crate::layout::{Entry, LengthParams, OctreeParams, SceneParams};
use crate::limits::{MAX_LEVELS, PAGE_LEVELS, TALLY_LENGTH, WORKGROUP};
use crate::recorder::Recorder;
use crate::stages::bounds::Scene;
use crate::stages::compact::Compact;
use crate::stages::pairs::Entries;
use crate::stages::scan::Scan;
use crate::stages::sort::Sort;
pub use levels::{Levels, Thresholds, next_levels};
use std::sync::Arc;

/// Most workgroups that share the pages.
const PAGE_GROUPS: u32 = 2048;

/// The octree of a scene and the registrations in its leaves, sorted by leaf.
#[derive(Debug)]
pub struct Octree {
    kernels: [Arc<Kernel>; 10],
    compact: Compact,
    scan: Scan<u32>,
    scan_wide: Scan<[u32; 2]>,
    sort: Sort,
    triangles: u32,
    is_two_stage: bool,
    /// Lowest and highest cell of each triangle.
    pub ranges: Array<[u32; 2]>,
    /// Pages of each triangle.
    pub visits: Array<u32>,
    /// Visits before each triangle, and their number.
    pub offsets: Array<[u32; 2]>,
    /// Triangles per cell of the dense levels.
    pub counts: Array<u32>,
    /// Members before each page.
    pub firsts: Array<u32>,
    /// Members placed in each page.
    pub cursors: Array<u32>,
    /// Triangles of the pages.
    pub members: Array<u32>,
    /// Which pages have trees below them.
    pub flags: Array<u32>,
    numbers: Array<u32>,
    /// How many of them before each page.
    pub selected_before: Array<u32>,
    /// Those that have.
    pub selected: Array<u32>,
    /// Tests per cell of the dense levels.
    pub costs: Array<[u32; 2]>,
    /// Which cells of the pages are divided.
    pub types: Array<u32>,
    /// Which cells of the coarser levels are.
    pub kinds: Array<u32>,
    /// Level of the leaf of each page.
    pub leaves: Array<u32>,
    /// Registrations of each visit.
    pub counted: Array<u32>,
    /// Registrations before each visit, and their number.
    pub sums: Array<[u32; 2]>,
    /// Keys of the registrations, sorted.
    pub keys: Array<u32>,
    /// Triangles of the registrations, and the levels of their leaves.
    pub registered: Array<u32>,
    /// The registrations with what their tests ask first.
    pub entries: Array<Entry>,
    /// Registrations per level, and leaves.
    pub tally: Array<u32>,
}

/// The texts of the kernels, in the order in which they run; the last but two and the last but one differ by a switch.
pub fn sources() -> [Source; 10] {
    let plain = |name, text| Source::new(name, text).include(include_str!("../../../shaders/octree.wgsl"));
    let find = |name, text| plain(name, text).include(include_str!("../../../shaders/octree_find.wgsl"));
    let register = || find("octree_register", include_str!("../../../shaders/octree_register.wgsl"));
    [
        plain("octree_ranges", include_str!("../../../shaders/octree_ranges.wgsl")),
        find("octree_assign", include_str!("../../../shaders/octree_assign.wgsl")),
        find("octree_place", include_str!("../../../shaders/octree_place.wgsl")),
        plain("octree_select", include_str!("../../../shaders/octree_select.wgsl")),
        plain("octree_pages", include_str!("../../../shaders/octree_pages.wgsl")),
        plain("octree_merge", include_str!("../../../shaders/octree_merge.wgsl")),
        plain("octree_descend", include_str!("../../../shaders/octree_descend.wgsl")),
        register(),
        register().switch("WRITE", true),
        plain("octree_gather", include_str!("../../../shaders/octree_gather.wgsl")),
    ]
}

/// Level of the pages of a tree whose finest level is `base`.
pub fn page_level(base: u32) -> u32 {
    base.saturating_sub(PAGE_LEVELS)
}

/// Cells of the levels 0 to `level`.
pub fn nodes(level: u32) -> usize {
    ((8usize << (3 * level)) - 1) / 7
}

/// The finest base level that the device binds and dispatches.
pub fn finest(gpu: &Gpu) -> u32 {
    let workgroups = u64::from(gpu.max_workgroups).pow(2);
    let fits = |page: u32| {
        let pages = 1u64 << (3 * page);
        (12 * pages).max(8 * nodes(page) as u64) <= gpu.max_binding
            && pages.div_ceil(WORKGROUP.into()) <= workgroups
    };
    (0..=MAX_LEVELS).rev().find(|&base| fits(page_level(base))).unwrap_or(0)
}

/// The most visits, and the most registrations.
pub fn most_registrations(gpu: &Gpu) -> usize {
    let workgroups = u64::from(gpu.max_workgroups).pow(2) * u64::from(WORKGROUP);
    Array::<Entry>::most(gpu).min(usize::try_from(workgroups).unwrap_or(usize::MAX))
}

/// What the kernels are told: a root around the boxes of the scene.
pub fn params(
    scene: &SceneParams,
    reach: f32,
    levels: Levels,
    room: u32,
    is_two_stage: bool,
) -> OctreeParams {
    let extents = [0, 1, 2].map(|k| scene.high[k] - scene.low[k] + 2.0 * reach);
    // The root is a cube: cells flatter than the triangles would hold each of them many times.
    let side = extents.iter().fold(0.0f32, |a, &b| a.max(b));
    OctreeParams {
        low: scene.low.map(|x| x - reach),
        triangles: scene.triangles,
        inverse: [(1u32 << levels.base) as f32 / side; 3],
        base: levels.base,
        top: levels.top,
        page: page_level(levels.base),
        room,
        two_stage: is_two_stage.into(),
        ..Default::default()
    }
}

impl Octree {
    /// Builds the pipelines; room for `capacity` visits and registrations.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, triangles: u32, capacity: usize, is_two_stage: bool) -> Result<Self, GpuError> {
        let n = triangles as usize;
        let mut kernels = vec![];
        for source in sources() {
            kernels.push(source.kernel(gpu)?);
        }
        let Ok(kernels) = kernels.try_into() else { unreachable!("as many kernels as texts") };
        Ok(Self {
            kernels,
            compact: Compact::new(gpu)?,
            scan: Scan::new(gpu)?,
            scan_wide: Scan::new(gpu)?,
            sort: Sort::new(gpu)?,
            triangles,
            is_two_stage,
            ranges: Array::new(gpu, "ranges of cells", n)?,
            visits: Array::new(gpu, "pages per triangle", n)?,
            offsets: Array::new(gpu, "first visits", n + 1)?,
            counts: Array::new(gpu, "counter tree", 1)?,
            firsts: Array::new(gpu, "first members", 1)?,
            cursors: Array::new(gpu, "members placed", 1)?,
            members: Array::new(gpu, "members of pages", capacity)?,
            flags: Array::new(gpu, "pages with trees", 1)?,
            numbers: Array::new(gpu, "numbers of pages", 1)?,
            selected_before: Array::new(gpu, "trees before each page", 1)?,
            selected: Array::new(gpu, "selected pages", 1)?,
            costs: Array::new(gpu, "tests per cell", 1)?,
            types: Array::new(gpu, "types within pages", 1)?,
            kinds: Array::new(gpu, "type tree", 1)?,
            leaves: Array::new(gpu, "leaves of pages", 1)?,
            counted: Array::new(gpu, "registrations per visit", capacity)?,
            sums: Array::new(gpu, "first registrations", capacity + 1)?,
            keys: Array::new(gpu, "leaf keys", capacity)?,
            registered: Array::new(gpu, "registered triangles", capacity)?,
            entries: Array::new(gpu, "registrations by leaf", capacity)?,
            tally: Array::new(gpu, "registrations per level", TALLY_LENGTH as usize)?,
        })
    }

    /// Makes room for so many visits and registrations.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn grow(&mut self, gpu: &Gpu, visits: usize, registrations: usize) -> Result<(), GpuError> {
        self.members.grow(gpu, visits)?;
        self.counted.grow(gpu, self.members.capacity())?;
        self.sums.grow(gpu, self.members.capacity() + 1)?;
        for array in [&mut self.keys, &mut self.registered] {
            array.grow(gpu, registrations)?;
        }
        self.entries.grow(gpu, self.keys.capacity())
    }

    /// Visits there is room for.
    pub fn room(&self) -> u32 {
        self.members.capacity() as u32
    }

    /// The registrations.
    pub fn entries(&self) -> Entries<'_> {
        Entries { entries: &self.entries, length: self.length(), has_tokens: true }
    }

    fn length(&self) -> Length<'_> {
        Length::device_wide(self.keys.capacity() as u32, &self.sums, self.room())
    }

    /// Records the tree and the registrations.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        scene: &Scene,
        reach: f32,
        levels: Levels,
    ) -> Result<(), GpuError> {
        let params = params(&scene.params, reach, levels, self.room(), self.is_two_stage);
        self.grow_trees(recorder.gpu(), params.page)?;
        recorder.stage("counter tree");
        self.record_counts(recorder, scene, &params)?;
        recorder.stage("bottom-up");
        self.record_types(recorder, &params)?;
        recorder.stage("registrations");
        self.record_registrations(recorder, &params)?;
        recorder.stage("sort");
        let length = Length::device_wide(self.keys.capacity() as u32, &self.sums, params.room);
        self.sort.record(recorder, &self.keys, &self.registered, length, 3 * params.base + 1)?;
        recorder.clear(&self.tally, 0..u64::from(TALLY_LENGTH));
        recorder.stage("gather");
        let length = self.length();
        let lengths = LengthParams { most: length.most, word: length.index(), shift: params.base, extra: 0 };
        let arrays = [
            length.buffer(recorder.gpu()),
            &self.keys.raw,
            &self.registered.raw,
            &self.ranges.raw,
            &scene.spheres.raw,
            &self.entries.raw,
            &self.tally.raw,
        ];
        recorder.dispatch(&self.kernels[9], &lengths, &arrays, length.most.div_ceil(WORKGROUP));
        Ok(())
    }

    fn grow_trees(&mut self, gpu: &Gpu, page: u32) -> Result<(), GpuError> {
        let pages = 1 << (3 * page);
        for array in [&mut self.counts, &mut self.kinds] {
            array.grow(gpu, nodes(page))?;
        }
        self.costs.grow(gpu, nodes(page))?;
        for array in [&mut self.firsts, &mut self.selected_before] {
            array.grow(gpu, pages + 1)?;
        }
        for array in
            [&mut self.cursors, &mut self.leaves, &mut self.flags, &mut self.numbers, &mut self.selected]
        {
            array.grow(gpu, pages)?;
        }
        self.types.grow(gpu, 3 * pages)
    }

    fn record_counts(
        &mut self,
        recorder: &mut Recorder<'_>,
        scene: &Scene,
        params: &OctreeParams,
    ) -> Result<(), GpuError> {
        let pages = 1u32 << (3 * params.page);
        recorder.clear(&self.counts, 0..nodes(params.page) as u64);
        recorder.clear(&self.cursors, 0..pages.into());
        recorder.stage("counter tree");
        let arrays = [&scene.bounds.raw, &self.ranges.raw, &self.visits.raw];
        recorder.dispatch(&self.kernels[0], params, &arrays, params.triangles.div_ceil(WORKGROUP));
        self.scan_wide.record(recorder, &self.visits, Length::host(self.triangles), &self.offsets)?;
        let groups = params.room.div_ceil(WORKGROUP);
        let arrays = [&self.ranges.raw, &self.offsets.raw, &self.counts.raw];
        recorder.dispatch(&self.kernels[1], params, &arrays, groups);
        self.scan.record(recorder, &self.counts, Length::host(pages), &self.firsts)?;
        let arrays =
            [&self.ranges.raw, &self.offsets.raw, &self.firsts.raw, &self.cursors.raw, &self.members.raw];
        recorder.dispatch(&self.kernels[2], params, &arrays, groups);
        Ok(())
    }

    fn record_types(&mut self, recorder: &mut Recorder<'_>, params: &OctreeParams) -> Result<(), GpuError> {
        let pages = 1u32 << (3 * params.page);
        let arrays = [&self.counts.raw, &self.flags.raw, &self.numbers.raw, &self.costs.raw, &self.types.raw];
        recorder.dispatch(&self.kernels[3], params, &arrays, pages.div_ceil(WORKGROUP));
        let length = Length::host(pages);
        self.compact.record(
            recorder,
            &self.flags,
            &self.numbers,
            length,
            &self.selected_before,
            &self.selected,
        )?;
        let arrays = [
            &self.ranges.raw,
            &self.counts.raw,
            &self.firsts.raw,
            &self.members.raw,
            &self.selected.raw,
            &self.selected_before.raw,
            &self.costs.raw,
            &self.types.raw,
        ];
        let most = recorder.gpu().max_workgroups.saturating_pow(2).min(PAGE_GROUPS);
        recorder.dispatch(&self.kernels[4], params, &arrays, pages.min(most));
        for level in (params.top..params.page).rev() {
            let arrays = [&self.counts.raw, &self.costs.raw, &self.kinds.raw];
            let groups = (1u32 << (3 * level)).div_ceil(WORKGROUP);
            recorder.dispatch(&self.kernels[5], &OctreeParams { level, ..*params }, &arrays, groups);
        }
        recorder.stage("top-down");
        let arrays = [&self.kinds.raw, &self.leaves.raw];
        recorder.dispatch(&self.kernels[6], params, &arrays, pages.div_ceil(WORKGROUP));
        Ok(())
    }

    fn record_registrations(
        &mut self,
        recorder: &mut Recorder<'_>,
        params: &OctreeParams,
    ) -> Result<(), GpuError> {
        let groups = params.room.div_ceil(WORKGROUP);
        let tree = [&self.ranges.raw, &self.offsets.raw, &self.leaves.raw, &self.types.raw];
        let arrays = [&tree[..], &[&self.counted.raw]].concat();
        recorder.dispatch(&self.kernels[7], params, &arrays, groups);
        self.scan_wide.record(recorder, &self.counted, Length::host(params.room), &self.sums)?;
        let tree = [&self.ranges.raw, &self.offsets.raw, &self.leaves.raw, &self.types.raw];
        let arrays = [&tree[..], &[&self.sums.raw, &self.keys.raw, &self.registered.raw]].concat();
        recorder.dispatch(&self.kernels[8], params, &arrays, groups);
        Ok(())
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        let words = [
            &self.visits,
            &self.counts,
            &self.firsts,
            &self.cursors,
            &self.members,
            &self.flags,
            &self.numbers,
            &self.selected_before,
            &self.selected,
            &self.types,
            &self.kinds,
            &self.leaves,
            &self.counted,
            &self.keys,
            &self.registered,
        ];
        let pairs = [&self.ranges, &self.offsets, &self.costs, &self.sums];
        words.map(Array::bytes).iter().sum::<u64>()
            + pairs.map(Array::bytes).iter().sum::<u64>()
            + self.entries.bytes()
    }
}
