//! What follows the triangle pairs, whatever found them: features, filter, copies to the host, room.

use crate::buffers::Array;
use crate::context::Gpu;
use crate::error::GpuError;
use crate::limits::{WORKGROUP, status};
use crate::recorder::{Answer, Recorder};
use crate::stages::bounds::Scene;
use crate::stages::features::Features;
use crate::stages::narrow_filter::NarrowFilter;

type Pairs = Array<[u32; 2]>;

/// Triangle pairs in, pairs of features that may be contacts out, a portion at a time.
#[derive(Debug)]
pub struct Tail {
    features: Features,
    filter: Option<NarrowFilter>,
    max_capacity: usize,
    /// Triangle pairs and candidates that are looked at, at most the room for them.
    looked_at: [usize; 3],
    /// Pairs to copy back unasked.
    expected: [usize; 2],
}

/// What a portion came to, though there may be room for less.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TailCounts {
    /// Triangle pairs whose boxes overlap.
    pub triangle_pairs: usize,
    /// Candidates (vertex, triangle) and (edge, edge).
    pub candidates: [usize; 2],
    /// Those that the filter leaves; all without it.
    pub left: [usize; 2],
}

impl TailCounts {
    /// The largest of them.
    pub fn most(&self) -> usize {
        self.candidates.into_iter().fold(self.triangle_pairs, usize::max)
    }
}

impl Tail {
    /// Builds the pipelines; room for `capacity` candidates of each kind, later for at most `max_capacity`. `dops`: features
    /// whose 18-DOPs stay apart are dropped; `filter`: so are those that the narrow filter finds apart.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(
        gpu: &Gpu,
        capacity: usize,
        max_capacity: usize,
        dops: bool,
        filter: bool,
    ) -> Result<Self, GpuError> {
        let capacity = capacity.clamp(1, max_capacity);
        Ok(Self {
            features: Features::new(gpu, capacity, dops)?,
            filter: if filter { Some(NarrowFilter::new(gpu, capacity.div_ceil(8))?) } else { None },
            max_capacity,
            looked_at: [capacity; 3],
            expected: [0; 2],
        })
    }

    fn lists(&self) -> [&Pairs; 2] {
        match &self.filter {
            Some(filter) => filter.left.each_ref(),
            None => [&self.features.vertex_triangle, &self.features.edge_edge],
        }
    }

    /// Records everything for the triangle pairs that the status counts, as far as `found` holds them.
    pub fn record(&self, recorder: &mut Recorder<'_>, scene: &Scene, found: &Pairs) {
        let [pairs, vertex_triangle, edge_edge] = self.looked_at.map(|n| n as u32);
        self.features.record(recorder, scene, found, pairs);
        if let Some(filter) = &self.filter {
            let candidates = [&self.features.vertex_triangle, &self.features.edge_edge];
            filter.record(recorder, scene, candidates, [vertex_triangle, edge_edge]);
        }
    }

    /// Records the copies of what is expected; returns what to ask the answer with.
    pub fn download(&self, recorder: &mut Recorder<'_>) -> [usize; 2] {
        let lists = self.lists();
        [0, 1].map(|k| recorder.download(lists[k], 0..self.expected[k].min(lists[k].capacity())))
    }

    /// The counts in the words of a status.
    pub fn counts(&self, words: &[u32]) -> TailCounts {
        let word = |k: u32| words[k as usize] as usize;
        let candidates = [word(status::VERTEX_TRIANGLE), word(status::EDGE_EDGE)];
        let left = if self.filter.is_some() { [0, 1].map(|k| word(status::LEFT + k)) } else { candidates };
        TailCounts { triangle_pairs: word(status::TRIANGLE_PAIRS), candidates, left }
    }

    /// Makes room for what a portion found, as far as there may be; None if all of it is there, else the size of the portion to
    /// try next.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn grow(
        &mut self,
        gpu: &Gpu,
        counts: &TailCounts,
        found: &mut Pairs,
        portion: u32,
    ) -> Result<Option<u32>, GpuError> {
        let mut next = None;
        let mut again = |size: u32| next = Some(next.map_or(size, |n: u32| n.min(size)));
        let mut needs = vec![
            (found, counts.triangle_pairs),
            (&mut self.features.vertex_triangle, counts.candidates[0]),
            (&mut self.features.edge_edge, counts.candidates[1]),
        ];
        if let Some(filter) = &mut self.filter {
            needs.extend(filter.left.iter_mut().zip(counts.left));
        }
        let mut rooms = vec![];
        for (list, needed) in needs {
            if needed > list.capacity() {
                let room = needed.min(self.max_capacity).max(list.capacity());
                list.grow(gpu, room)?;
                again(if needed > list.capacity() { (portion / 2).max(1) } else { portion });
            }
            rooms.push(list.capacity());
        }
        let counted = [counts.triangle_pairs, counts.candidates[0], counts.candidates[1]];
        for (k, &needed) in counted.iter().enumerate() {
            // More than were looked at, though they are there: once more.
            if needed > self.looked_at[k] && (k == 0 || self.filter.is_some()) {
                again(portion);
            }
            // A quarter more than this time, in case of more next time.
            self.looked_at[k] = (needed + needed / 4 + WORKGROUP as usize).min(rooms[k]);
        }
        Ok(next)
    }

    /// What a portion left: what came unasked, and the rest.
    ///
    /// # Errors
    /// As [`Recorder::run`].
    pub fn take(
        &mut self,
        gpu: &Gpu,
        counts: &TailCounts,
        answer: &Answer,
        copies: [usize; 2],
    ) -> Result<[Vec<[u32; 2]>; 2], GpuError> {
        let wanted = counts.left;
        let mut out = copies.map(|c| answer.read::<[u32; 2]>(c));
        let mut recorder = Recorder::new(gpu);
        let mut rest = [None; 2];
        let lists = self.lists();
        for k in 0..2 {
            if wanted[k] > out[k].len() {
                rest[k] = Some(recorder.download(lists[k], out[k].len()..wanted[k]));
            }
            out[k].truncate(wanted[k]);
        }
        if rest.iter().any(Option::is_some) {
            let answer = recorder.run()?;
            for (list, copy) in out.iter_mut().zip(rest) {
                list.extend(copy.map(|c| answer.read::<[u32; 2]>(c)).unwrap_or_default());
            }
        }
        // An eighth more next time: what comes unasked saves a round trip.
        self.expected = wanted.map(|n| n + n / 8);
        Ok(out)
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        self.features.bytes() + self.filter.as_ref().map_or(0, NarrowFilter::bytes)
    }
}
