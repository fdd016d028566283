// The bottom-up stage, one dense level (thesis 6.3.1): a cell is divided if its children come to fewer tests than it does whole.
//   in   counts[node]; costs[node] of the children; params.level
//   out  costs[node] tests of the best division of the cell (two-stage), or of the whole cell (single-stage)
//        kinds[node] 1: divided
// Includes: layout, octree.   Twin: src/twin/octree.rs
@group(0) @binding(0) var<uniform> params: OctreeParams;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> costs: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> kinds: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn octree_merge(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let cell = group_index(group, groups) * WORKGROUP + index;
    if cell >= 1u << (3u * params.level) { return; }
    let place = 2u * cell_place(params.level, cell);
    let start = level_start(params.page, params.level + 1u);
    var divided = vec2<u32>();
    for (var child = 0u; child < 8u; child++) {
        let moved = (vec3<u32>(child) >> vec3<u32>(0u, 1u, 2u)) & vec3<u32>(1u);
        divided = plus(divided, costs[start + cell_number(params.level + 1u, place + moved)]);
    }
    let node = level_start(params.page, params.level) + cell;
    let whole = tests_of(counts[node]);
    let is_divided = is_less(divided, whole);
    kinds[node] = u32(is_divided);
    costs[node] = whole;
    if params.two_stage != 0u && is_divided { costs[node] = divided; }
}
