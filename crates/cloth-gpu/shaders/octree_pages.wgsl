// The trees below the pages, one workgroup each: counters, then the bottom-up stage up to the page itself (thesis 6.3.1).
//   The counters of a level come from differences: a triangle adds to the eight corners of its range, and sums along x, y
//   and z give each cell how many ranges hold it. So a large triangle costs no more than a small one.
//   in   ranges[t]; counts[p], firsts[p], members[m]: triangles of each page
//        selected[k]         pages with trees, k < selected_before[pages]
//   out  costs[p]   tests of the page: of its best division (two-stage), or undivided (single-stage)
//        types[3 p]  73 bits: cells that are divided further, of the page itself, its 8 children, their 64 children
// Includes: layout, octree.   Twin: src/twin/octree.rs
@group(0) @binding(0) var<uniform> params: OctreeParams;
@group(0) @binding(1) var<storage, read> ranges: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> counts: array<u32>;
@group(0) @binding(3) var<storage, read> firsts: array<u32>;
@group(0) @binding(4) var<storage, read> members: array<u32>;
@group(0) @binding(5) var<storage, read> selected: array<u32>;
@group(0) @binding(6) var<storage, read> selected_before: array<u32>;
@group(0) @binding(7) var<storage, read_write> costs: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> types: array<u32>;

// 1 + 8 + 64 + 512 cells; those that may be divided; and their bits.
var<workgroup> sh_changes: array<atomic<u32>, 585>;
var<workgroup> sh_counts: array<u32, 585>;
var<workgroup> sh_costs: array<vec2<u32>, 73>;
var<workgroup> sh_types: array<atomic<u32>, 3>;

// First cell of the level so many below the page.
fn start_below(below: u32) -> u32 {
    return ((1u << (3u * below)) - 1u) / 7u;
}

fn add_range(low: vec3<u32>, high: vec3<u32>, depth: u32) {
    for (var below = 1u; below <= depth; below++) {
        let up = vec3<u32>(depth - below);
        let first = low >> up;
        let past = (high >> up) + 1u;
        let side = 1u << below;
        for (var corner = 0u; corner < 8u; corner++) {
            let is_past = ((vec3<u32>(corner) >> vec3<u32>(0u, 1u, 2u)) & vec3<u32>(1u)) != vec3<u32>();
            let place = select(first, past, is_past);
            if all(place < vec3<u32>(side)) {
                // Differences wrap; the sums are what they ought to be.
                let change = select(1u, 0xffffffffu, (countOneBits(corner) & 1u) != 0u);
                atomicAdd(&sh_changes[start_below(below) + cell_number(below, place)], change);
            }
        }
    }
}

// Sums along one axis: 4 + 16 + 64 lines.
fn sum_lines(axis: u32, depth: u32, index: u32) {
    for (var n = index; n < 84u; n += PAGE_WORKGROUP) {
        let below = 1u + u32(n >= 4u) + u32(n >= 20u);
        if below > depth { return; }
        let line = n - select(select(0u, 4u, n >= 4u), 20u, n >= 20u);
        let side = 1u << below;
        let across = vec2<u32>(line & (side - 1u), line >> below);
        var at = start_below(below);
        if axis == 0u {
            at += cell_number(below, vec3<u32>(0u, across));
        } else if axis == 1u {
            at += cell_number(below, vec3<u32>(across.x, 0u, across.y));
        } else {
            at += cell_number(below, vec3<u32>(across, 0u));
        }
        var sum = 0u;
        for (var k = 0u; k < side; k++) {
            sum += sh_counts[at];
            sh_counts[at] = sum;
            at += 1u << (axis * below);
        }
    }
}

// Whether the cell is divided, and its tests.
fn merge(below: u32, cell: u32, depth: u32) {
    var divided = vec2<u32>();
    let place = 2u * cell_place(below, cell);
    for (var child = 0u; child < 8u; child++) {
        let moved = (vec3<u32>(child) >> vec3<u32>(0u, 1u, 2u)) & vec3<u32>(1u);
        let node = start_below(below + 1u) + cell_number(below + 1u, place + moved);
        if below + 1u == depth {
            divided = plus(divided, tests_of(sh_counts[node]));
        } else {
            divided = plus(divided, sh_costs[node]);
        }
    }
    let node = start_below(below) + cell;
    let whole = tests_of(sh_counts[node]);
    let is_divided = params.page + below < params.top || is_less(divided, whole);
    if is_divided { atomicOr(&sh_types[node / 32u], 1u << (node % 32u)); }
    sh_costs[node] = whole;
    if params.two_stage != 0u && is_divided { sh_costs[node] = divided; }
}

@compute @workgroup_size(PAGE_WORKGROUP)
fn octree_pages(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let depth = params.base - params.page;
    let pages = selected_before[1u << (3u * params.page)];
    for (var k = group_index(group, groups); k < pages; k += groups.x * groups.y) {
        let page = selected[k];
        let n = counts[page];
        let first = firsts[page];
        for (var cell = index; cell < 585u; cell += PAGE_WORKGROUP) { atomicStore(&sh_changes[cell], 0u); }
        if index < 3u { atomicStore(&sh_types[index], 0u); }
        workgroupBarrier();
        let corner = cell_place(params.page, page) << vec3<u32>(depth);
        let last = vec3<u32>((1u << depth) - 1u);
        for (var m = index; m < n && first + m < arrayLength(&members); m += PAGE_WORKGROUP) {
            let range = ranges[members[first + m]];
            let low = max(unpack(range.x), corner) - corner;
            let high = min(unpack(range.y) - corner, last);
            add_range(low, high, depth);
        }
        workgroupBarrier();
        for (var cell = index; cell < 585u; cell += PAGE_WORKGROUP) {
            sh_counts[cell] = atomicLoad(&sh_changes[cell]);
        }
        if index == 0u { sh_counts[0] = n; }
        for (var axis = 0u; axis < 3u; axis++) {
            workgroupBarrier();
            sum_lines(axis, depth, index);
        }
        for (var below = depth; below > 0u; below--) {
            workgroupBarrier();
            if index < 1u << (3u * (below - 1u)) { merge(below - 1u, index, depth); }
        }
        workgroupBarrier();
        if index < 3u { types[3u * page + index] = atomicLoad(&sh_types[index]); }
        if index == 0u { costs[page] = sh_costs[0]; }
        workgroupBarrier();
    }
}
