// The top-down stage (thesis 6.3.1): the coarsest cell that is not divided takes all that is below it.
//   in   kinds[node]
//   out  leaves[p]  level of the leaf that page p lies in; params.page: the page itself or cells below it
// Includes: layout, octree.   Twin: src/twin/octree.rs
@group(0) @binding(0) var<uniform> params: OctreeParams;
@group(0) @binding(1) var<storage, read> kinds: array<u32>;
@group(0) @binding(2) var<storage, read_write> leaves: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn octree_descend(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let page = group_index(group, groups) * WORKGROUP + index;
    if page >= 1u << (3u * params.page) { return; }
    let place = cell_place(params.page, page);
    var level = min(params.top, params.page);
    while level < params.page {
        let cell = cell_number(level, place >> vec3<u32>(params.page - level));
        if kinds[level_start(params.page, level) + cell] == 0u { break; }
        level++;
    }
    leaves[page] = level;
}
