//! One grid on the device: what it holds, and how a query goes through it.

use super::{Distribution, Duplicates, GridOptions, LAMBDA};
use crate::buffers::Array;
use crate::collision::{CollisionMesh, Contacts, NarrowPhase, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::frame::Frame;
use crate::layout::Entry;
use crate::limits::{PAIR_BLOCK, WORKGROUP, status};
use crate::recorder::{Answer, Recorder};
use crate::seconds::Seconds;
use crate::stages::bounds::Scene;
use crate::stages::cells::{Cells, key_bits};
use crate::stages::pairs::Pairs;
use crate::stages::subdivision::{Subdivision, params};
use crate::tail::{Tail, TailCounts};
use std::sync::Arc;
use std::time::Instant;

/// Most triangle pairs and most candidates of a kind at a time: 64 MiB each.
const MAX_CAPACITY: usize = 1 << 23;
/// Most parts: then the cells are made larger.
const MAX_PARTS: usize = 1 << 24;
/// Tests per triangle in the first portion of the first call.
const FIRST_TESTS: u64 = 64;
/// Most tests per submission where each has a word or two.
const MAX_OWNED_TESTS: u32 = 1 << 24;

/// A scene's grid with its room.
#[derive(Debug)]
pub(super) struct Core {
    gpu: Arc<Gpu>,
    max_capacity: usize,
    max_tests: u32,
    triangle_count: usize,
    scene: Scene,
    subdivision: Option<Subdivision>,
    /// λ, times two for each time that there were too many parts.
    coarseness: f32,
    cells: Cells,
    pairs: Pairs,
    tail: Tail,
    /// Bits by which the keys are sorted and tests of a portion, as the last call had them.
    key_bits: u32,
    portion: u32,
}

/// What a submission counted.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    is_too_fine: bool,
    parts: u64,
    key_bits: u32,
    registrations: usize,
    tests: u64,
    tail: TailCounts,
}

/// What a submission left, to be asked with these copies.
struct Submitted {
    counts: Counts,
    answer: Answer,
    lists: [usize; 2],
}

impl Core {
    pub(super) fn new(gpu: Arc<Gpu>, mesh: &CollisionMesh, options: &GridOptions) -> Result<Self, GpuError> {
        let n = mesh.triangles.len();
        // One invocation per triangle pair.
        let invocations = u64::from(gpu.max_workgroups).pow(2) * u64::from(WORKGROUP);
        let most = Array::<[u32; 2]>::most(&gpu).min(MAX_CAPACITY).min(invocations as usize);
        let max_capacity = options.max_capacity.map_or(most, |m| most.min(m as usize)).max(16);
        let room = |per_triangle: usize| options.first_capacity.map_or(per_triangle * n, |c| c as usize);
        let is_scanned = options.distribution == Distribution::SegmentedScan;
        let per_submission = options.max_tests.unwrap_or(if gpu.is_software() { 1 << 24 } else { 1 << 28 });
        let dispatched = u64::from(gpu.max_workgroups).pow(2) * u64::from(PAIR_BLOCK);
        let owned = MAX_OWNED_TESTS.min(Array::<u32>::most(&gpu) as u32 - 1);
        let max_tests = u64::from(if is_scanned { per_submission.min(owned) } else { per_submission })
            .clamp(1, dispatched) as u32;
        let (mut parts, mut subdivision) = (n, None);
        if options.subdivision.is_some() {
            let most = Array::<[f32; 4]>::most(&gpu);
            parts = options.first_capacity.map_or((2 * n).min(most), |c| c as usize).max(n).max(1);
            subdivision = Some(Subdivision::new(&gpu, n as u32, parts)?);
        }
        let registrations = room(4).min(Array::<Entry>::most(&gpu));
        let mut cells = Cells::new(&gpu, parts as u32, registrations)?;
        cells.sorts_roots = options.duplicates == Duplicates::All;
        let capacity = room(8).clamp(1, max_capacity);
        Ok(Self {
            subdivision,
            coarseness: options.subdivision.unwrap_or(LAMBDA),
            max_capacity,
            max_tests,
            triangle_count: n,
            scene: Scene::new(&gpu, mesh)?,
            cells,
            pairs: Pairs::new(&gpu, capacity, is_scanned)?,
            tail: Tail::new(&gpu, capacity, max_capacity, options.dops, options.device_filter)?,
            key_bits: 24,
            portion: (FIRST_TESTS * n as u64)
                .clamp(u64::from(PAIR_BLOCK).min(max_tests.into()), max_tests.into())
                as u32,
            gpu,
        })
    }

    pub(super) fn bytes(&self) -> u64 {
        self.scene.bytes()
            + self.subdivision.as_ref().map_or(0, Subdivision::bytes)
            + self.cells.bytes()
            + self.pairs.bytes()
            + self.tail.bytes()
    }

    /// Everything up to the tests, unless it is there from the submission before, and `count` tests from `start` on.
    fn submit(
        &mut self,
        frame: &Frame,
        is_fresh: bool,
        start: u64,
        count: u32,
    ) -> Result<Submitted, GpuError> {
        let gpu = self.gpu.clone();
        let mut recorder = Recorder::new(&gpu);
        if is_fresh {
            self.scene.record(&mut recorder);
            let (scene, cells) = (&self.scene, &mut self.cells);
            if let Some(subdivision) = &mut self.subdivision {
                let params = params(scene, frame, cells.room(), self.coarseness);
                subdivision.record(&mut recorder, scene, cells, &params)?;
                let parts = subdivision.registered(self.triangle_count as u32);
                cells.record(&mut recorder, parts, &scene.spheres, self.key_bits)?;
            } else {
                cells.record_setup(&mut recorder, scene);
                cells.record(&mut recorder, scene.registered(), &scene.spheres, self.key_bits)?;
            }
            self.pairs.record_counts(&mut recorder, &self.cells)?;
        } else {
            let first = u64::from(status::TRIANGLE_PAIRS);
            recorder.clear(&self.scene.status, first..u64::from(status::LENGTH));
        }
        self.pairs.record_tests(&mut recorder, &self.scene, &self.cells, start, count)?;
        self.tail.record(&mut recorder, &self.scene, &self.pairs.found);
        let words = recorder.download(&self.scene.status, 0..status::LENGTH as usize);
        let lists = self.tail.download(&mut recorder);
        let room = self.cells.room() as usize;
        let registrations = recorder.download(&self.cells.offsets, room..room + 1);
        let n = self.triangle_count;
        let parts = self.subdivision.as_ref().map(|s| recorder.download(&s.sums, n..n + 1));
        let answer = recorder.run()?;
        let parts = parts.map_or(n as u64, |copy| {
            let [low, high] = answer.read::<[u32; 2]>(copy)[0];
            u64::from(low) | u64::from(high) << 32
        });
        let words = answer.read::<u32>(words);
        let word = |k: u32| words[k as usize];
        let counts = Counts {
            is_too_fine: word(status::TOO_FINE) != 0,
            parts,
            key_bits: key_bits(&words),
            registrations: answer.read::<u32>(registrations)[0] as usize,
            tests: u64::from(word(status::PAIRS)) | u64::from(word(status::PAIRS + 1)) << 32,
            tail: self.tail.counts(&words),
        };
        Ok(Submitted { counts, answer, lists })
    }

    /// Makes room for what the registrations need; true if they have to be done again.
    fn grow_cells(&mut self, counts: &Counts) -> Result<bool, GpuError> {
        let room = self.cells.room() as usize;
        let fits = counts.parts <= room as u64
            && counts.registrations <= self.cells.keys.capacity()
            && counts.key_bits <= self.key_bits;
        if let Some(subdivision) = &mut self.subdivision {
            let most = Array::<[f32; 4]>::most(&self.gpu).min(MAX_PARTS) as u64;
            if counts.is_too_fine || counts.parts > most {
                self.coarseness *= 2.0;
                return Ok(true);
            }
            if counts.parts > room as u64 {
                let wanted = (counts.parts + counts.parts / 4).min(most) as usize;
                subdivision.grow(&self.gpu, wanted)?;
                self.cells.grow(&self.gpu, wanted as u32, 0)?;
                // What was registered was a part of it.
                return Ok(true);
            }
        }
        self.cells.grow(&self.gpu, room as u32, counts.registrations)?;
        self.key_bits = self.key_bits.max(counts.key_bits);
        Ok(!fits)
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
        let (mut candidates, mut left) = ([0u64; 2], [0u64; 2]);
        let (mut registrations, mut parts) = (0, 0);
        let (mut portion, mut portions, mut is_fresh) = (self.portion, 0, true);
        let gpu = self.gpu.clone();
        loop {
            let clock = Instant::now();
            let Submitted { counts, answer, lists } = self.submit(&frame, is_fresh, start, portion)?;
            for &(name, s) in &answer.seconds {
                seconds.add(name, s);
            }
            if is_fresh {
                if self.grow_cells(&counts)? {
                    seconds.add("device", clock.elapsed().as_secs_f64());
                    continue;
                }
                (tests, registrations, parts) = (counts.tests, counts.registrations, counts.parts);
                is_fresh = false;
            }
            if let Some(next) = self.tail.grow(&gpu, &counts.tail, &mut self.pairs.found, portion)? {
                portion = next;
                seconds.add("device", clock.elapsed().as_secs_f64());
                continue;
            }
            let [vertex_triangle, edge_edge] = self.tail.take(&gpu, &counts.tail, &answer, lists)?;
            seconds.add("device", clock.elapsed().as_secs_f64());

            let clock = Instant::now();
            narrow.decide(&vertex_triangle, &edge_edge, pool);
            seconds.add("narrow phase", clock.elapsed().as_secs_f64());
            triangle_pairs += counts.tail.triangle_pairs as u64;
            for k in 0..2 {
                candidates[k] += counts.tail.candidates[k] as u64;
                left[k] += counts.tail.left[k] as u64;
            }
            portions += 1;
            start += u64::from(portion);
            if start >= tests {
                break;
            }
            if 4 * counts.tail.most() < self.max_capacity {
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
        out.stats.counts = vec![
            ("registrations", registrations as u64),
            ("parts", parts),
            ("portions", portions),
            ("left_vertex_triangle", left[0]),
            ("left_edge_edge", left[1]),
        ];
        out.stats.seconds = seconds.0;
        Ok(out)
    }
}
