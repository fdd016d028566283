//! One octree on the device: what it holds, and how triangles are registered in it.

use super::OctreeOptions;
use crate::collision::{CollisionMesh, Contacts, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::frame::Frame;
use crate::limits::{MAX_LEVELS, TALLY_LENGTH};
use crate::portions::{PortionOptions, Portions, Registrar};
use crate::recorder::{Answer, Recorder};
use crate::stages::bounds::Scene;
use crate::stages::octree::{
    Levels, Octree, Thresholds, finest, most_registrations, next_levels, page_level,
};
use crate::stages::pairs::Entries;
use crate::topology::OnDevice;
use std::sync::Arc;

/// Most visits and most registrations: then the tree loses a level.
const MAX_REGISTRATIONS: usize = 1 << 24;
/// Finest level of the first tree (thesis 6.3.2).
const FIRST_LEVELS: u32 = 9;
/// Most pages per triangle in the first tree: small scenes begin with fewer levels.
const FIRST_PAGES: usize = 16;
/// Visits and registrations per triangle that there is room for at first.
const PER_TRIANGLE: usize = 8;
/// Names of the registrations by level, the root first.
const BY_LEVEL: [&str; MAX_LEVELS as usize + 1] = [
    "registrations_level_0",
    "registrations_level_1",
    "registrations_level_2",
    "registrations_level_3",
    "registrations_level_4",
    "registrations_level_5",
    "registrations_level_6",
    "registrations_level_7",
    "registrations_level_8",
    "registrations_level_9",
    "registrations_level_10",
];

/// A scene's octree with its room.
#[derive(Debug)]
pub(super) struct Core {
    portions: Portions,
    tree: Tree,
}

#[derive(Debug)]
struct Tree {
    octree: Octree,
    triangle_count: usize,
    max_registrations: usize,
    thresholds: Option<Thresholds>,
    /// Finest base level: as the device binds it, or coarser if that brought too many registrations.
    finest: u32,
    levels: Levels,
    /// Registrations per level, then leaves.
    tally: Vec<u32>,
}

impl Core {
    /// Levels of the next tree.
    pub(super) fn levels(&self) -> Levels {
        self.tree.levels
    }

    /// Registrations per level, as the last tree had them.
    fn per_level(&self) -> &[u32] {
        &self.tree.tally[..TALLY_LENGTH as usize - 1]
    }
}

impl OnDevice for Core {
    type Options = OctreeOptions;

    fn new(gpu: Arc<Gpu>, mesh: &CollisionMesh, options: &OctreeOptions) -> Result<Self, GpuError> {
        let n = mesh.triangles.len();
        let most = options.max_registrations.map_or(MAX_REGISTRATIONS, |m| m as usize);
        let max_registrations = most_registrations(&gpu).min(most);
        let few = |base: &u32| 1usize << (3 * page_level(*base)) <= FIRST_PAGES * n;
        let first = options.levels.unwrap_or((1..=FIRST_LEVELS).rev().find(few).unwrap_or(1));
        let finest = finest(&gpu).min(first.max(FIRST_LEVELS));
        let room = options.first_capacity.map_or(PER_TRIANGLE * n, |c| c as usize).min(max_registrations);
        let portions = PortionOptions {
            first_capacity: options.first_capacity,
            max_capacity: options.max_capacity,
            max_tests: options.max_tests,
            by_scan: false,
            dops: true,
            device_filter: true,
        };
        Ok(Self {
            tree: Tree {
                octree: Octree::new(&gpu, n as u32, room, options.two_stage)?,
                triangle_count: n,
                max_registrations,
                thresholds: options.thresholds,
                finest,
                levels: Levels { top: 0, base: first.min(finest) },
                tally: vec![0; TALLY_LENGTH as usize],
            },
            portions: Portions::new(gpu, mesh, &portions)?,
        })
    }

    fn bytes(&self) -> u64 {
        self.portions.bytes() + self.tree.octree.bytes()
    }

    fn counts(&self) -> Vec<(&'static str, u64)> {
        self.tree.counts()
    }

    fn run(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, GpuError> {
        let contacts = self.portions.run(&mut self.tree, mesh, query, pool)?;
        if let Some(thresholds) = &self.tree.thresholds {
            self.tree.levels = next_levels(self.tree.levels, self.per_level(), self.tree.finest, thresholds);
        }
        Ok(contacts)
    }
}

fn wide([low, high]: [u32; 2]) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

impl Registrar for Tree {
    fn record(&mut self, recorder: &mut Recorder<'_>, scene: &Scene, frame: &Frame) -> Result<(), GpuError> {
        self.octree.record(recorder, scene, frame.reach(), self.levels)
    }

    fn entries(&self) -> Entries<'_> {
        self.octree.entries()
    }

    fn download(&self, recorder: &mut Recorder<'_>) -> Vec<usize> {
        let (n, room) = (self.triangle_count, self.octree.room() as usize);
        vec![
            recorder.download(&self.octree.offsets, n..n + 1),
            recorder.download(&self.octree.sums, room..room + 1),
            recorder.download(&self.octree.tally, 0..TALLY_LENGTH as usize),
        ]
    }

    fn settle(&mut self, gpu: &Gpu, _: &[u32], answer: &Answer, copies: &[usize]) -> Result<bool, GpuError> {
        let [visits, registrations] = [0, 1].map(|k| wide(answer.read(copies[k])[0]));
        self.tally = answer.read(copies[2]);
        // At the root alone every triangle is registered once: what is too much there is too much for the device.
        if visits.max(registrations) > self.max_registrations as u64 && self.levels.base > 0 {
            self.finest = self.levels.base - 1;
            self.levels = Levels { top: self.levels.top.min(self.finest), base: self.finest };
            return Ok(true);
        }
        let fits = visits <= self.octree.room().into() && registrations <= self.octree.keys.capacity() as u64;
        if !fits {
            self.octree.grow(gpu, visits as usize, registrations as usize)?;
        }
        Ok(!fits)
    }

    fn counts(&self) -> Vec<(&'static str, u64)> {
        let (levels, leaves) = self.tally.split_at(TALLY_LENGTH as usize - 1);
        let levels = levels.iter().map(|&n| u64::from(n));
        let mut counts = vec![
            ("registrations", levels.clone().sum()),
            ("leaves", leaves[0].into()),
            ("coarsest_level", self.levels.top.into()),
            ("finest_level", self.levels.base.into()),
        ];
        counts.extend(BY_LEVEL.into_iter().zip(levels));
        counts
    }
}
