//! The methods "grid", the traditional uniform grid with control bits (thesis 3.3.1), and "virtual-subdivision" (thesis 5.3), both
//! with the workload distribution of 5.3.4.

use crate::buffers::Array;
use crate::collision::{CollisionMesh, Contacts, DetectError, Detector, NarrowPhase, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::frame::Frame;
use crate::limits::{PAIR_BLOCK, WORKGROUP, status};
use crate::recorder::{Answer, Recorder};
use crate::stages::bounds::Scene;
use crate::stages::cells::{Cells, key_bits};
use crate::stages::features::Features;
use crate::stages::pairs::Pairs;
use crate::stages::subdivision::{Subdivision, params};
use std::sync::Arc;
use std::time::Instant;

/// Room and portions; the contacts never depend on them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GridOptions {
    /// λ of the virtual subdivision, 1.1 to 1.3 in the thesis (Eq. 5.1): cells are 3 λ times the average radius, and larger triangles are
    /// registered in parts. None: cells are 3 times the largest radius, and triangles stay whole.
    pub subdivision: Option<f32>,
    /// Room for parts, registrations, triangle pairs and candidates at first. None: by the number of triangles.
    pub first_capacity: Option<u32>,
    /// Most triangle pairs and most candidates of a kind at a time. None: 2^23, or what one binding holds.
    pub max_capacity: Option<u32>,
    /// Most tests per submission, at least 1. None: 2^24 on a software adapter, else 2^28.
    pub max_tests: Option<u32>,
}

/// Most triangle pairs and most candidates of a kind at a time: 64 MiB each.
const MAX_CAPACITY: usize = 1 << 23;

/// Most parts: then the cells are made larger.
const MAX_PARTS: usize = 1 << 24;
/// λ that the thesis settles on.
const LAMBDA: f32 = 1.2;
/// Least and most λ: beyond, cells hold nothing or everything.
const LAMBDAS: [f32; 2] = [0.1, 100.0];
/// Tests per triangle in the first portion of the first call.
const FIRST_TESTS: u64 = 64;

/// Detects contacts with a uniform grid on the device; [`Detector::name`] is `"grid"` or `"virtual-subdivision"`.
///
/// The device finds candidates; [`NarrowPhase`] decides them. What overflows is grown and done again; what is too much for
/// one portion is taken in several, which are decided as they come and not kept.
#[derive(Debug)]
pub struct GridGpu {
    gpu: Arc<Gpu>,
    max_capacity: usize,
    max_tests: u32,
    vertex_count: usize,
    triangle_count: usize,
    scene: Scene,
    subdivision: Option<Subdivision>,
    /// λ, times two for each time that there were too many parts.
    coarseness: f32,
    cells: Cells,
    pairs: Pairs,
    features: Features,
    /// Bits by which the keys are sorted, tests of a portion, and candidates to copy back unasked: as the last call had them.
    key_bits: u32,
    portion: u32,
    expected: [usize; 2],
    /// Triangle pairs whose features are looked at, at most the room for them.
    pair_room: usize,
    registrations: u64,
    parts: u64,
}

/// What a submission counted.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    is_too_fine: bool,
    parts: u64,
    key_bits: u32,
    registrations: usize,
    tests: u64,
    triangle_pairs: usize,
    vertex_triangle: usize,
    edge_edge: usize,
}

impl Counts {
    fn new(words: &[u32], registrations: usize, parts: u64) -> Self {
        let word = |k: u32| words[k as usize];
        Self {
            is_too_fine: word(status::TOO_FINE) != 0,
            parts,
            key_bits: key_bits(words),
            registrations,
            tests: u64::from(word(status::PAIRS)) | u64::from(word(status::PAIRS + 1)) << 32,
            triangle_pairs: word(status::TRIANGLE_PAIRS) as usize,
            vertex_triangle: word(status::VERTEX_TRIANGLE) as usize,
            edge_edge: word(status::EDGE_EDGE) as usize,
        }
    }
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

impl GridGpu {
    /// Writes the topology to the device.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`], [`GpuError::Shader`].
    pub fn new(gpu: Arc<Gpu>, mesh: &CollisionMesh) -> Result<Self, GpuError> {
        Self::with_options(gpu, mesh, GridOptions::default())
    }

    /// Virtual subdivision with the thesis's λ = 1.2.
    ///
    /// # Errors
    /// As [`GridGpu::new`].
    pub fn virtual_subdivision(gpu: Arc<Gpu>, mesh: &CollisionMesh) -> Result<Self, GpuError> {
        let options = GridOptions { subdivision: Some(LAMBDA), ..GridOptions::default() };
        Self::with_options(gpu, mesh, options)
    }

    /// [`GridGpu::new`] with other room and portions.
    ///
    /// # Errors
    /// As [`GridGpu::new`]; [`GpuError::Query`] for a λ outside 0.1 to 100.
    pub fn with_options(gpu: Arc<Gpu>, mesh: &CollisionMesh, options: GridOptions) -> Result<Self, GpuError> {
        let n = mesh.triangles.len();
        // One invocation per triangle pair.
        let invocations = u64::from(gpu.max_workgroups).pow(2) * u64::from(WORKGROUP);
        let most = Array::<[u32; 2]>::most(&gpu).min(MAX_CAPACITY).min(invocations as usize);
        let max_capacity = options.max_capacity.map_or(most, |m| most.min(m as usize)).max(16);
        let room = |per_triangle: usize| options.first_capacity.map_or(per_triangle * n, |c| c as usize);
        let per_submission = options.max_tests.unwrap_or(if gpu.is_software() { 1 << 24 } else { 1 << 28 });
        let dispatched = u64::from(gpu.max_workgroups).pow(2) * u64::from(PAIR_BLOCK);
        let max_tests = u64::from(per_submission).clamp(1, dispatched) as u32;
        let lambda = options.subdivision.unwrap_or(LAMBDA);
        if !(LAMBDAS[0]..=LAMBDAS[1]).contains(&lambda) {
            return Err(GpuError::Query(DetectError::Parameter {
                parameter: "subdivision",
                expected: "λ from 0.1 to 100",
                got: lambda.into(),
            }));
        }
        let (mut parts, mut subdivision) = (n, None);
        if options.subdivision.is_some() {
            parts = options.first_capacity.map_or(2 * n, |c| c as usize).max(n).max(1);
            subdivision = Some(Subdivision::new(&gpu, n as u32, parts)?);
        }
        Ok(Self {
            subdivision,
            coarseness: lambda,
            max_capacity,
            max_tests,
            vertex_count: mesh.vertex_count,
            triangle_count: n,
            scene: Scene::new(&gpu, mesh)?,
            cells: Cells::new(&gpu, parts as u32, room(4))?,
            pairs: Pairs::new(&gpu, room(8).min(max_capacity))?,
            features: Features::new(&gpu, room(8).min(max_capacity))?,
            key_bits: 24,
            portion: (FIRST_TESTS * n as u64)
                .clamp(u64::from(PAIR_BLOCK).min(max_tests.into()), max_tests.into())
                as u32,
            expected: [0, 0],
            pair_room: room(8).clamp(1, max_capacity),
            registrations: 0,
            parts: 0,
            gpu,
        })
    }

    /// Registrations of triangles in cells in the last call.
    pub fn registrations(&self) -> u64 {
        self.registrations
    }

    /// Parts that triangles were registered in, in the last call: at least as many as triangles.
    pub fn parts(&self) -> u64 {
        self.parts
    }

    /// Memory on the device, scratch memory of sorts and scans not counted [B].
    pub fn bytes(&self) -> u64 {
        self.scene.bytes()
            + self.subdivision.as_ref().map_or(0, Subdivision::bytes)
            + self.cells.bytes()
            + self.pairs.bytes()
            + self.features.bytes()
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
        self.pairs.record_tests(&mut recorder, &self.scene, &self.cells, start, count);
        self.features.record(&mut recorder, &self.scene, &self.pairs.found, self.pair_room as u32);
        let words = recorder.download(&self.scene.status, 0..status::LENGTH as usize);
        let lists = [&self.features.vertex_triangle, &self.features.edge_edge];
        for (list, expected) in lists.into_iter().zip(self.expected) {
            recorder.download(list, 0..expected.min(list.capacity()));
        }
        let room = self.cells.room() as usize;
        let registrations = recorder.download(&self.cells.offsets, room..room + 1);
        let n = self.triangle_count;
        let parts = self.subdivision.as_ref().map(|s| recorder.download(&s.sums, n..n + 1));
        let answer = recorder.run()?;
        let registrations = answer.read::<u32>(registrations)[0] as usize;
        let parts = parts.map_or(n as u64, |copy| {
            let [low, high] = answer.read::<[u32; 2]>(copy)[0];
            u64::from(low) | u64::from(high) << 32
        });
        Ok((Counts::new(&answer.read::<u32>(words), registrations, parts), answer))
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

    fn run(
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
                if self.grow_cells(&counts)? {
                    seconds.add("device", clock.elapsed().as_secs_f64());
                    continue;
                }
                tests = counts.tests;
                self.registrations = counts.registrations as u64;
                self.parts = counts.parts;
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

impl Detector for GridGpu {
    fn name(&self) -> &'static str {
        if self.subdivision.is_some() { "virtual-subdivision" } else { "grid" }
    }

    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        query.check(mesh)?;
        if mesh.triangles.len() != self.triangle_count || mesh.vertex_count != self.vertex_count {
            return Err(DetectError::OtherMesh { expected: self.triangle_count, got: mesh.triangles.len() });
        }
        if mesh.triangles.is_empty() {
            return Ok(Contacts::default());
        }
        let detector = self.name();
        self.run(mesh, query, pool).map_err(|error| match error {
            GpuError::Query(error) => error,
            error => DetectError::Device { detector, reason: error.to_string() },
        })
    }
}
