//! What the hinges of a range remember, taken one after the other.
//!
//! A hinge that has no history is in the elastic range of its law: it answers as an unused place does.

use crate::{
    bending::{BendingLaw, words},
    forces::memory::Found,
};

/// The places of a range's hinges, asked for in ascending order.
pub(crate) trait Places<L: BendingLaw> {
    /// Place of the hinge `k` of the range; `None` for one without history.
    fn get(&mut self, k: usize) -> Option<L::Memory>;
}

/// As [`Places`], to be moved on.
pub(crate) trait PlacesMut<L: BendingLaw>: Places<L> {
    /// Puts the place of the hinge that was asked for last.
    fn put(&mut self, k: usize, place: L::Memory);
}

/// Every hinge has a place, or its law needs none.
pub(crate) struct All<T>(pub(crate) T);

impl<L: BendingLaw> Places<L> for All<&[L::Memory]> {
    #[inline(always)]
    fn get(&mut self, k: usize) -> Option<L::Memory> {
        Some(if words::<L>() == 0 { L::Memory::default() } else { self.0[k] })
    }
}

impl<L: BendingLaw> Places<L> for All<&mut [L::Memory]> {
    #[inline(always)]
    fn get(&mut self, k: usize) -> Option<L::Memory> {
        Some(if words::<L>() == 0 { L::Memory::default() } else { self.0[k] })
    }
}

impl<L: BendingLaw> PlacesMut<L> for All<&mut [L::Memory]> {
    #[inline(always)]
    fn put(&mut self, k: usize, place: L::Memory) {
        if words::<L>() > 0 {
            self.0[k] = place;
        }
    }
}

/// The hinges `elements` of the model have a place; `first` is the first one of the range.
pub(crate) struct Few<'a, T> {
    first: usize,
    elements: &'a [u32],
    places: T,
    next: usize,
}

impl<'a, T> Few<'a, T> {
    pub(crate) fn new(first: usize, elements: &'a [u32], places: T) -> Self {
        Self { first, elements, places, next: 0 }
    }

    /// Where the place of the hinge `k` of the range stands.
    #[inline(always)]
    fn find(&mut self, k: usize) -> Option<usize> {
        let element = (self.first + k) as u32;
        while self.elements.get(self.next).is_some_and(|e| *e < element) {
            self.next += 1;
        }
        (self.elements.get(self.next) == Some(&element)).then_some(self.next)
    }
}

impl<L: BendingLaw> Places<L> for Few<'_, &[L::Memory]> {
    #[inline(always)]
    fn get(&mut self, k: usize) -> Option<L::Memory> {
        self.find(k).map(|at| self.places[at])
    }
}

/// [`Few`] that grows.
pub(crate) struct Growing<'a, T> {
    pub(crate) few: Few<'a, &'a mut [T]>,
    pub(crate) found: &'a mut Found,
}

impl<L: BendingLaw> Places<L> for Growing<'_, L::Memory> {
    #[inline(always)]
    fn get(&mut self, k: usize) -> Option<L::Memory> {
        self.few.find(k).map(|at| self.few.places[at])
    }
}

impl<L: BendingLaw> PlacesMut<L> for Growing<'_, L::Memory> {
    #[inline(always)]
    fn put(&mut self, k: usize, place: L::Memory) {
        if let Some(at) = self.few.find(k) {
            self.few.places[at] = place;
        } else {
            self.found.elements.push((self.few.first + k) as u32);
            self.found.numbers.extend_from_slice(bytemuck::cast_slice(&[place]));
        }
    }
}
