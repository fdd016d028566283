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
