//! The structs that host and kernels share; `shaders/layout.wgsl` holds the same ones.

use bytemuck::{Pod, Zeroable};

/// A kernel over `n = min(most, lengths[word])` elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct LengthParams {
    /// Elements at most.
    pub most: u32,
    /// Index of the word that bounds them too.
    pub word: u32,
    /// Scan: a level whose elements stand for 2^shift elements each. Sort: lowest bit of the digit.
    pub shift: u32,
    /// Scan: 1 where each block has a base. Sort: number of blocks.
    pub extra: u32,
}
