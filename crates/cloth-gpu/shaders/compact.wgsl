// Moves the marked values together, keeping their order.
//   in   flags[i], values[i]  i < n   0 or 1
//        offsets[i]           i < n   exclusive scan of flags
//   out  kept[j]              j < offsets[n]
// Includes: layout.   Twin: src/twin/compact.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> flags: array<u32>;
@group(0) @binding(3) var<storage, read> offsets: array<u32>;
@group(0) @binding(4) var<storage, read> values: array<u32>;
@group(0) @binding(5) var<storage, read_write> kept: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn compact(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = group_index(group, groups) * WORKGROUP + index;
    if i < min(params.most, lengths[params.word]) && flags[i] != 0u { kept[offsets[i]] = values[i]; }
}
