//! What elements write: corner forces and couplings, in arrays per model.

use std::ops::Range;

use rayon::prelude::*;

use super::{ELEMENTS_PER_CHUNK, ForceClock, timed};
use crate::{
    forces::{Block, CouplingKind, Couplings, ForceModel, Linear, Outer, Psd, corner_pairs},
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
    pub(crate) clock: ForceClock,
}

/// The memory of a range of a model's `count` elements.
pub(crate) fn part(memory: &[f64], count: usize, range: Range<usize>) -> &[f64] {
    let words = memory.len() / count.max(1);
    &memory[words * range.start..words * range.end]
}

/// The memory of each chunk of a model's `count` elements; empty parts for a law without memory.
pub(crate) fn parts_mut(memory: &mut [f64], count: usize) -> Vec<&mut [f64]> {
    if memory.is_empty() {
        return (0..count.div_ceil(ELEMENTS_PER_CHUNK)).map(|_| &mut [][..]).collect();
    }
    memory.chunks_mut(memory.len() / count * ELEMENTS_PER_CHUNK).collect()
}

impl Corners {
    pub(crate) fn new(models: &[Box<dyn ForceModel>]) -> Self {
        Self {
            forces: vec![Vec3::zeros(); models.iter().map(|m| m.vertices().len()).sum()],
            clock: ForceClock::new(models.len()),
        }
    }

    /// Evaluates the forces of all models. Call on the pool.
    pub(crate) fn evaluate(
        &mut self,
        models: &[Box<dyn ForceModel>],
        memory: &[Vec<f64>],
        x: &[Vec3],
        v: &[Vec3],
    ) {
        let mut forces = self.forces.as_mut_slice();
        for ((model, memory), seconds) in models.iter().zip(memory).zip(&mut self.clock.models) {
            let corners = model.corners();
            let mine;
            (mine, forces) = std::mem::take(&mut forces).split_at_mut(model.vertices().len());
            timed(seconds, || {
                mine.par_chunks_mut(ELEMENTS_PER_CHUNK * corners).enumerate().for_each(|(chunk, out)| {
                    let start = chunk * ELEMENTS_PER_CHUNK;
                    let range = start..start + out.len() / corners;
                    model.forces(range.clone(), x, v, part(memory, model.count(), range), out);
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
        memory: &mut [Vec<f64>],
        corners: &mut Corners,
        x: &[Vec3],
        v: &[Vec3],
        linear: &Linear,
    ) {
        let mut forces = corners.forces.as_mut_slice();
        let (mut blocks, mut outer, mut diagonal) =
            (self.blocks.as_mut_slice(), self.outer.as_mut_slice(), self.diagonal.as_mut_slice());
        for ((model, memory), seconds) in models.iter().zip(memory).zip(&mut corners.clock.models) {
            let n = model.corners();
            let f;
            (f, forces) = std::mem::take(&mut forces).split_at_mut(model.vertices().len());
            let memory = parts_mut(memory, model.count());
            let f = f.par_chunks_mut(ELEMENTS_PER_CHUNK * n).enumerate().zip(memory);
            let range = |chunk: usize, f: &[Vec3]| {
                let start = chunk * ELEMENTS_PER_CHUNK;
                start..start + f.len() / n
            };
            timed(seconds, || match model.coupling(linear.psd) {
                CouplingKind::Blocks => {
                    let per_element = corner_pairs(n).len();
                    let mine;
                    (mine, blocks) = std::mem::take(&mut blocks).split_at_mut(model.count() * per_element);
                    f.zip(mine.par_chunks_mut(ELEMENTS_PER_CHUNK * per_element)).for_each(
                        |(((chunk, f), memory), c)| {
                            model.linearise(range(chunk, f), x, v, linear, memory, f, Couplings::Blocks(c));
                        },
                    );
                }
                CouplingKind::Outer => {
                    let mine;
                    (mine, outer) = std::mem::take(&mut outer).split_at_mut(model.count());
                    f.zip(mine.par_chunks_mut(ELEMENTS_PER_CHUNK)).for_each(|(((chunk, f), memory), c)| {
                        model.linearise(range(chunk, f), x, v, linear, memory, f, Couplings::Outer(c));
                    });
                }
                CouplingKind::Diagonal => {
                    let mine;
                    (mine, diagonal) = std::mem::take(&mut diagonal).split_at_mut(model.count());
                    f.zip(mine.par_chunks_mut(ELEMENTS_PER_CHUNK)).for_each(|(((chunk, f), memory), c)| {
                        model.linearise(range(chunk, f), x, v, linear, memory, f, Couplings::Diagonal(c));
                    });
                }
            });
        }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.blocks.as_slice())
            + size_of_val(self.outer.as_slice())
            + size_of_val(self.diagonal.as_slice())
    }
}
