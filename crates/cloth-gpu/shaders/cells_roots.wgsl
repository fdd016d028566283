// The triangle that each registered part belongs to.
//   in   registered[r]  r < n; roots[k]
//   out  out_roots[r]
// Includes: layout.   Twin: src/twin/subdivision.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> registered: array<u32>;
@group(0) @binding(3) var<storage, read> roots: array<u32>;
@group(0) @binding(4) var<storage, read_write> out_roots: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn cells_roots(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let r = group_index(group, groups) * WORKGROUP + index;
    if r >= min(params.most, lengths[params.word]) { return; }
    out_roots[r] = roots[registered[r]];
}
