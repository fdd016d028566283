//! From elements to a sparse matrix: pattern and slot maps once per topology, values every step.
//!
//! Two phases, both parallel: elements write their couplings and corner forces into arrays of their own; then each row
//! of the matrix, and each vertex, gathers what belongs to it in a fixed order. Nothing is added from two places at a
//! time, so the bits do not depend on the number of threads.
//!
//! The first phase goes model by model and is timed per model. In the second a row takes what all models wrote in one
//! pass: its time has no part per model and counts as assembly.

mod block_csr;
mod clock;
mod elements;
mod gather;
mod pattern;
mod projection;
pub(crate) mod simd;

pub(crate) use block_csr::{BlockMatrix, Lanes};
pub(crate) use clock::{ForceClock, timed};
pub(crate) use elements::{Corners, ElementBuffers, surveyed};
pub(crate) use gather::Assembler;
pub(crate) use pattern::Pattern;
pub(crate) use projection::{Freedom, Projection};

/// Rows of one unit of parallel work: fixed, so that sums do not depend on the number of threads.
pub(crate) const ROWS_PER_CHUNK: usize = 256;
/// Elements of one unit of parallel work.
pub(crate) const ELEMENTS_PER_CHUNK: usize = 512;

/// Runs `f(chunk, part)` for consecutive parts of `data` that end at `end(chunk)`, in parallel, without allocating.
pub(crate) fn for_parts<T: Send>(
    chunks: std::ops::Range<usize>,
    data: &mut [T],
    end: &(impl Fn(usize) -> usize + Sync),
    f: &(impl Fn(usize, &mut [T]) + Sync),
) {
    fn recurse<T: Send>(
        chunks: std::ops::Range<usize>,
        start: usize,
        data: &mut [T],
        end: &(impl Fn(usize) -> usize + Sync),
        f: &(impl Fn(usize, &mut [T]) + Sync),
    ) {
        match chunks.len() {
            0 => {}
            1 => f(chunks.start, data),
            n => {
                let middle = chunks.start + n / 2;
                let split = end(middle - 1);
                let (left, right) = data.split_at_mut(split - start);
                rayon::join(
                    || recurse(chunks.start..middle, start, left, end, f),
                    || recurse(middle..chunks.end, split, right, end, f),
                );
            }
        }
    }
    recurse(chunks, 0, data, end, f);
}
