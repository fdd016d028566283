// The counter tree: how many triangles meet each cell of the dense levels from params.top on. Only visits to pages are counted; a
// coarser cell takes the one visit that holds the triangle's token there (thesis 6.3.1).
//   in   ranges[t], offsets[t]  t < n: visits before each triangle, (low, high), and their number
//   out  counts[node]           zero before
// Includes: layout, octree, octree_find.   Twin: src/twin/octree.rs
@group(0) @binding(0) var<uniform> params: OctreeParams;
@group(0) @binding(1) var<storage, read> ranges: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> offsets: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;

@compute @workgroup_size(WORKGROUP)
fn octree_assign(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let number = group_index(group, groups) * WORKGROUP + index;
    if !is_visit(number) { return; }
    let visit = find_visit(number);
    atomicAdd(&counts[cell_number(params.page, visit.place)], 1u);
    // A cell that is not the first in its parent is none further up.
    for (var level = params.page; level > params.top && is_first_in(visit, level - 1u); level--) {
        let place = visit.place >> vec3<u32>(params.page + 1u - level);
        atomicAdd(&counts[level_start(params.page, level - 1u) + cell_number(level - 1u, place)], 1u);
    }
}
