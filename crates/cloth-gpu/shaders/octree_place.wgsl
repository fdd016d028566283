// The triangles of each page, together.
//   in   ranges[t], offsets[t]  as in octree_assign
//        firsts[p]              members before page p
//   out  members[m]             triangles, in any order within a page
//        cursors[p]             zero before; then how many there are
// Includes: layout, octree, octree_find.   Twin: src/twin/octree.rs
@group(0) @binding(0) var<uniform> params: OctreeParams;
@group(0) @binding(1) var<storage, read> ranges: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> offsets: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> firsts: array<u32>;
@group(0) @binding(4) var<storage, read_write> cursors: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> members: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn octree_place(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let number = group_index(group, groups) * WORKGROUP + index;
    if !is_visit(number) { return; }
    let visit = find_visit(number);
    let page = cell_number(params.page, visit.place);
    let slot = firsts[page] + atomicAdd(&cursors[page], 1u);
    if slot < arrayLength(&members) { members[slot] = visit.triangle; }
}
