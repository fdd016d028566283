//! What the laws of a system remember of the path of their elements.

use std::borrow::Cow;

use rayon::prelude::*;

use super::ClothSystem;
use crate::{
    CoreError, EffectInfo,
    assembly::ELEMENTS_PER_CHUNK,
    bending::HingeState,
    forces::{ForceModel, memory::Memory},
    mesh::Vec3,
};

/// Hinges of one part that remember their path only where they must.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct History {
    /// Name of the law.
    pub law: &'static str,
    /// Hinges that remember.
    pub kept: usize,
    /// All hinges.
    pub hinges: usize,
    /// What their memory takes [B].
    pub bytes: usize,
}

impl ClothSystem {
    /// Hinges of laws with memory remember from here on only once they have left the elastic range: of the plastic law its limit,
    /// below which nothing changes; of hysteresis a curvature up to which the moment is off by at most the share `neglected` of the
    /// frictional moment. Before the first step: what was remembered is gone.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] for a share that is not in (0, 1).
    pub fn remember_beyond(&mut self, neglected: f64) -> Result<(), CoreError> {
        if !(neglected > 0.0 && neglected < 1.0) {
            let (name, expected) = ("history_tolerance", "a number > 0 and < 1");
            return Err(CoreError::Parameter { name, expected, got: neglected });
        }
        for (model, memory) in self.models.iter_mut().zip(&mut self.memory) {
            model.remember_beyond(neglected);
            *memory = model.unused();
        }
        self.apart.as_mut().map_or(Ok(()), |apart| apart.remember_beyond(neglected))
    }

    /// Of laws whose hinges remember only beyond the elastic range: name, how many do as of the start of the last step, of how many,
    /// and the bytes that it takes.
    pub fn histories(&self) -> Vec<History> {
        self.all_models()
            .filter_map(|(model, memory)| {
                let (kept, bytes) = memory.needed()?;
                let EffectInfo { name, elements, .. } = model.info();
                Some(History { law: name, kept, hinges: elements, bytes })
            })
            .collect()
    }

    /// Whether any law remembers the path that led to a state.
    pub fn remembers(&self) -> bool {
        self.all_models().any(|(_, memory)| !memory.is_empty())
    }

    /// What laws with memory remember of the path that ends at the accepted positions `x` [m]: with positions and
    /// velocities, the whole state. Empty where no material asks for memory.
    pub fn memory(&self, x: &[Vec3]) -> Vec<f64> {
        self.memories(x).concat()
    }

    /// [`Self::memory`] of each part whose law remembers, in the order of the parts.
    pub fn memories(&self, x: &[Vec3]) -> Vec<Vec<f64>> {
        let list = self.memory_by_model(x);
        list.into_iter().filter(|memory| !memory.is_empty()).map(|memory| memory.numbers()).collect()
    }

    /// Whose memories [`Self::memories`] lists: the vertices of the elements, one element after the other, and whether only those
    /// remember that must.
    pub fn rememberers(&self) -> Vec<(&[u32], bool)> {
        let list = self.all_models().filter(|(_, memory)| !memory.is_empty());
        list.map(|(model, memory)| (model.vertices(), memory.needed().is_some())).collect()
    }

    /// The memory of each model, moved on to `x` if an accepted motion waits for it.
    pub(super) fn memory_by_model(&self, x: &[Vec3]) -> Vec<Cow<'_, Memory>> {
        let mut list = Vec::new();
        for group in self.groups() {
            for (model, memory) in group.models.iter().zip(&group.memory) {
                let mut memory = Cow::Borrowed(memory);
                if group.moved && !memory.is_empty() {
                    accept(&**model, memory.to_mut(), x);
                }
                list.push(memory);
            }
        }
        list
    }

    /// Each hinge of a law with memory as it stands at the accepted positions `x` [m].
    pub fn hinge_states(&self, x: &[Vec3]) -> Vec<HingeState> {
        let memory = self.memory_by_model(x);
        self.all_models()
            .zip(&memory)
            .flat_map(|((model, _), memory)| model.hinge_states(x, memory))
            .collect()
    }

    /// Puts back what [`Self::memory`] gave.
    ///
    /// # Errors
    /// [`CoreError::Length`], [`CoreError::NotFinite`].
    pub fn set_memory(&mut self, memory: &[f64]) -> Result<(), CoreError> {
        if let Some(index) = memory.iter().position(|m| !m.is_finite()) {
            return Err(CoreError::NotFinite { name: "memory", index, got: memory[index] });
        }
        let mut read: Vec<Memory> = self.all_models().map(|(_, memory)| memory.clone()).collect();
        let mut rest = memory;
        let mut expected = 0;
        for ((model, _), own) in self.all_models().zip(&mut read) {
            let Some(others) = own.read(model.count(), rest) else {
                let expected = expected + own.numbers().len();
                return Err(CoreError::Length { name: "memory", expected, got: memory.len() });
            };
            expected += rest.len() - others.len();
            rest = others;
        }
        if !rest.is_empty() {
            return Err(CoreError::Length { name: "memory", expected, got: memory.len() });
        }
        let Self { memory: own, apart, moved, .. } = self;
        *moved = false;
        let others = apart.iter_mut().flat_map(|apart| {
            apart.moved = false;
            &mut apart.memory
        });
        for (to, from) in own.iter_mut().chain(others).zip(read) {
            *to = from;
        }
        Ok(())
    }

    /// Marks the motion to the positions of the next step's start as done. Laws with memory move on when that step first
    /// looks at them: by [`Self::settle`], or as they are linearised.
    pub(crate) fn accept(&mut self) {
        self.moved = true;
        if let Some(apart) = &mut self.apart {
            apart.moved = true;
        }
    }

    /// Lets laws with memory move on to `x` if an accepted motion waits for it. Call on the pool.
    pub(crate) fn settle(&mut self, x: &[Vec3]) {
        if std::mem::take(&mut self.moved) {
            for (model, memory) in self.models.iter().zip(&mut self.memory).filter(|(_, m)| !m.is_empty()) {
                accept(&**model, memory, x);
            }
        }
        if let Some(apart) = &mut self.apart {
            apart.settle(x);
        }
    }
}

/// Moves the memory of a model on to `x`. Call on the pool, or there is one thread to it.
pub(crate) fn accept(model: &dyn ForceModel, memory: &mut Memory, x: &[Vec3]) {
    let count = model.count();
    let mut room = memory.room(count);
    memory.chunks_mut(count, &mut room).into_par_iter().enumerate().for_each(|(chunk, memory)| {
        let start = chunk * ELEMENTS_PER_CHUNK;
        model.accept(start..(start + ELEMENTS_PER_CHUNK).min(count), x, memory);
    });
    memory.take(&room);
}
