// How often each digit occurs in each block of SORT_BLOCK keys.
//   in   keys[i]                 i < n           the word that holds the digit
//   out  counts[d · blocks + b]  d < RADIX, b < blocks = params.extra
// Includes: layout.   Twin: src/twin/sort.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

var<workgroup> sh_counts: array<atomic<u32>, RADIX>;

@compute @workgroup_size(WORKGROUP)
fn radix_count(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let block = group_index(group, groups);
    let n = min(params.most, lengths[params.word]);
    if index < RADIX { atomicStore(&sh_counts[index], 0u); }
    workgroupBarrier();
    for (var k = 0u; k < SORT_ITEMS; k++) {
        let i = block * SORT_BLOCK + k * WORKGROUP + index;
        if i < n { atomicAdd(&sh_counts[(keys[i] >> params.shift) & (RADIX - 1u)], 1u); }
    }
    workgroupBarrier();
    if index < RADIX && block < params.extra {
        counts[index * params.extra + block] = atomicLoad(&sh_counts[index]);
    }
}
