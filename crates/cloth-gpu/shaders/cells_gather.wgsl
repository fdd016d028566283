// Puts what the tests ask of a registration in the order of the cells.
//   in   keys, registered [r]  r < n, sorted by key, then by triangle
//        spheres[t]            of whole triangles; controls[k] of what is registered
//        roots[k]              the triangle that k is a part of (VIRTUAL); else k is the triangle
//        marks[r]              exclusive scan of cells_mark (VIRTUAL); else all are kept
//   out  entries[marks[r]]
// Includes: layout.   Twin: src/twin/cells.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read> registered: array<u32>;
@group(0) @binding(4) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> controls: array<u32>;
@group(0) @binding(6) var<storage, read_write> entries: array<Entry>;
//#if VIRTUAL
@group(0) @binding(7) var<storage, read> roots: array<u32>;
@group(0) @binding(8) var<storage, read> marks: array<u32>;
//#end

@compute @workgroup_size(WORKGROUP)
fn cells_gather(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let r = group_index(group, groups) * WORKGROUP + index;
    if r >= min(params.most, lengths[params.word]) { return; }
    let k = registered[r];
    var place = r;
    var t = k;
//#if VIRTUAL
    place = marks[r];
    if marks[r + 1u] == place { return; }
    t = roots[k];
//#end
    let sphere = spheres[t];
    entries[place] = Entry(sphere.xyz, sphere.w, t, controls[k], keys[r], 0u);
}
