// The cells of the base level that each triangle's box meets over the whole step, and how many pages that are.
//   in   bounds[t]  t < n
//   out  ranges[t]  lowest and highest cell, ten bits per axis
//        counts[t]  pages
// The place of a coordinate does not decrease with it: of two boxes that meet, so do the ranges, along each axis.
// Includes: layout, octree.   Twin: src/twin/octree.rs
@group(0) @binding(0) var<uniform> params: OctreeParams;
@group(0) @binding(1) var<storage, read> bounds: array<Bounds>;
@group(0) @binding(2) var<storage, read_write> ranges: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

fn place_of(x: vec3<f32>) -> vec3<u32> {
    let last = f32((1u << params.base) - 1u);
    return vec3<u32>(clamp(floor((x - params.low) * params.inverse), vec3<f32>(), vec3<f32>(last)));
}

@compute @workgroup_size(WORKGROUP)
fn octree_ranges(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let t = group_index(group, groups) * WORKGROUP + index;
    if t >= params.triangles { return; }
    let low = place_of(min(bounds[t].low_0, bounds[t].low_1));
    let high = place_of(max(bounds[t].high_0, bounds[t].high_1));
    ranges[t] = vec2<u32>(pack(low), pack(high));
    let depth = vec3<u32>(params.base - params.page);
    let size = (high >> depth) - (low >> depth) + 1u;
    counts[t] = size.x * size.y * size.z;
}
