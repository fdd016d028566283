//! What elements write: corner forces and couplings, in arrays per model.

use std::ops::Range;

use rayon::prelude::*;

use super::{ELEMENTS_PER_CHUNK, ForceClock, timed};
use crate::{
    forces::{
        Block, CouplingKind, Couplings, ForceModel, Linear, Outer, Psd, Survey, corner_pairs,
        memory::{Memory, chunks_mut},
    },
    mesh::Vec3,
};

/// Room for the couplings of every element of every model.
pub(crate) struct ElementBuffers {
    pub(crate) blocks: Vec<Block>,
    pub(crate) outer: Vec<Outer>,
    pub(crate) diagonal: Vec<f64>,
}

/// Room for the corner forces of every element of every model, and what their evaluation took.
pub(crate) struct Corners {
    pub(crate) forces: Vec<Vec3>,
    /// Per model what its elements see of each other.
    pub(crate) surveys: Vec<Survey<Vec<f64>>>,
    pub(crate) clock: ForceClock,
}

/// The survey of a model, for the elements of a range.
pub(crate) fn surveyed(survey: &Survey<Vec<f64>>, range: Range<usize>) -> Survey<&[f64]> {
    if survey.work.is_empty() {
        return Survey::default();
    }
    Survey { elastic: &survey.elastic, work: &survey.work[range] }
}

impl Survey<Vec<f64>> {
    /// Room for the elements of a model.
    pub(crate) fn new(model: &dyn ForceModel) -> Self {
        let count = if model.coupled().is_some() { model.count() } else { 0 };
        Self { elastic: vec![0.0; count], work: vec![0.0; count] }
    }

    /// Looks at all elements; nothing for a model whose elements stand alone.
    pub(crate) fn take(&mut self, model: &dyn ForceModel, memory: &Memory, x: &[Vec3]) {
        let count = self.work.len();
        let parts = self.elastic.par_chunks_mut(ELEMENTS_PER_CHUNK);
        parts.zip(self.work.par_chunks_mut(ELEMENTS_PER_CHUNK)).enumerate().for_each(
            |(chunk, (elastic, work))| {
                let start = chunk * ELEMENTS_PER_CHUNK;
                let range = start..start + work.len();
                model.survey(range.clone(), x, memory.part(count, range), Survey { elastic, work });
            },
        );
    }
}

impl Corners {
    pub(crate) fn new(models: &[Box<dyn ForceModel>]) -> Self {
        Self {
            forces: vec![Vec3::zeros(); models.iter().map(|m| m.vertices().len()).sum()],
            surveys: models.iter().map(|m| Survey::new(&**m)).collect(),
            clock: ForceClock::new(models.len()),
        }
    }

    /// Evaluates the forces of all models. Call on the pool.
    pub(crate) fn evaluate(
        &mut self,
        models: &[Box<dyn ForceModel>],
        memory: &[Memory],
        x: &[Vec3],
        v: &[Vec3],
    ) {
        let mut forces = self.forces.as_mut_slice();
        let clocks = self.surveys.iter_mut().zip(&mut self.clock.models);
        for ((model, memory), (survey, seconds)) in models.iter().zip(memory).zip(clocks) {
            let corners = model.corners();
            let mine;
            (mine, forces) = std::mem::take(&mut forces).split_at_mut(model.vertices().len());
            timed(seconds, || {
                survey.take(&**model, memory, x);
                let survey = &*survey;
                mine.par_chunks_mut(ELEMENTS_PER_CHUNK * corners).enumerate().for_each(|(chunk, out)| {
                    let start = chunk * ELEMENTS_PER_CHUNK;
                    let range = start..start + out.len() / corners;
                    let memory = memory.part(model.count(), range.clone());
                    model.forces(range.clone(), x, v, memory, surveyed(survey, range), out);
                });
            });
        }
    }
}

impl ElementBuffers {
    pub(crate) fn new(models: &[Box<dyn ForceModel>], psd: Psd) -> Self {
        let (mut blocks, mut outer, mut diagonal) = (0, 0, 0);
        for model in models {
            match model.coupling(psd) {
                CouplingKind::Blocks => blocks += model.count() * corner_pairs(model.corners()).len(),
                CouplingKind::Outer => outer += model.count(),
                CouplingKind::Diagonal => diagonal += model.count(),
            }
        }
        Self {
            blocks: vec![[0.0; 9]; blocks],
            outer: vec![Outer { gradient: [[0.0; 3]; 4], scale: 0.0 }; outer],
            diagonal: vec![0.0; diagonal],
        }
    }

    /// Evaluates corner forces and couplings of all models. Call on the pool.
    pub(crate) fn linearise(
        &mut self,
        models: &[Box<dyn ForceModel>],
        memory: &mut [Memory],
        corners: &mut Corners,
        x: &[Vec3],
        v: &[Vec3],
        linear: &Linear,
    ) {
        let mut forces = corners.forces.as_mut_slice();
        let (mut blocks, mut outer, mut diagonal) =
            (self.blocks.as_mut_slice(), self.outer.as_mut_slice(), self.diagonal.as_mut_slice());
        let clocks = corners.surveys.iter_mut().zip(&mut corners.clock.models);
        for ((model, memory), (survey, seconds)) in models.iter().zip(memory).zip(clocks) {
            let n = model.corners();
            let f;
            (f, forces) = std::mem::take(&mut forces).split_at_mut(model.vertices().len());
            let kind = model.coupling(linear.psd);
            let mut parts = Parts { blocks: &mut [], outer: &mut [], diagonal: &mut [] };
            match kind {
                CouplingKind::Blocks => {
                    let room = model.count() * corner_pairs(n).len();
                    (parts.blocks, blocks) = std::mem::take(&mut blocks).split_at_mut(room);
                }
                CouplingKind::Outer => {
                    (parts.outer, outer) = std::mem::take(&mut outer).split_at_mut(model.count());
                }
                CouplingKind::Diagonal => {
                    (parts.diagonal, diagonal) = std::mem::take(&mut diagonal).split_at_mut(model.count());
                }
            }
            timed(seconds, || {
                let count = model.count();
                let mut room = memory.room(count);
                let first = memory
                    .chunks_mut(count, &mut room)
                    .into_par_iter()
                    .zip(chunks_mut(&mut survey.elastic, count))
                    .zip(chunks_mut(&mut survey.work, count));
                parts.each(kind, f, n, first, |range, f, ((memory, elastic), work), couplings| {
                    model.linearise(range, x, v, linear, memory, Survey { elastic, work }, f, couplings);
                });
                memory.take(&room);
                if !survey.work.is_empty() {
                    let (memory, survey) = (&*memory, &*survey);
                    parts.each(kind, f, n, chunks(count), |range, f, (), couplings| {
                        let memory = memory.part(count, range.clone());
                        let survey = surveyed(survey, range.clone());
                        model.couple(range, x, v, linear, memory, survey, f, couplings);
                    });
                }
            });
        }
    }

    /// Adds to `out` what the exact stiffness of coupled models makes of the motions `d` beyond what they last wrote, of
    /// models that write outer products.
    pub(crate) fn add_beyond(&self, models: &[Box<dyn ForceModel>], d: &[Vec3], out: &mut [Vec3]) {
        let mut rest = self.outer.as_slice();
        for model in models.iter().filter(|m| m.coupling(Psd::Projected) == CouplingKind::Outer) {
            let mine;
            (mine, rest) = rest.split_at(model.count());
            model.add_beyond(mine, d, out);
        }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.blocks.as_slice())
            + size_of_val(self.outer.as_slice())
            + size_of_val(self.diagonal.as_slice())
    }
}

/// Nothing for each chunk of `count` elements.
fn chunks(count: usize) -> impl IndexedParallelIterator<Item = ()> {
    (0..count.div_ceil(ELEMENTS_PER_CHUNK)).into_par_iter().map(|_| ())
}

/// Room for the couplings of one model: one of the three is not empty.
struct Parts<'a> {
    blocks: &'a mut [Block],
    outer: &'a mut [Outer],
    diagonal: &'a mut [f64],
}

impl Parts<'_> {
    /// Calls `act(range, forces, own, couplings)` for each chunk of elements, `own` what `with` has for the chunk.
    fn each<T: Send>(
        &mut self,
        kind: CouplingKind,
        forces: &mut [Vec3],
        corners: usize,
        with: impl IndexedParallelIterator<Item = T>,
        act: impl Fn(Range<usize>, &mut [Vec3], T, Couplings<'_>) + Sync,
    ) {
        let elements = forces.par_chunks_mut(ELEMENTS_PER_CHUNK * corners).enumerate().zip(with);
        let range = |chunk: usize, f: &[Vec3]| {
            let start = chunk * ELEMENTS_PER_CHUNK;
            start..start + f.len() / corners
        };
        match kind {
            CouplingKind::Blocks => {
                let parts = self.blocks.par_chunks_mut(ELEMENTS_PER_CHUNK * corner_pairs(corners).len());
                elements.zip(parts).for_each(|(((chunk, f), own), c)| {
                    act(range(chunk, f), f, own, Couplings::Blocks(c));
                });
            }
            CouplingKind::Outer => {
                let parts = self.outer.par_chunks_mut(ELEMENTS_PER_CHUNK);
                elements.zip(parts).for_each(|(((chunk, f), own), c)| {
                    act(range(chunk, f), f, own, Couplings::Outer(c));
                });
            }
            CouplingKind::Diagonal => {
                let parts = self.diagonal.par_chunks_mut(ELEMENTS_PER_CHUNK);
                elements.zip(parts).for_each(|(((chunk, f), own), c)| {
                    act(range(chunk, f), f, own, Couplings::Diagonal(c));
                });
            }
        }
    }
}
