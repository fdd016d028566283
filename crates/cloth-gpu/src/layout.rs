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

/// What is asked of the broad phase.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct SceneParams {
    /// Number of triangles.
    pub triangles: u32,
    /// Index of the positions at t1: vertices in a moving query, 0 in a resting one, which has one end.
    pub second: u32,
    /// 1: every vertex is active.
    pub all_active: u32,
    /// Distance that counts as contact, not less than the exact one.
    pub thickness: f32,
    /// Lower corner of the scene's box.
    pub low: [f32; 3],
    /// 1: the distance that counts as contact is exactly 0.
    pub is_thin: u32,
    /// Upper corner.
    pub high: [f32; 3],
    /// Unused.
    pub pad: u32,
}

/// The cells.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Grid {
    /// Lower corner.
    pub low: [f32; 3],
    /// Edge length of a cell.
    pub size: f32,
    /// Cells along each axis.
    pub cells: [u32; 3],
    /// 1 / size.
    pub inverse: f32,
}

/// Part of the triangle pairs: from `start` on, `count` of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct PairParams {
    /// Registrations at most.
    pub most: u32,
    /// Index of the word that bounds them too.
    pub word: u32,
    /// First pair, low word.
    pub start_low: u32,
    /// First pair, high word.
    pub start_high: u32,
    /// Number of pairs.
    pub count: u32,
    /// Unused.
    pub pad_0: u32,
    /// Unused.
    pub pad_1: u32,
    /// Unused.
    pub pad_2: u32,
}

/// The boxes of a triangle at both ends of the step.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Bounds {
    /// Lower corner at t0.
    pub low_0: [f32; 3],
    /// 1: one of its vertices is active.
    pub is_active: u32,
    /// Upper corner at t0.
    pub high_0: [f32; 3],
    /// Body << 2 | dynamic << 1 | self-colliding.
    pub body: u32,
    /// Lower corner at t1.
    pub low_1: [f32; 3],
    /// Unused.
    pub pad_low: u32,
    /// Upper corner at t1.
    pub high_1: [f32; 3],
    /// Unused.
    pub pad_high: u32,
}

/// A registration with what its tests ask first.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Entry {
    /// Centre of the triangle's sphere.
    pub centre: [f32; 3],
    /// Its radius.
    pub radius: f32,
    /// The triangle.
    pub triangle: u32,
    /// Its control bits: see `control.wgsl`; of an octree the lowest cell of the base level that the triangle meets.
    pub control: u32,
    /// 2 · cell, plus 1 where that is not the home; of an octree 2 · the leaf's lowest cell of the base level.
    pub key: u32,
    /// Of an octree: levels of the leaf above the base | base << 8.
    pub level: u32,
}

/// What is asked of the virtual subdivision.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct SubdivisionParams {
    /// Number of triangles.
    pub triangles: u32,
    /// See [`SceneParams`].
    pub second: u32,
    /// Parts there is room for.
    pub room: u32,
    /// λ, times two for each time that the parts were too many.
    pub coarseness: f32,
    /// Lower corner of the scene's box.
    pub low: [f32; 3],
    /// What no subdivision gets a radius below.
    pub least: f32,
    /// Upper corner.
    pub high: [f32; 3],
    /// Unused.
    pub pad: u32,
}

/// What is asked of the octree.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct OctreeParams {
    /// Lower corner of the root.
    pub low: [f32; 3],
    /// Number of triangles.
    pub triangles: u32,
    /// Cells of the base level per unit of length.
    pub inverse: [f32; 3],
    /// Finest level.
    pub base: u32,
    /// Coarsest level.
    pub top: u32,
    /// Level of the pages: see `octree.wgsl`.
    pub page: u32,
    /// Visits of triangles to pages there is room for.
    pub room: u32,
    /// 1: two-stage; 0: single-stage.
    pub two_stage: u32,
    /// The level that `octree_merge` works on.
    pub level: u32,
    /// Unused.
    pub pad_0: u32,
    /// Unused.
    pub pad_1: u32,
    /// Unused.
    pub pad_2: u32,
}
