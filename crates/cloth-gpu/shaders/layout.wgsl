// Structs and functions shared by all kernels. The structs are equal to those of src/layout.rs (tests/layout.rs).

// A kernel over n = min(most, lengths[word]) elements.
struct LengthParams {
    most: u32,
    word: u32,
    // Scan: a level whose elements stand for 2^shift elements each. Sort: lowest bit of the digit.
    shift: u32,
    // Scan: 1 where bases holds what comes before each block. Sort: blocks, the stride of the counts.
    extra: u32,
}

// Number of this workgroup in a dispatch that may be folded to two dimensions.
fn group_index(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.x + group.y * groups.x;
}

// What is asked of the broad phase.
struct SceneParams {
    triangles: u32,
    // Index of the positions at t1: vertices in a moving query, 0 in a resting one, which has one end.
    second: u32,
    all_active: u32,
    // Distance that counts as contact, not less than the exact one.
    thickness: f32,
    // Box of the scene.
    low: vec3<f32>,
    // 1: the distance that counts as contact is exactly 0.
    is_thin: u32,
    high: vec3<f32>,
    pad: u32,
}

struct Grid {
    low: vec3<f32>,
    size: f32,
    cells: vec3<u32>,
    inverse: f32,
}

// Part of the triangle pairs: from start on, count of them.
struct PairParams {
    // Registrations: n = min(most, lengths[word]).
    most: u32,
    word: u32,
    start_low: u32,
    start_high: u32,
    count: u32,
    pad_0: u32,
    pad_1: u32,
    pad_2: u32,
}

// The boxes of a triangle at both ends of the step.
struct Bounds {
    low_0: vec3<f32>,
    is_active: u32,
    high_0: vec3<f32>,
    body: u32,
    low_1: vec3<f32>,
    pad_low: u32,
    high_1: vec3<f32>,
    pad_high: u32,
}

// A registration with what its tests ask first.
struct Entry {
    centre: vec3<f32>,
    radius: f32,
    triangle: u32,
    // See control.wgsl; of an octree the lowest cell of the base level that the triangle meets.
    control: u32,
    // 2 · cell, plus 1 where that is not the home; of an octree 2 · the leaf's lowest cell of the base level.
    key: u32,
    // Of an octree: levels of the leaf above the base | base << 8.
    level: u32,
}

// What is asked of the virtual subdivision.
struct SubdivisionParams {
    triangles: u32,
    // See SceneParams.
    second: u32,
    // Parts there is room for.
    room: u32,
    coarseness: f32,
    low: vec3<f32>,
    least: f32,
    high: vec3<f32>,
    pad: u32,
}

// What is asked of the octree.
struct OctreeParams {
    // Lower corner of the root.
    low: vec3<f32>,
    triangles: u32,
    // Cells of the base level per unit of length.
    inverse: vec3<f32>,
    // Finest level, coarsest level, level of the pages: see octree.wgsl.
    base: u32,
    top: u32,
    page: u32,
    // Visits of triangles to pages there is room for.
    room: u32,
    // 1: two-stage; 0: single-stage.
    two_stage: u32,
    // The level that octree_merge works on.
    level: u32,
    pad_0: u32,
    pad_1: u32,
    pad_2: u32,
}
