//! One octree on the device: what it holds, and how a query goes through it.

use super::{OctreeCounts, OctreeOptions};
use crate::buffers::Array;
use crate::collision::{CollisionMesh, Contacts, NarrowPhase, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::frame::Frame;
use crate::limits::{MAX_LEVELS, PAIR_BLOCK, TALLY_LENGTH, WORKGROUP, status};
use crate::recorder::{Answer, Recorder};
use crate::stages::bounds::Scene;
use crate::stages::features::Features;
use crate::stages::octree::{
    Levels, Octree, Thresholds, finest, most_registrations, next_levels, page_level,
};
use crate::stages::pairs::Pairs;
use std::sync::Arc;
use std::time::Instant;

/// Most triangle pairs and most candidates of a kind at a time: 64 MiB each.
const MAX_CAPACITY: usize = 1 << 23;
/// Most visits and most registrations: then the tree loses a level.
const MAX_REGISTRATIONS: usize = 1 << 24;
/// Finest level of the first tree (thesis 6.3.2).
const FIRST_LEVELS: u32 = 9;
/// Most pages per triangle in the first tree: small scenes begin with fewer levels.
const FIRST_PAGES: usize = 16;
/// Tests per triangle in the first portion of the first call.
const FIRST_TESTS: u64 = 64;

/// A scene's octree with its room.
#[derive(Debug)]
pub(super) struct Core {
    gpu: Arc<Gpu>,
    max_capacity: usize,
    max_registrations: usize,
    max_tests: u32,
    thresholds: Option<Thresholds>,
    /// Finest base level: as the device binds it, less one for each time that it brought too many registrations.
    finest: u32,
    levels: Levels,
    scene: Scene,
    octree: Octree,
    pairs: Pairs,
    features: Features,
    /// Tests of a portion, and candidates to copy back unasked: as the last call had them.
    portion: u32,
    expected: [usize; 2],
    /// Triangle pairs whose features are looked at, at most the room for them.
    pair_room: usize,
    counted: OctreeCounts,
}

/// What a submission counted.
#[derive(Debug, Clone, Default)]
struct Counts {
    visits: u64,
    registrations: u64,
    tests: u64,
    triangle_pairs: usize,
    vertex_triangle: usize,
    edge_edge: usize,
    tally: Vec<u32>,
}

/// Seconds by stage, in the order of their first appearance.
#[derive(Debug, Default)]
struct Seconds(Vec<(&'static str, f64)>);

impl Seconds {
    fn add(&mut self, name: &'static str, seconds: f64) {
        match self.0.iter_mut().find(|s| s.0 == name) {
            Some(entry) => entry.1 += seconds,
            None => self.0.push((name, seconds)),
        }
    }
}

fn wide([low, high]: [u32; 2]) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

impl Core {
    pub(super) fn new(
        gpu: Arc<Gpu>,
        mesh: &CollisionMesh,
        options: &OctreeOptions,
    ) -> Result<Self, GpuError> {
        let n = mesh.triangles.len();
        // One invocation per triangle pair.
        let invocations = u64::from(gpu.max_workgroups).pow(2) * u64::from(WORKGROUP);
        let most = Array::<[u32; 2]>::most(&gpu).min(MAX_CAPACITY).min(invocations as usize);
        let max_capacity = options.max_capacity.map_or(most, |m| most.min(m as usize)).max(16);
        let max_registrations = most_registrations(&gpu)
            .min(options.max_registrations.map_or(MAX_REGISTRATIONS, |m| m as usize))
            .max(n);
        let room = |per_triangle: usize| options.first_capacity.map_or(per_triangle * n, |c| c as usize);
        let per_submission = options.max_tests.unwrap_or(if gpu.is_software() { 1 << 24 } else { 1 << 28 });
        let dispatched = u64::from(gpu.max_workgroups).pow(2) * u64::from(PAIR_BLOCK);
        let max_tests = u64::from(per_submission).clamp(1, dispatched) as u32;
        let few = |base: &u32| 1usize << (3 * page_level(*base)) <= FIRST_PAGES * n;
        let first = options.levels.unwrap_or((1..=FIRST_LEVELS).rev().find(few).unwrap_or(1));
        let finest = finest(&gpu).min(first.max(FIRST_LEVELS));
        let capacity = room(8).clamp(1, max_capacity);
        let registrations = room(8).min(max_registrations);
        Ok(Self {
            max_capacity,
            max_registrations,
            max_tests,
            thresholds: options.thresholds,
            finest,
            levels: Levels { top: 0, base: first.min(finest) },
            scene: Scene::new(&gpu, mesh)?,
            octree: Octree::new(&gpu, n as u32, registrations, options.two_stage)?,
            pairs: Pairs::new(&gpu, capacity)?,
            features: Features::new(&gpu, capacity)?,
            portion: (FIRST_TESTS * n as u64)
                .clamp(u64::from(PAIR_BLOCK).min(max_tests.into()), max_tests.into())
                as u32,
            expected: [0, 0],
            pair_room: capacity,
            counted: OctreeCounts::default(),
            gpu,
        })
    }

    pub(super) fn levels(&self) -> Levels {
        self.levels
    }

    pub(super) fn counted(&self) -> OctreeCounts {
        self.counted
    }

    pub(super) fn bytes(&self) -> u64 {
        self.scene.bytes() + self.octree.bytes() + self.pairs.bytes() + self.features.bytes()
    }

    /// Everything up to the tests, unless it is there from the submission before, and `count` tests from `start` on.
    fn submit(
        &mut self,
        frame: &Frame,
        is_fresh: bool,
        start: u64,
        count: u32,
    ) -> Result<(Counts, Answer), GpuError> {
        let gpu = self.gpu.clone();
        let mut recorder = Recorder::new(&gpu);
        if is_fresh {
            self.scene.record(&mut recorder);
            self.octree.record(&mut recorder, &self.scene, frame.reach(), self.levels)?;
            self.pairs.record_counts(&mut recorder, self.octree.entries())?;
        } else {
            let first = u64::from(status::TRIANGLE_PAIRS);
            recorder.clear(&self.scene.status, first..u64::from(status::LENGTH));
        }
        self.pairs.record_tests(&mut recorder, &self.scene, self.octree.entries(), start, count);
        self.features.record(&mut recorder, &self.scene, &self.pairs.found, self.pair_room as u32);
        let words = recorder.download(&self.scene.status, 0..status::LENGTH as usize);
        let lists = [&self.features.vertex_triangle, &self.features.edge_edge];
        for (list, expected) in lists.into_iter().zip(self.expected) {
            recorder.download(list, 0..expected.min(list.capacity()));
        }
        let n = self.scene.params.triangles as usize;
        let visits = recorder.download(&self.octree.offsets, n..n + 1);
        let room = self.octree.room() as usize;
        let registrations = recorder.download(&self.octree.sums, room..room + 1);
        let tally = recorder.download(&self.octree.tally, 0..TALLY_LENGTH as usize);
        let answer = recorder.run()?;
        let words: Vec<u32> = answer.read(words);
        let word = |k: u32| words[k as usize];
        let counts = Counts {
            visits: wide(answer.read(visits)[0]),
            registrations: wide(answer.read(registrations)[0]),
            tests: wide([word(status::PAIRS), word(status::PAIRS + 1)]),
            triangle_pairs: word(status::TRIANGLE_PAIRS) as usize,
            vertex_triangle: word(status::VERTEX_TRIANGLE) as usize,
            edge_edge: word(status::EDGE_EDGE) as usize,
            tally: answer.read(tally),
        };
        Ok((counts, answer))
    }

    /// Makes room for what the tree needs, or takes a level off it; true if it has to be done again.
    fn grow_tree(&mut self, counts: &Counts) -> Result<bool, GpuError> {
        let most = self.max_registrations as u64;
        if counts.visits.max(counts.registrations) > most && self.levels.base > 0 {
            self.finest = self.levels.base - 1;
            self.levels = Levels { top: self.levels.top.min(self.finest), base: self.finest };
            return Ok(true);
        }
        let fits = counts.visits <= self.octree.room().into()
            && counts.registrations <= self.octree.keys.capacity() as u64;
        if !fits {
            self.octree.grow(&self.gpu, counts.visits as usize, counts.registrations as usize)?;
        }
        Ok(!fits)
    }

    fn count(&mut self, counts: &Counts) {
        let mut per_level = [0; MAX_LEVELS as usize + 1];
        per_level.copy_from_slice(&counts.tally[..TALLY_LENGTH as usize - 1]);
        self.counted = OctreeCounts {
            levels: [self.levels.top, self.levels.base],
            registrations: counts.registrations,
            leaves: counts.tally[TALLY_LENGTH as usize - 1].into(),
            per_level,
        };
    }

    /// Makes room for what a portion found, as far as there may be; None if all of it is there, else the size of the portion to
    /// try next.
    fn grow_lists(&mut self, counts: &Counts, portion: u32) -> Result<Option<u32>, GpuError> {
        let mut next = None;
        let needs = [
            (&mut self.pairs.found, counts.triangle_pairs),
            (&mut self.features.vertex_triangle, counts.vertex_triangle),
            (&mut self.features.edge_edge, counts.edge_edge),
        ];
        for (list, needed) in needs {
            if needed > list.capacity() {
                let room = needed.min(self.max_capacity).max(list.capacity());
                list.grow(&self.gpu, room)?;
                let smaller = if needed > list.capacity() { (portion / 2).max(1) } else { portion };
                next = Some(next.map_or(smaller, |n: u32| n.min(smaller)));
            }
        }
        // More pairs than were looked at, though they are there: once more.
        if counts.triangle_pairs > self.pair_room {
            next = next.or(Some(portion));
        }
        // A quarter more than this time, in case of more next time.
        let wanted = counts.triangle_pairs + counts.triangle_pairs / 4 + WORKGROUP as usize;
        self.pair_room = wanted.min(self.pairs.found.capacity());
        Ok(next)
    }

    /// The candidates of a portion: what came unasked, and the rest.
    fn candidates(&mut self, counts: &Counts, answer: &Answer) -> Result<[Vec<[u32; 2]>; 2], GpuError> {
        let wanted = [counts.vertex_triangle, counts.edge_edge];
        let mut out = [answer.read::<[u32; 2]>(1), answer.read::<[u32; 2]>(2)];
        let mut recorder = Recorder::new(&self.gpu);
        let mut copies = [None; 2];
        let lists = [&self.features.vertex_triangle, &self.features.edge_edge];
        for k in 0..2 {
            if wanted[k] > out[k].len() {
                copies[k] = Some(recorder.download(lists[k], out[k].len()..wanted[k]));
            }
            out[k].truncate(wanted[k]);
        }
        if copies.iter().any(Option::is_some) {
            let rest = recorder.run()?;
            for (list, copy) in out.iter_mut().zip(copies) {
                list.extend(copy.map(|c| rest.read::<[u32; 2]>(c)).unwrap_or_default());
            }
        }
        // An eighth more next time: what comes unasked saves a round trip.
        self.expected = wanted.map(|n| n + n / 8);
        Ok(out)
    }

    pub(super) fn run(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, GpuError> {
        let begin = Instant::now();
        let mut seconds = Seconds::default();
        let mut narrow = NarrowPhase::new(mesh, query)?;
        let frame = Frame::new(query, pool);
        self.scene.upload(&self.gpu, query, &frame);
        seconds.add("upload", begin.elapsed().as_secs_f64());

        let (mut start, mut tests, mut triangle_pairs) = (0u64, 0u64, 0u64);
        let (mut portion, mut portions, mut is_fresh) = (self.portion, 0, true);
        loop {
            let clock = Instant::now();
            let (counts, answer) = self.submit(&frame, is_fresh, start, portion)?;
            for &(name, s) in &answer.seconds {
                seconds.add(name, s);
            }
            if is_fresh {
                if self.grow_tree(&counts)? {
                    seconds.add("device", clock.elapsed().as_secs_f64());
                    continue;
                }
                tests = counts.tests;
                self.count(&counts);
                is_fresh = false;
            }
            if let Some(next) = self.grow_lists(&counts, portion)? {
                portion = next;
                seconds.add("device", clock.elapsed().as_secs_f64());
                continue;
            }
            let [vertex_triangle, edge_edge] = self.candidates(&counts, &answer)?;
            seconds.add("device", clock.elapsed().as_secs_f64());

            let clock = Instant::now();
            narrow.decide(&vertex_triangle, &edge_edge, pool);
            seconds.add("narrow phase", clock.elapsed().as_secs_f64());
            triangle_pairs += counts.triangle_pairs as u64;
            portions += 1;
            start += u64::from(portion);
            if start >= tests {
                break;
            }
            if 4 * counts.triangle_pairs.max(counts.vertex_triangle).max(counts.edge_edge) < self.max_capacity
            {
                portion = portion.saturating_mul(2).min(self.max_tests);
            }
        }
        if let Some(thresholds) = &self.thresholds {
            self.levels = next_levels(self.levels, &self.counted.per_level, self.finest, thresholds);
        }
        // Next time all at once if that went; an eighth more, as scenes move.
        let all = tests + tests / 8 + 1;
        self.portion = if portions == 1 { all.min(self.max_tests.into()) as u32 } else { portion };

        let clock = Instant::now();
        let mut out = narrow.finish();
        seconds.add("merge", clock.elapsed().as_secs_f64());
        out.stats.broad_phase_tests = tests;
        out.stats.leaf_pairs = triangle_pairs;
        out.stats.seconds = seconds.0;
        Ok(out)
    }
}
