// Puts what the tests ask of a registration in the order of the leaves, and counts registrations and leaves.
//   in   keys, registered [r]  r < n = min(params.most, lengths[params.word]), sorted by key; params.shift: base level
//        ranges[t], spheres[t]
//   out  entries[r]
//        tally[l]              registrations in leaves of level l, added; tally[TALLY_LEAVES]: leaves
// Includes: layout, octree.   Twin: src/twin/octree.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read> registered: array<u32>;
@group(0) @binding(4) var<storage, read> ranges: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> entries: array<Entry>;
@group(0) @binding(7) var<storage, read_write> tally: array<atomic<u32>>;

var<workgroup> sh_tally: array<atomic<u32>, TALLY_LENGTH>;

@compute @workgroup_size(WORKGROUP)
fn octree_gather(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    if index < TALLY_LENGTH { atomicStore(&sh_tally[index], 0u); }
    workgroupBarrier();
    let r = group_index(group, groups) * WORKGROUP + index;
    if r < min(params.most, lengths[params.word]) {
        let t = registered[r] & 0x0fffffffu;
        let up = registered[r] >> 28u;
        let sphere = spheres[t];
        let low = cell_number(params.shift, unpack(ranges[t].x));
        entries[r] = Entry(sphere.xyz, sphere.w, t, low, keys[r], up | (params.shift << 8u));
        atomicAdd(&sh_tally[params.shift - up], 1u);
        if r == 0u || keys[r - 1u] != keys[r] { atomicAdd(&sh_tally[TALLY_LEAVES], 1u); }
    }
    workgroupBarrier();
    if index < TALLY_LENGTH {
        let count = atomicLoad(&sh_tally[index]);
        if count > 0u { atomicAdd(&tally[index], count); }
    }
}
