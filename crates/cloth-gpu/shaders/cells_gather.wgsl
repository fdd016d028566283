// Puts what the tests ask of a registration in the order of the cells.
//   in   keys, registered [r]  r < n, sorted; spheres[t], controls[t]
//   out  entries[r]
// Includes: layout.   Twin: src/twin/cells.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read> registered: array<u32>;
@group(0) @binding(4) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> controls: array<u32>;
@group(0) @binding(6) var<storage, read_write> entries: array<Entry>;

@compute @workgroup_size(WORKGROUP)
fn cells_gather(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let r = group_index(group, groups) * WORKGROUP + index;
    if r >= min(params.most, lengths[params.word]) { return; }
    let t = registered[r];
    let sphere = spheres[t];
    entries[r] = Entry(sphere.xyz, sphere.w, t, controls[t], keys[r] & 1u, 0u);
}
