// Which pages have trees below them: those with a pair, or with a triangle where a page is too coarse for a leaf.
//   in   counts[p]
//   out  flags[p], numbers[p]  1: has a tree; p
//        costs[p], types[3 p]  of those that have none
// Includes: layout, octree.   Twin: src/twin/octree
@group(0) @binding(0) var<uniform> params: OctreeParams;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> flags: array<u32>;
@group(0) @binding(3) var<storage, read_write> numbers: array<u32>;
@group(0) @binding(4) var<storage, read_write> costs: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> types: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn octree_select(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let page = group_index(group, groups) * WORKGROUP + index;
    if page >= 1u << (3u * params.page) { return; }
    let n = counts[page];
    let has_tree = params.base > params.page && n > 0u && (n > 1u || params.top > params.page);
    flags[page] = u32(has_tree);
    numbers[page] = page;
    if !has_tree {
        costs[page] = tests_of(n);
        for (var k = 0u; k < 3u; k++) { types[3u * page + k] = 0u; }
    }
}
