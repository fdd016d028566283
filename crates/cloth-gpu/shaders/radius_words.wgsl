// Radii as words, to be added up: units of 2^-20, rounded up.
//   in   spheres[t]  t < n
//   out  words[t]
// Includes: layout.   Twin: src/twin/subdivision.rs
@group(0) @binding(0) var<uniform> params: SceneParams;
@group(0) @binding(1) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> words: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn radius_words(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let t = group_index(group, groups) * WORKGROUP + index;
    if t < params.triangles { words[t] = u32(ceil(spheres[t].w * 1048576.0)); }
}
