//! A query's way through the device, whatever registers the triangles: room, portions, and the narrow phase of each.

use crate::buffers::Array;
use crate::collision::{CollisionMesh, Contacts, NarrowPhase, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::frame::Frame;
use crate::limits::{PAIR_BLOCK, WORKGROUP, status};
use crate::recorder::{Answer, Recorder};
use crate::seconds::Seconds;
use crate::stages::bounds::Scene;
use crate::stages::pairs::{Entries, Pairs};
use crate::tail::{Tail, TailCounts};
use std::sync::Arc;
use std::time::Instant;

/// Most triangle pairs and most candidates of a kind at a time: 64 MiB each.
const MAX_CAPACITY: usize = 1 << 23;
/// Most tests per submission where each has a word or two.
const MAX_OWNED_TESTS: u32 = 1 << 24;
/// Tests per triangle in the first portion of the first call.
const FIRST_TESTS: u64 = 64;

/// What registers triangles in cells.
pub(crate) trait Registrar {
    /// Records everything up to the entries.
    fn record(&mut self, recorder: &mut Recorder<'_>, scene: &Scene, frame: &Frame) -> Result<(), GpuError>;

    /// The registrations.
    fn entries(&self) -> Entries<'_>;

    /// Records the copies of what it counted; returns what to ask the answer with.
    fn download(&self, recorder: &mut Recorder<'_>) -> Vec<usize>;

    /// Makes room for what it counted, or registers more coarsely; true if it has to be done again. `words`: the status.
    fn settle(
        &mut self,
        gpu: &Gpu,
        words: &[u32],
        answer: &Answer,
        copies: &[usize],
    ) -> Result<bool, GpuError>;

    /// What it counted, by name.
    fn counts(&self) -> Vec<(&'static str, u64)>;
}

/// How much at a time, and by what means.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PortionOptions {
    pub(crate) first_capacity: Option<u32>,
    pub(crate) max_capacity: Option<u32>,
    pub(crate) max_tests: Option<u32>,
    pub(crate) by_scan: bool,
    pub(crate) dops: bool,
    pub(crate) device_filter: bool,
}

/// The scene, its tests, and what follows them.
#[derive(Debug)]
pub(crate) struct Portions {
    gpu: Arc<Gpu>,
    max_capacity: usize,
    max_tests: u32,
    scene: Scene,
    pairs: Pairs,
    tail: Tail,
    /// Tests of a portion, as the last call had them.
    portion: u32,
}

/// What a submission left, to be asked with these copies.
struct Submitted {
    words: Vec<u32>,
    tail: TailCounts,
    answer: Answer,
    lists: [usize; 2],
    registered: Vec<usize>,
}

impl Portions {
    pub(crate) fn new(
        gpu: Arc<Gpu>,
        mesh: &CollisionMesh,
        options: &PortionOptions,
    ) -> Result<Self, GpuError> {
        let n = mesh.triangles.len();
        // One invocation per triangle pair.
        let invocations = u64::from(gpu.max_workgroups).pow(2) * u64::from(WORKGROUP);
        let most = Array::<[u32; 2]>::most(&gpu).min(MAX_CAPACITY).min(invocations as usize);
        let max_capacity = options.max_capacity.map_or(most, |m| most.min(m as usize)).max(16);
        let per_submission = options.max_tests.unwrap_or(if gpu.is_software() { 1 << 24 } else { 1 << 28 });
        let dispatched = u64::from(gpu.max_workgroups).pow(2) * u64::from(PAIR_BLOCK);
        let owned = MAX_OWNED_TESTS.min(Array::<u32>::most(&gpu) as u32 - 1);
        let max_tests = u64::from(if options.by_scan { per_submission.min(owned) } else { per_submission })
            .clamp(1, dispatched) as u32;
        let capacity = options.first_capacity.map_or(8 * n, |c| c as usize).clamp(1, max_capacity);
        Ok(Self {
            max_capacity,
            max_tests,
            scene: Scene::new(&gpu, mesh)?,
            pairs: Pairs::new(&gpu, capacity, options.by_scan)?,
            tail: Tail::new(&gpu, capacity, max_capacity, options.dops, options.device_filter)?,
            portion: (FIRST_TESTS * n as u64)
                .clamp(u64::from(PAIR_BLOCK).min(max_tests.into()), max_tests.into())
                as u32,
            gpu,
        })
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> u64 {
        self.scene.bytes() + self.pairs.bytes() + self.tail.bytes()
    }

    /// Everything up to the tests, unless it is there from the submission before, and `count` tests from `start` on.
    fn submit(
        &mut self,
        registrar: &mut impl Registrar,
        frame: &Frame,
        is_fresh: bool,
        start: u64,
        count: u32,
    ) -> Result<Submitted, GpuError> {
        let gpu = self.gpu.clone();
        let mut recorder = Recorder::new(&gpu);
        if is_fresh {
            self.scene.record(&mut recorder);
            registrar.record(&mut recorder, &self.scene, frame)?;
            self.pairs.record_counts(&mut recorder, registrar.entries())?;
        } else {
            let first = u64::from(status::TRIANGLE_PAIRS);
            recorder.clear(&self.scene.status, first..u64::from(status::LENGTH));
        }
        self.pairs.record_tests(&mut recorder, &self.scene, registrar.entries(), start, count)?;
        self.tail.record(&mut recorder, &self.scene, &self.pairs.found);
        let words = recorder.download(&self.scene.status, 0..status::LENGTH as usize);
        let lists = self.tail.download(&mut recorder);
        let registered = registrar.download(&mut recorder);
        let answer = recorder.run()?;
        let words = answer.read::<u32>(words);
        Ok(Submitted { tail: self.tail.counts(&words), words, answer, lists, registered })
    }

    /// The contacts of a query that has passed [`Query::check`].
    pub(crate) fn run(
        &mut self,
        registrar: &mut impl Registrar,
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
        let (mut candidates, mut left) = ([0u64; 2], [0u64; 2]);
        let (mut portion, mut portions, mut is_fresh) = (self.portion, 0, true);
        let gpu = self.gpu.clone();
        loop {
            let clock = Instant::now();
            let submitted = self.submit(registrar, &frame, is_fresh, start, portion)?;
            let Submitted { words, tail, answer, lists, registered } = submitted;
            for &(name, s) in &answer.seconds {
                seconds.add(name, s);
            }
            if is_fresh {
                if registrar.settle(&gpu, &words, &answer, &registered)? {
                    seconds.add("device", clock.elapsed().as_secs_f64());
                    continue;
                }
                let [low, high] = [0, 1].map(|k| u64::from(words[(status::PAIRS + k) as usize]));
                tests = low | high << 32;
                is_fresh = false;
            }
            if let Some(next) = self.tail.grow(&gpu, &tail, &mut self.pairs.found, portion)? {
                portion = next;
                seconds.add("device", clock.elapsed().as_secs_f64());
                continue;
            }
            let [vertex_triangle, edge_edge] = self.tail.take(&gpu, &tail, &answer, lists)?;
            seconds.add("device", clock.elapsed().as_secs_f64());

            let clock = Instant::now();
            narrow.decide(&vertex_triangle, &edge_edge, pool);
            seconds.add("narrow phase", clock.elapsed().as_secs_f64());
            triangle_pairs += tail.triangle_pairs as u64;
            for k in 0..2 {
                candidates[k] += tail.candidates[k] as u64;
                left[k] += tail.left[k] as u64;
            }
            portions += 1;
            start += u64::from(portion);
            if start >= tests {
                break;
            }
            if 4 * tail.most() < self.max_capacity {
                portion = portion.saturating_mul(2).min(self.max_tests);
            }
        }
        // Next time all at once if that went; an eighth more, as scenes move.
        let all = tests + tests / 8 + 1;
        self.portion = if portions == 1 { all.min(self.max_tests.into()) as u32 } else { portion };

        let clock = Instant::now();
        let mut out = narrow.finish();
        seconds.add("merge", clock.elapsed().as_secs_f64());
        out.stats.broad_phase_tests = tests;
        out.stats.leaf_pairs = triangle_pairs;
        [out.stats.candidates_vertex_triangle, out.stats.candidates_edge_edge] = candidates;
        out.stats.counts = registrar.counts();
        out.stats.counts.extend([
            ("portions", portions),
            ("left_vertex_triangle", left[0]),
            ("left_edge_edge", left[1]),
        ]);
        out.stats.seconds = seconds.0;
        Ok(out)
    }
}
