//! What the elements of a model remember between steps: a law's numbers, of every element or of those that need them.

use std::ops::Range;

use crate::assembly::ELEMENTS_PER_CHUNK;

/// The memory of all elements of one model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Memory {
    /// Of every element, one after the other; empty for a law without memory.
    Dense(Vec<f64>),
    /// Of the elements that have left the elastic range of their law.
    Sparse(Sparse),
}

/// Elements that remember, ascending, and `words` numbers of each.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Sparse {
    words: usize,
    elements: Vec<u32>,
    numbers: Vec<f64>,
}

/// What a range of elements remembers.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Past<'a> {
    Dense(&'a [f64]),
    /// Elements of the model, ascending, and their numbers.
    Sparse(&'a [u32], &'a [f64]),
}

/// As [`Past`], to be moved on.
pub(crate) enum PastMut<'a> {
    Dense(&'a mut [f64]),
    Sparse { elements: &'a [u32], numbers: &'a mut [f64], found: &'a mut Found },
}

/// Elements of a range that remember from here on, ascending, and their numbers.
#[derive(Debug, Default)]
pub(crate) struct Found {
    pub(crate) elements: Vec<u32>,
    pub(crate) numbers: Vec<f64>,
}

impl Default for Memory {
    /// That of a law without.
    fn default() -> Self {
        Self::Dense(Vec::new())
    }
}

impl Memory {
    /// No element of a law with so many numbers remembers yet.
    pub(crate) fn sparse(words: usize) -> Self {
        Self::Sparse(Sparse { words, ..Sparse::default() })
    }

    /// Whether its law remembers nothing.
    pub(crate) fn is_empty(&self) -> bool {
        matches!(self, Self::Dense(numbers) if numbers.is_empty())
    }

    /// How many elements remember, where that is not all of them; and the bytes that it takes.
    pub(crate) fn needed(&self) -> Option<(usize, usize)> {
        let Self::Sparse(Sparse { elements, numbers, .. }) = self else { return None };
        Some((elements.len(), size_of_val(elements.as_slice()) + size_of_val(numbers.as_slice())))
    }

    /// That of a range of a model's `count` elements.
    pub(crate) fn part(&self, count: usize, range: Range<usize>) -> Past<'_> {
        match self {
            Self::Dense(numbers) => {
                let words = numbers.len() / count.max(1);
                Past::Dense(&numbers[words * range.start..words * range.end])
            }
            Self::Sparse(Sparse { words, elements, numbers }) => {
                let [from, to] = [range.start, range.end].map(|end| position(elements, end));
                Past::Sparse(&elements[from..to], &numbers[words * from..words * to])
            }
        }
    }

    /// Room for what a pass over a model's `count` elements finds, per chunk; none for a dense one. [`Self::take`] takes it.
    pub(crate) fn room(&self, count: usize) -> Vec<Found> {
        match self {
            Self::Dense(_) => Vec::new(),
            Self::Sparse(_) => (0..count.div_ceil(ELEMENTS_PER_CHUNK)).map(|_| Found::default()).collect(),
        }
    }

    /// That of each chunk of a model's `count` elements, with [`Self::room`].
    pub(crate) fn chunks_mut<'a>(&'a mut self, count: usize, room: &'a mut [Found]) -> Vec<PastMut<'a>> {
        match self {
            Self::Dense(numbers) => chunks_mut(numbers, count).into_iter().map(PastMut::Dense).collect(),
            Self::Sparse(Sparse { words, elements, numbers }) => {
                let (mut elements, mut numbers) = (elements.as_slice(), numbers.as_mut_slice());
                let mut list = Vec::with_capacity(room.len());
                for (chunk, found) in room.iter_mut().enumerate() {
                    let n = position(elements, (chunk + 1) * ELEMENTS_PER_CHUNK);
                    let (mine, others) = elements.split_at(n);
                    let (own, rest) = std::mem::take(&mut numbers).split_at_mut(*words * n);
                    list.push(PastMut::Sparse { elements: mine, numbers: own, found });
                    (elements, numbers) = (others, rest);
                }
                list
            }
        }
    }

    /// Puts the elements found among those that remember.
    pub(crate) fn take(&mut self, room: &[Found]) {
        let Self::Sparse(Sparse { words, elements, numbers }) = self else { return };
        if room.iter().all(|found| found.elements.is_empty()) {
            return;
        }
        let (before, past) = (std::mem::take(elements), std::mem::take(numbers));
        let more = room.iter().flat_map(|f| f.elements.iter().zip(f.numbers.chunks_exact(*words)));
        let mut more = more.peekable();
        for (element, own) in before.iter().zip(past.chunks_exact(*words)) {
            while let Some((found, theirs)) = more.next_if(|(found, _)| *found < element) {
                elements.push(*found);
                numbers.extend_from_slice(theirs);
            }
            elements.push(*element);
            numbers.extend_from_slice(own);
        }
        for (found, theirs) in more {
            elements.push(*found);
            numbers.extend_from_slice(theirs);
        }
    }

    /// As plain numbers: the dense ones as they are; of sparse ones how many elements, which, and theirs.
    pub(crate) fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Dense(numbers) => numbers.clone(),
            Self::Sparse(Sparse { elements, numbers, .. }) => std::iter::once(elements.len() as f64)
                .chain(elements.iter().map(|e| f64::from(*e)))
                .chain(numbers.iter().copied())
                .collect(),
        }
    }

    /// Reads what [`Self::numbers`] gave for a model of `count` elements off the front of a list; `None`, and the memory is as it
    /// was, where the list does not begin with that.
    pub(crate) fn read<'a>(&mut self, count: usize, list: &'a [f64]) -> Option<&'a [f64]> {
        match self {
            Self::Dense(own) => {
                let (numbers, rest) = list.split_at_checked(own.len())?;
                own.copy_from_slice(numbers);
                Some(rest)
            }
            Self::Sparse(Sparse { words, elements, numbers }) => {
                let (length, rest) = list.split_first()?;
                let index = |value: f64, end: usize| {
                    (value >= 0.0 && value < end as f64 && value.fract() == 0.0).then_some(value as usize)
                };
                let length = index(*length, count + 1)?;
                let (which, rest) = rest.split_at_checked(length)?;
                let which: Vec<u32> =
                    which.iter().map(|e| index(*e, count).map(|e| e as u32)).collect::<Option<_>>()?;
                if !which.is_sorted_by(|a, b| a < b) {
                    return None;
                }
                let (own, rest) = rest.split_at_checked(*words * length)?;
                (*elements, *numbers) = (which, own.to_vec());
                Some(rest)
            }
        }
    }
}

/// How many of `elements` lie below `end`.
fn position(elements: &[u32], end: usize) -> usize {
    elements.partition_point(|e| (*e as usize) < end)
}

/// Numbers of each chunk of a model's `count` elements; empty parts where there are none.
pub(crate) fn chunks_mut(numbers: &mut [f64], count: usize) -> Vec<&mut [f64]> {
    if numbers.is_empty() {
        return (0..count.div_ceil(ELEMENTS_PER_CHUNK)).map(|_| &mut [][..]).collect();
    }
    numbers.chunks_mut(numbers.len() / count * ELEMENTS_PER_CHUNK).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three chunks.
    const COUNT: usize = 2 * ELEMENTS_PER_CHUNK + 10;

    fn found(elements: &[u32]) -> Found {
        let numbers = elements.iter().flat_map(|e| [f64::from(*e), 0.5]).collect();
        Found { elements: elements.to_vec(), numbers }
    }

    fn memory(rounds: &[[&[u32]; 3]]) -> Memory {
        let mut memory = Memory::sparse(2);
        for round in rounds {
            assert_eq!(memory.room(COUNT).len(), 3);
            memory.take(&round.map(found));
        }
        memory
    }

    #[test]
    fn elements_found_in_turns_stand_in_order() {
        let far = ELEMENTS_PER_CHUNK as u32;
        let turns = memory(&[
            [&[3, 9], &[], &[2 * far + 1]],
            [&[], &[], &[]],
            [&[0, 4, 20], &[far, far + 7], &[2 * far]],
        ]);
        let all = [0, 3, 4, 9, 20, far, far + 7, 2 * far, 2 * far + 1];
        assert_eq!(turns, memory(&[[&all[..5], &all[5..7], &all[7..]]]));
        let Past::Sparse(elements, numbers) = turns.part(COUNT, 4..ELEMENTS_PER_CHUNK) else { panic!() };
        assert_eq!((elements, numbers), (&[4, 9, 20][..], &[4.0, 0.5, 9.0, 0.5, 20.0, 0.5][..]));
        assert_eq!(turns.needed(), Some((9, 9 * (4 + 16))));
        let mut turns = turns;
        let mut room = turns.room(COUNT);
        let parts = turns.chunks_mut(COUNT, &mut room);
        let sizes: Vec<usize> = parts
            .iter()
            .map(|part| match part {
                PastMut::Sparse { elements, numbers, .. } => {
                    assert_eq!(numbers.len(), 2 * elements.len());
                    elements.len()
                }
                PastMut::Dense(_) => panic!("dense"),
            })
            .collect();
        assert_eq!(sizes, [5, 2, 2]);
    }

    #[test]
    fn reads_what_it_writes_and_nothing_else() {
        let written = memory(&[[&[3, 9], &[], &[]]]);
        let mut list = written.numbers();
        assert_eq!(list, [2.0, 3.0, 9.0, 3.0, 0.5, 9.0, 0.5]);
        list.push(77.0);
        let mut read = Memory::sparse(2);
        assert_eq!(read.read(COUNT, &list), Some(&[77.0][..]));
        assert_eq!(read, written);
        for (bad, what) in [
            (vec![], "nothing"),
            (vec![-1.0], "a negative number"),
            (vec![0.5], "half an element"),
            (vec![f64::INFINITY], "too many"),
            (vec![1e300], "too many"),
            (vec![2.0, 9.0, 3.0, 0.0, 0.0, 0.0, 0.0], "out of order"),
            (vec![2.0, 3.0, 3.0, 0.0, 0.0, 0.0, 0.0], "twice"),
            (vec![1.0, COUNT as f64, 0.0, 0.0], "an element that is not there"),
            (vec![1.0, 3.0, 0.0], "cut off"),
        ] {
            assert_eq!(read.read(COUNT, &bad), None, "{what}");
            assert_eq!(read, written, "{what}");
        }
        let mut dense = Memory::Dense(vec![0.0; 4]);
        assert_eq!(dense.read(2, &[1.0, 2.0, 3.0]), None);
        assert_eq!(dense.read(2, &[1.0, 2.0, 3.0, 4.0, 5.0]), Some(&[5.0][..]));
        assert_eq!(dense, Memory::Dense(vec![1.0, 2.0, 3.0, 4.0]));
    }
}
